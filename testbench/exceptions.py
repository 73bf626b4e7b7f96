"""The one tree of errors: bad input and a bad bench; a bad sensor is a verdict, not an error.

Every error is a full sentence, carries its numbers as attributes, and knows the exit code of the
command line.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


class BenchError(Exception):
    """Something went wrong on the bench; the base of every error raised on purpose.

    Attributes:
        session: What was recorded until then, if anything was. What helps a person to go on is in
            the notes of the exception (`add_note`), a sentence each.
    """

    exit_code = 3
    session: object = None

    def __reduce__(self) -> tuple[object, ...]:
        """How another process gets it: by its sentence, for its own arguments are not kept."""
        return _again, (type(self), self.args, self.__dict__)


def _again(
    kind: type[BenchError], args: tuple[object, ...], state: dict[str, object]
) -> BenchError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class InputError(BenchError):
    """The user's input was refused before anything moved."""

    exit_code = 2


class NotFoundError(InputError):
    """A name is unknown; the message lists the names that exist."""

    def __init__(self, kind: str, name: str, existing: list[str]):
        self.kind, self.name, self.existing = kind, name, existing
        listing = ", ".join(existing) if existing else "none"
        super().__init__(f"unknown {kind} '{name}'; known: {listing}")


@dataclass(frozen=True)
class Problem:
    """One fault of an input file, with the place a person finds it at (line and column from 1)."""

    message: str
    path: str = ""
    line: int | None = None
    column: int | None = None


def one_line(text: str) -> str:
    """The text with every character that would break or colour a line escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class FileProblems(InputError):
    """An input file was refused.

    Lists every problem found in it at once as `file:line:column: path: message`.
    """

    def __init__(self, file: str | Path, problems: list[Problem]):
        self.file, self.problems = str(file), problems
        super().__init__("\n".join(self._sentence(problem) for problem in problems))

    def _sentence(self, problem: Problem) -> str:
        place = self.file
        if problem.line is not None:
            place += f":{problem.line}" + (
                f":{problem.column}" if problem.column is not None else ""
            )
        return ": ".join(part for part in (place, problem.path, problem.message) if part)


MOST_DIGITS = 9


def _apart(value: float, limit: float, digits: int) -> tuple[str, str]:
    """Two numbers with as many digits after the point, at least `digits`, as tell them apart."""
    while (
        digits < MOST_DIGITS and value != limit and f"{value:.{digits}f}" == f"{limit:.{digits}f}"
    ):
        digits += 1
    return f"{value:.{digits}f}", f"{limit:.{digits}f}"


class ExpressionError(InputError):
    """An arithmetic expression of a protocol cannot be read or evaluated."""


class PlanError(InputError):
    """A plan breaks a rule and is refused before anything moves.

    Attributes:
        place: `file:line` of the protocol step at fault, put in front of the sentence once it is
            known.
        doubts: What the protocol may have meant instead, put behind it.
    """

    place: str = ""
    doubts: tuple[str, ...] = ()

    def __str__(self) -> str:
        sentence = "; ".join([super().__str__(), *self.doubts])
        return f"{self.place}: {sentence}" if self.place else sentence


@dataclass(frozen=True)
class Excess:
    """A joint beyond one of its limits.

    Attributes:
        joint: Joint name.
        quantity: "position", "velocity" or "acceleration".
        value: What is reached when the limit is first exceeded [unit].
        limit: The limit [unit].
        unit: Of the numbers, such as "deg/s".
        time: When the limit is first exceeded [s], from the start of the plan.
        step: Name of the step.
        onwards: The farthest from the limit that the joint goes after that in the same step
            [unit].
    """

    joint: str
    quantity: str
    value: float
    limit: float
    unit: str
    time: float
    step: str
    onwards: float


class LimitError(PlanError):
    """A joint would exceed one of its limits.

    Attributes:
        joint: Joint name.
        quantity: "position", "velocity" or "acceleration".
        value: What is reached when the limit is first exceeded [unit].
        limit: The limit [unit].
        unit: Of the numbers, such as "deg/s".
        time: When the limit is first exceeded [s], from the start of the plan.
        step: Name of the step.
        onwards: The farthest from the limit that the joint goes after that in the same step
            [unit].
    """

    def __init__(self, excess: Excess):
        self.joint, self.quantity, self.unit = excess.joint, excess.quantity, excess.unit
        self.value, self.limit, self.onwards = excess.value, excess.limit, excess.onwards
        self.time, self.step = excess.time, excess.step
        shown, bound = _apart(excess.value, excess.limit, 2)
        farthest, _ = _apart(excess.onwards, excess.limit, 2)
        super().__init__(
            f"joint {excess.joint}: {excess.quantity} {shown} {excess.unit} exceeds "
            f"{bound} {excess.unit} at t = {excess.time:.3f} s (step '{excess.step}'), "
            f"and goes on to {farthest} {excess.unit}"
        )


@dataclass(frozen=True)
class Contact:
    """Two bodies too near to each other.

    Attributes:
        first: One body.
        second: The other body.
        clearance: Distance between them [m], negative where they overlap.
        time: When [s], from the start of the plan.
        step: Name of the step.
    """

    first: str
    second: str
    clearance: float
    time: float
    step: str


class CollisionError(PlanError):
    """Two bodies would touch.

    Attributes:
        first: One body of the first contact.
        second: The other body of the first contact.
        clearance: Distance between them [m], negative where they overlap.
        time: When they first come too near [s], from the start of the plan.
        step: Name of the step of the first contact.
        margin: Clearance that must be kept [m].
        worst: The nearest that any two bodies come in the whole motion.
    """

    def __init__(self, contact: Contact, margin: float, worst: Contact):
        self.first, self.second, self.clearance, self.margin = (
            contact.first,
            contact.second,
            contact.clearance,
            margin,
        )
        self.time, self.step, self.worst = contact.time, contact.step, worst
        clearance, least = _apart(1e3 * contact.clearance, 1e3 * margin, 1)
        what = (
            "collide"
            if contact.clearance <= 0
            else f"come within {clearance} mm (margin {least} mm)"
        )
        sentence = (
            f"{contact.first} and {contact.second} {what} at t = {contact.time:.3f} s "
            f"(step '{contact.step}')"
        )
        if worst.clearance < contact.clearance:
            depth = f"{_apart(1e3 * abs(worst.clearance), 1e3 * abs(contact.clearance), 1)[0]} mm"
            how = f"overlap by {depth}" if worst.clearance < 0 else f"come within {depth}"
            same = {worst.first, worst.second} == {contact.first, contact.second}
            who = "they" if same else f"{worst.first} and {worst.second}"
            sentence += f"; at worst {who} {how}, at t = {worst.time:.3f} s (step '{worst.step}')"
        super().__init__(sentence)


class SensorRangeError(PlanError):
    """The motion would saturate a sensor."""

    def __init__(
        self,
        sensor: str,
        quantity: str,
        value: float,
        limit: float,
        unit: str,
        time: float,
        step: str,
    ):
        self.sensor, self.quantity, self.value, self.limit = sensor, quantity, value, limit
        self.unit, self.time, self.step = unit, time, step
        shown, bound = _apart(value, limit, 2)
        super().__init__(
            f"sensor {sensor}: {quantity} {shown} {unit} exceeds its range of {bound} {unit} "
            f"at t = {time:.3f} s (step '{step}')"
        )


class SessionError(InputError):
    """A folder is not a session, or a session lacks what a stage needs."""


class StorageError(BenchError):
    """What was recorded cannot be written: a full disk, or one that is gone."""


class DriverError(BenchError):
    """An arm or a sensor failed while it was being used."""


class ArmRefused(InputError):
    """A real arm is in no state to be driven, and was refused before it moved."""


class ProgramError(BenchError):
    """A fault of the program itself, which nobody foresaw.

    Attributes:
        file: What happened, for a report; "" where it could not be written.
    """

    exit_code = 70  # EX_SOFTWARE of sysexits.h
    file: str = ""


class RunInterrupted(BenchError):
    """The operator stopped the run; what was recorded is kept in `session`."""

    exit_code = 130

    def __init__(self, message: str, session: object = None):
        self.session = session
        super().__init__(message)
