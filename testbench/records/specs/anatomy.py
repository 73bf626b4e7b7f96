"""What a joint of a body is called, and what its name says: which joint, of which side."""

from __future__ import annotations

import re
from typing import Literal, get_args

from testbench.records.specs.joint_definition import FlexionAngle, JointRotation

JointKind = Literal["elbow", "wrist", "hip", "knee", "ankle"]
Side = Literal["right", "left"]
KINDS: tuple[JointKind, ...] = get_args(JointKind)
_SIDES: dict[str, Side] = {"right": "right", "r": "right", "left": "left", "l": "left"}
_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+")
_SEGMENTS = {
    "pelvis": ("pelvis", "sacrum"),
    "thigh": ("thigh", "femur"),
    "shank": ("shank", "shin", "tibia"),
    "foot": ("foot", "calcn"),
    "upper arm": ("humerus",),
    "forearm": ("forearm", "radius", "ulna"),
    "hand": ("hand",),
}
"""Words for the segments of the limbs."""
BETWEEN: dict[tuple[str, str], JointKind] = {
    ("pelvis", "thigh"): "hip",
    ("thigh", "shank"): "knee",
    ("shank", "foot"): "ankle",
    ("upper arm", "forearm"): "elbow",
    ("forearm", "hand"): "wrist",
}
"""The joint between two segments, the one nearer to the trunk first."""
FLEXION_AXIS = "Z"
"""In the axes of the ISB, z points to the right: flexion is about it (Wu et al. 2002, 2005)."""


def words_of(name: str) -> list[str]:
    """The words of a name, lower case: RFemur, r_femur and FemurRight alike."""
    return [word.lower() for word in _WORD.findall(name)]


def kind_of(name: str, definition: FlexionAngle | None = None) -> JointKind | None:
    """Which joint is meant: by its definition, else by its name; None where neither says.

    Args:
        name: Of the joint.
        definition: Of its angles.
    """
    rotation = None if definition is None else definition.rotation
    if isinstance(rotation, JointRotation):
        if rotation.isb is not None:
            return rotation.isb
        if rotation.grood_suntay is not None:
            return rotation.grood_suntay
    words = words_of(name)
    return next((kind for kind in KINDS if kind in words), None)


def segment_of(name: str) -> str | None:
    """Which segment of a limb a sensor or segment is called after; None where none or several.

    Args:
        name: Such as RFemur or thigh_r.
    """
    words = set(words_of(name))
    if {"upper", "arm"} <= words:
        return "upper arm"
    found = [segment for segment, own in _SEGMENTS.items() if words & set(own)]
    return found[0] if len(found) == 1 else None


def side_of(*names: str) -> Side | None:
    """Which side of the body is meant: by the first name that says it, None where none does."""
    for name in names:
        said = {_SIDES[word] for word in words_of(name) if word in _SIDES}
        if len(said) == 1:
            return said.pop()
    return None


def is_anatomical(definition: FlexionAngle) -> bool:
    """Whether angles are those of a joint in the ISB's axes: flexion about z first, then x, y."""
    rotation = definition.rotation
    if not isinstance(rotation, JointRotation):
        return False
    return rotation.isb is not None or rotation.euler == "ZXY"
