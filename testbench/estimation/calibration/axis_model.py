"""Axis model: each axis by itself, reading = s (true . u) + o with |u| = 1, and the orthogonality
check.

Castellanos Alonso (Universidad de Oviedo, 2023): theta = [s u; o] by least squares, then s = |s u|.
Where the poses turn about one axis only, the force stays in a plane and u is found in that plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.rotational import axes_in_plane
from testbench.estimation.calibration.triad_model import (
    ACCELEROMETER,
    AXES,
    Tolerance,
    bias_parameters,
    response_parameters,
)
from testbench.model.statistics.least_squares import FitParameter
from testbench.model.statistics.linear import solve_linear
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit

ADVICE = "each axis needs poses that turn it up, down and across"


def axis_model(poses: StaticPoses, tolerance: Tolerance = ACCELEROMETER) -> TriadCalibration:
    """Scale, direction and offset of each axis by itself, all poses counting alike.

    Args:
        poses: With expected vectors; at least four, not all in a plane.
        tolerance: Known beforehand.

    Returns:
        A correction whose three fits, one for each axis, hold s u (as response) and o (as bias).

    Raises:
        InputError: No expected vectors.
        PoorExcitation: The poses leave a parameter vaguer than its tolerance.
    """
    expected = poses.need_expected("axis_model")
    design = np.column_stack([expected, np.ones(len(poses))])
    sd = poses.typical_sd()
    responses, biases = response_parameters(tolerance), bias_parameters(tolerance)
    fits = tuple(
        solve_linear(
            design / sd,
            poses.mean[:, i] / sd,
            [*responses[3 * i : 3 * i + 3], biases[i]],
            residual_unit=tolerance.unit,
            residual_scale=sd,
            advice=ADVICE,
        )
        for i in range(3)
    )
    response = np.array([fit.values[:3] for fit in fits])
    scale = np.linalg.norm(response, axis=1)
    remark = ", ".join(f"s_{i} {s:.5f}" for i, s in zip(AXES, scale, strict=True))
    return TriadCalibration(
        "axis_model",
        np.linalg.inv(response),
        np.array([fit.values[3] for fit in fits]),
        fits=fits,
        remarks=(remark,),
    )


@dataclass(frozen=True)
class Orthogonality:
    """Two axes in the plane of a turn.

    Attributes:
        axes: Their names.
        fits: Of each: s u (2) as response [1], and o as bias [m/s^2].
        scale: s of each, shape (2,) [1].
        angle: From the first axis to the second [rad]; a quarter turn, of a good sensor.
        angle_sd: Standard uncertainty [rad].
        angle_half_width: Half of the 95 % interval of the angle [rad].
        theta: s u of both axes, and one common offset over gravity, shape (5,); [1, 0, 0, 1, 0] of
            a good sensor.
    """

    axes: tuple[str, str]
    fits: tuple[Fit, Fit]
    scale: np.ndarray
    angle: float
    angle_sd: float
    angle_half_width: float
    theta: np.ndarray


def orthogonality(poses: StaticPoses) -> Orthogonality:
    """Check the two axes that turn through the vertical, say by 0, 60, ... 300 deg about the third.

    Args:
        poses: With expected forces in the plane of two axes.

    Raises:
        InputError: No expected forces, or not in such a plane.
        PoorExcitation: Fewer than three different angles.
    """
    plane = axes_in_plane(poses, "orthogonality")
    expected = poses.need_expected("orthogonality")[:, plane]
    names = (AXES[plane[0]], AXES[plane[1]])
    design = np.column_stack([expected, np.ones(len(poses))])
    sd, found, variance = poses.typical_sd(), [], 0.0
    for axis, name in zip(plane, names, strict=True):
        parameters = [
            FitParameter(f"response_{name}{j}", "1", float(name == j), ACCELEROMETER.response)
            for j in names
        ]
        parameters.append(FitParameter(f"bias_{name}", ACCELEROMETER.unit, 0.0, ACCELEROMETER.bias))
        fit = solve_linear(
            design / sd,
            poses.mean[:, axis] / sd,
            parameters,
            residual_unit=ACCELEROMETER.unit,
            residual_scale=sd,
            advice=ADVICE,
        )
        su = fit.values[:2]
        slope = np.array([-su[1], su[0]]) / (su @ su)  # of the axis's direction
        variance += float(slope @ fit.covariance[:2, :2] @ slope)
        found.append(fit)
    first, second = (fit.values[:2] for fit in found)
    angle = float(np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second))
    both = np.zeros((2 * len(poses), 5))
    both[: len(poses), :2], both[len(poses) :, 2:4], both[:, 4] = (
        expected,
        expected,
        poses.magnitude,
    )
    theta = np.linalg.lstsq(both, poses.mean[:, plane].T.reshape(-1), rcond=None)[0]
    scale = np.array([np.linalg.norm(first), np.linalg.norm(second)])
    angle_sd = float(np.sqrt(variance))
    width = angle_sd * float(stdtrit(found[0].dof + found[1].dof, 0.975))
    return Orthogonality(names, (found[0], found[1]), scale, angle, angle_sd, width, theta)
