"""What a session keeps of the arm that moved, whoever made it."""

from __future__ import annotations

from collections.abc import Mapping
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


def arm_record(manifest: Mapping[str, Any]) -> ArmRecord | None:
    """The arm that a manifest names; None where the bench drove none.

    Earlier sessions name only the driver: a model, a recorded motion, or that of some controller.
    """
    arm = manifest.get("arm")
    if not isinstance(arm, dict) or not isinstance(arm.get("driver"), str):
        return None
    driver = arm["driver"]
    before = {"simulated": (MODEL, False), "replay": (RECORDED_MOTION, False)}
    provenance, commanded = before.get(driver, (REPORTED_MOTION, True))
    return ArmRecord(
        driver,
        str(arm.get("provenance", provenance)),
        bool(arm.get("commanded", commanded)),
    )
