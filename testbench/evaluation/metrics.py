"""Errors of orientations and of flexion angles, and their summaries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from testbench.model import rotation


@dataclass(frozen=True)
class OrientationErrors:
    """Error angles of orientations.

    Attributes:
        total: Of the whole rotation, shape (n,) [rad].
        heading: Of its part about the vertical, signed, shape (n,) [rad].
        inclination: Of the rest, shape (n,) [rad].
    """

    total: np.ndarray
    heading: np.ndarray
    inclination: np.ndarray


def orientation_errors(q_estimated: np.ndarray, q_true: np.ndarray) -> OrientationErrors:
    """Errors of orientations in the world, in all and by heading and inclination.

    Laidig & Seel (2023), section 4.2: the error is q_estimated conj(q_true).

    Args:
        q_estimated: Estimated q_world_from_sensor, shape (n, 4).
        q_true: True q_world_from_sensor, shape (n, 4).
    """
    found = _error_angles(
        np.ascontiguousarray(q_estimated, dtype=float), np.ascontiguousarray(q_true, dtype=float)
    )
    return OrientationErrors(*found)


@njit(cache=True)
def _error_angles(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """`rotation.angle`, `heading_angle` and `inclination_angle` of q conj(p), shape (3, n)."""
    angles = np.empty((3, len(q)))
    for i in range(len(q)):
        # q conj(p)
        w, x, y, z = rotation.product(
            (q[i, 0], q[i, 1], q[i, 2], q[i, 3]), (p[i, 0], -p[i, 1], -p[i, 2], -p[i, 3])
        )
        level2 = x * x + y * y
        # as `rotation.angle`: 2 atan2(|v|, |w|)
        angles[0, i] = 2.0 * np.arctan2(np.sqrt(level2 + z * z), abs(w))
        # as `rotation.heading_angle`, the twist about the vertical (Laidig & Seel 2023)
        heading = 2.0 * np.arctan2(z, w)
        if heading >= np.pi:
            heading -= 2.0 * np.pi
        elif heading < -np.pi:
            heading += 2.0 * np.pi
        angles[1, i] = heading
        # as `rotation.inclination_angle`, what remains
        angles[2, i] = 2.0 * np.arctan2(np.sqrt(level2), np.sqrt(w * w + z * z))
    return angles


class Summary(NamedTuple):
    """Of n errors, in their own unit.

    Attributes:
        mean: Signed.
        mean_abs: Of magnitudes.
        sd: Standard deviation.
        rmse: Root mean square.
        max_abs: Largest magnitude.
        median: Of signed errors.
        iqr: Upper less lower quartile of signed errors.
        p95_abs: 95th percentile of magnitudes.
    """

    n: int
    mean: float
    mean_abs: float
    sd: float
    rmse: float
    max_abs: float
    median: float
    iqr: float
    p95_abs: float


QUARTILES = [0.25, 0.5, 0.75]
MOST_OF = 0.95
"""Share of the magnitudes that `p95_abs` is not below."""
MANY = 2_000
"""Of so many values a few are selected faster than all are sorted."""


def summarise(errors: np.ndarray) -> Summary:
    """Summary of errors.

    The sd is that of a sample (n - 1), 0 for a single error. Quantiles are linear between order
    statistics (Hyndman & Fan 1996, type 7), as numpy's are.

    Args:
        errors: Shape (n,), n >= 1, in any unit.
    """
    return summarise_each(errors, np.array([len(errors)]))[0]


def summarise_each(errors: np.ndarray, sizes: np.ndarray) -> list[Summary]:
    """A summary of each of several consecutive sets of errors.

    Args:
        errors: Of all sets, one after the other, shape (n,).
        sizes: Errors in each set, none empty, shape (m,), summing to n.
    """
    errors = np.ascontiguousarray(errors, dtype=np.float64)
    ends = np.cumsum(sizes)
    ordered = _ordered(errors, sizes, QUARTILES), _ordered(np.abs(errors), sizes, [MOST_OF])
    found = _summaries(errors, *ordered, ends)
    return [Summary(*row) for row in zip(sizes.tolist(), *found.T.tolist(), strict=True)]


def _ordered(values: np.ndarray, sizes: np.ndarray, shares: list[float]) -> np.ndarray:
    """A copy in which the values that quantiles are taken of stand where sorting puts them.

    Numpy sorts several times faster than compiled loops do, and selects a few of many values in a
    quarter of the time that sorting takes.

    Args:
        values: Of all sets, one after the other, shape (n,).
        sizes: Values in each set, shape (m,).
        shares: The quantiles.
    """
    ordered, begin = values.copy(), 0
    for size in sizes.tolist():
        own = ordered[begin : begin + size]
        if size < MANY:
            own.sort()
        else:
            low = [int(share * (size - 1)) for share in shares]
            own.partition(sorted({*low, *(rank + 1 for rank in low)}))
        begin += size
    return ordered


@njit(cache=True)
def _summaries(
    errors: np.ndarray, ordered: np.ndarray, magnitudes: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """What follows the number in `Summary`, of each set of errors that ends there, shape (m, 8).

    Args:
        errors: Shape (n,).
        ordered: The same as `_ordered` gives them, shape (n,).
        magnitudes: Likewise their magnitudes, shape (n,).
        ends: Shape (m,).
    """
    result = np.empty((len(ends), 8))
    begin = 0
    for i, end in enumerate(ends):
        own, rising = errors[begin:end], ordered[begin:end]
        n = end - begin
        mean = own.mean()
        square = spread = magnitude = largest = 0.0
        for error in own:
            square += error * error
            spread += (error - mean) ** 2
            magnitude += abs(error)
            largest = max(largest, abs(error))
        # mean, mean magnitude, sd (n - 1), RMS, largest; then the quantiles
        result[i, 0] = mean
        result[i, 1] = magnitude / n
        result[i, 2] = np.sqrt(spread / (n - 1)) if n > 1 else 0.0
        result[i, 3] = np.sqrt(square / n)
        result[i, 4] = largest
        result[i, 5] = _quantile(rising, 0.5)
        result[i, 6] = _quantile(rising, 0.75) - _quantile(rising, 0.25)
        result[i, 7] = _quantile(magnitudes[begin:end], MOST_OF)
        begin = end
    return result


@njit(cache=True)
def _quantile(ordered: np.ndarray, share: float) -> float:
    # type 7 of Hyndman & Fan 1996: between the two ordered values about share (n - 1)
    place = share * (len(ordered) - 1)
    low = int(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


LEAST_SPREAD = np.radians(1.0)
"""A true angle with a smaller standard deviation than this says nothing by its correlation
[rad].
"""


def correlation(estimated: np.ndarray, true: np.ndarray) -> float | None:
    """Pearson's correlation of estimated and true angles.

    Args:
        estimated: Estimated angle [rad], shape (n,).
        true: True angle [rad], shape (n,).

    Returns:
        None where the true angle hardly changes.
    """
    if len(true) < 3:
        return None
    variance, of_true, together = _moments(estimated, true)
    if not np.sqrt(of_true) > LEAST_SPREAD or not variance > 0:
        return None
    return float(np.clip(together / np.sqrt(variance * of_true), -1, 1))


@njit(cache=True)
def _moments(a: np.ndarray, b: np.ndarray) -> tuple[float, float, float]:
    """Variances and covariance of two series."""
    mean_a, mean_b = a.mean(), b.mean()
    aa = bb = ab = 0.0
    for i in range(len(a)):
        x, y = a[i] - mean_a, b[i] - mean_b
        aa += x * x
        bb += y * y
        ab += x * y
    # over n
    return aa / len(a), bb / len(a), ab / len(a)


@njit(cache=True)
def unwrapped_pair(estimated: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two angles without jumps of a whole turn.

    Args:
        estimated: Estimated angle [rad], shape (n,).
        true: True angle [rad], shape (n,).

    Returns:
        The estimated angle within half a turn of the true one, and the true one unwrapped, shape
        (n,) each [rad].
    """
    turn = 2 * np.pi
    near, smooth = np.empty(len(true)), np.empty(len(true))
    offset = 0.0
    for i in range(len(true)):
        # the true angle goes on without jumps
        if i > 0:
            step = true[i] - true[i - 1]
            if abs(step) > np.pi:
                offset -= turn * np.round(step / turn)
        smooth[i] = true[i] + offset
        # the estimated one, give or take whole turns, nearest to it
        error = estimated[i] - smooth[i]
        near[i] = smooth[i] + error - turn * np.round(error / turn)
    return near, smooth


def rms(errors: np.ndarray) -> float:
    """Root mean square.

    Args:
        errors: Shape (n,), in any unit.
    """
    return float(np.sqrt(np.mean(np.square(errors))))
