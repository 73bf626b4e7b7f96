"""The linear model of a triad, reading = response x true + bias + drift (T - reference)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.static_poses import PRIOR_BIAS
from testbench.model.statistics.least_squares import FitParameter

AXES = "xyz"
LEAST_WARMING_K = 2.0
"""Smaller changes of temperature are not told from noise and fitted no drift [K]."""


@dataclass(frozen=True)
class Tolerance:
    """What is known of a triad before it is calibrated; a fit that says less is refused.

    Attributes:
        unit: Of the readings.
        response: Standard deviation of scale, cross-axis error and mounting [1].
        bias: Standard deviation of the bias [unit].
        drift: Standard deviation of its drift [unit/K].
    """

    unit: str
    response: float
    bias: float
    drift: float


ACCELEROMETER = Tolerance("m/s^2", 0.1, PRIOR_BIAS, 0.02)
"""Scale and cross-axis errors of 3 % and a mounting crooked by 5 deg, together; 40 mg; 2 mg/K
(consumer MEMS data sheets).
"""
MAGNETOMETER = Tolerance("uT", 0.3, 50.0, 1.0)
"""Soft iron of 30 %, hard iron as large as the earth's field (Renaudin, Afzal & Lachapelle, J.
Sensors 2010).
"""


def response_parameters(tolerance: Tolerance) -> list[FitParameter]:
    """response_ij, how axis i reads component j, row by row."""
    return [
        FitParameter(f"response_{i}{j}", "1", float(i == j), tolerance.response)
        for i in AXES
        for j in AXES
    ]


def bias_parameters(tolerance: Tolerance, start: np.ndarray | None = None) -> list[FitParameter]:
    """bias_x, bias_y, bias_z.

    Args:
        tolerance: Known beforehand.
        start: Where the search begins, shape (3,) [unit]; zeros if None.
    """
    at = np.zeros(3) if start is None else start
    return [
        FitParameter(f"bias_{i}", tolerance.unit, float(b), tolerance.bias)
        for i, b in zip(AXES, at, strict=True)
    ]


def drift_parameters(tolerance: Tolerance) -> list[FitParameter]:
    """drift_x, drift_y, drift_z."""
    return [FitParameter(f"drift_{i}", f"{tolerance.unit}/K", 0.0, tolerance.drift) for i in AXES]


def warming(poses: StaticPoses) -> tuple[np.ndarray | None, float | None]:
    """Temperature of each pose above the mean one, shape (m,) [K], and that mean [deg C].

    None for both where the temperature did not vary.
    """
    if poses.temperature is None or np.ptp(poses.temperature) < LEAST_WARMING_K:
        return None, None
    reference = float(poses.temperature.mean())
    return poses.temperature - reference, reference
