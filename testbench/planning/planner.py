"""The stage `plan`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from testbench.exceptions import FileProblems, InputError, NotFoundError, PlanError
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics
from testbench.model.reference_step import reference_warning
from testbench.planning.checks import check_plan
from testbench.planning.cycles import planned_cycles
from testbench.planning.definition_ranges import check_definition_ranges
from testbench.planning.expansion import LONGEST_DURATION_S, Command, expand
from testbench.planning.flexion_ranges import flexion_ranges
from testbench.planning.joint_constraints import constraint_warnings
from testbench.planning.motion import MotionBuilder
from testbench.planning.segment_frames import segment_frame_warnings
from testbench.planning.unit_slips import unit_warnings
from testbench.records.session.plan import Plan, PlannedStep, evaluated_steps
from testbench.records.specs.protocol import Protocol
from testbench.records.specs.protocol_chain import CHAIN_METRICS, WHOLE_CHAIN
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.robot import Robot, load_robot

FARTHEST_CENTRE_MM = 500.0
"""Of a tool that carries sensors: the reach of the smallest arm (UR3e, user manual). Farther is a
slip of the unit.
"""


def plan(protocol: Protocol | str | Path, robot: Robot | str | Path | None = None) -> Plan:
    """Turn a protocol into a checked, timed motion.

    The arm starts at rest at its home. The same inputs give the same plan, to the bit.

    Args:
        protocol: A protocol, its file, or the name of one that ships with the bench.
        robot: The arm, its name or file; the one the protocol names if None.

    Raises:
        FileProblems: The protocol or robot file is malformed.
        InputError: The tool is too heavy for the arm, or its centre of mass cannot be meant.
        PlanError: The motion breaks a limit, collides, or would saturate a sensor.
    """
    if not isinstance(protocol, Protocol):
        protocol = load_protocol(protocol)
    if not isinstance(robot, Robot):
        robot = find_robot(protocol, robot)
    commands = expand(protocol, robot)
    _check_names(protocol, robot)
    _check_tool(protocol, robot)
    builder = MotionBuilder(robot)
    steps: list[PlannedStep] = []
    for index, command in enumerate(commands):
        try:
            start, settled, end = builder.add(command)
        except PlanError as error:
            error.place, error.doubts = command.place, tuple(unit_warnings(protocol, commands))
            raise
        if end > LONGEST_DURATION_S * 1e9:
            raise protocol.document.problem(
                f"the motion lasts longer than the {LONGEST_DURATION_S:g} s allowed", "sections"
            )
        steps.append(_planned(index, command, start, settled, end))
    if builder.now_ns == 0:
        raise protocol.document.problem(
            "nothing moves and nothing dwells: the protocol lasts no time", "sections"
        )
    _check_settling(protocol, steps)
    trajectory = builder.trajectory()
    doubts = unit_warnings(protocol, commands)
    try:
        check = check_plan(robot, protocol, trajectory, steps)
    except PlanError as error:
        error.doubts = tuple(doubts)
        raise
    doubt = reference_warning(steps, protocol.spec.estimate.align)
    warnings = ([doubt] if doubt is not None else []) + doubts
    check_definition_ranges(robot, protocol, trajectory, steps)
    warnings += segment_frame_warnings(robot, protocol, trajectory, steps)
    warnings += constraint_warnings(robot, protocol, trajectory, steps)
    ranges = flexion_ranges(robot, protocol, trajectory, steps)
    check = replace(check, warnings=robot.spec.assumptions + warnings, flexions=ranges)
    return Plan(protocol, robot, trajectory, steps, check)


def _planned(index: int, command: Command, start: int, settled: int, end: int) -> PlannedStep:
    kind: Any = "sweep" if command.sweeps else "hold" if settled == start else "move"
    cycles = planned_cycles(command.sweeps, (settled - start) / NANOSECONDS)
    names = (command.section, command.role, command.name)
    return PlannedStep(
        index, *names, kind, dict(command.variables), start, settled, end, command.place, cycles
    )


def find_robot(protocol: Protocol, robot: str | Path | None) -> Robot:
    """The arm of that name or file, or the one that the protocol names."""
    if robot is not None:
        return load_robot(robot)
    name = protocol.spec.robot
    beside = protocol.document.file.parent / name
    try:
        return load_robot(
            beside if beside.exists() or name.endswith((".yaml", ".yml", ".urdf")) else name
        )
    except FileProblems:
        raise  # it names the robot file and its line
    except InputError as error:
        raise protocol.document.problem(str(error), "robot") from None


def _check_names(protocol: Protocol, robot: Robot) -> None:
    """Links and joints that the protocol names must exist on the arm."""
    _check_links(protocol, robot)
    joints: list[tuple[str, tuple[Any, ...]]] = [
        (joint.reference_joint, ("joints", name, "reference_joint"))
        for name, joint in protocol.spec.joints.items()
        if joint.reference_joint is not None
    ]
    chain = protocol.spec.estimate.chain
    joints += [
        (name, ("estimate", "chain", "joints", i))
        for i, name in enumerate(chain.joints if chain is not None else [])
    ]
    for i, limit in enumerate(protocol.spec.accept):
        owner, _, kind = limit.metric.partition(".")
        if kind in CHAIN_METRICS and owner != WHOLE_CHAIN:
            joints.append((owner, ("accept", i, "metric")))
    for name, where in joints:
        if name not in robot.joint_names:
            unknown = NotFoundError(f"joint of {robot.name}", name, robot.joint_names)
            raise protocol.document.problem(str(unknown), *where)


def _check_links(protocol: Protocol, robot: Robot) -> None:
    """Links that sensors and dipoles sit on."""
    kinematics = Kinematics(robot)
    named: list[tuple[str, tuple[Any, ...]]] = [
        (sensor.link, ("sensors", name, "link")) for name, sensor in protocol.spec.sensors.items()
    ]
    named += [
        (dipole.link, ("environment", "dipoles", i, "link"))
        for i, dipole in enumerate(protocol.spec.environment.dipoles)
    ]
    for link, where in named:
        try:
            kinematics.check_carrier(link)
        except NotFoundError as error:
            raise protocol.document.problem(str(error), *where) from None
    for dipole in robot.spec.magnetism.dipoles if protocol.spec.environment.arm_magnetism else []:
        try:
            kinematics.check_link(dipole.link)
        except NotFoundError as error:
            raise InputError(
                f"the robot file of {robot.name}, magnetism, dipole '{dipole.name}': {error}"
            ) from None


def _check_tool(protocol: Protocol, robot: Robot) -> None:
    """The arm must be able to carry the tool, whose centre of mass must be possible."""
    tool, payload = protocol.spec.arm.tool, robot.spec.payload_kg
    if tool is None:
        return
    if payload is not None and tool.mass_kg > payload:
        message = (
            f"the tool of {tool.mass_kg:g} kg is heavier than the {payload:g} kg that the maker of "
            f"the {robot.name} allows"
        )
        raise protocol.document.problem(message, "arm", "tool", "mass_kg")
    distance = math.hypot(*tool.centre_mm)
    if distance > FARTHEST_CENTRE_MM:
        message = (
            f"the tool's centre of mass is {distance:g} mm from the flange; at most "
            f"{FARTHEST_CENTRE_MM:g} mm are allowed"
        )
        raise protocol.document.problem(message, "arm", "tool", "centre_mm")


def _check_settling(protocol: Protocol, steps: list[PlannedStep]) -> None:
    """What `settling_s` leaves out of a step must leave something of each section of the chain."""
    chain = protocol.spec.estimate.chain
    if chain is None or chain.settling_s == 0:
        return
    judged = [step.section for step in evaluated_steps(steps)]
    for section in chain.sections or dict.fromkeys(judged):
        spans = [
            (step.settled_ns if step.kind == "sweep" else step.end_ns) - step.start_ns
            for step in steps
            if step.section == section
        ]
        longest = max(spans, default=0) / NANOSECONDS
        if spans and longest <= 2 * chain.settling_s:
            message = (
                f"settling_s leaves out {chain.settling_s:g} s at either end of each step, and the "
                f"longest of section '{section}' lasts {longest:.1f} s: nothing would be "
                f"evaluated; it must be below {longest / 2:.1f} s"
            )
            raise protocol.document.problem(message, "estimate", "chain", "settling_s")
