"""What a recording shows of a mounting, and whether that is enough to believe it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

REFUSED, DOUBTFUL = 0.05, 0.17
"""Observability below which a solution is refused, or warned of: 3 and 10 deg of motion about the
least moved axis.
"""


@dataclass(frozen=True)
class ShownMounting:
    """A mounting with what showed it; the solutions of `hand_eye` and `vector_mounting` are such.

    Attributes:
        q_body_from_sensor: Shape (4,).
        observability: RMS sine of what was seen beside the axis that is seen least [1].
        blind_axis: That axis, in the sensor, shape (3,).
        MISSING: What the recording lacks where it shows too little.
        ADVICE: What would help.
    """

    q_body_from_sensor: np.ndarray
    observability: float
    blind_axis: np.ndarray
    MISSING: ClassVar[str]
    ADVICE: ClassVar[str]

    @property
    def trusted(self) -> bool:
        """Whether all angles were shown."""
        return self.observability >= REFUSED

    def warning(self) -> str | None:
        """What is missing, as a sentence; None where nothing is."""
        if self.observability >= DOUBTFUL:
            return None
        x, y, z = self.blind_axis
        verdict = "is doubtful" if self.trusted else "cannot be solved"
        return (
            f"the mounting {verdict}: {self.MISSING}, ({x:.2f}, {y:.2f}, {z:.2f}) in the sensor "
            "(it reaches "
            f"{self.observability:.3f} beside it, {DOUBTFUL} is wanted); {self.ADVICE}"
        )
