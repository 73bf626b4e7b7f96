"""How the sensors of an import sit on the segments of a body, as a person says it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from testbench.records.specs.strict import Name, StrictModel

AlignmentMethod = Literal["auto", "standing", "functional", "stated"]
SensorDirection = Literal["x", "y", "z", "-x", "-y", "-z"]


class SegmentAlignment(StrictModel):
    """How sensors sit on the segments of a body that no arm carries."""

    method: AlignmentMethod = Field(
        default="auto",
        description="standing: the segments are upright and face one way in a standing pose; "
        "functional: as that, and hinges give their axis by their motion; stated: segment axes in "
        "the sensor, by `segments`; auto: stated where the truth or `segments` say the axes, else "
        "standing.",
    )
    standing_s: Annotated[list[float], Field(min_length=2, max_length=2)] | None = Field(
        default=None,
        description="When the person stands upright, from and to [s] since the first sample; "
        "null: the first rest of all sensors.",
    )
    forward: dict[Name, SensorDirection] = Field(
        default={},
        description="Axis of a sensor that points forwards while standing, by sensor; null: by "
        "the motion.",
    )
    axes_sd_deg: float = Field(
        default=2.0,
        ge=0,
        le=30,
        description="How far the axes of a segment may be from what the pose or a hinge says, "
        "about each axis, standard deviation [deg]; that of a pose that is taken with care "
        "(Donaldson, Bayne & Bezodis, ISBS 2021: 1.9).",
    )
    stated_sd_deg: float = Field(
        default=3.0,
        ge=0,
        le=30,
        description="How far they may be from what `segments` states, about each axis, standard "
        "deviation [deg]: a sensor is put on skin by eye.",
    )

    @field_validator("standing_s")
    @classmethod
    def _begins_before_it_ends(cls, interval: list[float] | None) -> list[float] | None:
        if interval is not None and not 0 <= interval[0] < interval[1]:
            raise ValueError(f"{interval}: an interval is [from, to] in seconds, from before to")
        return interval
