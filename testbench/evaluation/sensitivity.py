"""How the truth answers to the angles of the arm's joints: sensitivity coefficients by finite
differences of the kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.evaluation.judged import window_rows
from testbench.model import rotation
from testbench.model.joint_angle import (
    INDEX,
    joint_angles,
    segment_from_sensor,
    segment_orientation,
)
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.specs.protocol import JointDefinition, Sensor

STEP = 1e-4
"""Of the differences [rad]: far above rounding, far below the angles over which the answer
bends.
"""
MOST_CONFIGURATIONS = 32
"""A sweep is looked at in so many of its configurations."""


@dataclass(frozen=True)
class Configurations:
    """Joint angles in which the truth was used, and the step each belongs to.

    Attributes:
        q: Shape (m, n_joints) [rad].
        step: Index into the list of steps, shape (m,).
    """

    q: np.ndarray
    step: np.ndarray


def judged_configurations(arm: ArmSamples, steps: list[PlannedStep]) -> Configurations | None:
    """Measured joint angles in the judged windows: the mean of a pose, several of a sweep; None
    where there are none.
    """
    angles, which = [], []
    spans = window_rows(steps, arm.host_time_ns)
    for i, (step, first, last) in enumerate(zip(steps, *spans, strict=True)):
        if last <= first:
            continue
        if step.kind == "sweep":
            rows = np.unique(np.linspace(first, last - 1, MOST_CONFIGURATIONS).astype(int))
            own = arm.q_measured[rows]
        else:
            own = arm.q_measured[first:last].mean(axis=0)[None]
        angles.append(own)
        which += [i] * len(own)
    return Configurations(np.concatenate(angles), np.array(which)) if angles else None


def flexion_by_joints(
    kinematics: Kinematics, sensors: dict[str, Sensor], joint: JointDefinition, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Change of the true flexion with each joint's angle, and with each sensor's mounting.

    Args:
        kinematics: Of the arm.
        sensors: As placed by the protocol.
        joint: Whose flexion.
        q: Shape (m, n_joints) [rad].

    Returns:
        By joint angles, shape (m, n_joints) [1]; by rotations of the proximal and the distal sensor
        about their axes, shape (m, 6) [1]. Where the angle has a kink (the middle angle of a
        symmetric sequence at 0), the larger one-sided change.
    """
    m, n = q.shape
    proximal, distal = sensors[joint.proximal], sensors[joint.distal]
    definition = joint.definitions()[0]

    def flexion(q_proximal: np.ndarray, q_distal: np.ndarray) -> np.ndarray:
        angles = joint_angles(q_proximal, q_distal, definition)
        return np.asarray(definition.sign * angles[:, INDEX[definition.flexion]])

    shifts = STEP * np.vstack([np.zeros(n), np.eye(n), -np.eye(n)])
    if joint.reference_joint in kinematics.robot.joint_names:
        shifts = shifts[:1]
    moved_q = (q + shifts[:, None, :]).reshape(
        -1, n
    )  # all configurations at once: as they are, then each joint either way
    first, second = (
        segment_orientation(_sensor_orientation(kinematics, sensor, moved_q), sensor)
        for sensor in (proximal, distal)
    )
    middle, *moved = flexion(first, second).reshape(-1, m)
    by_joints = np.zeros((m, n))
    if moved:
        by_joints = np.stack([_larger(middle, moved[i], moved[n + i]) for i in range(n)], axis=1)
    else:
        by_joints[:, kinematics.robot.joint_names.index(str(joint.reference_joint))] = 1.0
    base = (first[:m], second[:m])
    by_mounting = np.zeros((m, 6))
    for place, sensor in enumerate((proximal, distal)):
        to_segment = rotation.rotate(segment_from_sensor(sensor)[None], np.eye(3))
        for axis in range(3):
            either_way = []
            for sign in (1, -1):
                turn = rotation.from_rotation_vector(sign * STEP * to_segment[axis])
                pair = [base[0], base[1]]
                pair[place] = rotation.multiply(pair[place], turn)
                either_way.append(flexion(*pair))
            by_mounting[:, 3 * place + axis] = _larger(middle, *either_way)
    return by_joints, by_mounting


def _larger(middle: np.ndarray, ahead: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Derivatives, shape (m,); at a kink the larger one-sided one, with the sign it has elsewhere,
    so that nothing cancels.
    """
    forward, backward = rotation.wrap(ahead - middle) / STEP, rotation.wrap(middle - behind) / STEP
    smooth = (forward + backward) / 2
    kinked = np.abs(forward - backward) > 0.1
    sign = -1.0 if (~kinked).any() and smooth[~kinked].mean() < 0 else 1.0
    return np.where(kinked, sign * np.maximum(np.abs(forward), np.abs(backward)), smooth)


def turning_by_joints(kinematics: Kinematics, sensor: Sensor, q: np.ndarray) -> np.ndarray:
    """Rotation of a sensor in the world for each joint's angle: the axes of the joints.

    Args:
        kinematics: Of the arm.
        sensor: As mounted.
        q: Joint angles, shape (m, n_joints) [rad].

    Returns:
        Shape (m, n_joints, 3) [1].
    """
    m, n = q.shape
    shifted = (q + STEP * np.vstack([np.zeros(n), np.eye(n)])[:, None, :]).reshape(-1, n)
    turned = _sensor_orientation(kinematics, sensor, shifted).reshape(n + 1, m, 4)
    turns = rotation.to_rotation_vector(
        rotation.multiply(turned[1:], rotation.conjugate(turned[0]))
    )
    return np.asarray(np.swapaxes(turns, 0, 1) / STEP)


def _sensor_orientation(kinematics: Kinematics, sensor: Sensor, q: np.ndarray) -> np.ndarray:
    return kinematics.frame_motion(
        sensor.link, q, offset=Pose.from_placement(sensor.mounting)
    ).q_world_from_frame
