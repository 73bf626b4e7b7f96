"""Axis model: each axis by itself, reading = s (true . u) + o with |u| = 1, and the orthogonality check.

Castellanos Alonso (Universidad de Oviedo, 2023): theta = [s u; o] by least squares, then s = |s u|. Where the poses turn about
one axis only, the force stays in a plane and u is found in that plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.least_squares import Parameter
from testbench.estimation.calibration.linear import solve_linear
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import ACCELEROMETER, AXES, Tolerance, bias_parameters, response_parameters
from testbench.records.calibration import TriadCalibration
from testbench.records.fit import Fit

ADVICE = "each axis needs poses that turn it up, down and across"


def axis_model(poses: StaticPoses, tolerance: Tolerance = ACCELEROMETER) -> TriadCalibration:
    """Scale, direction and offset of each axis by itself, all poses counting alike.

    Args:
        poses: With expected vectors; at least four, not all in a plane. tolerance: Known beforehand.

    Returns:
        A correction whose three fits, one for each axis, hold s u (as response) and o (as bias).

    Raises:
        InputError: No expected vectors. PoorExcitation: The poses leave a parameter vaguer than its tolerance.
    """
    expected = poses.need_expected("axis_model")
    design = np.column_stack([expected, np.ones(len(poses))])
    responses, biases = response_parameters(tolerance), bias_parameters(tolerance)
    fits = tuple(
        solve_linear(
            design,
            poses.mean[:, i],
            [*responses[3 * i : 3 * i + 3], biases[i]],
            residual_unit=tolerance.unit,
            advice=ADVICE,
        )
        for i in range(3)
    )
    response = np.array([fit.values[:3] for fit in fits])
    scale = np.linalg.norm(response, axis=1)
    remark = ", ".join(f"s_{i} {s:.5f}" for i, s in zip(AXES, scale, strict=True))
    return TriadCalibration(
        "axis_model", np.linalg.inv(response), np.array([fit.values[3] for fit in fits]), fits=fits, remarks=(remark,)
    )


@dataclass(frozen=True)
class Orthogonality:
    """Two axes in the plane of a turn.

    Attributes:
        fits: Of each axis: s u (2) [1] and o [unit]. scale: s of each, shape (2,) [1]. angle: From the first axis to the
        second [rad]; a quarter turn, of a good sensor. angle_sd: Its standard uncertainty [rad].
        theta: s u of both axes and one common offset over gravity, shape (5,); [1, 0, 0, 1, 0] of a good sensor.
    """

    fits: tuple[Fit, Fit]
    scale: np.ndarray
    angle: float
    angle_sd: float
    theta: np.ndarray


def orthogonality(turned: np.ndarray, readings: np.ndarray, magnitude: float) -> Orthogonality:
    """Check two axes by turning them in the vertical plane that they span, say by 0, 60, ... 300 deg.

    Args:
        turned: Angle of each pose [rad], shape (m,): at 0 the first axis is up, at a quarter turn the second.
        readings: Of the two axes, shape (m, 2). magnitude: Of gravity, in their unit.

    Raises:
        PoorExcitation: Fewer than three different angles.
    """
    force = magnitude * np.column_stack([np.cos(turned), np.sin(turned)])
    design = np.column_stack([force, np.ones(len(turned))])
    found = []
    for i in range(2):
        parameters = [Parameter(f"response_{AXES[i]}{j}", "1", float(AXES[i] == j), ACCELEROMETER.response) for j in "xy"]
        parameters.append(Parameter(f"bias_{AXES[i]}", ACCELEROMETER.unit, 0.0, ACCELEROMETER.bias))
        found.append(solve_linear(design, readings[:, i], parameters, residual_unit=ACCELEROMETER.unit, advice=ADVICE))
    first, second = (fit.values[:2] for fit in found)
    angle = float(np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second))
    variance = 0.0
    for fit in found:
        su = fit.values[:2]
        slope = np.array([-su[1], su[0]]) / (su @ su)  # of an axis's direction
        variance += float(slope @ fit.covariance[:2, :2] @ slope)
    both = np.zeros((2 * len(turned), 5))
    both[: len(turned), :2], both[len(turned) :, 2:4], both[:, 4] = force, force, magnitude
    theta = np.linalg.lstsq(both, readings.T.reshape(-1), rcond=None)[0]
    scale = np.array([np.linalg.norm(first), np.linalg.norm(second)])
    return Orthogonality((found[0], found[1]), scale, angle, float(np.sqrt(variance)), theta)
