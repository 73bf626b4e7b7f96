"""Twelve parameters from poses of known orientation: reading = response x expected + bias.

Linear in all twelve, so one weighted least-squares step is the answer (the multi-position tumble
test of IEEE Std 1293-2018, with the arm in the place of the dividing head). Each pose gives three
numbers, where the norm alone gives one. The weights know that an error of the arm's direction lies
across the expected vector. Errors of the arm that all poses share, such as the zeros of its joints,
are further unknowns of known size, so that neither residuals nor covariance are without them.

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
from testbench.model.statistics.added_terms import with_terms
from testbench.model.statistics.least_squares import FitParameter
from testbench.model.statistics.linear import (
    first_of,
    solve_linear,
    whitening,
    widened_by_misfit,
)
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.evidence import Evidence
from testbench.records.results.fit import Fit

HALVINGS = 8
"""Of the interval of direction errors: to a four hundredth of the assumed one."""
SHARED_SIZE = 2.0
"""Of an error that all poses share, in its standard uncertainties: a fit cannot know less of it."""


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
    rows = (whiten @ design).reshape(-1, len(parameters))
    observed = np.einsum("mij,mj->mi", whiten, poses.mean).reshape(-1)
    own = len(parameters)
    if poses.shared is not None:
        rows, observed = _with_shared(poses.shared, whiten, rows, observed)
        parameters += [
            FitParameter(f"shared_{i}", "1", 0.0, SHARED_SIZE) for i in range(rows.shape[1] - own)
        ]
    fit = solve_linear(
        rows,
        observed,
        parameters,
        known_scatter=True,
        residual_unit="standard deviations",
        advice="poses that turn the sensor about two axes at least, each face up and down, are "
        "needed",
    )
    found = calibration_of(first_of(widened_by_misfit(fit), own), "attitude_aided", reference)
    return replace(found, evidence=Evidence(fit.residuals, rows, whiten))


def _with_shared(
    shared: np.ndarray, whiten: np.ndarray, rows: np.ndarray, observed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Design and observations with errors that all poses share as further unknowns.

    Each is known beforehand to be 0 with standard uncertainty 1: one more observation for each.

    Args:
        shared: What they change of the expected vectors, shape (m, q, 3) [unit].
        whiten: Of each pose, shape (m, 3, 3).
        rows: Design without them, response first, shape (3 m, p).
        observed: Shape (3 m,).
    """
    q = shared.shape[1]
    response = np.linalg.lstsq(rows, observed, rcond=None)[0][:9].reshape(3, 3)
    read = np.einsum("mij,jk,mqk->miq", whiten, response, shared).reshape(-1, q)
    whole = np.block([[rows, read], [np.zeros((q, rows.shape[1])), np.eye(q)]])
    return whole, np.concatenate([observed, np.zeros(q)])


def sharpened(
    poses: StaticPoses, terms: np.ndarray, tolerance: Tolerance = ACCELEROMETER
) -> Evidence | None:
    """What a fit leaves where an arm repeats as well as its poses show, not as is assumed of it.

    The standard deviation of the expected direction is the largest, up to the assumed one, by which
    the residuals beside all terms that are asked for are as large as they should be. Only tests of
    the model take it: uncertainties are never narrowed by it.

    Args:
        poses: With expected vectors.
        terms: What may lack, shape (m, 3, q) [unit].
        tolerance: Known beforehand.
    """
    low, high = 0.0, poses.direction_sd
    evidence = attitude_aided(poses, tolerance).evidence
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        tried = attitude_aided(replace(poses, direction_sd=middle), tolerance).evidence
        beside = None if tried is None else with_terms(tried, terms)
        if beside is None or beside.left.squares > beside.left.dof:
            low = middle
        else:
            high, evidence = middle, tried
    return evidence


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
