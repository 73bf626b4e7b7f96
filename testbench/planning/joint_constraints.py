"""Do a joint's stated axes fit the arm, and will the planned motion show them?"""

from __future__ import annotations

import math

import numpy as np

from testbench.model.joint_angle import segment_pose
from testbench.model.joint_axes import axes_in_world, heading_slope, heading_terms
from testbench.model.kinematics import Kinematics
from testbench.planning.segment_frames import moments_of
from testbench.records.session.plan import PlannedStep, evaluated_steps
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.protocol import Protocol
from testbench.records.specs.robot import Robot

MOST_MISFIT = 2.0
"""Axes that are off by more than so many times what is stated of them do not belong to the arm's
joint.
"""
LEAST_TOLD = 0.17
"""Axes nearer to the vertical than 10 deg (RMS) tell no heading."""


def constraint_warnings(
    robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]
) -> list[str]:
    """A sentence for each joint whose axes do not fit the motion.

    They do not keep their angle as the arm moves, or stay too near to the vertical.
    """
    judged = evaluated_steps(steps)
    joints = {
        name: joint for name, joint in protocol.spec.joints.items() if joint.constraint is not None
    }
    if not judged or not joints:
        return []
    kinematics, q = (
        Kinematics(robot),
        trajectory.at(np.array([time for _, time in moments_of(judged)]))[0],
    )
    warnings = []
    for name, joint in joints.items():
        assert joint.constraint is not None
        proximal, distal = (
            kinematics.frame_motion(sensor.link, q, offset=segment_pose(sensor)).q_world_from_frame
            for sensor in (
                protocol.spec.sensors[joint.proximal],
                protocol.spec.sensors[joint.distal],
            )
        )
        axes = axes_in_world(proximal, distal, joint.constraint)
        between = np.degrees(
            np.arctan2(np.linalg.norm(np.cross(*axes), axis=1), np.sum(axes[0] * axes[1], axis=1))
        )
        off = math.sqrt(float(np.mean((between - joint.constraint.angle_deg) ** 2)))
        told = math.sqrt(float(np.mean(heading_slope(heading_terms(*axes, joint.constraint)) ** 2)))
        if off > MOST_MISFIT * joint.constraint.axes_sd_deg:
            span = (
                f"{between.min():.0f} deg"
                if np.ptp(between) < 1
                else f"{between.min():.0f} to {between.max():.0f} deg"
            )
            warnings.append(
                f"joint '{name}': in the planned motion the axes of its constraint are {span} "
                f"apart, not {joint.constraint.angle_deg:g} deg; headings would be turned wrongly: "
                f"are they axes of {robot.name} in the segments' own frames?"
            )
        elif told < LEAST_TOLD:
            warnings.append(
                f"joint '{name}': in the planned motion the axes of its constraint hardly tell a "
                "heading: one stays vertical"
            )
    return warnings
