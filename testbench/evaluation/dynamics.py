"""How errors depend on time: delay behind the truth, settling after a move, and what a sweep really
was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import gradient, median_interval
from testbench.model.statistics.lasting import lasting_sd
from testbench.model.windows import moving_mean
from testbench.records.session.plan import PlannedStep

CONVERGENCE_BAND = np.radians(0.1)
"""An error has settled when it stays this near to its settled value, or within three standard
deviations of its noise [rad].
"""
CLUSTER_S = 2.0
"""Residuals nearer than this count as one when the uncertainty of a delay is stated [s]."""
SLOW_S = 4.0
"""Errors of orientation that change more slowly than this are no delay: they are taken out of both
sides [s].
"""
LEAST_RATE = np.radians(1.0)
"""An RMS rate below this says nothing of a delay [rad/s]."""
LONG_S = 40.0
"""Motions of this time in all hold twenty such clusters; of shorter ones the law of their errors is
looked for [s].
"""
PIECES, LONGEST_PIECE_S = 100, 0.1
"""Into how many pieces short sweeps are averaged for that, and the longest of them [s]."""
_STEP_S = 2e-3
_LONGEST_S = 0.5
_ITERATIONS = 10

Delay = tuple[float, float]
"""Delay behind the truth [s], positive where the estimate is late, and its standard uncertainty
[s].
"""


def angle_delay(
    time_ns: np.ndarray, estimated: np.ndarray, true: np.ndarray, sweeps: Sequence[np.ndarray]
) -> Delay | None:
    """The delay of an estimated angle behind the true one.

    Least squares of estimated(t) = b + c t + g true(t - delay), with an own b and c for each sweep,
    by Gauss-Newton: an error that drifts through a sweep which goes there and back looks like a
    delay. The uncertainty lets residuals last by a law of first order, and those of motions of more
    than 40 s hang together over 2 s (Liang & Zeger 1986).

    Args:
        time_ns: Increasing, shape (n,) [ns].
        estimated: Estimated angle [rad], shape (n,).
        true: True angle [rad], shape (n,).
        sweeps: Rows of each sweep, shape (rows of the sweep,) each.

    Returns:
        None where the truth hardly moves or the fit finds no delay below half a second.
    """
    if not sweeps:
        return None
    rows = np.concatenate(sweeps)
    around = slice(
        *np.searchsorted(time_ns, [time_ns[rows[0]] - NANOSECONDS, time_ns[rows[-1]] + NANOSECONDS])
    )
    known = np.arange(len(time_ns))[around][np.isfinite(true[around])]
    if len(known) < 10:
        return None
    which = np.repeat(np.arange(len(sweeps)), [len(sweep) for sweep in sweeps])
    time = (time_ns - time_ns[rows[0]]) / NANOSECONDS
    t = time[rows]
    passed = _centred(t, which)
    y = _without_drift(estimated[rows], passed, which)
    known_time, known_angle = time[known], true[known]
    delay = 0.0
    for _ in range(_ITERATIONS):
        late, before, after = (
            np.interp(t - delay + s, known_time, known_angle) for s in (0.0, -_STEP_S, _STEP_S)
        )
        rate = (after - before) / (2 * _STEP_S)
        x = np.column_stack(
            [_without_drift(late, passed, which), -_without_drift(rate, passed, which)]
        )
        if not np.sqrt(np.mean(x[:, 1] ** 2)) > LEAST_RATE:
            return None
        gain, step = np.linalg.lstsq(x, y, rcond=None)[0]
        if not abs(gain) > 0.1:
            return None
        delay += float(step / gain)
        if abs(delay) > _LONGEST_S:
            return None
        if abs(step) < 1e-6:
            break
    if len(t) * median_interval(t) > LONG_S:
        residual = y - x @ np.array([gain, step])
        sd = _clustered_sd(x, residual, _runs(np.floor(t / CLUSTER_S) + 1e6 * which))
    else:
        sd = _sweeps_sd(t, estimated[rows], np.column_stack([late, -rate]), x, which)
    return delay, sd / abs(float(gain))


def _sweeps_sd(
    t: np.ndarray, estimated: np.ndarray, columns: np.ndarray, x: np.ndarray, which: np.ndarray
) -> float:
    """Standard uncertainty of the last coefficient of a fit to short sweeps.

    Their drift is not among what explains the angles here: it shows how slow the errors are.

    Args:
        t: Shape (n,) [s].
        estimated: Angle, shape (n,) [rad].
        columns: True angle and less its rate, shape (n, 2).
        x: The same without offset and drift of each sweep, shape (n, 2).
        which: Sweep that each row belongs to, shape (n,).
    """
    count = which[-1] + 1
    label = _runs(np.floor((t - t[0]) / _piece_s(t)) + 1e6 * which)
    size = np.bincount(label)
    means = [np.bincount(label, column) / size for column in (t, estimated, *columns.T, which)]
    offsets = (means[-1][:, None] == np.arange(count)).astype(float)
    influence = np.bincount(label, x @ np.linalg.pinv(x.T @ x)[:, -1])
    explained = np.column_stack([offsets, means[2], means[3]])
    return lasting_sd(means[0], explained, means[1], influence)


@dataclass(frozen=True)
class TrueTurning:
    """How the truth turns at a sensor's instants; worked out once for all filters.

    Attributes:
        time_ns: Shape (n,) [ns].
        q: q_world_from_sensor, shape (n, 4).
        rate: In the world, by differences of orientations; NaN at the ends and beside gaps, shape
            (n, 3) [rad/s].
        window: Samples of the moving average that takes slow errors out.
        fast_rate: The rate less its moving average, shape (n, 3) [rad/s].
    """

    time_ns: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    window: int
    fast_rate: np.ndarray

    @staticmethod
    def of(time_ns: np.ndarray, q_world_from_sensor: np.ndarray) -> TrueTurning:
        """Of the truth at some instants.

        Args:
            time_ns: Increasing, shape (n,) [ns].
            q_world_from_sensor: True orientations, shape (n, 4).
        """
        rate = rate_in_world(time_ns, q_world_from_sensor)
        interval = median_interval(time_ns) / NANOSECONDS if len(time_ns) > 1 else 1.0
        window = max(round(SLOW_S / max(interval, 1e-6)), 3)
        return TrueTurning(
            time_ns, q_world_from_sensor, rate, window, _without_slow(np.nan_to_num(rate), window)
        )


def _without_slow(signal: np.ndarray, window: int) -> np.ndarray:
    """A signal less its moving average, shape (n, 3)."""
    slow = moving_mean(signal, window)
    return np.asarray(np.subtract(signal, slow, out=slow))


def orientation_delay(
    q_estimated: np.ndarray, true: TrueTurning, moving: np.ndarray
) -> Delay | None:
    """The delay of an estimated orientation behind the true one.

    An estimate that is late by d has the error -d w, with w the true angular rate; d by least
    squares over all three axes, after slow errors are taken out of both by the same moving average.
    Its uncertainty is that of the delay of an angle.

    Args:
        q_estimated: q_world_from_sensor, shape (n, 4).
        true: The truth at the same instants.
        moving: Which samples count, shape (n,).

    Returns:
        None where the truth hardly turns.
    """
    if moving.sum() < 20 or len(moving) < 20:
        return None
    error = rotation.turn_between(true.q, q_estimated)
    usable = moving & np.isfinite(error[:, 0]) & np.isfinite(true.rate[:, 0])
    count = int(usable.sum())
    if count < 20:
        return None
    time = (true.time_ns - true.time_ns[0]) / NANOSECONDS
    cluster = _runs(np.floor(time[usable] / CLUSTER_S))
    fast = _without_slow(np.nan_to_num(error), true.window)
    products, squares = _sums_by_cluster(fast, true.fast_rate, usable, cluster)
    size = float(squares.sum())
    if not np.sqrt(size / count) > LEAST_RATE:
        return None
    delay = -float(products.sum()) / size
    if abs(delay) > _LONGEST_S:
        return None
    if count * median_interval(time) <= LONG_S:
        return delay, _axes_sd(time[usable], fast[usable], true.fast_rate[usable])
    scores = products + delay * squares
    return delay, float(np.sqrt(np.sum(scores**2) * (len(scores) / max(len(scores) - 1, 1)))) / size


def _axes_sd(t: np.ndarray, error: np.ndarray, rate: np.ndarray) -> float:
    """Standard uncertainty of the delay of an orientation in short motions, its axes together.

    Args:
        t: Shape (n,) [s].
        error: Without what is slow, shape (n, 3) [rad].
        rate: The true one, without what is slow, shape (n, 3) [rad/s].
    """
    label = _runs(np.floor((t - t[0]) / _piece_s(t)))
    size, squares = np.bincount(label), float(np.sum(rate**2))
    time = np.bincount(label, t) / size
    sds = []
    for axis in range(3):
        mean_error, mean_rate = (np.bincount(label, own[:, axis]) / size for own in (error, rate))
        influence = np.bincount(label, rate[:, axis]) / squares
        sds.append(lasting_sd(time, mean_rate[:, None], mean_error, influence))
    return float(np.linalg.norm(sds))


def _piece_s(t: np.ndarray) -> float:
    """How long the pieces are that short motions are averaged to [s]."""
    lasted = len(t) * median_interval(t)
    return min(lasted / PIECES, LONGEST_PIECE_S)


@njit(cache=True)
def _sums_by_cluster(
    error: np.ndarray, rate: np.ndarray, usable: np.ndarray, cluster: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sums of error times rate and of squared rates over each cluster of usable samples, shapes
    (clusters,).
    """
    products, squares = np.zeros(cluster[-1] + 1), np.zeros(cluster[-1] + 1)
    place = 0
    for i in range(len(error)):
        if usable[i]:
            for axis in range(3):
                # numerator and denominator of the delay, sum e' w / sum w' w
                products[cluster[place]] += error[i, axis] * rate[i, axis]
                squares[cluster[place]] += rate[i, axis] ** 2
            place += 1
    return products, squares


def rate_in_world(time_ns: np.ndarray, q_world_from_sensor: np.ndarray) -> np.ndarray:
    """Angular rate in the world by central differences of orientations.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        q_world_from_sensor: True orientations, shape (n, 4).

    Returns:
        Shape (n, 3) [rad/s]; NaN at the ends and beside gaps.
    """
    q = q_world_from_sensor
    rate = np.full((len(q), 3), np.nan)
    if len(q) > 2:
        seconds = (time_ns[2:] - time_ns[:-2]) / NANOSECONDS
        np.divide(
            rotation.turn_between(q[:-2], q[2:]), np.maximum(seconds, 1e-9)[:, None], out=rate[1:-1]
        )
    return rate


def _centred(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Values less the mean of their sweep."""
    means = np.bincount(which, values) / np.bincount(which)
    return np.asarray(values - means[which])


def _without_drift(values: np.ndarray, passed: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Values less the straight line through those of their sweep.

    Args:
        values: Shape (n,).
        passed: Time since the middle of the sweep, shape (n,) [s].
        which: Sweep of each, shape (n,).
    """
    centred = _centred(values, which)
    squares = np.maximum(np.bincount(which, passed**2), 1e-300)
    slopes = np.bincount(which, passed * centred) / squares
    return np.asarray(centred - slopes[which] * passed)


def _runs(label: np.ndarray) -> np.ndarray:
    """Number of the run of equal labels that each belongs to, from 0, shape (n,)."""
    return np.cumsum(np.diff(label, prepend=label[:1]) != 0)


def _clustered_sd(x: np.ndarray, residual: np.ndarray, cluster: np.ndarray) -> float:
    """Standard uncertainty of the last coefficient of a least-squares fit whose residuals hang
    together in clusters.
    """
    bread = np.linalg.pinv(x.T @ x)
    scores = np.column_stack([np.bincount(cluster, column * residual) for column in x.T])
    count = len(scores)
    covariance = bread @ (scores.T @ scores) @ bread * (count / max(count - 1, 1))
    return float(np.sqrt(max(covariance[-1, -1], 0.0)))


def convergence_times(
    time_ns: np.ndarray, error: np.ndarray, steps: list[PlannedStep]
) -> np.ndarray:
    """Time from the end of each move until the error stays near its settled value [s], shape
    (len(steps),).

    The settled value is the mean over the last quarter of the dwell; near is 0.1 deg, or three
    standard deviations of the last half (about a straight line) where the error is noisier than
    that.

    Args:
        time_ns: Increasing, shape (n,).
        error: [rad], shape (n,).
        steps: Poses, each with a dwell.

    Returns:
        Infinite where it settles only in the last quarter, NaN where there is nothing to look at.
    """
    begins = np.array([step.settled_ns for step in steps], dtype=np.int64)
    ends = np.array([step.end_ns for step in steps], dtype=np.int64)
    first, last = np.searchsorted(time_ns, begins), np.searchsorted(time_ns, ends, side="right")
    return np.asarray(_settled_after(time_ns, error, first, last, begins, float(CONVERGENCE_BAND)))


def settling_sd(times: Sequence[float], interval_s: float, time_sd: float) -> float:
    """Standard uncertainty of the median of settling times [s].

    It is their own scatter (of a median of normal values, 1.25 of that of their mean), the interval
    between samples within which an error enters its band (rectangular), and the clock's.

    Args:
        times: In which the error settled, at least one [s].
        interval_s: Between samples [s].
        time_sd: Standard uncertainty of the sensor's time [s].
    """
    count = len(times)
    of_median = np.sqrt(np.pi / 2) if count > 2 else 1.0
    scatter = of_median * np.std(times, ddof=1) / np.sqrt(count) if count > 1 else 0.0
    return float(np.sqrt(scatter**2 + interval_s**2 / 12 + time_sd**2))


@njit(cache=True)
def _noise(signal: np.ndarray) -> float:
    """Standard deviation about a straight line, so that a drift is not taken for noise."""
    n = len(signal)
    place = np.arange(n) - (n - 1) / 2
    level = signal.mean()
    # least squares: sum t (y - mean) / sum t^2, with t counted from the middle
    slope = np.sum(place * (signal - level)) / np.sum(place**2)
    return np.sqrt(np.mean((signal - level - slope * place) ** 2))


@njit(cache=True)
def _settled_after(
    time_ns: np.ndarray,
    error: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    begins: np.ndarray,
    least_band: float,
) -> np.ndarray:
    result = np.full(len(first), np.nan)
    for i in range(len(first)):
        signal = error[first[i] : last[i]]
        n = len(signal)
        if n < 8 or not np.isfinite(signal).all():
            continue
        # the end: mean of the last quarter
        settled = signal[n - n // 4 :].mean()
        band = max(least_band, 3 * _noise(signal[n // 2 :]))
        outside = -1
        # the last sample outside the band
        for k in range(n):
            if abs(signal[k] - settled) > band:
                outside = k
        if outside >= n - n // 4 - 1:
            result[i] = np.inf
        elif outside < 0:
            result[i] = 0.0
        else:
            result[i] = (time_ns[first[i] + outside + 1] - begins[i]) / 1e9
    return result


def amplitude_and_frequency(time_ns: np.ndarray, angle: np.ndarray) -> tuple[float, float] | None:
    """Half the range of an angle [rad], and the frequency of a sine of the same RMS angle and rate
    [Hz].

    Args:
        time_ns: Shape (n,).
        angle: [rad], shape (n,).
    """
    if len(angle) < 5 or not np.isfinite(angle).all():
        return None
    rate = gradient(angle, (time_ns - time_ns[0]) / NANOSECONDS)
    spread = float(angle.std())
    if not spread > 1e-4:
        return None
    return float(np.ptp(angle) / 2), float(rate.std() / spread / (2 * np.pi))
