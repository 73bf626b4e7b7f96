"""The range of each joint definition's true angle where it will be evaluated."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from testbench.model.joint_angle import beside, flexion_of, joint_angles, nearest_turn
from testbench.model.kinematics import Kinematics
from testbench.planning.segment_frames import moments_of, segments_of
from testbench.records.session.plan import FlexionUse, PlannedStep, judged_steps
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.protocol import Protocol
from testbench.records.specs.robot import Robot


def flexion_ranges(
    robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]
) -> list[FlexionUse]:
    """Of every definition of every joint, the range of its angle as planned.

    It is looked at at the end of each evaluated pose, and all along each evaluated sweep.
    """
    judged = judged_steps(steps)
    moments = moments_of(judged)
    if not moments or not protocol.spec.joints:
        return []
    kinematics, q = Kinematics(robot), trajectory.at(np.array([time for _, time in moments]))[0]
    moving = np.array([step.kind == "sweep" for step, _ in moments])
    kinds: list[tuple[Literal["poses", "sweeps"], np.ndarray]] = [
        ("poses", ~moving),
        ("sweeps", moving),
    ]
    begins = [i for i, (step, _) in enumerate(moments) if i == 0 or step is not moments[i - 1][0]]
    result = []
    for name, joint in protocol.spec.joints.items():
        proximal, distal = segments_of(joint, protocol, kinematics, q)
        arm = (
            None
            if joint.reference_joint is None
            else q[:, robot.joint_names.index(joint.reference_joint)]
        )
        for definition in joint.definitions():
            angles = joint_angles(proximal, distal, definition)
            if arm is not None and definition.continuous:
                angles = beside(definition, angles, angles, arm)
            angle = flexion_of(definition, angles)
            if arm is not None:
                angle = nearest_turn(angle, arm)
            else:  # each sweep is one curve
                angle = np.concatenate([np.unwrap(piece) for piece in np.split(angle, begins[1:])])
            for kind, rows in kinds:
                if rows.any():
                    use = FlexionUse(name, definition.label, kind, *_range_deg(angle[rows]))
                    use = (
                        use
                        if arm is None
                        else replace(use, arm=joint.reference_joint, arm_deg=_range_deg(arm[rows]))
                    )
                    result.append(_with_commanded(use, joint.flexion_variable, judged))
    return result


def _with_commanded(use: FlexionUse, variable: str, judged: list[PlannedStep]) -> FlexionUse:
    """With what its steps are commanded by, where the protocol has that variable."""
    steps = [
        step
        for step in judged
        if (step.kind == "sweep") == (use.kind == "sweeps") and variable in step.variables
    ]
    values = [float(step.variables[variable]) for step in steps]
    return replace(use, variable=variable, commanded=(min(values), max(values))) if values else use


def _range_deg(angle: np.ndarray) -> tuple[float, float]:
    """Smallest and largest [deg]."""
    return float(np.degrees(angle.min())), float(np.degrees(angle.max()))
