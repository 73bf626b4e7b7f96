"""When the controller's own reference begins to move, which it cannot do before it is told to."""

from __future__ import annotations

import numpy as np

LEFT_RAD = 1e-4
"""The reference has left its place when it is so far away [rad]: far above the rounding of the
reports, which is 1e-7.
"""
LEAD_S = 0.005
"""A motion that precedes its command by more is told [s]; the clocks are matched to less."""


class Onset:
    """Watches the references of the samples, one motion after another."""

    def __init__(self) -> None:
        self._cause_ns: int | None = None
        self._place: np.ndarray | None = None
        self._target: np.ndarray | None = None
        self._resting = False

    def expect(self, cause_ns: int) -> None:
        """A motion is commanded now [ns].

        Nothing can be told of it where the reference still moves from the one before.
        """
        self._cause_ns, self._place = (cause_ns, self._target) if self._resting else (None, None)

    def cause(self, target: np.ndarray) -> int | None:
        """Take in the next sample's reference.

        Args:
            target: Where the controller is going, shape (n,) [rad].

        Returns:
            When the motion was commanded that this sample shows the beginning of [ns]; None if it
            shows none.
        """
        self._resting = self._target is not None and bool(
            np.abs(target - self._target).max() < 1e-6
        )
        self._target = target
        if (
            self._cause_ns is None
            or self._place is None
            or np.abs(target - self._place).max() < LEFT_RAD
        ):
            return None
        cause, self._cause_ns = self._cause_ns, None
        return cause
