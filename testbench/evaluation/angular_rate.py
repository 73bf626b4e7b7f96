"""How much of a true angle each of its sensors makes, and how it moves where it is judged."""

from __future__ import annotations

import numpy as np

from testbench.evaluation.time_lines import JudgedMotion
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.decomposition import follow
from testbench.model.joint_angle import decomposition_of, flexion_of, joint_angles
from testbench.model.statistics.intervals import gradient
from testbench.records.specs.joint_definition import FlexionAngle


def turned_by_sensor(
    q_world_from_proximal: np.ndarray, q_world_from_distal: np.ndarray, definition: FlexionAngle
) -> np.ndarray:
    """What each segment's own motion has added to the flexion since the beginning.

    The flexion is followed along orientations in which the segments move in turn, so that both
    parts together are its change.

    Args:
        q_world_from_proximal: True orientations of the proximal segment, shape (n, 4).
        q_world_from_distal: True orientations of the distal segment, shape (n, 4).
        definition: How they give the flexion.

    Returns:
        By the proximal and by the distal segment, shape (n, 2) [rad].
    """
    count = len(q_world_from_distal)
    if not count:
        return np.zeros((0, 2))
    angles = np.empty((2 * count - 1, 3))
    # the segments at 0 0, then at 0 1, 1 1, 1 2, 2 2
    angles[::2] = joint_angles(q_world_from_proximal, q_world_from_distal, definition)
    angles[1::2] = joint_angles(q_world_from_proximal[:-1], q_world_from_distal[1:], definition)
    if definition.continuous:
        angles = follow(decomposition_of(definition), angles)
    change = rotation.wrap(np.diff(flexion_of(definition, angles)))
    parts = np.zeros((count, 2))
    np.cumsum(change[1::2], out=parts[1:, 0])
    np.cumsum(change[0::2], out=parts[1:, 1])
    return parts


def judged_motion(time_ns: np.ndarray, angle: np.ndarray, judged: list[np.ndarray]) -> JudgedMotion:
    """How an angle moves in the steps that are judged, each step with the same weight.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        angle: Without jumps, NaN where not known, shape (n,) [rad].
        judged: Rows of each step, none empty, shape (rows of the step,) each.
    """
    degrees = np.degrees(angle)
    rate = gradient(degrees, time_ns / NANOSECONDS)
    every = np.concatenate(judged)
    sizes = np.array([len(rows) for rows in judged])
    starts = np.cumsum(sizes) - sizes
    known = np.isfinite(rate[every])
    own = np.where(known, rate[every], 0.0)
    count = np.add.reduceat(known, starts, dtype=np.int64)
    with np.errstate(invalid="ignore"):  # nothing is known of a step: nor is its mean
        mean, square = (
            float(np.mean([piece.sum() for piece in np.split(values, starts[1:])] / count))
            for values in (own, own**2)
        )
    angles = degrees[every]
    swings = np.maximum.reduceat(angles, starts) - np.minimum.reduceat(angles, starts)
    return JudgedMotion(mean, float(np.sqrt(square)), float(np.fmax.reduce(swings)))


def judged_swing(q_world_from_sensor: np.ndarray, part: str) -> float:
    """Largest less smallest rotation of a sensor that hardly moves, in the world [deg].

    Args:
        q_world_from_sensor: Where it is judged in one step, shape (n, 4).
        part: As for `length_of`.
    """
    if not len(q_world_from_sensor):
        return 0.0
    turns = rotation.turn_between(
        np.broadcast_to(q_world_from_sensor[:1], q_world_from_sensor.shape), q_world_from_sensor
    )
    return float(length_of(np.degrees(np.ptp(turns, axis=0)), part))


def length_of(vectors: np.ndarray, part: str) -> np.ndarray:
    """Length of rotations in the world, or of their part about the vertical or a level axis.

    Args:
        vectors: Rotation vectors in the world, shape (..., 3), in any unit.
        part: "total", "heading" for the part about the vertical, else the level part.

    Returns:
        Shape (...), in the same unit.
    """
    if part == "heading":
        return np.abs(vectors[..., 2])
    return np.asarray(np.linalg.norm(vectors if part == "total" else vectors[..., :2], axis=-1))
