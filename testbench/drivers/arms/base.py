"""What the bench asks of an arm, simulated or real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from testbench.drivers.arms.entry import ArmEntry
from testbench.records.plan import Plan, PlannedStep
from testbench.records.samples import ArmSamples
from testbench.records.session import Event


class Arm(ABC):
    """An arm that can follow a plan: prepare, kickoff, read until done; stop is allowed in every
    state.

    Attributes:
        extra_columns: What its samples hold beyond angles and rates, name to type.
    """

    extra_columns: dict[str, Any] = {}

    @abstractmethod
    def prepare(self, plan: Plan) -> None:
        """Take the plan and stand at its start."""

    @abstractmethod
    def kickoff(self) -> None:
        """Begin to move; this is time 0 of the session."""

    @abstractmethod
    def read(self, until_ns: int) -> ArmSamples:
        """What was recorded since the last call, up to a host time; waits for it where time is
        real.
        """

    @abstractmethod
    def stop(self) -> None:
        """Come to rest, from any state, and stay there; a second call does nothing."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the hardware."""


class SteppingArm(Arm):
    """An arm that goes through the steps of a plan in its own time, and says when each of them
    happened.

    Attributes:
        entry: Its place in the catalogue of arms.
    """

    entry: ArmEntry

    @property
    def notice(self) -> str:
        """What a person must know before it moves; nothing if empty."""
        return self.entry.notice

    @property
    def remedies(self) -> Mapping[str, str]:
        """What a person does after it has stopped, by the word for the cause."""
        return self.entry.remedies

    @abstractmethod
    def connect(self) -> None:
        """Connect, and refuse an arm that must not be driven; nothing moves."""

    @abstractmethod
    def check_way(self, plan: Plan, steps: list[PlannedStep] | None = None) -> None:
        """Look at the ways between steps before anything moves; `steps` are those to do, all if
        None.
        """

    @property
    @abstractmethod
    def finished(self) -> bool:
        """Whether every step is done."""

    @abstractmethod
    def events(self) -> list[Event]:
        """What happened since the last call: step_started, step_settled, step_ended with their
        `index`, paused, faults.
        """

    @abstractmethod
    def pause(self) -> None:
        """Come to rest at the end of the step under way, and wait."""

    @abstractmethod
    def resume(self) -> None:
        """Go on after a pause."""

    def describe(self) -> dict[str, Any]:
        """What the manifest should say of this arm."""
        return self.entry.record.to_dict()
