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
from testbench.records.specs.protocol_steps import Motion, Role, Section, Step, Sweep
from testbench.records.specs.robot import Robot

MOST_COMMANDS = 100_000
LONGEST_DURATION_S = 24 * 3600.0
LONGEST_SWEEP_S = 3600.0
LARGEST_ANGLE_DEG = 36_000.0
"""A hundred turns: beyond it a joint without limits is not meant."""
HIGHEST_FREQUENCY_HZ = 20.0
MOST_CYCLES = 10_000


_ANGLE: dict[str, float] = {"lowest": -LARGEST_ANGLE_DEG, "highest": LARGEST_ANGLE_DEG}


@dataclass(frozen=True)
class SineCommand:
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
class FourierCommand:
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
        where: tuple[Any, ...] = (
            "sweep",
            joint,
            "sine" if sweep.sine else "fourier" if sweep.fourier else "trapezoid",
        )
        column = self._joint(joint, *path, *where[:2])

        def whole(expression: float | str, key: str) -> int:
            value = number(expression, *where, key, lowest=1.0, highest=MOST_CYCLES)
            if value != round(value):
                raise self._error(f"{value:g} must be a whole number", *path, *where, key)
            return int(value)

        def last(seconds: float) -> None:
            if seconds > LONGEST_SWEEP_S:
                raise self._error(
                    f"the sweep would last {seconds:.6g} s, more than the {LONGEST_SWEEP_S:g} s "
                    "allowed",
                    *path,
                    *where,
                )

        if sweep.sine is not None:
            sine = sweep.sine
            command = SineCommand(
                joint=column,
                amplitude=np.radians(number(sine.amplitude_deg, *where, "amplitude_deg", **_ANGLE)),
                frequency=number(
                    sine.frequency_hz,
                    *where,
                    "frequency_hz",
                    above=0.0,
                    highest=HIGHEST_FREQUENCY_HZ,
                ),
                cycles=whole(sine.cycles, "cycles"),
                ramp_cycles=number(
                    sine.ramp_cycles, *where, "ramp_cycles", lowest=0.5, highest=MOST_CYCLES
                ),
                phase=np.radians(number(sine.phase_deg, *where, "phase_deg", **_ANGLE)),
            )
            last((command.cycles + 2 * command.ramp_cycles) / command.frequency)
            return command
        if sweep.fourier is not None:
            series = sweep.fourier
            angles = [
                [
                    np.radians(number(value, *where, key, k, **_ANGLE))
                    for k, value in enumerate(getattr(series, key))
                ]
                for key in ("amplitudes_deg", "phases_deg")
            ]
            highest = HIGHEST_FREQUENCY_HZ / len(angles[0])
            sum_of_harmonics = FourierCommand(
                joint=column,
                amplitudes=tuple(angles[0]),
                phases=tuple(angles[1]),
                frequency=number(
                    series.frequency_hz, *where, "frequency_hz", above=0.0, highest=highest
                ),
                cycles=whole(series.cycles, "cycles"),
                ramp_cycles=number(
                    series.ramp_cycles, *where, "ramp_cycles", lowest=0.5, highest=MOST_CYCLES
                ),
            )
            last(
                (sum_of_harmonics.cycles + 2 * sum_of_harmonics.ramp_cycles)
                / sum_of_harmonics.frequency
            )
            return sum_of_harmonics
        assert sweep.trapezoid is not None  # Sweep holds one of the three
        trapezoid = sweep.trapezoid
        there_and_back = TrapezoidCommand(
            joint=column,
            amplitude=np.radians(
                number(trapezoid.amplitude_deg, *where, "amplitude_deg", **_ANGLE)
            ),
            rate=np.radians(
                number(
                    trapezoid.rate_deg_s, *where, "rate_deg_s", above=0.0, highest=LARGEST_ANGLE_DEG
                )
            ),
            cycles=whole(trapezoid.cycles, "cycles"),
            hold=number(trapezoid.hold_s, *where, "hold_s", lowest=0.0),
        )
        rise = (
            abs(there_and_back.amplitude) / there_and_back.rate if there_and_back.rate else math.inf
        )
        last(2 * there_and_back.cycles * (rise + there_and_back.hold))
        return there_and_back

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
