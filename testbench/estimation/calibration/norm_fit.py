"""Calibration by the length of a vector alone: |A (reading - bias)| is the same in all poses.

Geometrically the readings lie on an ellipsoid. A is found up to a rotation from the left, which
leaves all lengths as they are: each method that uses this states which A it picks. An algebraic fit
of the ellipsoid starts the search (Li & Griffiths, Least squares ellipsoid specific fitting, GMP
2004, without the constraint), maximum likelihood ends it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import (
    Tolerance,
    bias_parameters,
    drift_parameters,
    warming,
)
from testbench.model.statistics.least_squares import (
    FitParameter,
    PoorExcitation,
    covariance_of,
    solve,
)
from testbench.model.statistics.linear import widened_by_misfit
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.evidence import Evidence
from testbench.records.results.fit import Fit

MOST_CONDITION = 1e3
"""Above this the readings are on no ellipsoid that could be told from others; about 10 where poses
go all round.
"""
ADVICE = "poses that turn every axis up, down and across are needed: nine at least, not in a plane"


def ellipsoid_through(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The ellipsoid (x - centre)' Q (x - centre) = 1 nearest to readings.

    Args:
        readings: Shape (m, 3).

    Returns:
        The centre, shape (3,), and Q, shape (3, 3); None where the readings are on no ellipsoid.
    """
    if len(readings) < 9:
        return None
    middle, spread = readings.mean(axis=0), float(readings.std()) or 1.0
    x, y, z = ((readings - middle) / spread).T
    terms = np.column_stack(
        [x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, 2 * x, 2 * y, 2 * z]
    )
    if np.linalg.cond(terms) > MOST_CONDITION:
        return None
    # x' Q x + 2 b' x = 1, linear in Q and b
    a, *_ = np.linalg.lstsq(terms, np.ones(len(x)), rcond=None)
    Q = np.array([[a[0], a[3], a[4]], [a[3], a[1], a[5]], [a[4], a[5], a[2]]])
    if abs(np.linalg.det(Q)) < 1e-12:
        return None
    # the centre, and Q scaled to 1 about it
    centre = -np.linalg.solve(Q, a[6:])
    Q = Q / (1 + centre @ Q @ centre)
    if np.linalg.eigvalsh(Q)[0] <= 0:
        return None
    return middle + spread * centre, Q / spread**2


@dataclass(frozen=True)
class MatrixModel:
    """How the matrix A follows from k parameters.

    Attributes:
        parameters: The k parameters.
        start: From magnitude^2 Q, shape (3, 3), to their values, shape (k,).
        matrix: From their values to A, shape (3, 3).
        gradient: From their values to dA, shape (k, 3, 3).
    """

    parameters: Sequence[FitParameter]
    start: Callable[[np.ndarray], np.ndarray]
    matrix: Callable[[np.ndarray], np.ndarray]
    gradient: Callable[[np.ndarray], np.ndarray]


def searched(
    residuals: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    parameters: Sequence[FitParameter],
    begun: bool,
    advice: str,
) -> Fit:
    """The fit by residuals in standard deviations, widened where they are larger.

    Args:
        residuals: By the parameters, shape (p,) to (r,).
        jacobian: Their derivatives, shape (p,) to (r, p).
        parameters: With their starts, p of them.
        begun: Whether the starts are from the readings.
        advice: Against poor excitation.

    Raises:
        PoorExcitation: A parameter stays vaguer than its size.
    """
    if not begun:  # ask before the search runs away along what is not seen
        at, size = (
            np.array([getattr(item, key) for item in parameters]) for key in ("start", "size")
        )
        covariance_of(jacobian(at) * size, 1.0, [item.name for item in parameters], advice)
    found = solve(
        residuals,
        parameters,
        jacobian=jacobian,
        known_scatter=True,
        residual_unit="standard deviations",
        advice=advice,
    )
    return widened_by_misfit(found)


def fit_norm(
    poses: StaticPoses,
    model: MatrixModel,
    tolerance: Tolerance,
    method: str,
    remarks: tuple[str, ...] = (),
) -> TriadCalibration:
    """Fit the parameters of a matrix, a bias, and its drift where the temperature varied.

    Args:
        poses: Of known `magnitude`.
        model: How the matrix follows from its parameters.
        tolerance: Known of bias and drift beforehand.
        method: Name that the calibration bears.
        remarks: What its user must know.

    Raises:
        PoorExcitation: Poses in a plane, say, which leave a parameter vaguer than its tolerance.
    """
    # Longer than a screen: residuals and their derivatives share the poses and the weights.
    shape, k, x, magnitude = model.parameters, len(model.parameters), poses.mean, poses.magnitude
    warm, reference = warming(poses)
    begin, bias = np.array([item.start for item in shape]), np.zeros(3)
    guess = ellipsoid_through(x)
    if guess is not None:
        bias, begin = guess[0], model.start(magnitude**2 * guess[1])
    parameters = [
        FitParameter(item.name, item.unit, float(value), item.size)
        for item, value in zip(shape, begin, strict=True)
    ]
    parameters += bias_parameters(tolerance, bias)
    if warm is not None:
        parameters += drift_parameters(tolerance)
    # Noise along the corrected vector, by the start: it differs little over the search.
    A = model.matrix(begin)
    h = (x - bias) @ A.T
    along = (h / np.linalg.norm(h, axis=1, keepdims=True)) @ A
    weight = 1 / np.sqrt(np.sum(along**2 * poses.variance, axis=1))

    def centred(theta: np.ndarray) -> np.ndarray:
        b = x - theta[k : k + 3]
        return b if warm is None else b - warm[:, None] * theta[k + 3 :]

    def residuals(theta: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(centred(theta) @ model.matrix(theta[:k]).T, axis=1)
        return np.asarray(weight * (length - magnitude))

    def jacobian(theta: np.ndarray) -> np.ndarray:
        # d|A y| = u' dA y - u' A db, u along A y
        y, A = centred(theta), model.matrix(theta[:k])
        h = y @ A.T
        u = h / np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-12)
        columns = [np.einsum("mi,kij,mj->mk", u, model.gradient(theta[:k]), y), -u @ A]
        if warm is not None:
            columns.append(-(u @ A) * warm[:, None])
        return np.asarray(weight[:, None] * np.hstack(columns))

    if len(x) < len(parameters):
        names = [item.name for item in parameters]
        raise PoorExcitation(
            names, float("inf"), f"{len(x)} poses are fewer than {len(names)} parameters"
        )
    fit = searched(residuals, jacobian, parameters, guess is not None, ADVICE)
    drift = fit.values[k + 3 :] if warm is not None else np.zeros(3)
    A = model.matrix(fit.values[:k])
    h = centred(fit.values) @ A.T
    reach = -weight[:, None] * (h / np.linalg.norm(h, axis=1, keepdims=True)) @ A
    evidence = Evidence(fit.residuals, jacobian(fit.values), reach[:, None, :])
    return TriadCalibration(
        method,
        A,
        fit.values[k : k + 3],
        drift=drift,
        reference=reference,
        fits=(fit,),
        remarks=remarks,
        evidence=evidence,
    )
