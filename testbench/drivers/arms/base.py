"""What the bench asks of an arm, simulated or real."""

from __future__ import annotations

from abc import ABC, abstractmethod

from testbench.records.plan import Plan
from testbench.records.samples import ArmSamples


class Arm(ABC):
    """An arm that can follow a plan: prepare, kickoff, read until done; stop is allowed in every state."""

    @abstractmethod
    def prepare(self, plan: Plan) -> None:
        """Take the plan and stand at its start."""

    @abstractmethod
    def kickoff(self) -> None:
        """Begin to move; this is time 0 of the session."""

    @abstractmethod
    def read(self, until_ns: int) -> ArmSamples:
        """What was recorded since the last call, up to a host time; waits for it where time is real."""

    @abstractmethod
    def stop(self) -> None:
        """Come to rest, from any state, and stay there; a second call does nothing."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the hardware."""
