"""Do the segment frames of a joint definition fit the arm? URDFs of one arm label their link axes differently."""

from __future__ import annotations

import math

import numpy as np

from testbench.model import rotation
from testbench.model.joint_angle import joint_angles, segment_pose
from testbench.model.kinematics import Kinematics
from testbench.records.plan import PlannedStep
from testbench.records.protocol import Protocol
from testbench.records.robot import Robot
from testbench.records.trajectory import Trajectory

MOST_SEQUENCE_ERROR_DEG = 15.0
"""The error that an Euler sequence alone makes in the published study stays below 9 deg at 20 deg of misalignment."""


def segment_frame_warnings(robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]) -> list[str]:
    """Joint definitions whose flexion does not follow the arm's joint that they name.

    The median over the judged poses is asked, so that an Euler sequence that fails at large angles may still be studied.

    Returns:
        A sentence for each definition that is off by more than any Euler sequence could be.
    """
    judged = [step.end_ns for step in steps if step.role == "evaluation"]
    if not judged:
        return []
    kinematics, q = Kinematics(robot), trajectory.at(np.array(judged))[0]
    warnings = []
    for name, joint in protocol.spec.joints.items():
        if joint.reference_joint is None:
            continue
        proximal, distal = (
            kinematics.frame_motion(sensor.link, q, offset=segment_pose(sensor)).q_world_from_frame
            for sensor in (protocol.spec.sensors[joint.proximal], protocol.spec.sensors[joint.distal])
        )
        angles = joint_angles(proximal, distal, joint.sequence)[:, ("first", "second", "third").index(joint.flexion)]
        reference = q[:, robot.joint_names.index(joint.reference_joint)]
        off = math.degrees(float(np.median(np.abs(rotation.wrap(joint.sign * angles - reference)))))
        if off > MOST_SEQUENCE_ERROR_DEG:
            warnings.append(
                f"joint '{name}': in the middle of the poses the {joint.sequence} flexion of the segments differs from "
                f"{joint.reference_joint} by {off:.1f} deg; its segment frames (rotation_deg) do not fit the link frames of "
                f"{robot.name}"
            )
    return warnings
