"""What misaligned segments and wrong sensor orientations do to a joint angle.

A joint's rotation is computed from the two sensors and a start pose in which the segments'
orientations are taken as known. Errors enter in that pose (misalignment: the limb did not stand as
assumed) or in the sensors at every instant (Castellanos Alonso 2023, eqs 2.18 to 2.26).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.joint_angle import INDEX, decomposition_of, joint_rotation
from testbench.records.specs.joint_definition import FlexionAngle

AxisName = Literal["X", "Y", "Z"]
AXES: dict[str, np.ndarray] = dict(zip("XYZ", np.eye(3), strict=True))
LEAST_MARGIN = np.radians(0.01)
"""Nearer to gimbal lock than this an outer angle is not compared [rad]."""


def with_errors(
    q: np.ndarray, yaw: np.ndarray | float, pitch: np.ndarray | float, roll: np.ndarray | float
) -> np.ndarray:
    """Errors about each axis of q = q_yaw(z) q_pitch(y) q_roll(x).

    They enter as q' = (q_ye q_y)(q_p q_pe)(q_r q_re) (eq. 2.19). An error shares the axis of the
    angle it stands beside, so this adds the errors to the ZYX angles of q.

    Args:
        q: World from segment or sensor, shape (..., 4).
        yaw: Error about z [rad], broadcast to the shape of q.
        pitch: Error about y [rad], broadcast to the shape of q.
        roll: Error about x [rad], broadcast to the shape of q.

    Returns:
        Shape (..., 4).
    """
    angles = rotation.to_euler("ZYX", q)
    errors = np.stack(np.broadcast_arrays(yaw, pitch, roll), axis=-1)
    return rotation.from_euler("ZYX", angles + errors)


def joint_from_start_pose(
    q_world_from_sensor_A: np.ndarray,
    q_world_from_sensor_F: np.ndarray,
    q_world_from_sensor_A0: np.ndarray,
    q_world_from_sensor_F0: np.ndarray,
    q_world_from_segment_A0: np.ndarray,
    q_world_from_segment_F0: np.ndarray,
) -> np.ndarray:
    """q_A_from_F of two sensors whose mounting comes from a start pose (0) with known segments.

        q_A_from_F = conj(q_SA (conj(q_SA0) q_A0)) (q_SF (conj(q_SF0) q_F0))        (eqs 2.1 to 2.5)

    With errors in the segments of the start pose it is eq. 2.18 (misalignment), with errors in the
    two sensors eq. 2.21.

    Args:
        q_world_from_sensor_A: Sensor on the arm at every instant, shape (n, 4).
        q_world_from_sensor_F: Sensor on the forearm at every instant, shape (n, 4).
        q_world_from_sensor_A0: Sensor on the arm in the start pose, shape (4,) or (n, 4).
        q_world_from_sensor_F0: Sensor on the forearm in the start pose, shape (4,) or (n, 4).
        q_world_from_segment_A0: Arm in the start pose, shape (4,) or (n, 4).
        q_world_from_segment_F0: Forearm in the start pose, shape (4,) or (n, 4).
    """
    arm = rotation.multiply(
        q_world_from_sensor_A,
        rotation.multiply(rotation.conjugate(q_world_from_sensor_A0), q_world_from_segment_A0),
    )
    forearm = rotation.multiply(
        q_world_from_sensor_F,
        rotation.multiply(rotation.conjugate(q_world_from_sensor_F0), q_world_from_segment_F0),
    )
    return joint_rotation(arm, forearm)


def middle_angle_error(flexion: np.ndarray, misalignment: np.ndarray) -> np.ndarray:
    """asin(sin f cos d) - f: error of a flexion about the middle one of three different axes.

    It is read by a proximal segment that is turned about the axis of one of the others.

    Args:
        flexion: f, within ±90 degrees [rad], of a shape that broadcasts with that of d.
        misalignment: d [rad], of a shape that broadcasts with that of f.

    Returns:
        Of their common shape [rad].
    """
    return np.asarray(np.arcsin(np.sin(flexion) * np.cos(misalignment)) - flexion)


def misalignment_errors(
    definition: str | FlexionAngle,
    about: AxisName,
    flexion: np.ndarray,
    misalignment: np.ndarray,
    flexion_about: AxisName = "Y",
    which: Literal["proximal", "distal"] = "proximal",
) -> np.ndarray:
    """Errors of all three angles when one segment is misaligned at the start and the distal one
    flexes.

    By quaternions (eqs 2.18, 2.20). The segments start level and agree; one of them is taken to be
    turned by the misalignment.

    Args:
        definition: An Euler sequence, or any definition.
        about: Axis of the misalignment.
        flexion: Shape (f,) [rad].
        misalignment: Shape (d,) [rad].
        flexion_about: Axis of the flexion in the segments.
        which: The segment that is misaligned.

    Returns:
        Estimated less true angles, in ±180 degrees, shape (f, d, 3) [rad]; NaN where one is not
        defined.
    """
    turned, bent = _grid(flexion, misalignment)
    level = np.tile(rotation.IDENTITY, (len(bent), 1))
    q_forearm = rotation.from_rotation_vector(bent[:, None] * AXES[flexion_about])
    q_wrong = rotation.multiply(level, rotation.from_rotation_vector(turned[:, None] * AXES[about]))
    starts = (q_wrong, level) if which == "proximal" else (level, q_wrong)
    estimated = joint_from_start_pose(level, q_forearm, level, level, *starts)
    shape = (len(np.atleast_1d(flexion)), len(np.atleast_1d(misalignment)), 3)
    return _angle_errors(definition, estimated, q_forearm).reshape(shape)


def start_pose_errors(
    definition: str | FlexionAngle,
    flexion: np.ndarray,
    yaw_pitch_roll: tuple[float, float, float] | np.ndarray,
    flexion_about: AxisName = "Y",
    which: Literal["proximal", "distal"] = "proximal",
) -> np.ndarray:
    """Errors of all three angles when one segment starts off in yaw, pitch and roll together.

    Args:
        definition: An Euler sequence, or any definition.
        flexion: Shape (f,) [rad].
        yaw_pitch_roll: By which the start pose is wrong (eq. 2.19), shape (3,) [rad].
        flexion_about: Axis of the flexion in the segments.
        which: The segment.

    Returns:
        As for `misalignment_errors`, shape (f, 3) [rad].
    """
    bent = np.atleast_1d(flexion).astype(float)
    level = np.tile(rotation.IDENTITY, (len(bent), 1))
    q_forearm = rotation.from_rotation_vector(bent[:, None] * AXES[flexion_about])
    yaw, pitch, roll = (np.full(len(bent), value) for value in yaw_pitch_roll)
    q_wrong = with_errors(level, yaw, pitch, roll)
    starts = (q_wrong, level) if which == "proximal" else (level, q_wrong)
    estimated = joint_from_start_pose(level, q_forearm, level, level, *starts)
    return _angle_errors(definition, estimated, q_forearm)


def sensor_errors(
    definition: str | FlexionAngle,
    about: AxisName,
    flexion: np.ndarray,
    error: np.ndarray,
    flexion_about: AxisName = "Y",
    which: Literal["proximal", "distal"] = "proximal",
) -> np.ndarray:
    """Errors of all three angles when one sensor's orientation is wrong by yaw, pitch or roll.

    The start pose is free of errors (eqs 2.19, 2.21).

    Args:
        definition: An Euler sequence, or any definition.
        about: Axis of the error: Z for yaw, Y for pitch, X for roll.
        flexion: Shape (f,) [rad].
        error: Shape (d,) [rad].
        flexion_about: Axis of the flexion in the segments.
        which: The sensor that is wrong.

    Returns:
        As for `misalignment_errors`, shape (f, d, 3) [rad].
    """
    wrong, bent = _grid(flexion, error)
    level = np.tile(rotation.IDENTITY, (len(bent), 1))
    q_forearm = rotation.from_rotation_vector(bent[:, None] * AXES[flexion_about])
    yaw, pitch, roll = (wrong if about == axis else np.zeros_like(wrong) for axis in "ZYX")
    arm, forearm = level, q_forearm
    if which == "proximal":
        arm = with_errors(level, yaw, pitch, roll)
    else:
        forearm = with_errors(q_forearm, yaw, pitch, roll)
    estimated = joint_from_start_pose(arm, forearm, level, level, level, level)
    shape = (len(np.atleast_1d(flexion)), len(np.atleast_1d(error)), 3)
    return _angle_errors(definition, estimated, q_forearm).reshape(shape)


def flexion_index(definition: str | FlexionAngle, flexion_about: AxisName = "Y") -> int:
    """Which of the three angles is the flexion about an axis.

    It is what a definition says, or the place of the axis in a sequence.

    Raises:
        InputError: The axis stands not once in the sequence, so that no single angle is the
            flexion.
    """
    if isinstance(definition, FlexionAngle):
        return INDEX[definition.flexion]
    if definition.count(flexion_about) != 1:
        raise InputError(
            f"a flexion about {flexion_about} is no single angle of {definition}: the axis stands "
            "there "
            f"{definition.count(flexion_about)} times"
        )
    return definition.index(flexion_about)


def _grid(flexion: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Error and flexion of each cell, flattened with the error changing fastest."""
    bent, wrong = np.meshgrid(np.atleast_1d(flexion), np.atleast_1d(error), indexing="ij")
    return wrong.ravel().astype(float), bent.ravel().astype(float)


def _angle_errors(
    definition: str | FlexionAngle, estimated: np.ndarray, true: np.ndarray
) -> np.ndarray:
    """Estimated less true angles, with the sign of the definition, shape (n, 3) [rad].

    NaN where an angle of either is not defined (eqs 2.24 to 2.26).
    """
    decomposition = decomposition_of(definition)
    found, wanted = decomposition.angles(estimated), decomposition.angles(true)
    defined = np.minimum(decomposition.margins(found), decomposition.margins(wanted)) > LEAST_MARGIN
    sign = definition.sign if isinstance(definition, FlexionAngle) else 1
    return np.where(defined, sign * rotation.wrap(found - wanted), np.nan)
