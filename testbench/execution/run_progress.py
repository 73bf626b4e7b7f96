"""How far a run on a real arm is: by the planned time of what is done, since steps differ much in
length.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from testbench.execution.executor import Progress
from testbench.execution.motion_table import motion_rows
from testbench.frames import NANOSECONDS
from testbench.records.plan import Plan, PlannedStep
from testbench.records.session import Event


class ProgressMeter:
    """Follows the events of an arm through the motions that it is to do.

    Args:
        plan: The motion.
        steps: Those of its steps to do, in order.
        tell: Called with every progress; None for nobody.
    """

    def __init__(
        self, plan: Plan, steps: Sequence[PlannedStep], tell: Callable[[Progress], None] | None
    ):
        self._rows, self._tell, self._steps = motion_rows(plan, steps), tell, len(steps)
        self.duration = sum(row.duration_s for row in self._rows)
        self._row = self._done = 0
        self._begin_ns = 0

    def note(self, event: Event) -> None:
        """Take note of what the arm did."""
        started = event.event in {"step_started", "connecting_started"}
        index = event.details.get("index") if event.event == "step_started" else None
        coming = range(self._row, len(self._rows))
        if started and any(self._rows[k].index == index for k in coming):
            self._row = next(k for k in coming if self._rows[k].index == index)
            self._begin_ns = event.host_time_ns
        elif event.event in {"step_ended", "connecting_ended"} and self._row < len(self._rows):
            self._done += event.event == "step_ended"
            self._row, self._begin_ns = self._row + 1, event.host_time_ns

    def say(self, now_ns: int, doing: str = "") -> None:
        """Tell how far the run is at a host time [ns]; `doing`: in place of a step."""
        if self._tell is None or not self._rows:
            return
        last = self._row >= len(self._rows)
        row = self._rows[-1 if last else self._row]
        passed = 0.0 if last else min((now_ns - self._begin_ns) / NANOSECONDS, row.duration_s)
        time = sum(done.duration_s for done in self._rows[: self._row]) + max(passed, 0.0)
        self._tell(
            Progress(
                row.name, min(self._done, self._steps - 1), self._steps, time, self.duration, doing
            )
        )
