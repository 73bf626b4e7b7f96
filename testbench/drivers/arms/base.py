"""What the bench asks of an arm: simulated, emulated, replayed or real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from testbench.drivers.arms.entry import ArmEntry
from testbench.drivers.session_time import SessionTime
from testbench.frames import NANOSECONDS
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Event
from testbench.records.session.trajectory import TrueState
from testbench.records.specs.protocol_arm import Guards


class SteppingArm(ABC):
    """An arm that goes through the steps of a plan in its own time, and says when each happened.

    Order of calls: connect, check_way, prepare, kickoff, read until finished; stop is allowed in
    every state.

    Attributes:
        time: Of the session; whether it is real or virtual is the arm's affair.
        entry: Its place in the catalogue of arms.
        extra_columns: What its samples hold beyond angles and rates, name to type.
        usual_guards: What is watched where the protocol names no guards; nothing if None.
        attended: Whether a person stands beside it: then each change of state is an event, and what
            the guards found is summed up at the end.
        takes_pauses: Whether it can wait between two steps.
        ends: Whether it comes to an end by itself; if not, the operator's stop is no interruption.
        coming: What it does before its first step, for people.
        tail_ns: Recording goes on for so long after the last step, so that the last dwell is whole
            on every clock [ns].
        rests_after_ns: It is at rest so long after `stop` has returned [ns].
    """

    time: SessionTime
    entry: ArmEntry
    extra_columns: dict[str, Any] = {}
    usual_guards: Guards | None = Guards()
    attended: bool = True
    takes_pauses: bool = True
    ends: bool = True
    coming: str = "the arm goes to the start of the plan"
    tail_ns: int = NANOSECONDS
    rests_after_ns: int = 0

    @property
    def notice(self) -> str:
        """What a person must know before it moves; nothing if empty."""
        return self.entry.notice

    @property
    def felt(self) -> TrueState | None:
        """What simulated sensors on it feel; None where nobody knows: they then follow the motion
        that it reports.
        """
        return None

    @abstractmethod
    def connect(self) -> None:
        """Connect, and refuse an arm that must not be driven; nothing moves."""

    @abstractmethod
    def check_way(self, plan: Plan, steps: list[PlannedStep] | None = None) -> None:
        """Look at the ways between steps before anything moves; `steps` are those to do, all if
        None.
        """

    @abstractmethod
    def prepare(self, plan: Plan) -> None:
        """Take the plan and stand at its start."""

    @abstractmethod
    def kickoff(self) -> None:
        """Begin to move; this is time 0 of the session."""

    def next_ns(self, after_ns: int) -> int:
        """Up to when it is read next, after a time [ns]."""
        return self.time.next_ns(after_ns)

    @abstractmethod
    def read(self, until_ns: int) -> ArmSamples:
        """What was recorded since the last call, up to a host time; waits for it."""

    @property
    @abstractmethod
    def finished(self) -> bool:
        """Whether every step is done."""

    @abstractmethod
    def events(self) -> list[Event]:
        """What happened since the last call.

        That is step_started, step_settled, step_ended with their `index`, paused, resumed, and
        faults.
        """

    @abstractmethod
    def pause(self) -> bool:
        """Come to rest at the end of the step under way, or at once, and wait.

        Returns:
            Whether it rests already. The event `paused` says when it came to rest.
        """

    @abstractmethod
    def resume(self) -> None:
        """Go on after a pause."""

    @abstractmethod
    def stop(self) -> None:
        """Come to rest, from any state, and stay there; a second call does nothing."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the hardware."""

    def describe(self) -> dict[str, Any]:
        """What the manifest should say of this arm."""
        return self.entry.record.to_dict()

    def afterwards(self) -> list[str]:
        """What a person must know of it once the run is over, a line each."""
        return []
