"""Time alignment: a sensor's clock against the host's, from the magnitude of the angular rate.

The magnitude does not depend on any frame, so it needs neither heading nor mounting. A coarse offset comes from
cross-correlation, then offset and drift (with the gyroscope's gain) from least squares by Gauss-Newton, to a fraction of a
sample.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import correlate, correlation_lags

from testbench.frames import NANOSECONDS
from testbench.records.estimate import ClockFit
from testbench.records.samples import ImuSamples, Truth

GRID_S = 0.01
SEARCH_S = 3.0
"""The coarse search looks this far on either side of what the arrival times say."""
LEAST_RATE = np.radians(2.0)
"""Rates of change slower than this per grid step's worth of motion say nothing of time [rad/s]."""
ITERATIONS = 15
CLUSTER_S = 2.0
"""Residuals nearer than this count as one when the uncertainty is stated [s]."""


def fit_clock(samples: ImuSamples, truth: Truth | None, rate_delay: float = 0.0) -> ClockFit:
    """Fit the sensor's clock to the host's.

    Args:
        samples: Of the sensor. truth: With angular rates; None or motionless leaves only the arrival times.
        rate_delay: How much older than its time stamp an angular rate is [s]: half an interval for a sensor that integrates on
        board.

    Returns:
        The fit; its method is "angular_rate", or "arrival" where nothing moves: then it is late by the unknown latency.
    """
    arrival = _fit_arrival(samples)
    if truth is None or truth.rate is None or len(samples) < 10:
        return arrival
    truth_time = truth.host_time_ns / NANOSECONDS
    truth_rate = np.linalg.norm(truth.rate, axis=1)
    device_time = samples.device_time_ns / NANOSECONDS - rate_delay
    rate = np.linalg.norm(samples.gyr - _rest_bias(samples.gyr), axis=1)
    if np.percentile(truth_rate, 99.5) < LEAST_RATE:
        return arrival
    lag = _coarse_lag(_on_host(device_time, arrival), rate, truth_time, truth_rate)
    return _refine(device_time, rate, truth_time, truth_rate, arrival.offset_s + lag, arrival.drift_ppm * 1e-6)


def _fit_arrival(samples: ImuSamples) -> ClockFit:
    """From the least delayed arrivals: in each of up to 50 windows, the sample whose delay was shortest."""
    host, device = samples.host_time_ns / NANOSECONDS, samples.device_time_ns / NANOSECONDS
    if len(host) < 2:
        return ClockFit(offset_s=float(device[0] - host[0]) if len(host) else 0.0, method="arrival")
    ahead = device - host
    picks = [window[np.argmax(ahead[window])] for window in np.array_split(np.arange(len(host)), min(50, len(host) // 2 + 1))]
    span = host[-1] - host[0]
    drift, offset = (
        np.polyfit(host[picks], ahead[picks], 1) if len(picks) > 5 and span > 10 else (0.0, float(ahead[picks].max()))
    )
    return ClockFit(offset_s=float(offset), drift_ppm=float(drift * 1e6), method="arrival")


def _on_host(device_time: np.ndarray, fit: ClockFit) -> np.ndarray:
    return np.asarray((device_time - fit.offset_s) / (1 + 1e-6 * fit.drift_ppm))


def _rest_bias(gyr: np.ndarray) -> np.ndarray:
    """Reading at rest: the mean over the tenth of the samples whose neighbourhood varies least."""
    size = 25
    if len(gyr) < 4 * size:
        return np.zeros(3)
    blocks = gyr[: len(gyr) // size * size].reshape(-1, size, 3)
    spread = blocks.var(axis=1).sum(axis=1)
    quiet = blocks[spread <= np.quantile(spread, 0.1)].reshape(-1, 3)
    bias = np.median(quiet, axis=0)
    return bias if np.linalg.norm(bias) < np.radians(10) else np.zeros(3)  # more than that is motion, not bias


def _coarse_lag(time: np.ndarray, rate: np.ndarray, truth_time: np.ndarray, truth_rate: np.ndarray) -> float:
    """Seconds that the sensor's time, brought to the host, still lies ahead of the truth."""
    start, end = max(time[0], truth_time[0]) - SEARCH_S, min(time[-1], truth_time[-1]) + SEARCH_S
    grid = np.arange(start, end, GRID_S)
    a = np.interp(grid, time, rate, left=0, right=0)
    b = np.interp(grid, truth_time, truth_rate, left=0, right=0)
    correlation = correlate(a - a.mean(), b - b.mean(), mode="full", method="fft")
    lags = correlation_lags(len(grid), len(grid)) * GRID_S
    near = np.abs(lags) <= SEARCH_S
    return float(lags[near][np.argmax(correlation[near])])


def _refine(
    device_time: np.ndarray, rate: np.ndarray, truth_time: np.ndarray, truth_rate: np.ndarray, offset: float, drift: float
) -> ClockFit:
    """Gauss-Newton on offset, drift and gain: minimise sum (rate(t) - gain * truth((t - offset) / (1 + drift)))^2."""
    slope = np.gradient(truth_rate, truth_time)
    middle = float(device_time.mean())
    gain = 1.0
    residual, jacobian = np.zeros(1), np.eye(3)
    for _ in range(ITERATIONS):
        host = (device_time - offset) / (1 + drift)
        inside = (host > truth_time[0]) & (host < truth_time[-1])
        expected = np.interp(host[inside], truth_time, truth_rate)
        gradient = gain * np.interp(host[inside], truth_time, slope) / (1 + drift)
        # About the middle of the recording, offset and drift are nearly uncorrelated.
        centred = device_time[inside] - middle
        jacobian = np.column_stack([gradient, gradient * centred, -expected])
        residual = rate[inside] - gain * expected
        step, *_ = np.linalg.lstsq(jacobian, -residual, rcond=None)
        drift += step[1]
        offset += step[0] - step[1] * middle
        gain += step[2]
        if abs(step[0]) < 1e-9 and abs(step[1]) < 1e-12:
            break
    variance = float(residual @ residual) / max(len(residual) - 3, 1)
    covariance = _clustered_covariance(jacobian, residual, np.floor(device_time[inside] / CLUSTER_S).astype(np.int64))
    to_start = np.array([1.0, -middle, 0.0])
    offset_sd = float(np.sqrt(to_start @ covariance @ to_start))
    middle_sd = float(np.sqrt(covariance[0, 0]))
    return ClockFit(
        offset_s=float(offset),
        drift_ppm=float(drift * 1e6),
        offset_sd_s=offset_sd,
        drift_sd_ppm=float(np.sqrt(covariance[1, 1]) * 1e6),
        residual_deg_s=float(np.degrees(np.sqrt(variance))),
        angle_error_deg=float(np.degrees(truth_rate.max()) * middle_sd),
        method="angular_rate",
    )


def _clustered_covariance(jacobian: np.ndarray, residual: np.ndarray, cluster: np.ndarray) -> np.ndarray:
    """Covariance of a least-squares fit whose errors hang together within clusters (Liang & Zeger 1986).

    What remains after the fit is mostly the gyroscope's own errors, which last as long as a move does.

    Args:
        jacobian: Shape (n, k). residual: Shape (n,). cluster: Which cluster each row belongs to, shape (n,), increasing.
    """
    bread = np.linalg.pinv(jacobian.T @ jacobian)
    starts = np.flatnonzero(np.diff(cluster, prepend=cluster[0] - 1))
    scores = np.add.reduceat(jacobian * residual[:, None], starts, axis=0)
    return np.asarray(bread @ (scores.T @ scores) @ bread)
