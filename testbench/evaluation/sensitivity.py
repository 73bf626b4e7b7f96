"""How the truth answers to what the arm may be wrong by, the zeros of its joints and the twists of
its links: sensitivity coefficients by finite differences.

An error of a zero or of a twist turns all that the joint carries about an axis that the arm's
configuration gives, exactly; what that does to an angle is a finite difference of its definition.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.evaluation.judged import window_rows
from testbench.model import rotation
from testbench.model.joint_angle import (
    INDEX,
    joint_angles,
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
    """Measured joint angles in the judged windows: the mean of a pose, several of a sweep.

    None where there are none.
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


def flexion_by_arm(
    kinematics: Kinematics, sensors: dict[str, Sensor], joint: JointDefinition, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Change of the true flexion with each error of the arm, and with each sensor's mounting.

    Args:
        kinematics: Of the arm.
        sensors: As placed by the protocol.
        joint: Whose flexion.
        q: Shape (m, n_joints) [rad].

    Returns:
        By zeros of the joints and by twists of the links, in the order of `Kinematics.error_axes`,
        shape (m, n_joints + twists) [1]; by rotations of the proximal and the distal sensor about
        their axes, shape (m, 6) [1]. Where the angle has a kink (the middle angle of a symmetric
        sequence at 0), the larger one-sided change.
    """
    placed = sensors[joint.proximal], sensors[joint.distal]
    true = [_sensor_orientation(kinematics, sensor, q) for sensor in placed]
    sources = len(kinematics.robot.joint_names) + len(kinematics.twists)
    # by the arm both sensors are turned in the world; by its mounting each about its own axes
    arm = [kinematics.error_axes(sensor.link, q) for sensor in placed]
    if joint.reference_joint in kinematics.robot.joint_names:
        arm = [axes[:, :0] for axes in arm]
    own = [
        np.swapaxes(rotation.to_matrix(q_world_from_sensor), 1, 2) for q_world_from_sensor in true
    ]
    still = np.zeros((len(q), 3, 3))
    turning = [
        np.concatenate([arm[0], own[0], still], axis=1),
        np.concatenate([arm[1], still, own[1]], axis=1),
    ]
    found = _flexion_by_turning(placed, true, turning, joint)
    by_arm = found[:, :-6]
    if joint.reference_joint in kinematics.robot.joint_names:
        by_arm = np.zeros((len(q), sources))
        by_arm[:, kinematics.robot.joint_names.index(joint.reference_joint)] = 1.0
    return by_arm, found[:, -6:]


def _flexion_by_turning(
    placed: tuple[Sensor, Sensor],
    true: list[np.ndarray],
    turning: list[np.ndarray],
    joint: JointDefinition,
) -> np.ndarray:
    """Change of the flexion with turns of its sensors in the world, shape (m, s) [1].

    Args:
        placed: The proximal and the distal sensor.
        true: q_world_from_sensor of each, shape (m, 4).
        turning: Axes that each is turned about, of s errors, shape (m, s, 3).
        joint: What the flexion is.
    """
    definition = joint.definitions()[0]
    count = turning[0].shape[1]
    steps = STEP * np.array([0.0, *[1.0] * count, *[-1.0] * count])
    which = np.array([0, *range(count), *range(count)])
    moved = []
    for sensor, q, axes in zip(placed, true, turning, strict=True):
        vectors = steps[:, None, None] * np.swapaxes(axes, 0, 1)[which]
        turned = rotation.multiply(
            rotation.from_rotation_vector(vectors), np.broadcast_to(q, (len(steps), *q.shape))
        )
        moved.append(segment_orientation(turned.reshape(-1, 4), sensor))
    angles = joint_angles(moved[0], moved[1], definition)[:, INDEX[definition.flexion]].reshape(
        len(steps), -1
    )
    middle, ahead, behind = np.split(definition.sign * angles, [1, 1 + count])
    return np.stack([_larger(middle[0], *pair) for pair in zip(ahead, behind, strict=True)], axis=1)


def _larger(middle: np.ndarray, ahead: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Derivatives, shape (m,).

    At a kink the larger one-sided one, with the sign it has elsewhere, so that nothing cancels.
    """
    forward, backward = rotation.wrap(ahead - middle) / STEP, rotation.wrap(middle - behind) / STEP
    smooth = (forward + backward) / 2
    kinked = np.abs(forward - backward) > 0.1
    sign = -1.0 if (~kinked).any() and smooth[~kinked].mean() < 0 else 1.0
    return np.where(kinked, sign * np.maximum(np.abs(forward), np.abs(backward)), smooth)


def _sensor_orientation(kinematics: Kinematics, sensor: Sensor, q: np.ndarray) -> np.ndarray:
    return kinematics.frame_motion(
        sensor.link, q, offset=Pose.from_placement(sensor.mounting)
    ).q_world_from_frame
