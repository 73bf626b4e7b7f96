"""What emulated controllers share: a clock of control periods, joints, and scenarios of faults."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from testbench.emulation.faults import Faults, Scenario, ScheduledFault
from testbench.emulation.joints import Joints
from testbench.records.specs.robot import Robot

AMPERE_PER_RAD_S2, AMPERE_PER_RAD_S = 0.2, 0.3
"""Currents grow with acceleration and speed by these factors: a stand-in, not a motor model."""
CLOCK_STEP_S = -0.4
"""How far the time stamps jump where nobody says [s]."""


class EmulatedController(ABC):
    """State of an emulated controller; `tick` advances it by a control period.

    Args:
        robot: The arm.
        identity: What the controller says of itself.
        q: Joint angles at the start, shape (n,) [rad]; the arm's home if None.
        seed: Of the encoders' noise.
        scenario: Faults to come.

    Attributes:
        period: Of the controller [s]; that of the robot file if None.
        messages: What happened, for whoever watches.
        heard_until: What clients sent later was not yet looked at [s]; a program must not take that
            for their silence.
    """

    period: ClassVar[float | None] = None

    def __init__(
        self,
        robot: Robot,
        identity: Any,
        q: np.ndarray | None = None,
        seed: int = 0,
        scenario: Scenario | None = None,
    ):
        self.robot, self.identity = robot, identity
        self.joints = Joints(robot, robot.home if q is None else q, seed, self.period)
        self.faults = Faults()
        self.scheduled: list[ScheduledFault] = list(scenario.faults) if scenario else []
        self.messages: list[str] = []
        self.ticks, self.moving_ticks = 0, 0
        self.heard_until = math.inf
        self._stamp_shift = 0.0
        self._to_clear: list[tuple[float, str]] = []
        self._rng = np.random.default_rng(seed + 1)
        self._switch_on()

    @abstractmethod
    def _switch_on(self) -> None:
        """Begin with the state of the vendor's controller."""

    @property
    def time(self) -> float:
        """Time since the controller was started [s], exact multiples of the control period."""
        return self.ticks * self.joints.period

    @property
    def stamp(self) -> float:
        """What its reports say of the time [s]."""
        return self.time + self._stamp_shift

    def step_clock(self, value: float | None) -> None:
        """Let the time stamps jump [s]; by default they fall behind."""
        self._stamp_shift += CLOCK_STEP_S if value is None else value

    @property
    def cut_off(self) -> bool:
        """Whether its connections are cut."""
        return self.time < self.faults.disconnected_until

    @property
    def currents(self) -> np.ndarray:
        """Of the joints' motors, shape (n,) [A]."""
        return (
            AMPERE_PER_RAD_S2 * self.joints.a_reference + AMPERE_PER_RAD_S * self.joints.v_measured
        )

    def tick(self) -> None:
        """Advance by one control period."""
        self.ticks += 1
        self._run_scenario()
        self._advance()
        self.moving_ticks += not self.joints.at_rest

    @abstractmethod
    def _advance(self) -> None:
        """Program, safety and joints of one control period."""

    @abstractmethod
    def fault(self, name: str, value: float | None = None) -> None:
        """Let a fault happen."""

    @abstractmethod
    def clear(self) -> None:
        """End every fault and make the arm ready."""

    @property
    @abstractmethod
    def state(self) -> str:
        """Modes and states in words without commas."""

    def status(self) -> str:
        """What the fault port answers."""
        rest = "at rest" if self.joints.steady else "moving"
        return f"{self.state}, {rest}, moved {self.moving_ticks} periods"

    def lost_package(self) -> bool:
        """Draw whether a report is lost."""
        return bool(self._rng.random() < self.faults.report_loss)

    def _run_scenario(self) -> None:
        period = self.joints.period
        for fault in list(self.scheduled):
            at = self.time if fault.at_s is not None else self.moving_ticks * period
            due = fault.at_s if fault.at_s is not None else fault.moving_s
            if due is not None and at >= due:
                self.scheduled.remove(fault)
                self.fault(fault.fault, fault.value)
                if fault.for_s is not None:
                    self._to_clear.append((self.time + fault.for_s, fault.fault))
        for entry in list(self._to_clear):
            if self.time >= entry[0]:
                self._to_clear.remove(entry)
                self.clear()
