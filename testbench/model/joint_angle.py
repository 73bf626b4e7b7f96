"""Joint angles: the distal segment against the proximal one, by any definition of a protocol."""

from __future__ import annotations

from typing import Literal

import numpy as np

from testbench.model import rotation
from testbench.model.decomposition import (
    AxisAngle,
    Decomposition,
    Euler,
    Hinge,
    RotationVector,
    SwingTwist,
    follow,
)
from testbench.model.kinematics import Pose
from testbench.records.specs.joint_definition import FlexionAngle, JointRotation
from testbench.records.specs.protocol import Sensor

INDEX = {"first": 0, "second": 1, "third": 2}
PIECE = 100_000
"""Rotations that are taken apart at once: what is in between takes three times their memory."""
"""Place of each angle."""

# Signs of the ISB's angles of a right limb, with its segment axes x forward, y up (proximal), z to
# the right, sequence ZXY (Wu et al., J. Biomechanics 35, 2002, and 38, 2005). A positive turn about
# z carries what hangs below forwards and what points forwards upwards: flexion of elbow, wrist
# (palm forwards) and hip, dorsiflexion of the ankle; a knee flexes backwards.
_ISB: dict[str, tuple[tuple[int, int, int], tuple[str, str, str]]] = {
    "elbow": ((1, 1, 1), ("flexion", "carrying angle", "pronation")),
    "wrist": ((1, 1, 1), ("flexion", "ulnar deviation", "pronation")),
    "hip": ((1, 1, 1), ("flexion", "adduction", "internal rotation")),
    "knee": ((-1, 1, 1), ("flexion", "adduction", "internal rotation")),
    "ankle": ((1, 1, 1), ("dorsiflexion", "inversion", "internal rotation")),
}
# Grood & Suntay, J. Biomechanical Engineering 105, 1983: right knee, x to the right, y forward, z
# up, sequence XYZ.
_GROOD_SUNTAY = {"knee": ((-1, 1, -1), ("flexion", "adduction", "external rotation"))}


def segment_pose(sensor: Sensor) -> Pose:
    """The segment's frame in the sensor's link."""
    assert (
        sensor.segment is not None
    )  # a protocol whose joints name sensors without a segment is refused
    return Pose.from_placement(sensor.segment.placement())


def segment_from_sensor(sensor: Sensor) -> np.ndarray:
    """q_segment_from_sensor, shape (4,), by the mounting and axes that the protocol states."""
    link_from_segment, link_from_sensor = segment_pose(sensor), Pose.from_placement(sensor.mounting)
    return rotation.from_matrix(link_from_segment.R.T @ link_from_sensor.R)


def segment_orientation(q_world_from_sensor: np.ndarray, sensor: Sensor) -> np.ndarray:
    """q_world_from_segment = q_world_from_sensor conj(q_segment_from_sensor) (eqs 2.1 to 2.4).

    Args:
        q_world_from_sensor: Shape (n, 4).
        sensor: Its mounting and segment, as the protocol states them.

    Returns:
        Shape (n, 4).
    """
    return rotation.multiply(q_world_from_sensor, rotation.conjugate(segment_from_sensor(sensor)))


def joint_rotation(
    q_world_from_proximal: np.ndarray, q_world_from_distal: np.ndarray
) -> np.ndarray:
    """q_proximal_from_distal = conj(q_world_from_proximal) q_world_from_distal (eq. 2.5).

    Args:
        q_world_from_proximal: Of the proximal segment, shape (n, 4).
        q_world_from_distal: Of the distal segment, shape (n, 4).

    Returns:
        Shape (n, 4).
    """
    return rotation.multiply(rotation.conjugate(q_world_from_proximal), q_world_from_distal)


def joint_rotation_in_world(
    q_world_from_proximal: np.ndarray, q_world_from_distal: np.ndarray
) -> np.ndarray:
    """q_world_from_distal conj(q_world_from_proximal): the same rotation, written in the world.

    The program of Castellanos Alonso 2023 (annex H) multiplies in this order. Its angles are those
    of the joint only where the world's axes are the segment's, and a heading that both sensors
    share turns them.

    Args:
        q_world_from_proximal: Of the proximal segment, shape (n, 4).
        q_world_from_distal: Of the distal segment, shape (n, 4).

    Returns:
        Shape (n, 4).
    """
    return rotation.multiply(q_world_from_distal, rotation.conjugate(q_world_from_proximal))


def joint_angles(
    q_world_from_proximal: np.ndarray,
    q_world_from_distal: np.ndarray,
    definition: str | FlexionAngle,
) -> np.ndarray:
    """The three angles of the distal segment against the proximal one.

    Args:
        q_world_from_proximal: Of the proximal segment, shape (n, 4).
        q_world_from_distal: Of the distal segment, shape (n, 4).
        definition: An intrinsic Euler sequence such as "ZXZ", or what the protocol says.

    Returns:
        Each sample by itself, in the principal ranges, shape (n, 3) [rad].
    """
    in_world = isinstance(definition, FlexionAngle) and definition.seen_from == "world"
    put_together = joint_rotation_in_world if in_world else joint_rotation
    kind = decomposition_of(definition)
    found = np.empty((len(q_world_from_proximal), 3))
    for begin in range(0, len(found), PIECE):
        rows = slice(begin, begin + PIECE)
        found[rows] = kind.angles(
            put_together(q_world_from_proximal[rows], q_world_from_distal[rows])
        )
    return found


def joint_angle_series(
    q_world_from_proximal: np.ndarray, q_world_from_distal: np.ndarray, definition: FlexionAngle
) -> np.ndarray:
    """The three angles over time, followed from sample to sample where the definition says so.

    Args:
        q_world_from_proximal: Of the proximal segment, in the order of time, shape (n, 4).
        q_world_from_distal: Of the distal segment at the same instants, shape (n, 4).
        definition: What the protocol says; a `continuous` one is followed.

    Returns:
        Shape (n, 3) [rad].
    """
    angles = joint_angles(q_world_from_proximal, q_world_from_distal, definition)
    return follow(decomposition_of(definition), angles) if definition.continuous else angles


def decomposition_of(definition: str | FlexionAngle) -> Decomposition:
    """How a definition writes rotations; a text is an Euler sequence."""
    if isinstance(definition, str):
        return Euler(definition)
    kind = definition.rotation
    if isinstance(kind, str):
        return _named(kind)
    return _of_rotation(kind)


def flexion_of(definition: FlexionAngle, angles: np.ndarray) -> np.ndarray:
    """The flexion among the three angles, with its sign.

    Args:
        definition: Says which of them it is.
        angles: Shape (n, 3) [rad].

    Returns:
        Shape (n,) [rad].
    """
    return np.asarray(definition.sign * angles[:, INDEX[definition.flexion]])


def beside(
    definition: FlexionAngle, angles: np.ndarray, true: np.ndarray, reference: np.ndarray
) -> np.ndarray:
    """The angles on the branch of the true ones: of all triples of a rotation the nearest.

    A definition that is followed beyond its range passes a singularity, where the least error of an
    orientation decides on which branch it goes on; both are the same rotation.

    Args:
        definition: A `continuous` one.
        angles: Shape (n, 3) [rad].
        true: True ones by the same definition, shape (n, 3) [rad], on any branch.
        reference: True flexion, shape (n,) [rad], which tells the branch.

    Returns:
        Shape (n, 3) [rad]; as they are where the true ones are not finite.
    """
    kind = decomposition_of(definition)
    truths = np.concatenate([true[None], kind.alternatives(true)])
    off = [np.abs(rotation.wrap(flexion_of(definition, one) - reference)) for one in truths]
    rows = np.arange(len(true))
    aim = truths[np.argmin(np.nan_to_num(off, nan=np.inf), axis=0), rows]
    choices = np.concatenate([angles[None], kind.alternatives(angles)])
    apart = np.where(kind.periodic, rotation.wrap(choices - aim), choices - aim)
    # an angle near to where it is not defined says little of the branch
    weight = np.sin(np.minimum(kind.margins(aim), np.pi / 2))
    size = np.sum((weight * apart) ** 2, axis=-1)
    return np.asarray(choices[np.argmin(np.nan_to_num(size, nan=np.inf), axis=0), rows])


def nearest_turn(angle: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """The angles, give or take whole turns, nearest to a reference.

    So a sweep past 180 degrees stays one curve.

    Args:
        angle: Of any shape [rad].
        reference: Of the same shape [rad]; where it is not finite the angle stays as it is.

    Returns:
        Of the same shape [rad].
    """
    turns = np.round((np.asarray(reference) - angle) / (2 * np.pi))
    return np.asarray(angle + 2 * np.pi * np.where(np.isfinite(turns), turns, 0.0))


def unwrapped(angle: np.ndarray) -> np.ndarray:
    """A series of angles without jumps of a turn.

    Args:
        angle: In the order of time, shape (n,) [rad]; samples that are not finite are passed over.

    Returns:
        Shape (n,) [rad].
    """
    angle = np.array(angle, float)
    known = np.isfinite(angle)
    angle[known] = np.unwrap(angle[known])
    return angle


def _named(name: Literal["axis_angle", "rotation_vector"]) -> Decomposition:
    return AxisAngle() if name == "axis_angle" else RotationVector()


def _of_rotation(kind: JointRotation) -> Decomposition:
    if kind.euler is not None:
        return Euler(kind.euler)
    if kind.hinge is not None:
        return Hinge((kind.hinge[0], kind.hinge[1], kind.hinge[2]))
    if kind.swing_twist is not None:
        return SwingTwist((kind.swing_twist[0], kind.swing_twist[1], kind.swing_twist[2]))
    if kind.isb is not None:
        sequence, (signs, names) = "ZXY", _ISB[kind.isb]
    else:
        assert kind.grood_suntay is not None
        sequence, (signs, names) = "XYZ", _GROOD_SUNTAY[kind.grood_suntay]
    if kind.side == "left":  # what is inwards for one side is outwards for the other
        signs = (signs[0], -signs[1], -signs[2])
    return Euler(sequence, signs, names)
