"""Whether an arm stands still, as far as somebody saw it."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

REST_RAD_S = float(np.radians(0.15))
"""Largest joint rate at rest: above the noise of the rates [rad/s]."""
REST_FOR_S = 0.05
"""An arm stands still once its joints have been at rest for so long [s]."""


class Standing(StrEnum):
    """What was seen of an arm after it was told to stop."""

    AT_REST = "at rest"
    HALTED = "halted"
    """Its joints were not seen, but the controller says that nothing moves them any more."""
    MOVING = "moving"
    UNKNOWN = "unknown"

    @property
    def stopped(self) -> bool:
        """Whether the arm is known not to move."""
        return self in {Standing.AT_REST, Standing.HALTED}


class RestWatch:
    """Looks at one sample after another until the joints have rested for long enough."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self.standing = Standing.UNKNOWN

    def look(self, time_s: float, rates: np.ndarray, may_move: bool) -> Standing:
        """Take a sample in.

        Args:
            time_s: Of the sample, on any clock that is the same for all [s].
            rates: Of the joints, shape (n,) [rad/s].
            may_move: Whether something on the controller may still move it.
        """
        if may_move or float(np.abs(rates).max()) >= REST_RAD_S:
            self._since_s, self.standing = None, Standing.MOVING
            return self.standing
        if self._since_s is None or time_s < self._since_s:
            self._since_s = time_s
        if time_s - self._since_s >= REST_FOR_S:
            self.standing = Standing.AT_REST
        return self.standing
