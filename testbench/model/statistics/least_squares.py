"""Weighted non-linear least squares with uncertainty; data that tell too little are refused.

Gauss-Newton covariance (J' J)^-1 of residuals scaled to unit variance (Bates & Watts, Nonlinear
Regression Analysis, 1988, section 2.3). Whether the data determine a parameter is asked against its
`size`: what the data sheet already says of it. Data that say less than that are refused by the
parameter's name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbench.exceptions import InputError
from testbench.records.results.fit import Fit

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

Residuals = Callable[[np.ndarray], np.ndarray]

CONVERGED = 1e-12
"""Share of the sum of squares, or of the parameters, that a last step changes. Of m residuals of
unit variance it is a step of at most 1e-6 sqrt(m) standard deviations; below it rounding decides,
and what data do not determine would wander on.
"""
MOST_STEPS = 20
"""Per parameter, and for one more. Fits take some 25 in all; a search that goes on follows what the
data do not determine.
"""


@dataclass(frozen=True)
class FitParameter:
    """One unknown.

    Attributes:
        name: As the fit lists it.
        unit: Of its value.
        start: Where the search begins.
        size: Standard deviation of what is known beforehand, such as a data sheet's tolerance; the
            scale of the search, and the uncertainty that a fit must beat.
    """

    name: str
    unit: str
    start: float
    size: float


class PoorExcitation(InputError):
    """The recording does not determine some parameters.

    Attributes:
        parameters: Their names.
        condition: Condition number of the scaled design.
    """

    def __init__(self, parameters: Sequence[str], condition: float, advice: str):
        self.parameters, self.condition = tuple(parameters), condition
        named = ", ".join(parameters)
        super().__init__(
            f"the recording does not determine {named} (condition number {condition:.3g}); {advice}"
        )


def solve(
    residuals: Residuals,
    parameters: Sequence[FitParameter],
    *,
    jacobian: Residuals | None = None,
    known_scatter: bool = False,
    residual_unit: str = "",
    residual_scale: float = 1.0,
    advice: str = "more poses or motions about other axes are needed",
) -> Fit:
    """Fit parameters to residuals.

    Args:
        residuals: Gives residuals, shape (m,), of parameters, shape (p,), each divided by its
            standard deviation, or all by the same number.
        parameters: The unknowns.
        jacobian: Gives the derivatives, shape (m, p); by differences if None.
        known_scatter: The residuals' standard deviation is 1 by knowledge; else it is estimated
            from what the fit leaves.
        residual_unit: Unit that the fit states its residuals in.
        residual_scale: How many of that unit a residual of 1 is.
        advice: Against poor excitation.

    Raises:
        PoorExcitation: Fewer residuals than parameters, or a parameter that the data leave vaguer
            than its size.
    """
    # Longer than a screen: the call of SciPy and the fit that it comes to, one step.
    p = len(parameters)
    start, size = (
        np.array([getattr(item, key) for item in parameters]) for key in ("start", "size")
    )
    names, units = tuple(item.name for item in parameters), tuple(item.unit for item in parameters)

    def scaled(z: np.ndarray) -> np.ndarray:
        return residuals(start + size * z)

    def scaled_jacobian(z: np.ndarray) -> np.ndarray:
        assert jacobian is not None
        return jacobian(start + size * z) * size

    if len(scaled(np.zeros(p))) < p:
        raise PoorExcitation(
            names,
            float("inf"),
            f"{len(scaled(np.zeros(p)))} observations are fewer than {p} parameters",
        )
    from scipy.optimize import least_squares  # a quarter of a second to load

    def search(steps: int) -> OptimizeResult:
        return least_squares(
            scaled,
            np.zeros(p),
            jac=scaled_jacobian if jacobian else "3-point",
            method="trf",
            xtol=CONVERGED,
            ftol=CONVERGED,
            gtol=1e-15,
            max_nfev=steps,
        )

    found = search(MOST_STEPS * (p + 1))
    if found.status == 0:  # it wandered off: what is not determined is told where it began
        covariance_of(np.asarray(search(1).jac), 1.0, names, advice)
    J, left = np.asarray(found.jac), np.asarray(found.fun)
    dof = float("inf") if known_scatter else float(len(left) - p)
    variance = 1.0 if known_scatter else float(left @ left / dof) if dof > 0 else 1.0
    covariance, condition = covariance_of(J, variance, names, advice)
    return Fit(
        names,
        units,
        start + size * found.x,
        covariance * np.outer(size, size),
        dof,
        condition,
        left * residual_scale,
        residual_unit,
    )


def covariance_of(
    J: np.ndarray, variance: float, names: Sequence[str], advice: str
) -> tuple[np.ndarray, float]:
    """Covariance of parameters in units of their sizes, and the condition number.

    Args:
        J: Jacobian of residuals of unit variance by parameters in units of their sizes, shape (m,
            p).
        variance: Of those.
        names: Of the parameters.
        advice: For the error.

    Raises:
        PoorExcitation: A parameter stays vaguer than its size.
    """
    length = np.linalg.norm(J, axis=0)
    safe = np.where(length > 0, length, 1.0)
    _, strength, vt = np.linalg.svd(J / safe, full_matrices=False)
    condition = float(strength[0] / strength[-1]) if strength[-1] > 0 else float("inf")
    kept = strength > 1e-10 * strength[0]
    inverse = np.divide(1.0, strength, out=np.zeros_like(strength), where=kept)
    lost = np.abs(vt[~kept]).max(axis=0, initial=0.0) > 0.1
    half = (vt.T * inverse) / safe[:, None]
    covariance = half @ half.T * variance
    vague = np.sqrt(np.diag(covariance)) > 1.0
    poor = lost | vague | (length == 0)
    if poor.any():
        raise PoorExcitation(
            [name for name, bad in zip(names, poor, strict=True) if bad], condition, advice
        )
    return covariance, condition
