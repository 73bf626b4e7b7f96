"""Faults of the emulated xArm controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from testbench.emulation.faults import FaultKind, Scenario, ScheduledFault

FAULTS = {
    "protective_stop": FaultKind("the controller finds a collision (error 31) and stops the arm"),
    "emergency_stop": FaultKind(
        "the stop button is pressed (error 1): the arm stops and its motors are switched off"
    ),
    "power_off": FaultKind("the motors are switched off"),
    "servo_error": FaultKind("the motor of joint 1 fails (error 11)"),
    "program_stop": FaultKind(
        "the arm is stopped, as if somebody had pressed stop in the maker's program"
    ),
    "disconnect": FaultKind(
        "all connections are cut and none is accepted for value seconds (default: until cleared)",
        "seconds",
    ),
    "report_delay": FaultKind("reports arrive value seconds late", "seconds"),
    "report_loss": FaultKind("this share of the reports is not sent (value 0 to 1)", "share"),
    "clock_step": FaultKind(
        "the time stamps jump by value seconds; they fall behind where it is negative", "step"
    ),
    "report_silence": FaultKind("no report is sent any more, the connections stay open"),
    "payload": FaultKind(
        "the controller goes by another weight of the tool than it was told (value in kg)", "mass"
    ),
    "slow_response": FaultKind("commands are answered value seconds late", "seconds"),
}
"""What can be asked for, with its meaning and its value."""


class XArmFault(ScheduledFault):
    """A fault of a scenario."""

    known: ClassVar[Mapping[str, FaultKind]] = FAULTS


class XArmScenario(Scenario):
    """The content of a scenario file."""

    faults: list[XArmFault] = Field(max_length=1000)
