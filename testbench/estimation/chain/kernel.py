"""The extended Kalman filter of a chain, sample by sample; compiled.

Samples come one sensor at a time, each at its own instant: no sensor is interpolated to another.
The six readings of a sample are independent and are put in one after the other, linearised once
(Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, ch. II.7; the result is
that of the joint update).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from testbench.estimation.chain.sensors import SensorArrays, read_placement, read_sensor
from testbench.estimation.chain.state import Process, carry, drive, joint_motion, propagate

WIDE = 0.3
"""A joint whose standard deviation exceeds this part of its range is held by its limits though its
mean lies within them: it is known worse than an angle anywhere in the range, whose standard
deviation is 1 / sqrt(12) = 0.289 of it.
"""


class FilterPoint(NamedTuple):
    """Where the filter stands at an instant.

    Attributes:
        x: State, shape (n,).
        P: Its covariance, shape (n, n).
        levels: Of the two levels of process noise (Bar-Shalom, Li & Kirubarajan, 2001, sect.
            11.2.2), shape (5,): mean normalised innovation squared of one reading above which the
            raised one holds, memory of that mean [s], the mean now, part of the raised level now,
            time constant with which it falls back [s].
        time: The instant [s].
    """

    x: np.ndarray
    P: np.ndarray
    levels: np.ndarray
    time: float


class ChainReadings(NamedTuple):
    """The e samples of all sensors, in order of time.

    Attributes:
        time: Instants, shape (e,), not decreasing [s].
        sensor: Which of the sensors, shape (e,).
        reading: Rate and force, shape (e, 6) [rad/s], [m/s^2].
        change: Their derivatives by time, shape (e, 6).
        variance: Their variances, shape (e, 6).
    """

    time: np.ndarray
    sensor: np.ndarray
    reading: np.ndarray
    change: np.ndarray
    variance: np.ndarray


class PlacementEffect(NamedTuple):
    """What p constants of placement, held at zero, would do to the filter: Friedland's separate
    estimation of a bias (Treatment of bias in recursive filtering, IEEE Transactions on Automatic
    Control 14, 1969, 359-367).

    The filter knows nothing of them; its error is that of its own covariance plus `sensitivity`
    times the constants, and its innovations tell of these by a regression.

    Attributes:
        sensitivity: Of the state's error to the constants, shape (n, p); updated.
        information: What the innovations told of them, shape (p, p); added to.
        score: The same times their most likely values, shape (p,); added to.
        swing: Sum over samples of the outer product of each angle's sensitivity, shape (m, p, p);
            added to.
        covariance: Of the constants, which the standard deviations of the joints include, shape
            (p, p); or empty, shape (0, 0).
        lengths: Which constant the relative length before each joint is, -1 for none, shape (s, k).
    """

    sensitivity: np.ndarray
    information: np.ndarray
    score: np.ndarray
    swing: np.ndarray
    covariance: np.ndarray
    lengths: np.ndarray


@njit(cache=True)
def filter_chain(
    point: FilterPoint,
    process: Process,
    sensors: SensorArrays,
    readings: ChainReadings,
    effect: PlacementEffect,
    keep: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Run the filter.

    Args:
        point: Where it stands; its arrays end as those after the last sample.
        process: How the joints move.
        sensors: What sits on the chain.
        readings: What it read.
        effect: What wrong placement would do; of no constants where it is not asked for.
        keep: Whether to keep the state and covariance of every sample.

    Returns:
        Joint angles, rates and accelerations after each sample, shape (e, 3, m), and their standard
        deviations; of each sample the normalised innovation squared (mean over its readings), the
        logarithm of its likelihood, and the part of the raised level that held before it; states
        and covariances, shapes (e, n) and (e, n, n), empty unless kept.
    """
    # Longer than a screen and of many branches: prediction, and the update by six readings, whose
    # rows of H are assembled where all that they depend on is at hand.
    x, P, levels, now = point
    harmonics, indices, _, confined, jerk, walk, raised = process
    time, sensor, reading, change, variance = readings
    counts, columns = sensors.counts, sensors.columns
    e, n, m = len(time), len(x), indices.shape[0]
    bias = m * (2 * harmonics + 1) + 1 if harmonics else 3 * m
    clock = bias + 6 * len(counts)
    scale = clock + len(counts)
    means, sds = np.empty((e, 3, m)), np.empty((e, 3, m))
    nis, high = np.zeros(e), np.zeros(e)
    states = np.empty((e if keep else 0, n))
    covariances = np.empty((e if keep else 0, n, n))
    motion, slopes = np.empty((3, m)), np.empty((3, m, indices.shape[1]))
    by = np.zeros((3, 6, m))
    predicted, h, Ph, dx = np.empty(6), np.empty(n), np.empty(n), np.empty(n)
    likelihood = np.zeros(e)
    V, told, score, swing, covariance, lengths = effect
    p = V.shape[1]
    by_place, row, used = np.empty((6, 6 + columns.shape[1])), np.empty(p), np.empty(p)
    for i in range(e):
        dt = time[i] - now
        now = time[i]
        if dt > 0:
            propagate(x, P, m, harmonics, confined, dt)
            if p > 0:
                carry(x, V, m, harmonics, confined, dt)
            # the raised level holds while innovations are large, and then fades
            levels[3] = 1.0 if levels[2] > levels[0] else levels[3] * math.exp(-dt / levels[4])
            high[i] = levels[3]
            drive(P, m, harmonics, jerk, confined, walk + high[i] * raised, dt)
        s = sensor[i]
        joint_motion(x, indices, harmonics, motion, slopes)
        read_sensor(sensors, s, motion, predicted, by)
        if p > 0:
            read_placement(sensors, s, motion, predicted, by_place)
        dx[:] = 0.0
        for r in range(6):
            # row of H: the reading by the motion of each joint, times that by the states
            h[:] = 0.0
            for k in range(counts[s]):
                j = columns[s, k]
                for t in range(indices.shape[1]):
                    h[indices[j, t]] += (
                        by[0, r, j] * slopes[0, j, t]
                        + by[1, r, j] * slopes[1, j, t]
                        + by[2, r, j] * slopes[2, j, t]
                    )
            innovation = reading[i, r] - predicted[r]
            if n > bias:  # its bias, and what a late clock adds
                h[bias + 6 * s + r] = 1.0
                h[clock + s] = change[i, r]
                innovation -= x[bias + 6 * s + r] + change[i, r] * x[clock + s]
            if n > scale:
                # scale and axes, the gyroscope's response to force, and nonlinearity
                for t in range(3 if r >= 3 else 6):
                    place = scale + 33 * s + (6 * r if r < 3 else 9 + 3 * r) + t
                    h[place] = predicted[t if r < 3 else 3 + t]
                    innovation -= x[place] * h[place]
                place = scale + 33 * s + 27 + r
                h[place] = predicted[r] ** 3
                innovation -= x[place] * h[place]
            # S = h' P h + R, and the innovation less what the readings before it have told
            times_gain(P, h, Ph)
            S = variance[i, r]
            for t in range(n):
                S += h[t] * Ph[t]
                innovation -= h[t] * dx[t]
            nis[i] += innovation * innovation / S
            likelihood[i] -= 0.5 * (math.log(2 * math.pi * S) + innovation * innovation / S)
            take(dx, P, Ph, innovation / S, 1.0 / S)
            if p > 0:
                # d innovation / d constants: directly, and by the state's error
                row[:] = 0.0
                for t in range(6):
                    row[6 * s + t] = by_place[r, t]
                for k in range(counts[s]):
                    if lengths[s, k] >= 0:
                        row[lengths[s, k]] = by_place[r, 6 + k]
                learn(V, told, score, h, Ph, row, innovation, S)
        for t in range(n):
            x[t] += dx[t]
        nis[i] /= 6
        # mean of the normalised innovation squared with a fading memory
        fade = math.exp(-dt / levels[1])
        levels[2] = fade * levels[2] + (1 - fade) * nis[i]
        hold(x, P, V, process, motion, slopes, h, Ph)
        joint_motion(x, indices, harmonics, motion, slopes)
        for order in range(3):
            for j in range(m):
                means[i, order, j] = motion[order, j]
                variance_of = spread(P, indices[j], slopes[order, j])
                if p > 0 and (order == 0 or covariance.shape[0] > 0):
                    row[:] = 0.0
                    for t in range(indices.shape[1]):
                        for c in range(p):
                            row[c] += slopes[order, j, t] * V[indices[j, t], c]
                    if order == 0:
                        for t in range(p):
                            for c in range(p):
                                swing[j, t, c] += row[t] * row[c]
                    if covariance.shape[0] > 0:
                        times_gain(covariance, row, used)
                        for c in range(p):
                            variance_of += row[c] * used[c]
                sds[i, order, j] = math.sqrt(max(variance_of, 0.0))
        if keep:
            states[i], covariances[i] = x, P
    return means, sds, nis, likelihood, high, states, covariances


@njit(cache=True)
def times_gain(P: np.ndarray, h: np.ndarray, Ph: np.ndarray) -> None:
    """P h of a symmetric P and a sparse h.

    Args:
        P: Shape (n, n).
        h: Shape (n,).
        Ph: Filled with the product, shape (n,).
    """
    n = len(h)
    Ph[:] = 0.0
    for t in range(n):
        if h[t] != 0.0:
            weight = h[t]
            for c in range(n):
                Ph[c] += weight * P[t, c]


@njit(cache=True)
def take(x: np.ndarray, P: np.ndarray, Ph: np.ndarray, step: float, shrink: float) -> None:
    """Put one reading in: x += Ph step, P -= Ph Ph' shrink.

    Args:
        x: State, shape (n,); updated.
        P: Covariance, shape (n, n); updated.
        Ph: P times the row of H, shape (n,).
        step: Innovation over its variance.
        shrink: One over the variance of the innovation.
    """
    n = len(x)
    for r in range(n):
        x[r] += Ph[r] * step
        for c in range(n):
            P[r, c] -= (Ph[r] * Ph[c]) * shrink  # in this order P stays symmetric to the last bit


@njit(cache=True)
def learn(
    V: np.ndarray,
    told: np.ndarray,
    score: np.ndarray,
    h: np.ndarray,
    Ph: np.ndarray,
    row: np.ndarray,
    innovation: float,
    S: float,
) -> None:
    """What one innovation tells of the constants, and what its update leaves of their effect.

    Args:
        V: Sensitivity of the state's error, shape (n, p); updated.
        told: Information, shape (p, p); added to.
        score: Shape (p,); added to.
        h: Row of H, shape (n,).
        Ph: P times that before the update, shape (n,).
        row: Derivative of the reading by the constants, shape (p,); ends as that of the innovation.
        innovation: Of the reading.
        S: Its variance.
    """
    n, p = V.shape
    for t in range(n):
        if h[t] != 0.0:
            for c in range(p):
                row[c] += h[t] * V[t, c]
    for r in range(p):
        weight = row[r] / S
        score[r] += weight * innovation
        for c in range(p):
            told[r, c] += weight * row[c]
    for t in range(n):
        gain = Ph[t] / S
        for c in range(p):
            V[t, c] -= gain * row[c]


@njit(cache=True)
def spread(P: np.ndarray, index: np.ndarray, slope: np.ndarray) -> float:
    """Variance of a weighted sum of states.

    Args:
        P: Covariance of the states, shape (n, n).
        index: Which states, shape (k,).
        slope: Their weights, shape (k,).
    """
    total = 0.0
    for r in range(len(index)):
        if slope[r] != 0.0:
            for c in range(len(index)):
                total += slope[r] * slope[c] * P[index[r], index[c]]
    return total


@njit(cache=True)
def hold(
    x: np.ndarray,
    P: np.ndarray,
    V: np.ndarray,
    process: Process,
    motion: np.ndarray,
    slopes: np.ndarray,
    h: np.ndarray,
    Ph: np.ndarray,
) -> None:
    """Bring joints back within their limits: the density is cut off there (Simon, Optimal State
    Estimation, 2006, sect. 7.5.4).

    An estimate beyond a limit is moved to the mean of what is left, and the other states with it.
    The covariance is only shrunk where the joint is so uncertain that the limits know more: the
    same knowledge put in with every sample would soon make the filter sure of a limit.

    Args:
        x: State, shape (n,); updated.
        P: Covariance, shape (n, n); updated.
        process: With the limits.
        motion: Filled with q, v and a, shape (3, m).
        slopes: Filled with their derivatives by the states, shape (3, m, k).
        h: Space for a row of H, shape (n,).
        Ph: Space for P times that, shape (n,).
    """
    harmonics, indices, limits = process.harmonics, process.indices, process.limits
    joint_motion(x, indices, harmonics, motion, slopes)
    for j in range(indices.shape[0]):
        low, high = limits[j, 0], limits[j, 1]
        if low == -np.inf and high == np.inf:
            continue
        variance = spread(P, indices[j], slopes[0, j])
        mean, sd = motion[0, j], math.sqrt(max(variance, 0.0))
        if (low <= mean <= high and sd <= WIDE * (high - low)) or sd == 0.0:
            continue
        shift, left = truncated(mean, sd, low, high)
        h[:] = 0.0
        for t in range(indices.shape[1]):
            h[indices[j, t]] = slopes[0, j, t]
        times_gain(P, h, Ph)
        shrink = (variance - left) / variance**2 if sd > WIDE * (high - low) else 0.0
        take(x, P, Ph, (shift - mean) / variance, shrink)
        # the mean of what is left follows the mean by left / variance (d shift / d mean)
        for c in range(V.shape[1]):
            moved = 0.0
            for t in range(indices.shape[1]):
                moved += slopes[0, j, t] * V[indices[j, t], c]
            moved *= (1.0 - left / variance) / variance
            for t in range(V.shape[0]):
                V[t, c] -= Ph[t] * moved
        joint_motion(x, indices, harmonics, motion, slopes)


@njit(cache=True)
def truncated(mean: float, sd: float, low: float, high: float) -> tuple[float, float]:
    """Mean and variance of a normal density cut off at two limits (Johnson, Kotz & Balakrishnan,
    1994, sect. 10.1).
    """
    a, b = (low - mean) / sd, (high - mean) / sd
    if a > 6.0 or b < -6.0:  # what is left is an exponential at the limit
        distance = a if a > 6.0 else -b
        reach = min(sd / distance, high - low)
        return (low + reach if a > 6.0 else high - reach), reach**2
    mass = 0.5 * (math.erf(b / math.sqrt(2.0)) - math.erf(a / math.sqrt(2.0)))
    at_a = math.exp(-0.5 * a * a) / math.sqrt(2 * math.pi) if a > -40.0 else 0.0
    at_b = math.exp(-0.5 * b * b) / math.sqrt(2 * math.pi) if b < 40.0 else 0.0
    shift = (at_a - at_b) / mass
    bend = (a * at_a if at_a > 0 else 0.0) - (b * at_b if at_b > 0 else 0.0)
    return mean + sd * shift, max(sd * sd * (1.0 + bend / mass - shift * shift), 1e-9 * sd * sd)
