"""Linear least squares with the same refusals and the same record as the non-linear one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from testbench.model.statistics.least_squares import (
    FitParameter,
    PoorExcitation,
    covariance_of,
)
from testbench.records.results.fit import Fit

SURPRISING = 0.95
"""Residuals beyond this quantile are put to model errors."""


def solve_linear(
    design: np.ndarray,
    observed: np.ndarray,
    parameters: Sequence[FitParameter],
    *,
    known_scatter: bool = False,
    residual_unit: str = "",
    residual_scale: float = 1.0,
    advice: str = "more poses or motions about other axes are needed",
) -> Fit:
    """Fit observed = design @ values, rows divided by their standard deviations.

    With as many observations as parameters nothing is left to tell the scatter from, and the
    standard deviations are believed.

    Args:
        design: Shape (m, p).
        observed: Shape (m,).
        parameters: Their `start` is not used.
        known_scatter: The standard deviations of the rows are known; else the scatter is estimated
            from what the fit leaves.
        residual_unit: Unit that the fit states its residuals in.
        residual_scale: How many of that unit a residual of 1 is.
        advice: Against poor excitation.

    Raises:
        PoorExcitation: Fewer observations than parameters, or a parameter that the data leave
            vaguer than its size.
    """
    m, p = design.shape
    names = tuple(item.name for item in parameters)
    if m < p:
        raise PoorExcitation(names, float("inf"), f"{m} observations are fewer than {p} parameters")
    size = np.array([item.size for item in parameters])
    values = np.linalg.lstsq(design * size, observed, rcond=None)[0]
    left = design @ (size * values) - observed
    known = known_scatter or m == p
    dof = float("inf") if known else float(m - p)
    variance = 1.0 if known else float(left @ left / dof)
    covariance, condition = covariance_of(design * size, variance, names, advice)
    return Fit(
        names,
        tuple(item.unit for item in parameters),
        size * values,
        covariance * np.outer(size, size),
        dof,
        condition,
        left * residual_scale,
        residual_unit,
    )


def axis_by_axis(regressors: np.ndarray, axes: int) -> np.ndarray:
    """Design of several axes with the same regressors and coefficients of their own.

    Args:
        regressors: Shape (m, q).
        axes: Number of axes.

    Returns:
        Shape (m * axes, q * axes), rows pose by pose, columns axis by axis.
    """
    m, q = regressors.shape
    design = np.zeros((m, axes, axes * q))
    for i in range(axes):
        design[:, i, q * i : q * i + q] = regressors
    return design.reshape(m * axes, axes * q)


def widened_by_misfit(fit: Fit) -> Fit:
    """The fit with its covariance widened where residuals are larger than the noise that is known.

    Noise is taken from the samples and the arm's data; model errors come on top of it. Where the
    residuals exceed what such noise does in 95 of 100 cases, the covariance is multiplied by chi^2
    / dof (Birge, Phys. Rev. 40, 1932) and its degrees of freedom are those of the residuals. It is
    never narrowed: that residuals across the expected direction are small says nothing of the noise
    along it.

    Args:
        fit: With known scatter, its residuals in standard deviations.
    """
    dof = fit.residuals.size - len(fit.names)
    squares = float(np.sum(np.square(fit.residuals)))
    if dof < 1 or squares <= chdtri(dof, 1 - SURPRISING):
        return fit
    return replace(fit, covariance=fit.covariance * squares / dof, dof=float(dof))


def first_of(fit: Fit, count: int) -> Fit:
    """The fit of the first parameters alone; what the others leave unknown stays in them."""
    return replace(
        fit,
        names=fit.names[:count],
        units=fit.units[:count],
        values=fit.values[:count],
        covariance=fit.covariance[:count, :count],
    )


def whitening(covariance: np.ndarray) -> np.ndarray:
    """Matrices W with W C W' = 1: the inverse of the Cholesky factor of each covariance.

    Args:
        covariance: C, shape (m, k, k).

    Returns:
        Shape (m, k, k).
    """
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))
