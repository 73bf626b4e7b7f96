"""Errors of orientations and of flexion angles, and their summaries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.model import rotation


@dataclass(frozen=True)
class OrientationErrors:
    """Error angles [rad], each of shape (n,): total, its part about the vertical (signed), and the
    rest.
    """

    total: np.ndarray
    heading: np.ndarray
    inclination: np.ndarray


def orientation_errors(q_estimated: np.ndarray, q_true: np.ndarray) -> OrientationErrors:
    """Errors of q_world_from_sensor, split as Laidig & Seel (2023, section 4.2) do: e = q_estimated
    conj(q_true).

    Args:
        q_estimated: Shape (n, 4).
        q_true: Shape (n, 4).
    """
    found = _error_angles(
        np.ascontiguousarray(q_estimated, dtype=float), np.ascontiguousarray(q_true, dtype=float)
    )
    return OrientationErrors(*found)


@njit(cache=True)
def _error_angles(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """`rotation.angle`, `heading_angle` and `inclination_angle` of q conj(p) in one pass, shape (3,
    n).
    """
    angles = np.empty((3, len(q)))
    for i in range(len(q)):
        w, x, y, z = rotation.product(
            q[i, 0], q[i, 1], q[i, 2], q[i, 3], p[i, 0], -p[i, 1], -p[i, 2], -p[i, 3]
        )
        level2 = x * x + y * y
        angles[0, i] = 2.0 * np.arctan2(np.sqrt(level2 + z * z), abs(w))
        heading = 2.0 * np.arctan2(z, w)
        if heading >= np.pi:
            heading -= 2.0 * np.pi
        elif heading < -np.pi:
            heading += 2.0 * np.pi
        angles[1, i] = heading
        angles[2, i] = 2.0 * np.arctan2(np.sqrt(level2), np.sqrt(w * w + z * z))
    return angles


@dataclass(frozen=True)
class Summary:
    """Of n errors, in their own unit.

    Attributes:
        mean: Signed.
        mean_abs: Of magnitudes.
        sd: Standard deviation.
        rmse: Root mean square.
        max_abs: Largest magnitude.
        median: Of signed errors: the middle, and upper less lower quartile.
        iqr: Of signed errors: the middle, and upper less lower quartile.
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


def summarise(errors: np.ndarray) -> Summary:
    """Summary of errors, shape (n,) with n >= 1; the sd is that of a sample (n - 1), 0 for a single
    one.

    Quantiles are linear between order statistics (Hyndman & Fan 1996, type 7), as numpy's are.
    """
    errors = np.ascontiguousarray(errors, dtype=np.float64)
    ordered = np.sort(errors)  # numpy sorts several times faster than compiled loops
    found = _summary(errors, ordered, ordered if ordered[0] >= 0 else np.sort(np.abs(errors)))
    return Summary(len(errors), *(float(value) for value in found))


@njit(cache=True)
def _quantile(ordered: np.ndarray, share: float) -> float:
    place = share * (len(ordered) - 1)
    low = int(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


@njit(cache=True)
def _summary(
    errors: np.ndarray, ordered: np.ndarray, magnitude: np.ndarray
) -> tuple[float, float, float, float, float, float, float, float]:
    n = len(errors)
    mean = errors.mean()
    square = 0.0
    spread = 0.0
    for error in errors:
        square += error * error
        spread += (error - mean) ** 2
    sd = np.sqrt(spread / (n - 1)) if n > 1 else 0.0
    iqr = _quantile(ordered, 0.75) - _quantile(ordered, 0.25)
    return (
        mean,
        magnitude.mean(),
        sd,
        np.sqrt(square / n),
        magnitude[-1],
        _quantile(ordered, 0.5),
        iqr,
        _quantile(magnitude, 0.95),
    )


LEAST_SPREAD = np.radians(1.0)
"""A true angle with a smaller standard deviation than this says nothing by its correlation
[rad].
"""


def correlation(estimated: np.ndarray, true: np.ndarray) -> float | None:
    """Pearson's correlation of estimated and true angles [rad], shape (n,); None where the true
    ones hardly change.
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
    return aa / len(a), bb / len(a), ab / len(a)


@njit(cache=True)
def unwrapped_pair(estimated: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two angles [rad] without jumps of a whole turn: the true one unwrapped, the estimated one
    brought next to it, (n,).
    """
    turn = 2 * np.pi
    near, smooth = np.empty(len(true)), np.empty(len(true))
    offset = 0.0
    for i in range(len(true)):
        if i > 0:
            step = true[i] - true[i - 1]
            if abs(step) > np.pi:
                offset -= turn * np.round(step / turn)
        smooth[i] = true[i] + offset
        error = estimated[i] - smooth[i]
        near[i] = smooth[i] + error - turn * np.round(error / turn)
    return near, smooth


def rms(errors: np.ndarray) -> float:
    """Root mean square, shape (n,)."""
    return float(np.sqrt(np.mean(np.square(errors))))
