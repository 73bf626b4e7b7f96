"""How a joint's rotation is written in three angles; docs/joint_angles.md explains each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    field_validator,
    model_validator,
)

from testbench.records.specs.strict import Angles3, EulerSequence, StrictModel

NamedDefinition = Literal["elbow", "wrist", "hip", "knee", "ankle", "axis_angle", "rotation_vector"]
"""The joints of a right limb by the recommendations of the ISB, and two definitions that take no
further word.
"""

SMALLEST_AXIS = 1e-6
_KINDS = ("euler", "isb", "grood_suntay", "hinge", "swing_twist")


def _unit(axis: list[float]) -> list[float]:
    """The axis at unit length; a ValueError where it has no direction."""
    length = sum(value * value for value in axis) ** 0.5
    if length < SMALLEST_AXIS:
        raise ValueError("an axis needs a direction, such as [0, 0, 1]")
    return list(axis) if abs(length - 1) < 1e-12 else [value / length for value in axis]


Axis = Annotated[Angles3, AfterValidator(_unit)]
"""A direction in the axes of the segments, scaled to unit length."""


class JointRotation(StrictModel):
    """A definition that needs more than a name; exactly one of its keys but `side`."""

    euler: EulerSequence | None = Field(
        default=None, description="Intrinsic Euler sequence, e.g. ZXZ."
    )
    isb: Literal["elbow", "wrist", "hip", "knee", "ankle"] | None = Field(
        default=None,
        description="Joint coordinate system of the ISB (Wu 2002, 2005); segment axes: x forward, "
        "y up, z to the right.",
    )
    grood_suntay: Literal["knee"] | None = Field(
        default=None,
        description="Joint coordinate system of Grood & Suntay 1983; segment axes: x to the right, "
        "y forward, z up.",
    )
    hinge: Axis | None = Field(
        default=None, description="Axis of a hinge, the same numbers in both segments' axes."
    )
    swing_twist: Axis | None = Field(
        default=None, description="Axis of the twist in both segments; the rest is the swing."
    )
    side: Literal["right", "left"] = Field(
        default="right",
        description="Of the body, for isb and grood_suntay: what is inwards, and so the sign of "
        "two angles.",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> JointRotation:
        given = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError(
                f"a definition takes exactly one of {', '.join(_KINDS)}, not "
                f"{' and '.join(given) or 'none'}"
            )
        if self.side == "left" and given[0] not in ("isb", "grood_suntay"):
            raise ValueError(f"side goes with isb and grood_suntay, not with {given[0]}")
        return self

    @property
    def label(self) -> str:
        """A word for it that can stand in a column's name, such as ZXZ, isb_elbow or hinge_z."""
        if self.euler is not None:
            return self.euler
        for kind in ("hinge", "swing_twist"):
            axis = getattr(self, kind)
            if axis is not None:
                return f"{kind}_{axis_label(axis)}"
        kind = "isb" if self.isb is not None else "grood_suntay"
        return f"{kind}_{getattr(self, kind)}" + ("_left" if self.side == "left" else "")


def axis_label(axis: Sequence[float]) -> str:
    """A word for an axis: x, y, z, minus_x, ..., or its three numbers."""
    for i, name in enumerate("xyz"):
        if abs(abs(axis[i]) - 1) < 1e-9:
            return name if axis[i] > 0 else f"minus_{name}"
    return "_".join(f"{value:.3f}".replace("-", "m").replace(".", "p") for value in axis)


_EXAMPLES = {
    "euler": "{euler: ZXZ}",
    "isb": "{isb: elbow}",
    "grood_suntay": "{grood_suntay: knee}",
    "hinge": "{hinge: [0, 0, 1]}",
    "swing_twist": "{swing_twist: [0, 0, 1]}",
}


def _refuse_kind_alone(value: Any) -> Any:
    """The name of a kind of definition says nothing without what belongs to it."""
    if isinstance(value, str) and value in _EXAMPLES:
        raise ValueError(f"{value} needs to be told of what, such as {_EXAMPLES[value]}")
    return value


def _name_or_mapping(value: Any) -> str:
    return "<name>" if isinstance(value, str) else "<definition>"


RotationDefinition = Annotated[
    Annotated[NamedDefinition, Tag("<name>")] | Annotated[JointRotation, Tag("<definition>")],
    Discriminator(_name_or_mapping),
    BeforeValidator(_refuse_kind_alone),
]


LEAST_ANGLE_DEG, MOST_ANGLE_DEG = 30.0, 150.0
"""Two axes that are nearer to one direction hardly tell a heading."""


class JointConstraint(StrictModel):
    """The axes that a joint turns about, which tell how far the headings of its two sensors drift
    apart.
    """

    proximal_axis: Axis = Field(
        description="Axis that is fixed in the proximal segment, in that segment's axes."
    )
    distal_axis: Axis = Field(
        description="Axis that is fixed in the distal segment, in that segment's axes; a hinge's, "
        "the same axis."
    )
    angle_deg: float = Field(
        default=0.0,
        description="Angle between both axes [deg]: 0 for a hinge, else 30 to 150 for a joint of "
        "two axes.",
    )
    axes_sd_deg: float = Field(
        default=3.0,
        ge=0.1,
        le=30,
        description="How well the axes are known in their segments, standard deviation [deg].",
    )
    drift_deg: float = Field(
        default=2.0,
        gt=0,
        le=180,
        description="How far the headings drift apart in a minute, standard deviation [deg].",
    )
    filters: list[str] | None = Field(
        default=None,
        min_length=1,
        description="Filters of estimate.filters to correct; null: those that use no magnetometer, "
        "without the device's own.",
    )

    @field_validator("angle_deg")
    @classmethod
    def _tells_a_heading(cls, angle: float) -> float:
        if angle != 0 and not LEAST_ANGLE_DEG <= angle <= MOST_ANGLE_DEG:
            raise ValueError(
                f"{angle:g} deg between the axes: allowed are 0 (a hinge, its axis pointing the "
                "same way in both segments) and "
                f"{LEAST_ANGLE_DEG:g} to {MOST_ANGLE_DEG:g} (two axes)"
            )
        return angle


class FlexionAngle(StrictModel):
    """How the rotation of the distal segment against the proximal one is written, and which of its
    angles is the flexion.
    """

    sequence: EulerSequence | None = Field(
        default=None, description="Intrinsic Euler sequence, e.g. ZXZ; or a definition."
    )
    definition: RotationDefinition | None = Field(
        default=None,
        description="A named joint such as elbow, or a mapping such as {isb: elbow} or {hinge: [0, "
        "0, 1]}.",
    )
    flexion: Literal["first", "second", "third"] = Field(
        default="second",
        description="Angle that is the flexion; without it the second of an Euler sequence and the "
        "first of all others.",
    )
    sign: Literal[1, -1] = Field(
        default=1, description="-1 where the angle runs against the flexion."
    )
    seen_from: Literal["proximal", "world"] = Field(
        default="proximal",
        description="In whose axes the rotation of the joint is written: conj(q_A) q_F in those of "
        "the proximal segment, q_F conj(q_A) in the world's, which take both sensors' common "
        "heading into the angles.",
    )
    continuous: bool = Field(
        default=False,
        description="Follow the angles from sample to sample through ±180 deg and through the ends "
        "of their range, for sweeps.",
    )

    @model_validator(mode="before")
    @classmethod
    def _flexion_by_definition(cls, data: Any) -> Any:
        if isinstance(data, dict) and "flexion" not in data and data.get("definition") is not None:
            given = data["definition"]
            is_euler = (isinstance(given, dict) and given.get("euler") is not None) or (
                isinstance(given, JointRotation) and given.euler is not None
            )
            return data if is_euler else {**data, "flexion": "first"}
        return data

    @model_validator(mode="after")
    def _one_definition(self) -> FlexionAngle:
        if (self.sequence is None) == (self.definition is None):
            raise ValueError(
                "a joint angle needs either a sequence or a definition"
                + (", not both" if self.sequence is not None else "")
            )
        return self

    @property
    def label(self) -> str:
        """The name of its rows and columns, such as ZXZ, isb_elbow or ZXZ_in_world."""
        return self._kind + ("_in_world" if self.seen_from == "world" else "")

    @property
    def _kind(self) -> str:
        """The label of the way in which the rotation is written."""
        if self.sequence is not None:
            return self.sequence
        if isinstance(self.definition, JointRotation):
            return self.definition.label
        assert self.definition is not None
        return (
            self.definition
            if self.definition in ("axis_angle", "rotation_vector")
            else f"isb_{self.definition}"
        )

    @property
    def rotation(self) -> JointRotation | Literal["axis_angle", "rotation_vector"]:
        """The definition with its name resolved."""
        if self.sequence is not None:
            return JointRotation(euler=self.sequence)
        if isinstance(self.definition, JointRotation):
            return self.definition
        assert self.definition is not None
        if self.definition == "axis_angle" or self.definition == "rotation_vector":
            return self.definition
        return JointRotation(isb=self.definition)
