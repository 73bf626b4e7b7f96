"""Parts of a recording that a person takes out, and gates whose samples a person vouches for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from pydantic import Field, model_validator

from testbench.records.specs.strict import StrictModel

DoubtfulSamples = Literal["zeros", "stuck", "clipped", "spike", "straight", "wrapped"]
"""Gates that judge by what sensors usually do, and that a person may know better than."""


class Exclusion(StrictModel):
    """An interval whose samples are left out like lost ones: no filter integrates them, no mean
    counts them.
    """

    from_s: float = Field(
        description="Its beginning [s] on the time axis of the session (`host_time_ns`), which "
        "begins at 0."
    )
    to_s: float = Field(description="Its end [s].")
    reason: str = Field(
        min_length=1, max_length=200, description="Why, as findings and report say it."
    )
    sensors: list[str] = Field(default=[], description="Sensors that it is about; none named: all.")

    @model_validator(mode="after")
    def _has_a_length(self) -> Exclusion:
        if not self.from_s < self.to_s:
            raise ValueError(f"from_s {self.from_s:g} is not before to_s {self.to_s:g}")
        return self

    def concerns(self, sensor: str) -> bool:
        """Whether it is about a sensor."""
        return not self.sensors or sensor in self.sensors


def unknown_sensors(exclusions: Sequence[Exclusion], known: Sequence[str]) -> list[str]:
    """Names that exclusions speak of and no sensor has, in their order.

    Args:
        exclusions: Of one recording.
        known: Its sensors.
    """
    named = [sensor for exclusion in exclusions for sensor in exclusion.sensors]
    return [sensor for sensor in dict.fromkeys(named) if sensor not in known]
