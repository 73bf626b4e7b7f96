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

from testbench.estimation.chain.effect import PlacementEffect, add_effect, follow, learn
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


@njit(cache=True)
def filter_chain(
    point: FilterPoint,
    process: Process,
    sensors: SensorArrays,
    readings: ChainReadings,
    effect: PlacementEffect,
    keep: bool,
) -> tuple[
    np.ndarray,
    np.ndarray,
    np.ndarray,
    np.ndarray,
    np.ndarray,
    np.ndarray,
    np.ndarray,
    np.ndarray,
]:
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
        logarithm of its likelihood, and the part of the raised level that held before it; states,
        covariances and sensitivities, shapes (e, n), (e, n, n) and (e, n, p), empty unless kept.
    """
    # Longer than a screen: prediction, and the update by six readings, whose rows of H are
    # assembled where all that they depend on is at hand.
    x, P, levels, now = point
    harmonics, indices, _, confined, jerk, walk, raised = process
    time, sensor, reading, change, variance = readings
    counts, columns = sensors.counts, sensors.columns
    e, n, m = len(time), len(x), indices.shape[0]
    bias = m * (2 * harmonics + 1) + 1 if harmonics else 3 * m
    errors = (bias, bias + 6 * len(counts), bias + 7 * len(counts))
    means, sds = np.empty((e, 3, m)), np.empty((e, 3, m))
    nis, high = np.zeros(e), np.zeros(e)
    states = np.empty((e if keep else 0, n))
    covariances = np.empty((e if keep else 0, n, n))
    motion, slopes = np.empty((3, m)), np.empty((3, m, indices.shape[1]))
    by = np.zeros((3, 6, m))
    predicted, h, Ph, dx = np.empty(6), np.empty(n), np.empty(n), np.empty(n)
    likelihood = np.zeros(e)
    V, p = effect.sensitivity, effect.sensitivity.shape[1]
    sensitivities = np.empty((e if keep else 0, n, p))
    by_place, row, variances = np.empty((6, 6 + columns.shape[1])), np.empty(p), np.empty((3, m))
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
            by_motion(h, by[:, r], columns[s, : counts[s]], indices, slopes)
            innovation = reading[i, r] - predicted[r]
            innovation -= by_errors(x, h, s, r, errors, change[i, r], predicted)
            # S = h' P h + R, and the innovation less what the readings before it have told
            times_gain(P, h, Ph)
            S = variance[i, r]
            for t in range(n):
                S += h[t] * Ph[t]
                innovation -= h[t] * dx[t]
            nis[i] += innovation * innovation / S
            likelihood[i] -= 0.5 * (math.log(2 * math.pi * S) + innovation * innovation / S)
            take(dx, P, Ph, innovation / S, 1.0 / S)
            if p > 0:  # what wrong placement does to this reading
                learn(effect, s, by_place[r], h, Ph, innovation, S)
        for t in range(n):
            x[t] += dx[t]
        nis[i] /= 6
        # mean of the normalised innovation squared with a fading memory
        fade = math.exp(-dt / levels[1])
        levels[2] = fade * levels[2] + (1 - fade) * nis[i]
        hold(x, P, effect, process, motion, slopes, h)
        joint_motion(x, indices, harmonics, motion, slopes)
        means[i] = motion
        for order in range(3):
            for j in range(m):
                variances[order, j] = spread(P, indices[j], slopes[order, j])
        if p > 0:
            add_effect(effect, indices, slopes, variances, row)
        for order in range(3):
            for j in range(m):
                sds[i, order, j] = math.sqrt(max(variances[order, j], 0.0))
        if keep:
            states[i], covariances[i], sensitivities[i] = x, P, V
    return means, sds, nis, likelihood, high, states, covariances, sensitivities


@njit(cache=True)
def by_motion(
    h: np.ndarray, by: np.ndarray, columns: np.ndarray, indices: np.ndarray, slopes: np.ndarray
) -> None:
    """Begin a row of H: a reading by the motion of each joint, times that by the states.

    Args:
        h: Overwritten, shape (n,).
        by: Derivatives of the reading by angles, rates and accelerations, shape (3, m).
        columns: Joints that carry the sensor, shape (k,).
        indices: States that each joint depends on, shape (m, l).
        slopes: Derivatives of its motion by them, shape (3, m, l).
    """
    h[:] = 0.0
    for j in columns:
        for t in range(indices.shape[1]):
            # chain rule: d(reading) / d(motion) times d(motion) / d(state)
            h[indices[j, t]] += (
                by[0, j] * slopes[0, j, t] + by[1, j] * slopes[1, j, t] + by[2, j] * slopes[2, j, t]
            )


@njit(cache=True)
def by_errors(
    x: np.ndarray,
    h: np.ndarray,
    s: int,
    r: int,
    first: tuple[int, int, int],
    change: float,
    predicted: np.ndarray,
) -> float:
    """What a sensor's own errors add to a reading, and its derivatives by them.

    Args:
        x: State, shape (n,).
        h: Row of H, whose elements of this sensor are filled in, shape (n,).
        s: Which sensor.
        r: Which of its readings.
        first: First states of biases, clocks and scales; those that are left out begin at n.
        change: Derivative of the reading by time.
        predicted: Readings of the sensor without errors, shape (6,).
    """
    (bias, clock, scale), n, added = first, len(x), 0.0
    if n > bias:  # its bias, and what a late clock adds
        h[bias + 6 * s + r] = 1.0
        h[clock + s] = change
        added += x[bias + 6 * s + r] + change * x[clock + s]
    if n > scale:
        # scale and axes, the gyroscope's response to force, and nonlinearity
        for t in range(3 if r >= 3 else 6):
            place = scale + 33 * s + (6 * r if r < 3 else 9 + 3 * r) + t
            h[place] = predicted[t if r < 3 else 3 + t]
            added += x[place] * h[place]
        place = scale + 33 * s + 27 + r
        h[place] = predicted[r] ** 3
        added += x[place] * h[place]
    return added


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
                # P is symmetric: rows in place of columns, which lie side by side
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
                # s' P s
                total += slope[r] * slope[c] * P[index[r], index[c]]
    return total


@njit(cache=True)
def hold(
    x: np.ndarray,
    P: np.ndarray,
    effect: PlacementEffect,
    process: Process,
    motion: np.ndarray,
    slopes: np.ndarray,
    h: np.ndarray,
) -> None:
    """Bring joints back within their limits: the density is cut off there (Simon, Optimal State
    Estimation, 2006, sect. 7.5.4).

    An estimate beyond a limit is moved to the mean of what is left, and the other states with it.
    The covariance is only shrunk where the joint is so uncertain that the limits know more: the
    same knowledge put in with every sample would soon make the filter sure of a limit.

    Args:
        x: State, shape (n,); updated.
        P: Covariance, shape (n, n); updated.
        effect: Of constants of placement; its sensitivity is updated.
        process: With the limits.
        motion: Filled with q, v and a, shape (3, m).
        slopes: Filled with their derivatives by the states, shape (3, m, k).
        h: Space for a row of H, shape (n,).
    """
    Ph = np.empty(len(x))
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
        # mean and variance of what lies within the limits (Simon 2006, sect. 7.5.4)
        shift, left = truncated(mean, sd, low, high)
        h[:] = 0.0
        for t in range(indices.shape[1]):
            h[indices[j, t]] = slopes[0, j, t]
        times_gain(P, h, Ph)
        shrink = (variance - left) / variance**2 if sd > WIDE * (high - low) else 0.0
        # x + P h (shift - mean) / variance, and P less what is known now
        take(x, P, Ph, (shift - mean) / variance, shrink)
        if effect.sensitivity.shape[1] > 0:
            follow(effect, indices[j], slopes[0, j], Ph, (1.0 - left / variance) / variance)
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
