"""Faults of the emulated Universal Robots controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from testbench.emulation.faults import Scenario, ScheduledFault

FAULTS = {
    "protective_stop": "the arm stops hard and the program pauses",
    "emergency_stop": "the arm stops hard and the program ends",
    "power_off": "the arm stops and its power is cut",
    "disconnect": "all connections are cut and none is accepted for value seconds (default: until cleared)",
    "rtde_delay": "RTDE packages arrive value seconds late",
    "rtde_loss": "this share of the RTDE packages is not sent (value 0 to 1)",
    "clock_step": "the time stamps jump by value seconds; they fall behind where it is negative",
    "rtde_silence": "no RTDE package is sent any more, the connection stays open",
    "slow_response": "dashboard and script answer value seconds late",
    "slider": "the speed slider stands at value (0 to 1)",
    "local_control": "the robot is taken out of remote control",
    "program_stop": "the running program ends, as if somebody had pressed stop",
}
"""What can be asked for, with its meaning."""


class UrFault(ScheduledFault):
    """A fault of a scenario."""

    known: ClassVar[Mapping[str, str]] = FAULTS


class UrScenario(Scenario):
    """The content of a scenario file."""

    faults: list[UrFault] = Field(max_length=1000)
