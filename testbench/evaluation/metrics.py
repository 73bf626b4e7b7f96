"""Errors of orientations and of flexion angles, and their summaries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
    """Of n errors, in their own unit: signed mean, mean magnitude, standard deviation, RMS, largest magnitude."""

    n: int
    mean: float
    mean_abs: float
    sd: float
    rmse: float
    max_abs: float


def summarise(errors: np.ndarray) -> Summary:
    """Summary of errors, shape (n,) with n >= 1; the sd is that of a sample (n - 1), 0 for a single one."""
    magnitude = np.abs(errors)
    sd = float(errors.std(ddof=1)) if len(errors) > 1 else 0.0
    return Summary(
        len(errors),
        float(errors.mean()),
        float(magnitude.mean()),
        sd,
        float(np.sqrt(np.mean(errors**2))),
        float(magnitude.max()),
    )


def rms(errors: np.ndarray) -> float:
    """Root mean square, shape (n,)."""
    return float(np.sqrt(np.mean(np.square(errors))))
