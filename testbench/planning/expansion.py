"""Unroll a protocol: loops, includes and expressions become a flat list of commands."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from testbench.exceptions import ExpressionError, FileProblems, NotFoundError
from testbench.planning.expressions import UnknownVariable, evaluate_expression
from testbench.records.specs.protocol import Protocol
from testbench.records.specs.protocol_steps import (
    Fourier,
    Motion,
    Role,
    Section,
    Sine,
    Step,
    Sweep,
    Trapezoid,
)
from testbench.records.specs.robot import Robot

MOST_COMMANDS = 100_000
LONGEST_DURATION_S = 24 * 3600.0
LARGEST_ANGLE_DEG = 36_000.0
"""A hundred turns: beyond it a joint without limits is not meant."""
HIGHEST_FREQUENCY_HZ = 20.0
MOST_CYCLES = 10_000


_ANGLE: dict[str, float] = {"lowest": -LARGEST_ANGLE_DEG, "highest": LARGEST_ANGLE_DEG}


class _Faded:
    """A periodic sweep that begins and ends at rest."""

    frequency: float
    cycles: float
    ramp_cycles: float

    @property
    def duration(self) -> float:
        """With both fades [s]."""
        return (self.cycles + 2 * self.ramp_cycles) / self.frequency


@dataclass(frozen=True)
class SineCommand(_Faded):
    """Numbers of a sine sweep of one joint.

    Attributes:
        joint: Index of the joint.
        amplitude: Of the sine [rad].
        frequency: Of the sine [Hz].
        cycles: How many at full amplitude.
        ramp_cycles: Length of the fade before and of that after them [cycles].
        phase: At the beginning [rad].
    """

    joint: int
    amplitude: float
    frequency: float
    cycles: float
    ramp_cycles: float
    phase: float


@dataclass(frozen=True)
class FourierCommand(_Faded):
    """Numbers of a Fourier sweep of one joint.

    Attributes:
        joint: Index of the joint.
        amplitudes: Of the harmonics, that of the base frequency first [rad].
        phases: Of the harmonics at the beginning [rad].
        frequency: The base frequency [Hz].
        cycles: How many of the base frequency at full amplitude.
        ramp_cycles: Length of the fade before and of that after them [cycles].
    """

    joint: int
    amplitudes: tuple[float, ...]
    phases: tuple[float, ...]
    frequency: float
    cycles: float
    ramp_cycles: float


@dataclass(frozen=True)
class TrapezoidCommand:
    """Numbers of a trapezoid sweep of one joint.

    Attributes:
        joint: Index of the joint.
        amplitude: Farthest from the middle [rad].
        rate: Of the flanks [rad/s].
        cycles: How many.
        hold: Length of each plateau [s].
    """

    joint: int
    amplitude: float
    rate: float
    cycles: int
    hold: float

    @property
    def duration(self) -> float:
        """Of all cycles; infinite for a rate that vanishes in radians [s]."""
        rise = abs(self.amplitude) / self.rate if self.rate else math.inf
        return 2 * self.cycles * (rise + self.hold)


@dataclass(frozen=True)
class Command:
    """One step with all its numbers.

    Attributes:
        section: Name of its section.
        role: Of its section.
        name: Of the step, or empty.
        variables: Values of the protocol's variables in this step, by name.
        target: Joint angles to move to, shape (n_joints,) [rad]; NaN where a joint stays; None for
            no move.
        sweeps: Motion of the joints that sweep.
        dwell: How long the arm then stands still [s].
        motion: Scaling of the limits.
        protocol: Its document, for error messages.
        path: Its place in the document, for error messages.
    """

    section: str
    role: Role
    name: str
    variables: dict[str, float]
    target: np.ndarray | None
    sweeps: tuple[SineCommand | FourierCommand | TrapezoidCommand, ...]
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
        FileProblems: An expression, joint name or number of joint angles is wrong, or the protocol
            is too large.
    """
    commands: list[Command] = []
    for command in _expand_protocol(protocol, robot):
        commands.append(command)
        if len(commands) > MOST_COMMANDS:
            raise protocol.document.problem(
                f"the protocol has more than {MOST_COMMANDS} steps", "sections"
            )
    return commands


def _expand_protocol(
    protocol: Protocol, robot: Robot, including: Section | None = None
) -> Iterator[Command]:
    """The commands of a protocol.

    Those of an included one bear the name, role and motion of the section that includes it.
    """
    values = {name: protocol.spec.values(name) for name in protocol.spec.variables}
    for i, section in enumerate(protocol.spec.sections):
        if including is not None:
            name, role, motion = including.name, including.role, including.motion or section.motion
        else:
            name, role, motion = section.name, section.role, section.motion
        acting = section.model_copy(update={"name": name, "role": role, "motion": motion})
        if section.include is not None:
            yield from _expand_protocol(protocol.included[section.include], robot, acting)
        else:
            yield from _Expander(protocol, robot, acting, values).expand(i)


class _Expander:
    """Unrolls the steps of one section."""

    def __init__(
        self, protocol: Protocol, robot: Robot, section: Section, values: dict[str, list[float]]
    ):
        self.protocol, self.robot, self.section, self.values = protocol, robot, section, values
        self.constants = {name: several[0] for name, several in values.items() if len(several) == 1}

    def expand(self, index: int) -> Iterator[Command]:
        """The commands of the section, which is number `index` of its file."""
        steps = self.section.steps or []
        motion = self.section.motion or self.protocol.spec.motion
        yield from self._loop(
            self.section.for_each, steps, self.constants, {}, motion, ("sections", index, "steps")
        )

    def _loop(
        self,
        loop: list[str],
        steps: list[Step],
        variables: dict[str, float],
        shown: dict[str, float],
        motion: Motion,
        path: tuple[Any, ...],
    ) -> Iterator[Command]:
        values = [self.values[name] for name in loop]
        if math.prod(len(several) for several in values) * len(steps) > MOST_COMMANDS:
            raise self._error(
                f"the loop over {', '.join(loop)} repeats its steps more than {MOST_COMMANDS} "
                "times",
                *path,
            )
        for combination in itertools.product(*values):
            looped = dict(zip(loop, combination, strict=True))
            for k, step in enumerate(steps):
                inner = step.motion or motion
                here, all_shown = variables | looped, shown | looped
                if step.steps is not None:
                    yield from self._loop(
                        step.for_each or [], step.steps, here, all_shown, inner, (*path, k, "steps")
                    )
                else:
                    yield self._command(step, here, all_shown, inner, (*path, k))

    def _command(
        self,
        step: Step,
        variables: dict[str, float],
        shown: dict[str, float],
        motion: Motion,
        path: tuple[Any, ...],
    ) -> Command:
        def number(
            expression: float | str | None,
            *where: Any,
            lowest: float | None = None,
            above: float | None = None,
            highest: float | None = None,
        ) -> float:
            value = self._evaluate(
                expression if expression is not None else 0.0, variables, *path, *where
            )
            shown = (
                f"{value:g}"
                if not isinstance(expression, str)
                else f"'{expression}' is {value:g}; it"
            )
            if lowest is not None and value < lowest:
                raise self._error(f"{shown} must be at least {lowest:g}", *path, *where)
            if above is not None and value <= above:
                raise self._error(f"{shown} must be greater than {above:g}", *path, *where)
            if highest is not None and value > highest:
                raise self._error(f"{shown} must be at most {highest:g}", *path, *where)
            return value

        target = self._target(step, number, path)
        sweeps = tuple(
            self._sweep(joint, sweep, number, path) for joint, sweep in (step.sweep or {}).items()
        )
        dwell = number(step.dwell_s, "dwell_s", lowest=0.0, highest=LONGEST_DURATION_S)
        name = step.name or ", ".join(
            [self.section.name, *[f"{key} {value:g}" for key, value in shown.items()]]
        )
        role = self.section.role
        return Command(
            self.section.name, role, name, shown, target, sweeps, dwell, motion, self.protocol, path
        )

    def _target(
        self, step: Step, number: Callable[..., float], path: tuple[Any, ...]
    ) -> np.ndarray | None:
        if step.move_to == "home":
            return self.robot.home
        names = self.robot.joint_names
        if isinstance(step.move_to_deg, list):
            if len(step.move_to_deg) != len(names):
                message = (
                    f"{len(step.move_to_deg)} joint angles given; {self.robot.name} has "
                    f"{len(names)}: {', '.join(names)}"
                )
                raise self._error(message, *path, "move_to_deg")
            return np.radians(
                [
                    number(value, "move_to_deg", i, **_ANGLE)
                    for i, value in enumerate(step.move_to_deg)
                ]
            )
        if step.move_to_deg is not None:
            target = np.full(len(names), np.nan)
            for name, value in step.move_to_deg.items():
                where = ("move_to_deg", name)
                target[self._joint(name, *path, *where)] = np.radians(
                    number(value, *where, **_ANGLE)
                )
            return target
        return None

    def _sweep(
        self, joint: str, sweep: Sweep, number: Callable[..., float], path: tuple[Any, ...]
    ) -> SineCommand | FourierCommand | TrapezoidCommand:
        """The one of three motions that a sweep is."""
        kind = "sine" if sweep.sine else "fourier" if sweep.fourier else "trapezoid"
        where = ("sweep", joint, kind)
        column = self._joint(joint, *path, *where[:2])

        def value(expression: float | str | None, *key: Any, **limits: float) -> float:
            return number(expression, *where, *key, **limits)

        def cycles(expression: float | str) -> int:
            count = value(expression, "cycles", lowest=1.0, highest=MOST_CYCLES)
            if count != round(count):
                raise self._error(f"{count:g} must be a whole number", *path, *where, "cycles")
            return int(count)

        command: SineCommand | FourierCommand | TrapezoidCommand
        if sweep.sine is not None:
            command = _sine(column, sweep.sine, value, cycles)
        elif sweep.fourier is not None:
            command = _fourier(column, sweep.fourier, value, cycles)
        else:
            assert sweep.trapezoid is not None  # Sweep holds one of the three
            command = _trapezoid(column, sweep.trapezoid, value, cycles)
        if command.duration > LONGEST_DURATION_S:
            raise self._error(
                f"the sweep would last {command.duration:.6g} s, more than the "
                f"{LONGEST_DURATION_S:g} s allowed",
                *path,
                *where,
            )
        return command

    def _evaluate(self, expression: float | str, variables: dict[str, float], *where: Any) -> float:
        try:
            return evaluate_expression(expression, variables)
        except UnknownVariable as error:
            count = len(self.values.get(error.name, []))
            message = (
                f"the variable '{error.name}' has {count} values; name it in a for_each around "
                "this step"
            )
            raise self._error(message if count else str(error), *where) from None
        except ExpressionError as error:
            raise self._error(str(error), *where) from None

    def _joint(self, name: str, *where: Any) -> int:
        if name not in self.robot.joint_names:
            raise self._error(
                str(NotFoundError(f"joint of {self.robot.name}", name, self.robot.joint_names)),
                *where,
            )
        return self.robot.joint_names.index(name)

    def _error(self, message: str, *where: Any) -> FileProblems:
        return self.protocol.document.problem(message, *where)


def _sine(
    joint: int, sine: Sine, value: Callable[..., float], cycles: Callable[[float | str], int]
) -> SineCommand:
    return SineCommand(
        joint,
        np.radians(value(sine.amplitude_deg, "amplitude_deg", **_ANGLE)),
        value(sine.frequency_hz, "frequency_hz", above=0.0, highest=HIGHEST_FREQUENCY_HZ),
        cycles(sine.cycles),
        value(sine.ramp_cycles, "ramp_cycles", lowest=0.5, highest=MOST_CYCLES),
        np.radians(value(sine.phase_deg, "phase_deg", **_ANGLE)),
    )


def _fourier(
    joint: int, series: Fourier, value: Callable[..., float], cycles: Callable[[float | str], int]
) -> FourierCommand:
    amplitudes, phases = (
        tuple(
            np.radians(value(angle, key, k, **_ANGLE))
            for k, angle in enumerate(getattr(series, key))
        )
        for key in ("amplitudes_deg", "phases_deg")
    )
    highest = HIGHEST_FREQUENCY_HZ / len(amplitudes)
    return FourierCommand(
        joint,
        amplitudes,
        phases,
        value(series.frequency_hz, "frequency_hz", above=0.0, highest=highest),
        cycles(series.cycles),
        value(series.ramp_cycles, "ramp_cycles", lowest=0.5, highest=MOST_CYCLES),
    )


def _trapezoid(
    joint: int,
    trapezoid: Trapezoid,
    value: Callable[..., float],
    cycles: Callable[[float | str], int],
) -> TrapezoidCommand:
    return TrapezoidCommand(
        joint,
        np.radians(value(trapezoid.amplitude_deg, "amplitude_deg", **_ANGLE)),
        np.radians(value(trapezoid.rate_deg_s, "rate_deg_s", above=0.0, highest=LARGEST_ANGLE_DEG)),
        cycles(trapezoid.cycles),
        value(trapezoid.hold_s, "hold_s", lowest=0.0),
    )
