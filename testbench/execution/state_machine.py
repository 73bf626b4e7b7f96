"""The states of a run, and which may follow which."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

from testbench.exceptions import BenchError


class RunState(StrEnum):
    """Where a run stands."""

    PREPARED = "prepared"
    APPROACHING = "approaching"
    RUNNING = "running"
    PAUSED = "paused"
    STOPPING = "stopping"
    DONE = "done"
    FAULTED = "faulted"


FOLLOWING: dict[RunState, set[RunState]] = {
    RunState.PREPARED: {RunState.APPROACHING, RunState.STOPPING, RunState.FAULTED},
    RunState.APPROACHING: {RunState.RUNNING, RunState.STOPPING, RunState.FAULTED},
    RunState.RUNNING: {RunState.PAUSED, RunState.STOPPING, RunState.FAULTED},
    RunState.PAUSED: {RunState.RUNNING, RunState.STOPPING, RunState.FAULTED},
    RunState.STOPPING: {RunState.DONE, RunState.FAULTED},
    RunState.DONE: set(),
    RunState.FAULTED: set(),
}


Changed = Callable[[int, RunState, RunState, str], None]


class StateMachine:
    """The state of one run.

    Args:
        changed: Told of every change: when [ns], old state, new state, why.
    """

    def __init__(self, changed: Changed):
        self.state = RunState.PREPARED
        self._changed = changed

    def to(self, state: RunState, at_ns: int = 0, why: str = "") -> None:
        """Change the state.

        Args:
            state: The new one.
            at_ns: Host time at which it changes.
            why: For people.

        Raises:
            BenchError: It cannot follow the present one; this is a fault of the bench.
        """
        if state not in FOLLOWING[self.state]:
            raise BenchError(f"a run that is {self.state} cannot become {state}")
        old, self.state = self.state, state
        self._changed(at_ns, old, state, why)
