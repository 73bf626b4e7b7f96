"""What a session keeps of the arm that moved, whoever made it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

SIMULATED = "simulated"
"""The driver of a session whose arm was a model."""
MODEL = "a model of the arm"
REPORTED_MOTION = "the motion that the controller of an arm reported"
RECORDED_MOTION = "a recorded motion"


@dataclass(frozen=True)
class ArmRecord:
    """The arm of a session.

    Attributes:
        driver: Its name in the manifest.
        provenance: Where its motion comes from, in words that go on after "followed".
        commanded: Whether a real arm was told to move; a recorded motion is only looked at.
    """

    driver: str
    provenance: str
    commanded: bool

    @property
    def simulated(self) -> bool:
        """Whether the arm was a model."""
        return self.driver == SIMULATED

    def to_dict(self) -> dict[str, Any]:
        """As in the manifest, under `arm`."""
        return {
            "driver": self.driver,
            "provenance": self.provenance,
            "commanded": self.commanded,
        }
