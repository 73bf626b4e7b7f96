"""Twelve parameters from poses of known orientation: reading = response x expected + bias.

Linear in all twelve, so one weighted least-squares step is the answer (the multi-position tumble
test of IEEE Std 1293-2018, with the arm in the place of the dividing head). Each pose gives three
numbers, where the norm alone gives one. The weights know that an error of the arm's direction lies
across the expected vector.

Gauge: none. The mounting of the sensor on the arm is part of the response, and the correction turns
it into the axes as believed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import (
    ACCELEROMETER,
    MAGNETOMETER,
    Tolerance,
    bias_parameters,
    drift_parameters,
    response_parameters,
    warming,
)
from testbench.model.statistics.linear import solve_linear, whitening, widened_by_misfit
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit


def attitude_aided(poses: StaticPoses, tolerance: Tolerance = ACCELEROMETER) -> TriadCalibration:
    """Fit response and bias, and the bias's drift where the temperature varied.

    Args:
        poses: With expected vectors; at least four, not all in one plane.
        tolerance: Known beforehand.

    Raises:
        InputError: No expected vectors.
        PoorExcitation: The poses leave a parameter vaguer than its tolerance.
    """
    expected = poses.need_expected("attitude_aided")
    warm, reference = warming(poses)
    parameters = [*response_parameters(tolerance), *bias_parameters(tolerance)]
    design = triad_design(expected)
    if warm is not None:
        parameters += drift_parameters(tolerance)
        design = np.concatenate([design, np.eye(3) * warm[:, None, None]], axis=2)
    # rows of unit variance, so that one step of least squares is the answer
    whiten = whitening(poses.covariance())
    fit = solve_linear(
        (whiten @ design).reshape(-1, len(parameters)),
        np.einsum("mij,mj->mi", whiten, poses.mean).reshape(-1),
        parameters,
        known_scatter=True,
        residual_unit="standard deviations",
        advice="poses that turn the sensor about two axes at least, each face up and down, are "
        "needed",
    )
    return calibration_of(widened_by_misfit(fit), "attitude_aided", reference)


def known_field(poses: StaticPoses) -> TriadCalibration:
    """The same of a magnetometer, in a field that is known."""
    return replace(attitude_aided(poses, MAGNETOMETER), method="known_field")


def triad_design(expected: np.ndarray) -> np.ndarray:
    """Derivative of a triad's readings by its twelve parameters: response by rows, then bias.

    Args:
        expected: True vectors, shape (m, 3) [unit].

    Returns:
        Shape (m, 3, 12).
    """
    design = np.zeros((len(expected), 3, 12))
    for axis in range(3):
        design[:, axis, 3 * axis : 3 * axis + 3] = expected
        design[:, axis, 9 + axis] = 1.0
    return design


def calibration_of(
    fit: Fit, method: str, reference: float | None = None, remarks: tuple[str, ...] = ()
) -> TriadCalibration:
    """The correction that undoes a fitted response, bias and drift."""
    matrix = np.linalg.inv(fit.block("response_").reshape(3, 3))
    drift = fit.block("drift_") if reference is not None else np.zeros(3)
    return TriadCalibration(
        method,
        matrix,
        fit.block("bias_"),
        drift=drift,
        reference=reference,
        fits=(fit,),
        remarks=remarks,
    )
