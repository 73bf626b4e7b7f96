"""Building blocks of every record that a person writes.

Nothing is unknown, nothing coerced, nothing infinite.
"""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

EulerSequence = Literal[
    "XYZ",
    "XZY",
    "YXZ",
    "YZX",
    "ZXY",
    "ZYX",
    "XYX",
    "XZX",
    "YXY",
    "YZY",
    "ZXZ",
    "ZYZ",
]
"""Intrinsic Euler sequences, spelt in upper case as SciPy does."""

NAME_PATTERN = r"^[A-Za-z][A-Za-z0-9_]{0,63}$"
Name = Annotated[str, Field(pattern=NAME_PATTERN)]
"""A word that can stand in an expression, a file name and a metric."""
EARLIER_NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_]{0,99}$"
"""What a sensor may be called in a session that is read: earlier versions let more pass. Files are
named after sensors: nothing that could lead out of the session's folder.
"""


def _zoned(text: str) -> str:
    if datetime.fromisoformat(text).tzinfo is None:
        raise ValueError("needs a time zone, such as 2026-01-31T12:00:00+00:00")
    return text


UtcText = Annotated[str, AfterValidator(_zoned)]
"""A date and time with its zone, ISO 8601."""

Angles3 = Annotated[list[float], Field(min_length=3, max_length=3)]

EulerAngles = dict[EulerSequence, Angles3]
"""One sequence and its three angles [deg]."""


def check_one_sequence(rotation_deg: EulerAngles) -> EulerAngles:
    """Refuse a rotation of several Euler sequences: their order would be anyone's guess."""
    if len(rotation_deg) > 1:
        raise ValueError(f"rotation_deg takes one Euler sequence, not {' and '.join(rotation_deg)}")
    return rotation_deg


def _refuse_bare_angles(rotation_deg: Any) -> Any:
    """Angles without a sequence mean twelve rotations."""
    if isinstance(rotation_deg, list):
        raise ValueError(
            f"angles need the Euler sequence they belong to, such as {{XYZ: {rotation_deg}}}"
        )
    return rotation_deg


Rotation = Annotated[
    EulerAngles, AfterValidator(check_one_sequence), BeforeValidator(_refuse_bare_angles)
]


class StrictModel(BaseModel):
    """A record whose keys and types are taken literally."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Placement(StrictModel):
    """A pose as a person writes it: a rotation by Euler angles of a named intrinsic sequence, and a
    position.
    """

    rotation_deg: Rotation = Field(
        default={},
        description="One intrinsic Euler sequence and its three angles [deg], e.g. {ZYX: [0, 90, "
        "0]}.",
    )
    position_mm: Angles3 = Field(default=[0.0, 0.0, 0.0], description="Position [mm].")
