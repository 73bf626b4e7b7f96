"""How much of what the magnetic field's heading does a filter's heading follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import stdtrit

from testbench.evaluation.magnetic import FEWEST_SAMPLES, FieldDeviation
from testbench.evaluation.orientation import SensorErrors
from testbench.frames import NANOSECONDS
from testbench.model.statistics.memory import CONFIDENCE, layout, means
from testbench.records.results.evaluation_rows import FieldFollowingRow

BIN_NS = NANOSECONDS // 2
"""Both headings are averaged over so long: the magnetometer's noise of 0.2 deg a sample becomes
0.03 deg.
"""
AROUND_S = 60.0
"""Changes are those against the mean over so long around: a drift of the heading, which resembles
any slow change, is out.
"""
LEAST_CHANGE_DEG = 0.2
"""With smaller changes of the field's heading (SD) the interval would be wider than from 0 to 1."""
FEWEST_STRETCHES = 3
"""With fewer minutes nothing is said."""
GYROSCOPE_DEG = 0.1
"""What a gyroscope's scale and axes may turn a heading by in the pace of the field, as both go by
the pose. In three runs each of elbow_flexion, elbow_dynamic and magnetic_passage filters without
magnetometer showed 0.08 deg at most, and 0.15 deg once, where slow turns were taken for a bias.
"""


@dataclass(frozen=True)
class Following:
    """The heading error of a filter against that which the field would give a compass.

    Attributes:
        n: Half seconds.
        change: Standard deviation of the field's heading against its mean over the minute around
            [rad].
        share: Of that in the filter's heading: 1 for a compass, 0 for a filter that ignores the
            field; NaN without changes.
        error: Standard error of the share, that of a mean of errors with memory; infinite for
            too few half seconds.
        blocks: Minutes, or degrees of freedom of the error and one, whichever are fewer.
    """

    n: int
    change: float
    share: float
    error: float
    blocks: int


def following(time_ns: np.ndarray, field: np.ndarray, error: np.ndarray) -> Following:
    """Regress a filter's heading error on the error of a compass, in changes against the minute
    around.

    Ordinary least squares with intercept, and with a trend where the minute is cut at the ends or
    has gaps. The standard error is that of the mean of regressor times residual
    (`means`): it holds for residuals with memory and of changing size.

    Args:
        time_ns: Of the judged samples, increasing, shape (n,), n > 0.
        field: Heading of the field against the reference, anticlockwise from above, shape (n,)
            [rad]; a compass errs by its negative.
        error: Heading error, shape (n,) [rad].
    """
    time_s, (compass, heading) = _averaged(time_ns, [-field, error])
    return _following(time_s, _changes(time_s, compass), _changes(time_s, heading))


def following_rows(sensor: SensorErrors, found: FieldDeviation) -> list[FieldFollowingRow]:
    """One row for each filter, over all judged samples.

    Without a share where the field says too little of it.
    """
    rows = np.flatnonzero(sensor.judged & np.isfinite(found.heading_rad))
    if len(rows) < FEWEST_SAMPLES:
        return []
    time_s, (compass, *headings) = _averaged(
        sensor.estimate.host_time_ns[rows],
        [-found.heading_rad[rows], *(e.heading[rows] for e in sensor.errors.values())],
    )
    changes = _changes(time_s, compass)
    result = []
    for key, heading in zip(sensor.errors, headings, strict=True):
        seen = _following(time_s, changes, _changes(time_s, heading))
        change_deg = float(np.degrees(seen.change))
        row = FieldFollowingRow(sensor.name, key, seen.n, change_deg, None, None, seen.blocks)
        if (
            change_deg >= LEAST_CHANGE_DEG
            and seen.blocks >= FEWEST_STRETCHES
            and np.isfinite(seen.share)
        ):
            quantile = float(stdtrit(seen.blocks - 1, (1 + CONFIDENCE) / 2))
            half = quantile * seen.error + GYROSCOPE_DEG / change_deg
            interval = [seen.share - half, seen.share + half]
            row = FieldFollowingRow(
                sensor.name, key, seen.n, change_deg, seen.share, interval, seen.blocks
            )
        result.append(row)
    return result


def _averaged(time_ns: np.ndarray, angles: list[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Means over each half second that holds samples: time from the first sample [s], and angles
    without jumps [rad].
    """
    place = time_ns // BIN_NS
    starts = np.concatenate([[0], np.flatnonzero(np.diff(place)) + 1, [len(place)]])
    time_s = np.add.reduceat((time_ns - time_ns[0]) / NANOSECONDS, starts[:-1]) / np.diff(starts)
    return time_s, [
        np.unwrap(_mean_angles(np.ascontiguousarray(angle, dtype=float), starts))
        for angle in angles
    ]


@njit(cache=True)
def _mean_angles(angle: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Mean angle of each piece [rad], next to its first one."""
    turn = 2 * np.pi
    result = np.empty(len(starts) - 1)
    for i in range(len(result)):
        first, total = angle[starts[i]], 0.0
        for j in range(starts[i], starts[i + 1]):
            # differences without whole turns, so that the mean is one across +-pi
            away = angle[j] - first
            total += away - turn * np.round(away / turn)
        result[i] = first + total / (starts[i + 1] - starts[i])
    return result


def _changes(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values, shape (n,), less their mean over the minute around."""
    first = np.searchsorted(time_s, time_s - AROUND_S / 2)
    last = np.searchsorted(time_s, time_s + AROUND_S / 2, side="right")
    centred = values - values.mean()
    running = np.concatenate([[0.0], np.cumsum(centred)])
    return np.asarray(centred - (running[last] - running[first]) / (last - first))


def _following(time_s: np.ndarray, compass: np.ndarray, heading: np.ndarray) -> Following:
    """Of changes in half seconds, shape (n,) each."""
    n = len(time_s)
    trend = np.column_stack([np.ones(n), _changes(time_s, time_s)])
    both = np.column_stack([compass, heading])
    x, y = (both - trend @ np.linalg.lstsq(trend, both, rcond=None)[0]).T
    square = float(np.mean(x**2))
    if not square > 0:
        return Following(n, 0.0, np.nan, np.inf, 0)
    share = float(np.mean(x * y)) / square
    when = layout(time_s, [np.arange(n)], equally=False)
    if when is None:
        return Following(n, float(np.sqrt(square)), share, np.inf, 0)
    found = means(when, when.pieces(x * (y - share * x))[None])
    stretches = int(min(when.duration_s / AROUND_S, found.freedom[0] + 1))
    error = float(found.error[0]) / square
    return Following(n, float(np.sqrt(square)), share, error, stretches)
