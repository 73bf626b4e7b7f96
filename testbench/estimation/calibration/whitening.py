"""Differences at the ends of turns, made independent of one another and of unit variance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded

from testbench.estimation.calibration.turn_integration import IntegratedTurns
from testbench.estimation.calibration.turns import Turn
from testbench.model import rotation


@dataclass(frozen=True)
class Whitening:
    """What makes differences independent and of unit variance.

    Attributes:
        factor: Lower Cholesky factor of their covariance, banded as in LAPACK, shape (2 k, m k).
    """

    factor: np.ndarray

    def __call__(self, differences: np.ndarray) -> np.ndarray:
        """Whitened differences, or derivatives of these.

        Args:
            differences: Shape (m k,) or (m k, p).
        """
        return np.asarray(solve_banded((len(self.factor) - 1, 0), self.factor, differences))

    @staticmethod
    def of(
        turns: Sequence[Turn],
        sd: np.ndarray,
        noise: float,
        across: np.ndarray,
        ends: IntegratedTurns,
        shared: np.ndarray,
    ) -> Whitening:
        """The factor for m turns.

        Each difference holds the integrated noise of its turn and the errors of what is known at
        its two ends. Where a turn begins with what the one before ended with, one error enters both
        differences, with opposite signs.

        Args:
            turns: m of them.
            sd: Of what is known at the ends of each, about each axis, shape (m,) [rad].
            noise: Of one reading, above zero [rad/s].
            across: Components that count, as columns, shape (m, 3, k).
            ends: Ends of the turns.
            shared: Whether each turn but the last ends with what the next begins with, shape
                (m - 1,).
        """
        m, _, k = across.shape
        walk = np.array([noise**2 * (len(turn.gyr) - 1) * turn.interval**2 for turn in turns])
        banded = np.zeros((2 * k, m * k))
        # variance of a difference: both ends, and the integrated noise of the rates
        banded[0] = np.repeat(2 * sd**2 + walk, k)
        R = rotation.to_matrix(ends.q_before_from_after[1:])
        both = -(sd[:-1] * sd[1:] * shared)[:, None, None] * (
            across[:-1].transpose(0, 2, 1) @ R @ across[1:]
        )
        # covariance with the next one, of the end that they share
        for i in range(k):  # rows of the later turn below columns of the earlier one
            for j in range(k):
                banded[k + j - i, np.arange(m - 1) * k + i] = both[:, i, j]
        return Whitening(cholesky_banded(banded, lower=True))
