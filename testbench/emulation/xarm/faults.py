"""Faults of the emulated xArm controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from testbench.emulation.faults import Scenario, ScheduledFault

FAULTS = {
    "protective_stop": "the controller finds a collision (error 31) and stops the arm",
    "emergency_stop": "the stop button is pressed (error 1): the arm stops and its motors are switched off",
    "power_off": "the motors are switched off",
    "servo_error": "the motor of joint 1 fails (error 11)",
    "program_stop": "the arm is stopped, as if somebody had pressed stop in the maker's program",
    "disconnect": "all connections are cut and none is accepted for value seconds (default: until cleared)",
    "report_delay": "reports arrive value seconds late",
    "report_loss": "this share of the reports is not sent (value 0 to 1)",
    "clock_step": "the time stamps jump by value seconds; they fall behind where it is negative",
    "report_silence": "no report is sent any more, the connections stay open",
    "slow_response": "commands are answered value seconds late",
}
"""What can be asked for, with its meaning."""


class XArmFault(ScheduledFault):
    """A fault of a scenario."""

    known: ClassVar[Mapping[str, str]] = FAULTS


class XArmScenario(Scenario):
    """The content of a scenario file."""

    faults: list[XArmFault] = Field(max_length=1000)
