"""Static segmentation: the still intervals of a recording by four witnesses, and their agreement.

The gyroscope at rest (`segmentation`), the plateaus between the gyroscope's peaks (Castellanos
Alonso 2023), the variance of the accelerometer with its threshold found automatically (Tedaldi,
Pretto & Menegatti 2014), and what the arm says it did. Intervals are (k, 2) arrays of sample
indices, begin and end (exclusive), in the order of time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import TrueVector, static_poses
from testbench.estimation.signals.segmentation import detect_static, intervals_of
from testbench.frames import STANDARD_GRAVITY
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.model.windows import moving_mean
from testbench.records.results.calibration_result import Agreement

LEAST_REST_S = 0.5
"""Shorter still intervals are no poses: their mean says less than the arm's settling [s]."""
SMOOTHING_S = 0.2
LEAST_PEAK = np.radians(3.0)
"""A turn that never gets faster than this is no move between poses [rad/s]."""
FOOT = np.radians(1.0)
"""A peak begins and ends here [rad/s]; a bias that moves with the pose, by 0.1 deg/s/g (Xsens DOT),
stays below.
"""
WINDOW_S = 1.0
"""Of the variance: 101 samples at 100 Hz in the authors' program imu_tk."""
MULTIPLES = np.arange(1, 11)
"""Of the initial variance that are tried for a threshold; integers, as Tedaldi has it."""
LEAST_SHARE = 0.8
"""Multiples that find less than this share of the most still time are not chosen: bits of still
intervals fit well by chance.
"""
SETTLING_S = 0.3
"""After a move the arm still swings in (a servo of 12 Hz is within 1e-6 after 0.3 s) [s]."""
MATCHING = 0.5
"""Two still intervals are one where they share more than this part of the shorter."""


def by_gyroscope(gyr: np.ndarray, interval: float, least_s: float = LEAST_REST_S) -> np.ndarray:
    """Still intervals by the spread of the gyroscope; see `detect_static`.

    Args:
        gyr: Shape (n, 3) [rad/s].
        interval: Between samples [s].
        least_s: Shortest still interval [s].
    """
    return intervals_of(detect_static(gyr, interval), round(least_s / interval))


def between_peaks(gyr: np.ndarray, interval: float, least_s: float = LEAST_REST_S) -> np.ndarray:
    """Still intervals as the plateaus between the peaks of the angular rate.

    The rate, without its median and smoothed over 0.2 s, has a peak for each move, of 3 deg/s at
    least; the plateau is what lies between the feet of two peaks, at 1 deg/s, drawn in by the
    smoothing.

    Args:
        gyr: Shape (n, 3) [rad/s].
        interval: Between samples [s].
        least_s: Shortest still interval [s].
    """
    if not len(gyr):
        return np.zeros((0, 2), int)
    window = max(round(SMOOTHING_S / interval), 1)
    speed = moving_mean(np.linalg.norm(gyr - np.median(gyr, axis=0), axis=1), window)
    speed = speed - np.quantile(speed, 0.1)  # the noise at rest has a length too
    moving = np.zeros(len(gyr), bool)
    for begin, end in intervals_of(speed > FOOT):
        if speed[begin:end].max() > LEAST_PEAK:
            moving[max(begin - window // 2, 0) : end + window // 2] = True
    return intervals_of(~moving, round(least_s / interval))


@dataclass(frozen=True)
class VarianceSegmentation:
    """What the variance of the accelerometer says.

    Attributes:
        intervals: Still intervals, shape (k, 2).
        multiple: Of the initial variance that was chosen.
        threshold: That multiple of it [(m/s^2)^2].
        residuals: For each of `MULTIPLES`, RMS of |force| - gravity after a norm-only calibration,
            with its degrees of freedom [m/s^2]; NaN where the intervals found did not allow one.
        calibrated: Whether any did; else the multiple with the most still time was taken.
    """

    intervals: np.ndarray
    multiple: int
    threshold: float
    residuals: np.ndarray
    calibrated: bool


def by_variance(
    acc: np.ndarray,
    interval: float,
    initial_s: float | None = None,
    gravity: float = STANDARD_GRAVITY,
    window_s: float = WINDOW_S,
    least_s: float = LEAST_REST_S,
) -> VarianceSegmentation:
    """Still intervals by the variance of the accelerometer.

    Tedaldi, Pretto & Menegatti, ICRA 2014, section V. The sensor is still where the norm of the
    three variances, over a window, is below a multiple of its value over an initial interval. Each
    multiple gives other intervals; of those that find four fifths of the most still time at least,
    the one whose intervals let a norm-only calibration fit best is taken.

    Args:
        acc: Shape (n, 3) [m/s^2].
        interval: Between samples [s].
        initial_s: How long the sensor is still at first [s]; if None, the quietest tenth of the
            recording stands for that.
        gravity: Local [m/s^2].
        window_s: Over which the variance is taken [s].
        least_s: Shortest still interval [s].
    """
    window = max(round(window_s / interval), 2)
    mean = moving_mean(acc, window)
    variance = moving_mean((acc - mean) ** 2, window)
    spread = np.linalg.norm(np.maximum(variance, 0.0), axis=1)
    if initial_s is not None:
        initial = float(np.linalg.norm(acc[: max(round(initial_s / interval), 2)].var(axis=0)))
    else:
        initial = (
            float(np.median(np.sort(spread)[: max(len(spread) // 10, 1)])) if len(spread) else 0.0
        )
    found = [intervals_of(spread <= k * initial, round(least_s / interval)) for k in MULTIPLES]
    residuals = np.array([_norm_residual(acc, intervals, interval, gravity) for intervals in found])
    resting = np.array([np.sum(intervals[:, 1] - intervals[:, 0]) for intervals in found])
    eligible = np.where(resting >= LEAST_SHARE * resting.max(), residuals, np.nan)
    calibrated = bool(np.isfinite(eligible).any())
    best = int(np.nanargmin(eligible)) if calibrated else int(np.argmax(resting))
    return VarianceSegmentation(
        found[best], int(MULTIPLES[best]), float(MULTIPLES[best] * initial), residuals, calibrated
    )


def _norm_residual(
    acc: np.ndarray, intervals: np.ndarray, interval: float, gravity: float
) -> float:
    """RMS of what a norm-only calibration leaves of gravity's length [m/s^2]; NaN without one."""
    if len(intervals) < 10:
        return float("nan")
    times = np.arange(len(acc)) * interval
    poses = static_poses(acc, intervals, times=times, true=TrueVector(gravity))
    try:
        calibration = norm_only(poses)
    except PoorExcitation:
        return float("nan")
    left = np.linalg.norm(calibration.apply(poses.mean), axis=1) - gravity
    return float(np.sqrt(left @ left / (len(poses) - 9)))


def by_events(
    settled: np.ndarray, ended: np.ndarray, times: np.ndarray, settling_s: float = SETTLING_S
) -> np.ndarray:
    """Still intervals as the arm reports them: from a while after a move to the next one.

    Args:
        settled: When the arm had settled in each dwell, shape (k,) [s].
        ended: When each dwell ended, shape (k,) [s].
        times: Of the samples, on the same clock, shape (n,) [s].
        settling_s: Left out at the beginning [s].

    Returns:
        Shape (m, 2); dwells that hold no sample are left out.
    """
    intervals = np.column_stack(
        [np.searchsorted(times, settled + settling_s), np.searchsorted(times, ended, side="right")]
    )
    return np.asarray(intervals[intervals[:, 1] > intervals[:, 0]])


def compare(found: Mapping[str, np.ndarray], samples: int, interval: float) -> list[Agreement]:
    """Every pair of ways to find still intervals, in the order given.

    Args:
        found: Intervals by name, shape (k, 2).
        samples: Length of the recording.
        interval: Between samples [s].
    """
    return [
        _agreement(a, b, found[a], found[b], samples, interval) for a, b in combinations(found, 2)
    ]


def _agreement(
    first: str, second: str, a: np.ndarray, b: np.ndarray, samples: int, interval: float
) -> Agreement:
    masks = []
    for intervals in (a, b):
        mask = np.zeros(samples, bool)
        for begin, end in intervals:
            mask[begin:end] = True
        masks.append(mask)
    either = int(np.sum(masks[0] | masks[1]))
    iou = float(np.sum(masks[0] & masks[1]) / either) if either else float("nan")
    shared = np.minimum(a[:, None, 1], b[None, :, 1]) - np.maximum(a[:, None, 0], b[None, :, 0])
    shorter = np.minimum((a[:, 1] - a[:, 0])[:, None], (b[:, 1] - b[:, 0])[None])
    pairs = np.argwhere(shared > MATCHING * shorter)
    pairs = pairs[np.unique(pairs[:, 0], return_index=True)[1]]  # one partner each
    pairs = pairs[np.unique(pairs[:, 1], return_index=True)[1]]
    later = (b[pairs[:, 1]] - a[pairs[:, 0]]) * interval
    start, end, size = (*later.mean(axis=0), np.abs(later).mean()) if len(pairs) else (np.nan,) * 3
    return Agreement(
        first, second, (len(a), len(b)), len(pairs), iou, float(start), float(end), float(size)
    )
