"""Faults of the emulated Universal Robots controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from testbench.emulation.faults import FaultKind, Scenario, ScheduledFault

FAULTS = {
    "protective_stop": FaultKind("the arm stops hard and the program pauses"),
    "emergency_stop": FaultKind("the arm stops hard and the program ends"),
    "power_off": FaultKind("the arm stops and its power is cut"),
    "disconnect": FaultKind(
        "all connections are cut and none is accepted for value seconds (default: until cleared)",
        "seconds",
    ),
    "rtde_delay": FaultKind("RTDE packages arrive value seconds late", "seconds"),
    "rtde_loss": FaultKind("this share of the RTDE packages is not sent (value 0 to 1)", "share"),
    "clock_step": FaultKind(
        "the time stamps jump by value seconds; they fall behind where it is negative", "step"
    ),
    "rtde_silence": FaultKind("no RTDE package is sent any more, the connection stays open"),
    "slow_response": FaultKind("dashboard and script answer value seconds late", "seconds"),
    "slider": FaultKind("the speed slider stands at value (0 to 1)", "share"),
    "payload": FaultKind(
        "the controller goes by another weight of the tool than it was told (value in kg)", "mass"
    ),
    "local_control": FaultKind("the robot is taken out of remote control"),
    "program_stop": FaultKind("the running program ends, as if somebody had pressed stop"),
}
"""What can be asked for, with its meaning and its value."""


class UrFault(ScheduledFault):
    """A fault of a scenario."""

    known: ClassVar[Mapping[str, FaultKind]] = FAULTS


class UrScenario(Scenario):
    """The content of a scenario file."""

    faults: list[UrFault] = Field(max_length=1000)
