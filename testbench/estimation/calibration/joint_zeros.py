"""What the truth would be with the zero of a joint of the arm off by its standard uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.model import rotation
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.session.samples import Truth
from testbench.records.session.session import Session


def shifted_truths(session: Session, sensor: str, truth: Truth) -> list[Truth]:
    """The truth with the zero of a joint off by its standard uncertainty, joint by joint.

    Args:
        session: With the arm's samples, or nothing comes of it.
        sensor: Its name.
        truth: Of the sensor.

    Returns:
        One truth for each joint that turns the sensor.
    """
    arm, robot = session.arm(), session.robot
    if (
        arm is None
        or robot is None
        or sensor not in session.analysis.sensors
        or len(arm.host_time_ns) < 2
    ):
        return []
    placed, kinematics = session.analysis.sensors[sensor], Kinematics(robot)
    at = truth.host_time_ns
    q, v = (
        np.column_stack([np.interp(at, arm.host_time_ns, column) for column in group.T])
        for group in (arm.q_measured, arm.v_measured)
    )
    offset = Pose.from_placement(placed.mounting)
    base = kinematics.frame_motion(placed.link, q, v, offset=offset)
    q_base, rate = rotation.conjugate(base.q_world_from_frame), base.angular_velocity_in_frame
    truths = []
    for joint, u in enumerate(robot.joint_angle_uncertainty):
        if u <= 0:
            continue
        moved = kinematics.frame_motion(
            placed.link, q + u * np.eye(q.shape[1])[joint], v, offset=offset
        )
        turn = rotation.multiply(moved.q_world_from_frame, q_base)
        if float(rotation.angle(turn).max()) < 1e-3 * u:  # it does not carry the sensor
            continue
        turned = None if truth.rate is None else truth.rate + moved.angular_velocity_in_frame - rate
        truths.append(
            replace(
                truth,
                q_world_from_sensor=rotation.multiply(turn, truth.q_world_from_sensor),
                rate=turned,
            )
        )
    return truths
