"""Errors of orientations and of flexion angles, and their summaries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.model import rotation


@dataclass(frozen=True)
class OrientationErrors:
    """Error angles [rad], each of shape (n,): total, its part about the vertical (signed), and the rest."""

    total: np.ndarray
    heading: np.ndarray
    inclination: np.ndarray


def orientation_errors(q_estimated: np.ndarray, q_true: np.ndarray) -> OrientationErrors:
    """Errors of q_world_from_sensor, split as Laidig & Seel (2023, section 4.2) do: e = q_estimated conj(q_true).

    Args:
        q_estimated, q_true: Shape (n, 4).
    """
    error = rotation.multiply(q_estimated, rotation.conjugate(q_true))
    return OrientationErrors(rotation.angle(error), rotation.heading_angle(error), rotation.inclination_angle(error))


@dataclass(frozen=True)
class Summary:
    """Of n errors, in their own unit.

    Attributes:
        mean: Signed. mean_abs: Of magnitudes. sd: Standard deviation. rmse: Root mean square. max_abs: Largest magnitude.
        median, iqr: Of signed errors: the middle, and upper less lower quartile. p95_abs: 95th percentile of magnitudes.
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
    """Summary of errors, shape (n,) with n >= 1; the sd is that of a sample (n - 1), 0 for a single one.

    Quantiles are linear between order statistics (Hyndman & Fan 1996, type 7), as numpy's are.
    """
    errors = np.ascontiguousarray(errors, dtype=np.float64)
    found = _summary(errors, np.sort(errors), np.sort(np.abs(errors)))  # numpy sorts several times faster than compiled loops
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
        mean, magnitude.mean(), sd, np.sqrt(square / n), magnitude[-1], _quantile(ordered, 0.5), iqr,
        _quantile(magnitude, 0.95),
    )  # fmt: skip


LEAST_SPREAD = np.radians(1.0)
"""A true angle with a smaller standard deviation than this says nothing by its correlation [rad]."""


def correlation(estimated: np.ndarray, true: np.ndarray) -> float | None:
    """Pearson's correlation of estimated and true angles [rad], shape (n,); None where the true ones hardly change."""
    if len(true) < 3 or not true.std() > LEAST_SPREAD or not estimated.std() > 0:
        return None
    centred = estimated - estimated.mean()
    return float(np.clip(np.mean(centred * (true - true.mean())) / (estimated.std() * true.std()), -1, 1))


def rms(errors: np.ndarray) -> float:
    """Root mean square, shape (n,)."""
    return float(np.sqrt(np.mean(np.square(errors))))
