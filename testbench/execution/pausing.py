"""A pause: what the operator or a guard wishes, and what the arm makes of it."""

from __future__ import annotations

from collections.abc import Callable

from testbench.drivers.arms.base import SteppingArm
from testbench.execution.operator import Operator
from testbench.execution.recorder import Recorder
from testbench.execution.state_machine import RunState, StateMachine
from testbench.records.session.session import Event


class Pausing:
    """Pauses and resumes one run.

    That the arm rests, or goes on, and not the wish, changes the state of the run.

    Args:
        arm: Which is told.
        recorder: Which keeps what was wished.
        machine: State of the run.
        say: Told what a person must know.

    Attributes:
        resting: Whether the arm rests.
    """

    def __init__(
        self,
        arm: SteppingArm,
        recorder: Recorder,
        machine: StateMachine,
        say: Callable[[str], None],
    ):
        self.arm, self.recorder, self.machine, self.say = arm, recorder, machine, say
        self.resting = False
        self._wished = False
        self._why = self._how_to_go_on = ""

    def heed(self, operator: Operator) -> None:
        """Tell the arm what is wished, if that has changed."""
        if operator.pause_asked and not self._wished and self.machine.state is RunState.RUNNING:
            self._wished, self._why = True, operator.pause_reason or "asked for"
            self._how_to_go_on = operator.how_to_go_on
            if not self.arm.pause():
                self._note("pause_requested", why=self._why)
                self.say(f"pause requested ({self._why}): the arm rests after this step")
        elif not operator.pause_asked and self._wished:
            self._wished, operator.pause_reason = False, ""
            self.arm.resume()
            if not self.resting:  # the step under way had not ended
                self._note("pause_withdrawn")
            self.say("going on")

    def happened(self, event: Event) -> None:
        """Take note of an event of the arm."""
        if event.event == "paused":
            self.resting = True
            if self.machine.state is RunState.RUNNING:
                self.machine.to(RunState.PAUSED, event.host_time_ns, self._why)
            self.say(f"PAUSED ({self._why}): {self._how_to_go_on}")
        elif event.event == "resumed":
            self.resting = False
            if self.machine.state is RunState.PAUSED:
                self.machine.to(RunState.RUNNING, event.host_time_ns, "asked for")

    def _note(self, wish: str, **details: str) -> None:
        self.recorder.event(self.arm.time.now_ns(), wish, **details)
