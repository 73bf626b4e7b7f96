"""Unroll a protocol: loops, includes and expressions become a flat list of commands with numbers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from testbench.exceptions import ExpressionError, FileProblems, NotFoundError
from testbench.planning.expressions import evaluate_expression
from testbench.records.protocol import Motion, Protocol, Role, Section, Step, Sweep
from testbench.records.robot import Robot

MOST_COMMANDS = 100_000
LONGEST_DURATION_S = 24 * 3600.0


@dataclass(frozen=True)
class SineCommand:
    """Numbers of a sine sweep of one joint: [rad], [Hz], cycles, cycles, [rad]."""

    joint: int
    amplitude: float
    frequency: float
    cycles: float
    ramp_cycles: float
    phase: float


@dataclass(frozen=True)
class TrapezoidCommand:
    """Numbers of a trapezoid sweep of one joint: [rad], [rad/s], whole cycles, [s]."""

    joint: int
    amplitude: float
    rate: float
    cycles: int
    hold: float


@dataclass(frozen=True)
class Command:
    """One step with all its numbers.

    Attributes:
        section, role, name, variables: As in PlannedStep. target: Joint angles to move to [rad]; NaN where the joint stays;
        None for no move. sweeps: Motion of the joints that sweep. dwell: [s]. motion: Scaling of the limits.
        where: (document, path) for error messages.
    """

    section: str
    role: Role
    name: str
    variables: dict[str, float]
    target: np.ndarray | None
    sweeps: tuple[SineCommand | TrapezoidCommand, ...]
    dwell: float
    motion: Motion
    protocol: Protocol
    path: tuple[Any, ...]

    @property
    def place(self) -> str:
        """`file:line` of the step."""
        line = self.protocol.document.problem("", *self.path).problems[0].line
        return f"{self.protocol.document.file}:{line}"


def expand(protocol: Protocol, robot: Robot) -> list[Command]:
    """Every command of a protocol, in order.

    Raises:
        FileProblems: An expression, joint name or number of joint angles is wrong, or the protocol is too large.
    """
    commands: list[Command] = []
    for command in _expand_protocol(protocol, robot, None, None):
        commands.append(command)
        if len(commands) > MOST_COMMANDS:
            raise protocol.document.problem(f"the protocol has more than {MOST_COMMANDS} steps", "sections")
    return commands


def _expand_protocol(protocol: Protocol, robot: Robot, section_name: str | None, role: Role | None) -> Iterator[Command]:
    for i, section in enumerate(protocol.spec.sections):
        name, section_role = section_name or section.name, role or section.role
        if section.include is not None:
            yield from _expand_protocol(protocol.included[section.include], robot, name, section_role)
            continue
        yield from _Expander(protocol, robot, section, name, section_role).expand(i)


class _Expander:
    """Unrolls the steps of one section."""

    def __init__(self, protocol: Protocol, robot: Robot, section: Section, name: str, role: Role):
        self.protocol, self.robot, self.section, self.name, self.role = protocol, robot, section, name, role
        spec = protocol.spec
        self.constants = {key: spec.values(key)[0] for key in spec.variables if len(spec.values(key)) == 1}

    def expand(self, index: int) -> Iterator[Command]:
        steps = self.section.steps or []
        motion = self.section.motion or self.protocol.spec.motion
        yield from self._loop(self.section.for_each, steps, self.constants, {}, motion, ("sections", index, "steps"))

    def _loop(
        self,
        loop: list[str],
        steps: list[Step],
        variables: dict[str, float],
        shown: dict[str, float],
        motion: Motion,
        path: tuple[Any, ...],
    ) -> Iterator[Command]:
        values = [self.protocol.spec.values(name) for name in loop]
        if int(np.prod([len(v) for v in values], dtype=float)) * len(steps) > MOST_COMMANDS:
            raise self._error(f"the loop over {', '.join(loop)} repeats its steps more than {MOST_COMMANDS} times", *path)
        for combination in itertools.product(*values):
            looped = dict(zip(loop, combination, strict=True))
            for k, step in enumerate(steps):
                inner = step.motion or motion
                here, all_shown = variables | looped, shown | looped
                if step.steps is not None:
                    yield from self._loop(step.for_each or [], step.steps, here, all_shown, inner, (*path, k, "steps"))
                else:
                    yield self._command(step, here, all_shown, inner, (*path, k))

    def _command(
        self, step: Step, variables: dict[str, float], shown: dict[str, float], motion: Motion, path: tuple[Any, ...]
    ) -> Command:
        def number(
            expression: float | str | None, *where: Any, lowest: float | None = None, above: float | None = None
        ) -> float:
            try:
                value = evaluate_expression(expression if expression is not None else 0.0, variables)
            except ExpressionError as error:
                raise self._error(str(error), *path, *where) from None
            if lowest is not None and value < lowest:
                raise self._error(f"{value:g} must be at least {lowest:g}", *path, *where)
            if above is not None and value <= above:
                raise self._error(f"{value:g} must be greater than {above:g}", *path, *where)
            return value

        target = self._target(step, number, path)
        sweeps = tuple(self._sweep(joint, sweep, number, path) for joint, sweep in (step.sweep or {}).items())
        dwell = number(step.dwell_s, "dwell_s", lowest=0.0)
        if dwell > LONGEST_DURATION_S:
            raise self._error(f"a dwell of {dwell:g} s is longer than the {LONGEST_DURATION_S:g} s allowed", *path, "dwell_s")
        name = step.name or ", ".join([self.name, *[f"{key} {value:g}" for key, value in shown.items()]])
        return Command(self.name, self.role, name, shown, target, sweeps, dwell, motion, self.protocol, path)

    def _target(self, step: Step, number: Callable[..., float], path: tuple[Any, ...]) -> np.ndarray | None:
        if step.move_to == "home":
            return self.robot.home
        names = self.robot.joint_names
        if isinstance(step.move_to_deg, list):
            if len(step.move_to_deg) != len(names):
                message = f"{len(step.move_to_deg)} joint angles given; {self.robot.name} has {len(names)}: {', '.join(names)}"
                raise self._error(message, *path, "move_to_deg")
            return np.radians([number(value, "move_to_deg", i) for i, value in enumerate(step.move_to_deg)])
        if step.move_to_deg is not None:
            target = np.full(len(names), np.nan)
            for name, value in step.move_to_deg.items():
                target[self._joint(name, *path, "move_to_deg", name)] = np.radians(number(value, "move_to_deg", name))
            return target
        return None

    def _sweep(
        self, joint: str, sweep: Sweep, number: Callable[..., float], path: tuple[Any, ...]
    ) -> SineCommand | TrapezoidCommand:
        where = ("sweep", joint)
        column = self._joint(joint, *path, *where)
        if sweep.sine is not None:
            sine, where = sweep.sine, (*where, "sine")
            return SineCommand(
                joint=column,
                amplitude=np.radians(number(sine.amplitude_deg, *where, "amplitude_deg")),
                frequency=number(sine.frequency_hz, *where, "frequency_hz", above=0.0),
                cycles=self._whole(number(sine.cycles, *where, "cycles", lowest=1.0), *path, *where, "cycles"),
                ramp_cycles=number(sine.ramp_cycles, *where, "ramp_cycles", lowest=0.5),
                phase=np.radians(number(sine.phase_deg, *where, "phase_deg")),
            )
        trapezoid, where = sweep.trapezoid, (*where, "trapezoid")
        assert trapezoid is not None  # Sweep holds one of the two
        return TrapezoidCommand(
            joint=column,
            amplitude=np.radians(number(trapezoid.amplitude_deg, *where, "amplitude_deg")),
            rate=np.radians(number(trapezoid.rate_deg_s, *where, "rate_deg_s", above=0.0)),
            cycles=self._whole(number(trapezoid.cycles, *where, "cycles", lowest=1.0), *path, *where, "cycles"),
            hold=number(trapezoid.hold_s, *where, "hold_s", lowest=0.0),
        )

    def _whole(self, value: float, *where: Any) -> int:
        if value != round(value) or value > 10_000:
            raise self._error(f"{value:g} must be a whole number up to 10000", *where)
        return int(value)

    def _joint(self, name: str, *where: Any) -> int:
        if name not in self.robot.joint_names:
            raise self._error(str(NotFoundError(f"joint of {self.robot.name}", name, self.robot.joint_names)), *where)
        return self.robot.joint_names.index(name)

    def _error(self, message: str, *where: Any) -> FileProblems:
        return self.protocol.document.problem(message, *where)
