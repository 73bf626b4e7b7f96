"""Timing audit: what the time stamps and the counter of a recording say of its sampling."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.estimate import TimingAudit
from testbench.records.samples import ImuSamples

GAP_FACTOR = 1.5
"""Intervals longer than this many median ones are gaps."""
SMOOTH = 5
MOST_LAG = 30


def audit_timing(samples: ImuSamples, nominal_rate: float | None) -> TimingAudit:
    """Audit a sensor's sampling, by its own clock.

    Args:
        samples: As recorded. nominal_rate: As the data sheet or file says [Hz], or None.
    """
    intervals = np.diff(samples.device_time_ns) / NANOSECONDS
    if len(intervals) == 0:
        return TimingAudit(samples=len(samples), nominal_rate_hz=nominal_rate)
    moving = intervals[intervals > 0]
    median = float(np.median(moving)) if len(moving) else float("nan")
    gaps = intervals[intervals > GAP_FACTOR * median]
    steps = np.diff(samples.counter)
    lost = int(np.sum(steps[steps > 1] - 1))
    regular = intervals[(intervals > 0) & (intervals <= GAP_FACTOR * median)]
    span = (samples.device_time_ns[-1] - samples.device_time_ns[0]) / NANOSECONDS
    delay = (samples.host_time_ns - samples.device_time_ns) / NANOSECONDS
    fit = np.polyval(np.polyfit(samples.device_time_ns / NANOSECONDS, delay, 1), samples.device_time_ns / NANOSECONDS)
    return TimingAudit(
        samples=len(samples),
        nominal_rate_hz=nominal_rate,
        effective_rate_hz=float((len(samples) - 1) / span) if span > 0 else float("nan"),
        sampling_rate_hz=1 / float(regular.mean()) if len(regular) else float("nan"),
        interval_median_ms=1e3 * median,
        jitter_ms=1e3 * float(regular.std()) if len(regular) else float("nan"),
        repeated_stamps=int(np.sum(intervals == 0)),
        backward_stamps=int(np.sum(intervals < 0)),
        gaps=len(gaps),
        longest_gap_ms=1e3 * float(gaps.max()) if len(gaps) else 0.0,
        lost_packets=lost,
        lost_percent=100 * lost / (len(samples) + lost),
        arrival_jitter_ms=1e3 * float(np.std(delay - fit)),
        acc_after_gyr_ms=1e3 * _asynchrony(samples, median),
    )


def _asynchrony(samples: ImuSamples, interval: float) -> float:
    """How much later than the gyroscope the accelerometer sees a turn [s]; NaN where the motion does not tell.

    While turning, gravity's direction u in the sensor moves as du/dt = -omega x u: the magnitudes of both sides are correlated.
    """
    if not np.isfinite(samples.acc).all() or not np.isfinite(samples.gyr).all() or len(samples) < 20 * MOST_LAG:
        return float("nan")
    kernel = np.ones(SMOOTH) / SMOOTH

    def smooth(columns: np.ndarray) -> np.ndarray:
        return np.column_stack([np.convolve(column, kernel, mode="same") for column in columns.T])

    u = smooth(samples.acc)
    u = u / np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-9)
    seen = np.linalg.norm(np.gradient(u, interval, axis=0), axis=1)
    expected = np.linalg.norm(np.cross(smooth(samples.gyr), u), axis=1)
    if np.percentile(expected, 95) < np.radians(10):
        return float("nan")
    a, b = seen - seen.mean(), expected - expected.mean()
    lags = np.arange(-MOST_LAG, MOST_LAG + 1)
    begin, end = MOST_LAG, len(a) - MOST_LAG
    correlation = np.array([np.dot(a[begin + lag : end + lag], b[begin:end]) for lag in lags])
    k = int(np.argmax(correlation))
    if k in (0, len(lags) - 1):
        return float("nan")
    left, top, right = correlation[k - 1 : k + 2]
    return float((lags[k] + 0.5 * (left - right) / (left - 2 * top + right)) * interval)
