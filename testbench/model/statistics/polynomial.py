"""Least-squares polynomials in one and two variables, with R², RMSE and confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.exceptions import InputError
from testbench.records.results.fit import Fit


@dataclass(frozen=True)
class PolynomialFit:
    """A polynomial and how well it fits.

    Attributes:
        fit: Coefficients by name with covariance and residuals.
        exponents: Of each term, shape (p, variables).
        r_squared: Part of the variance about the mean that is explained.
        adjusted_r_squared: The same, allowing for the number of coefficients.
        rmse: sqrt(SSE / (n - p)), in the unit of y.
        centre: What is taken off each variable before it enters, shape (variables,).
        scale: What each variable is then divided by, shape (variables,).
    """

    fit: Fit
    exponents: np.ndarray
    r_squared: float
    adjusted_r_squared: float
    rmse: float
    centre: np.ndarray
    scale: np.ndarray

    def value(self, name: str) -> float:
        """A coefficient."""
        return float(self.fit.values[self.fit.names.index(name)])

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of a coefficient (Student's t with n - p degrees of freedom)."""
        half = float(self.fit.half_width(level)[self.fit.names.index(name)])
        return self.value(name) - half, self.value(name) + half

    def at(self, *variables: np.ndarray) -> np.ndarray:
        """The polynomial's values.

        Args:
            *variables: One or two, in their order, of any common shape.

        Returns:
            Of the variables' shape.
        """
        normed = [
            (np.asarray(x, float) - m) / s
            for x, m, s in zip(variables, self.centre, self.scale, strict=True)
        ]
        terms = [
            np.prod([x**k for x, k in zip(normed, powers, strict=True)], axis=0)
            for powers in self.exponents
        ]
        return np.asarray(
            sum(value * term for value, term in zip(self.fit.values, terms, strict=True))
        )


def fit_quadratic(x: np.ndarray, y: np.ndarray) -> PolynomialFit:
    """Fit y = a x² + b x + c, by coefficients a, b, c.

    Args:
        x: Abscissae, shape (n,).
        y: Values, shape (n,).

    Raises:
        InputError: Fewer than four points, or fewer than three different x.
    """
    x = np.asarray(x, float)
    return _fit(
        [x],
        np.asarray(y, float),
        np.array([[2], [1], [0]]),
        ("a", "b", "c"),
        np.zeros(1),
        np.ones(1),
    )


def fit_surface(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, degrees: tuple[int, int]
) -> PolynomialFit:
    """Fit z = Σ p_ij X^i Y^j in X and Y up to some degrees, and i + j up to the larger of both.

    X and Y are x and y less their mean over the points, by their standard deviation (n - 1);
    coefficients are called p00, ...

    Args:
        x: First variable, shape (n,).
        y: Second variable, shape (n,).
        z: Values, shape (n,).
        degrees: The largest i and the largest j.

    Raises:
        InputError: The points are fewer than the coefficients or do not determine them.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    exponents = [
        (i, j)
        for i in range(degrees[0] + 1)
        for j in range(degrees[1] + 1)
        if i + j <= max(degrees)
    ]
    names = tuple(f"p{i}{j}" for i, j in exponents)
    centre, scale = np.array([x.mean(), y.mean()]), np.array([x.std(ddof=1), y.std(ddof=1)])
    return _fit([x, y], np.asarray(z, float), np.array(exponents), names, centre, scale)


def _fit(
    variables: list[np.ndarray],
    y: np.ndarray,
    exponents: np.ndarray,
    names: tuple[str, ...],
    centre: np.ndarray,
    scale: np.ndarray,
) -> PolynomialFit:
    n, p = len(y), len(names)
    normed = [(x - m) / s for x, m, s in zip(variables, centre, scale, strict=True)]
    design = np.stack(
        [
            np.prod([x**k for x, k in zip(normed, powers, strict=True)], axis=0)
            for powers in exponents
        ],
        axis=1,
    )
    if n <= p or np.linalg.matrix_rank(design) < p:
        raise InputError(
            f"{n} points do not determine the {p} coefficients {', '.join(names)} and their "
            "uncertainty"
        )
    length = np.linalg.norm(design, axis=0)
    u, singular, vt = np.linalg.svd(design / length, full_matrices=False)
    values = (vt.T / singular) @ (u.T @ y) / length
    residuals = y - design @ values
    sse, total = float(residuals @ residuals), float(np.sum((y - y.mean()) ** 2))
    covariance = sse / (n - p) * ((vt.T / singular**2) @ vt) / np.outer(length, length)
    r_squared = 1 - sse / total if total > 0 else float("nan")
    fit = Fit(
        names, ("",) * p, values, covariance, n - p, float(singular[0] / singular[-1]), residuals
    )
    adjusted = 1 - (1 - r_squared) * (n - 1) / (n - p)
    return PolynomialFit(fit, exponents, r_squared, adjusted, (sse / (n - p)) ** 0.5, centre, scale)
