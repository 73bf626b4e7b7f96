"""Do the segment frames of a joint definition fit the arm? URDFs of one arm label their link axes differently."""

from __future__ import annotations

import math

import numpy as np

from testbench.model import rotation
from testbench.model.joint_angle import INDEX, decomposition_of, flexion_of, joint_angles, segment_pose
from testbench.model.kinematics import Kinematics
from testbench.records.plan import PlannedStep
from testbench.records.protocol import Protocol
from testbench.records.robot import Robot
from testbench.records.trajectory import Trajectory

MOST_SEQUENCE_ERROR_DEG = 15.0
"""The error that an Euler sequence alone makes in the published study stays below 9 deg at 20 deg of misalignment."""
LEAST_MARGIN_DEG = 5.0
"""Nearer to a singularity than this an angle magnifies every error more than eleven times (1 / sin)."""


def segment_frame_warnings(robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]) -> list[str]:
    """Joint definitions whose flexion does not follow the arm's joint that they name, or is lost in a singularity.

    The median over the judged poses is asked for the first, so that an Euler sequence that fails at large angles may still be
    studied, and the worst of them for the second.

    Returns:
        A sentence for each definition that is off by more than any Euler sequence could be, and for each whose flexion is not
        defined in one of the poses.
    """
    judged = [step.end_ns for step in steps if step.role == "evaluation"]
    if not judged:
        return []
    kinematics, q = Kinematics(robot), trajectory.at(np.array(judged))[0]
    warnings = []
    for name, joint in protocol.spec.joints.items():
        proximal, distal = (
            kinematics.frame_motion(sensor.link, q, offset=segment_pose(sensor)).q_world_from_frame
            for sensor in (protocol.spec.sensors[joint.proximal], protocol.spec.sensors[joint.distal])
        )
        for definition in joint.definitions():
            angles = joint_angles(proximal, distal, definition)
            margin = math.degrees(float(decomposition_of(definition).margins(angles)[:, INDEX[definition.flexion]].min()))
            if margin < LEAST_MARGIN_DEG:
                warnings.append(
                    f"joint '{name}': the {definition.flexion} angle of {definition.label} is its flexion, and in one of the "
                    f"poses it is {margin:.1f} deg from where that angle is not defined; its error there says nothing"
                )
        if joint.reference_joint is None:
            continue
        flexion = flexion_of(joint, joint_angles(proximal, distal, joint))
        reference = q[:, robot.joint_names.index(joint.reference_joint)]
        off = math.degrees(float(np.median(np.abs(rotation.wrap(flexion - reference)))))
        if off > MOST_SEQUENCE_ERROR_DEG:
            warnings.append(
                f"joint '{name}': in the middle of the poses the {joint.label} flexion of the segments differs from "
                f"{joint.reference_joint} by {off:.1f} deg; its segment frames (rotation_deg) do not fit the link frames of "
                f"{robot.name}"
            )
    return warnings
