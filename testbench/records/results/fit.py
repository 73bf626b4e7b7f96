"""Fit: fitted parameters with their uncertainty.

Every calibration and every study of parameters hands one on.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import stdtrit


@dataclass(frozen=True)
class Fit:
    """Parameters of a least-squares fit.

    Attributes:
        names: Of the p parameters, e.g. "acc_bias_x".
        units: Of each.
        values: Shape (p,).
        covariance: Shape (p, p).
        dof: Degrees of freedom that the scatter was estimated with; infinite where it was known
            beforehand.
        condition: Condition number of the design, its columns scaled to unit length.
        residuals: What the fit leaves, any shape, in `residual_unit`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    dof: float = float("inf")
    condition: float = float("nan")
    residuals: np.ndarray = field(default_factory=lambda: np.zeros(0))
    residual_unit: str = ""

    def __post_init__(self) -> None:
        p = len(self.names)
        if len(self.units) != p or self.values.shape != (p,) or self.covariance.shape != (p, p):
            raise ValueError(
                f"a fit of {p} parameters cannot hold {self.values.shape} values, "
                f"{self.covariance.shape} covariance"
            )

    @property
    def sd(self) -> np.ndarray:
        """Standard uncertainty of each parameter, shape (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation matrix, shape (p, p); zero beside a parameter that is known exactly."""
        sd = self.sd
        scale = np.divide(1.0, sd, out=np.zeros_like(sd), where=sd > 0)
        correlation = self.covariance * np.outer(scale, scale)
        np.fill_diagonal(correlation, 1.0)
        return correlation

    @property
    def residual_rms(self) -> float:
        """Root mean square of the residuals; NaN where there are none."""
        return (
            float(np.sqrt(np.mean(np.square(self.residuals))))
            if self.residuals.size
            else float("nan")
        )

    def half_width(self, level: float = 0.95) -> np.ndarray:
        """Half of each parameter's confidence interval, shape (p,).

        By Student's t (JCGM 100:2008, annex G).
        """
        return np.asarray(stdtrit(self.dof, 0.5 + level / 2)) * self.sd

    def __getitem__(self, name: str) -> float:
        """A parameter by its name."""
        return float(self.values[self.names.index(name)])

    def block(self, prefix: str) -> np.ndarray:
        """Values of all parameters whose name begins with `prefix`, in order."""
        return self.values[[i for i, name in enumerate(self.names) if name.startswith(prefix)]]
