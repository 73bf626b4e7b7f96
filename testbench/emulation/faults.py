"""Faults of emulated controllers, on command or from a scenario file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeVar

from pydantic import Field, model_validator

from testbench.exceptions import InputError
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.strict import StrictModel

VERBS = {"fault", "clear", "status", "clock", "quit"}
MOST_STEP_S = 60.0
"""Of the controller's clock."""


@dataclass(frozen=True)
class FaultKind:
    """A fault that can be asked for.

    Attributes:
        meaning: What happens.
        value: What its value is; None if it takes none.
    """

    meaning: str
    value: Literal["seconds", "share", "step", "mass"] | None = None

    def check(self, name: str, value: float | None) -> None:
        """Refuse a value that this fault cannot have; without one it has its usual size.

        Raises:
            InputError: It takes none, or another.
        """
        if value is None:
            return
        if self.value is None:
            raise InputError(f"the fault {name} takes no value")
        if self.value == "share" and not 0 <= value <= 1:
            raise InputError(f"the value of {name} must be a share from 0 to 1, not {value:g}")
        if self.value == "seconds" and not 0 <= value < math.inf:
            raise InputError(
                f"the value of {name} must be a number of seconds, 0 or more, not {value:g}"
            )
        if self.value == "mass" and not 0 <= value < math.inf:
            raise InputError(f"the value of {name} must be a mass in kg, 0 or more, not {value:g}")
        if self.value == "step" and not abs(value) <= MOST_STEP_S:
            raise InputError(
                f"the value of {name} must be a number of seconds from -{MOST_STEP_S:g} to "
                f"{MOST_STEP_S:g}, not {value:g}"
            )


@dataclass
class Faults:
    """Lasting disturbances; those that happen once act on the controller at once."""

    report_delay_s: float = 0.0
    report_loss: float = 0.0
    report_silent: bool = False
    response_delay_s: float = 0.0
    disconnected_until: float = 0.0
    payload_kg: float | None = None

    def strike(self, name: str, value: float | None, now: float) -> bool:
        """Let a disturbance begin.

        Args:
            name: disconnect, delay, loss or silence (of reports), slow_response, payload.
            value: Its size; a usual one if None.
            now: The controller's time [s].

        Returns:
            Whether it is one of these.
        """
        if name == "disconnect":
            self.disconnected_until = now + (math.inf if value is None else value)
        elif name == "delay":
            self.report_delay_s = 0.2 if value is None else value
        elif name == "loss":
            self.report_loss = 0.5 if value is None else value
        elif name == "silence":
            self.report_silent = True
        elif name == "slow_response":
            self.response_delay_s = 1.0 if value is None else value
        elif name == "payload":
            self.payload_kg = 1.0 if value is None else value
        else:
            return False
        return True


class ScheduledFault(StrictModel):
    """A fault of a scenario."""

    known: ClassVar[Mapping[str, FaultKind]] = {}

    fault: str = Field(description="Its name.")
    value: float | None = Field(default=None, description="Its size, where it has one.")
    at_s: Annotated[float, Field(ge=0)] | None = Field(
        default=None, description="Time after the emulator's start [s]."
    )
    moving_s: Annotated[float, Field(ge=0)] | None = Field(
        default=None, description="Time during which the arm has moved since the start [s]."
    )
    for_s: Annotated[float, Field(gt=0)] | None = Field(
        default=None, description="Cleared again after this long [s]."
    )

    @model_validator(mode="after")
    def _known(self) -> ScheduledFault:
        if self.fault not in self.known:
            raise ValueError(f"unknown fault '{self.fault}'; known: {', '.join(self.known)}")
        if (self.at_s is None) == (self.moving_s is None):
            raise ValueError("a fault needs either at_s or moving_s")
        try:
            self.known[self.fault].check(self.fault, self.value)
        except InputError as error:
            raise ValueError(str(error)) from None
        return self


class Scenario(StrictModel):
    """The content of a scenario file; each maker's emulator has its own kind of fault."""

    faults: Sequence[ScheduledFault]


AnyScenario = TypeVar("AnyScenario", bound=Scenario)


def load_scenario(path: Path, kind: type[AnyScenario]) -> AnyScenario:
    """Read a scenario.

    Raises:
        InputError: The file is missing or malformed.
    """
    if not path.is_file():
        raise InputError(f"scenario file {path} does not exist")
    return load_yaml(path, kind).value


def parse_command(text: str, known: Mapping[str, FaultKind]) -> tuple[str, str, float | None]:
    """Verb (one of `VERBS`), name and value of a line of the control port.

    Args:
        text: The line.
        known: Faults that there are.

    Raises:
        InputError: It is none of these, or the fault cannot have the value.
    """
    words = text.split()
    usage = "say: fault NAME [VALUE], clear, status, clock or quit"
    if not words or words[0] not in VERBS or len(words) > 3:
        raise InputError(usage)
    if words[0] != "fault":
        return words[0], "", None
    if len(words) < 2 or words[1] not in known:
        raise InputError(f"{usage}; faults: {', '.join(known)}")
    try:
        value = float(words[2]) if len(words) == 3 else None
    except ValueError:
        raise InputError(f"the value '{words[2]}' is no number") from None
    known[words[1]].check(words[1], value)
    return "fault", words[1], value
