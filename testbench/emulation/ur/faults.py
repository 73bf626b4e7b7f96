"""Faults of the emulated controller, on command or from a scenario file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from testbench.exceptions import InputError
from testbench.records.strict import StrictModel
from testbench.records.yaml_file import load_yaml

FAULTS = {
    "protective_stop": "the arm stops hard and the program pauses",
    "emergency_stop": "the arm stops hard and the program ends",
    "power_off": "the arm stops and its power is cut",
    "disconnect": "all connections are cut and none is accepted for value seconds (default: until cleared)",
    "rtde_delay": "RTDE packages arrive value seconds late",
    "rtde_loss": "this share of the RTDE packages is not sent (value 0 to 1)",
    "rtde_silence": "no RTDE package is sent any more, the connection stays open",
    "slow_response": "dashboard and script answer value seconds late",
    "slider": "the speed slider stands at value (0 to 1)",
    "local_control": "the robot is taken out of remote control",
    "program_stop": "the running program ends, as if somebody had pressed stop",
}
"""What can be asked for, with its meaning."""


@dataclass
class Faults:
    """Lasting disturbances; those that happen once act on the controller at once."""

    rtde_delay_s: float = 0.0
    rtde_loss: float = 0.0
    rtde_silent: bool = False
    response_delay_s: float = 0.0
    disconnected_until: float = 0.0


class ScheduledFault(StrictModel):
    """A fault of a scenario."""

    fault: str = Field(description="Its name.")
    value: float | None = Field(default=None, description="Its size, where it has one.")
    at_s: Annotated[float, Field(ge=0)] | None = Field(default=None, description="Time after the emulator's start [s].")
    moving_s: Annotated[float, Field(ge=0)] | None = Field(
        default=None, description="Time during which the arm has moved since the start [s]."
    )
    for_s: Annotated[float, Field(gt=0)] | None = Field(default=None, description="Cleared again after this long [s].")

    @model_validator(mode="after")
    def _known(self) -> ScheduledFault:
        if self.fault not in FAULTS:
            raise ValueError(f"unknown fault '{self.fault}'; known: {', '.join(FAULTS)}")
        if (self.at_s is None) == (self.moving_s is None):
            raise ValueError("a fault needs either at_s or moving_s")
        return self


class Scenario(StrictModel):
    """The content of a scenario file."""

    faults: list[ScheduledFault] = Field(max_length=1000)


def load_scenario(path: Path) -> Scenario:
    """Read a scenario.

    Raises:
        InputError: The file is missing or malformed.
    """
    if not path.is_file():
        raise InputError(f"scenario file {path} does not exist")
    return load_yaml(path, Scenario).value


def parse_command(text: str) -> tuple[str, str, float | None]:
    """A line of the control port in parts: verb ("fault", "clear", "status", "quit"), name and value.

    Raises:
        InputError: It is none of these.
    """
    words = text.split()
    usage = "say: fault NAME [VALUE], clear, status or quit"
    if not words or words[0] not in {"fault", "clear", "status", "quit"} or len(words) > 3:
        raise InputError(usage)
    if words[0] != "fault":
        return words[0], "", None
    if len(words) < 2 or words[1] not in FAULTS:
        raise InputError(f"{usage}; faults: {', '.join(FAULTS)}")
    try:
        value = float(words[2]) if len(words) == 3 else None
    except ValueError:
        raise InputError(f"the value '{words[2]}' is no number") from None
    return "fault", words[1], value
