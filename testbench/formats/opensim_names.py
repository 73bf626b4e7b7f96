"""What OpenSim's own models call the angles of a joint, and with which sign they count them.

The coordinates are those of gait2392_simbody.osim (Delp et al., IEEE Trans. Biomedical Engineering
37, 1990; Anderson & Pandy 1999), in which a knee flexes from 0 to -120 deg, and of
Rajagopal2016.osim (Rajagopal et al., IEEE Trans. Biomedical Engineering 63, 2016), in which it
flexes from 0 to 120 deg. All else has one sign in both: that of the ISB's angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from testbench.model.joint_angle import decomposition_of
from testbench.records.specs.anatomy import (
    JointKind,
    Side,
    is_anatomical,
    kind_of,
    side_of,
    words_of,
)
from testbench.records.specs.joint_definition import FlexionAngle, JointRotation
from testbench.records.specs.protocol import JointDefinition

Model = Literal["rajagopal", "gait2392"]
LEGS: dict[tuple[JointKind, int], tuple[str, int]] = {
    ("hip", 0): ("hip_flexion", 1),
    ("hip", 1): ("hip_adduction", 1),
    ("hip", 2): ("hip_rotation", 1),
    ("knee", 0): ("knee_angle", 1),
    ("ankle", 0): ("ankle_angle", 1),
}
ARMS: dict[tuple[JointKind, int], tuple[str, int]] = {
    ("elbow", 0): ("elbow_flex", 1),
    ("elbow", 2): ("pro_sup", 1),
    ("wrist", 0): ("wrist_flex", 1),
    ("wrist", 1): ("wrist_dev", 1),
}
COORDINATES: dict[Model, dict[tuple[JointKind, int], tuple[str, int]]] = {
    "rajagopal": {**LEGS, **ARMS},
    "gait2392": {**LEGS, ("knee", 0): ("knee_angle", -1)},
}
"""Coordinate without its side, and its sign, by joint and angle of the ISB's three. The subtalar
coordinate of both turns about an oblique axis: the ISB's inversion is none."""
FILES: dict[Model, str] = {"rajagopal": "Rajagopal2016", "gait2392": "gait2392_simbody"}
BODIES: dict[str, str] = {
    "pelvis": "pelvis",
    "sacrum": "pelvis",
    "trunk": "torso",
    "torso": "torso",
    "sternum": "torso",
    "femur": "femur",
    "thigh": "femur",
    "tibia": "tibia",
    "shank": "tibia",
    "shin": "tibia",
    "foot": "calcn",
    "calcn": "calcn",
    "humerus": "humerus",
    "forearm": "radius",
    "radius": "radius",
    "ulna": "ulna",
    "hand": "hand",
}
"""Body of both models by a word in the name of a sensor or a segment; those of a limb end in their
side."""
ONE_OF_A_KIND = ("pelvis", "torso")


def body_name(name: str) -> str:
    """The body of OpenSim's models that a sensor or segment is called after, else its own name.

    Args:
        name: Such as RFemur, thigh_r or foot_left.
    """
    found = {BODIES[word] for word in words_of(name) if word in BODIES}
    if len(found) != 1:
        return name
    body, side = found.pop(), side_of(name)
    if body in ONE_OF_A_KIND:
        return body
    return name if side is None else f"{body}_{side[0]}"


def anatomical_columns(
    name: str, joint: JointDefinition, angles: np.ndarray, model: Model
) -> dict[str, np.ndarray] | None:
    """The angles of a joint by the names of a model, its own words for those the model lacks.

    Args:
        name: Of the joint.
        joint: As defined.
        angles: By its own definition, shape (n, 3) [rad].
        model: Whose coordinates are meant.

    Returns:
        By column, shape (n,) each [rad]; None for a joint that is none of the body's, or whose
        angles are not those of the ISB's axes.
    """
    own = isb_angles(name, joint)
    if own is None:
        return None
    columns = {}
    for i, (word, sign) in enumerate(zip(own.words, own.signs, strict=True)):
        coordinate, counted = own.coordinate(i, model)
        columns[coordinate or f"{name}_{word}"] = counted * sign * angles[:, i]
    return columns


@dataclass(frozen=True)
class IsbAngles:
    """What the ISB calls the three angles of a joint, and how they are counted.

    Attributes:
        kind: Which joint it is.
        side: Of the body.
        words: Of the angles, such as internal_rotation.
        signs: By which the angles of the joint's own definition are theirs, shape (3,).
    """

    kind: JointKind
    side: Side
    words: list[str]
    signs: np.ndarray

    def coordinate(self, place: int, model: Model, side: Side | None = None) -> tuple[str, int]:
        """Coordinate of a model that is one of the angles, and its sign; "" where it has none.

        Args:
            place: Of the angle.
            model: Whose coordinates are meant.
            side: Of the body, in place of its own.
        """
        coordinate, sign = COORDINATES[model].get((self.kind, place), ("", 1))
        return (f"{coordinate}_{(side or self.side)[0]}" if coordinate else ""), sign


def isb_angles(name: str, joint: JointDefinition) -> IsbAngles | None:
    """The angles of a joint in the words of the ISB.

    Args:
        name: Of the joint.
        joint: As defined.

    Returns:
        None for a joint that is none of the body's, or whose angles are not those of the ISB's
        axes.
    """
    kind = kind_of(name, joint)
    if kind is None or not is_anatomical(joint):
        return None
    side = _side(name, joint)
    meant = FlexionAngle(definition=JointRotation(isb=kind, side=side))
    words = [word.replace(" ", "_") for word in decomposition_of(meant).names]
    signs = np.ones(3) if joint.label == meant.label else _signs(meant)
    return IsbAngles(kind, side, words, signs)


def _signs(meant: FlexionAngle) -> np.ndarray:
    """Signs of the ISB's angles against those of the plain sequence ZXY, shape (3,)."""
    small = np.array([[0.1, 0.2, 0.3]])
    plain = decomposition_of("ZXY").rotation(small)
    return np.asarray(np.sign(decomposition_of(meant).angles(plain)[0]))


def _side(name: str, joint: JointDefinition) -> Side:
    rotation = joint.rotation
    if isinstance(rotation, JointRotation) and rotation.euler is None:
        return rotation.side
    return side_of(name, joint.distal, joint.proximal) or "right"
