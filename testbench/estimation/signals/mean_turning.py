"""How a sensor turned between the samples that are kept of it, as mean rates.

Only all samples together tell it. That rotations do not commute is left out: over the hundredths of
a second between two kept samples it is far less than what a truth is doubted for.
"""

from __future__ import annotations

import numpy as np


class MeanTurning:
    """Takes angular rates as they go by, and gives one for each so many.

    Args:
        every: Samples that a mean is of.
    """

    def __init__(self, every: int):
        self._every = every
        self._left = np.zeros((0, 3))
        self._means: list[np.ndarray] = []

    def add(self, gyr: np.ndarray) -> None:
        """Take the next rates, at even intervals.

        Args:
            gyr: Shape (n, 3) [rad/s], NaN where unknown.
        """
        rates = np.concatenate([self._left, gyr])
        count = len(rates) // self._every
        whole = count * self._every
        self._left = rates[whole:].copy()
        self._means.append(rates[:whole].reshape(count, self._every, 3).mean(axis=1))

    def rates(self) -> np.ndarray:
        """Means over each so many samples, NaN where one of them is, shape (m, 3) [rad/s]."""
        return np.concatenate(self._means)
