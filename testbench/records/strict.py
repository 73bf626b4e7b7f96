"""Building blocks of every record that a person writes: nothing unknown, nothing coerced, nothing infinite."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

EulerSequence = Literal[
    "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX",
    "XYX", "XZX", "YXY", "YZY", "ZXZ", "ZYZ",
]  # fmt: skip
"""Intrinsic Euler sequences, spelt in upper case as SciPy does."""

Angles3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class StrictModel(BaseModel):
    """A record whose keys and types are taken literally."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Placement(StrictModel):
    """A pose as a person writes it: a rotation by Euler angles of a named intrinsic sequence, and a position."""

    rotation_deg: dict[EulerSequence, Angles3] = Field(
        default={}, description="One intrinsic Euler sequence and its three angles [deg], e.g. {ZYX: [0, 90, 0]}."
    )
    position_mm: Angles3 = Field(default=[0.0, 0.0, 0.0], description="Position [mm].")

    @model_validator(mode="after")
    def _one_sequence(self) -> Placement:
        if len(self.rotation_deg) > 1:
            raise ValueError("rotation_deg takes one Euler sequence, not several")
        return self
