"""Evidence: what a weighted fit leaves, open to terms that it did not have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Evidence:
    """What a weighted fit leaves.

    Attributes:
        residuals: In standard deviations, shape (n,); those of m poses with k each come first,
            what is known beforehand of the parameters may follow.
        jacobian: Their derivatives by all parameters, shape (n, p).
        reach: What a term of the readings does to the residuals of its pose, shape (m, k, 3)
            [1/unit].
    """

    residuals: np.ndarray
    jacobian: np.ndarray
    reach: np.ndarray

    @property
    def squares(self) -> float:
        """Chi-square of the fit."""
        return float(self.residuals @ self.residuals)

    @property
    def dof(self) -> int:
        """Its degrees of freedom."""
        return len(self.residuals) - self.jacobian.shape[1]

    def columns(self, terms: np.ndarray) -> np.ndarray:
        """Derivatives of the residuals by terms of the readings, shape (n, q).

        Args:
            terms: What each of q terms adds to the readings, shape (m, 3, q) [unit].
        """
        own = (self.reach @ terms).reshape(-1, terms.shape[2])
        return np.vstack([own, np.zeros((len(self.residuals) - len(own), terms.shape[2]))])
