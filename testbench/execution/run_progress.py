"""How far a run is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from testbench.execution.motion_table import motion_rows
from testbench.frames import NANOSECONDS
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.session import Event


@dataclass(frozen=True)
class Progress:
    """How far a run is; times in seconds from its start.

    Attributes:
        step: Name of the step under way; empty where there are none.
        index: How many steps are done; of the last, one less.
        steps: How many there are.
        time: What is done, by its planned time.
        duration: Of the whole; 0 where it is open.
        doing: What happens in place of a step, for people.
        samples: Of devices that are recorded alone: how many of each.
    """

    step: str
    index: int
    steps: int
    time: float
    duration: float
    doing: str = ""
    samples: Mapping[str, int] = field(default_factory=dict)


Tell = Callable[[Progress], None]


class Meter(ABC):
    """Tells somebody how far a run is."""

    @abstractmethod
    def note(self, event: Event) -> None:
        """Take note of what the arm did."""

    @abstractmethod
    def say(self, now_ns: int, doing: str = "") -> None:
        """Tell how far the run is at a host time [ns]; `doing`: in place of a step."""


class ProgressMeter(Meter):
    """Progress of an arm through the motions that it is to do, as the planned time of what is done.

    Steps differ much in length, so that their number says little.

    Args:
        plan: The motion.
        steps: Those of its steps to do, in order.
        tell: Called with every progress; None for nobody.
    """

    def __init__(self, plan: Plan, steps: Sequence[PlannedStep], tell: Tell | None):
        self._tell, self._steps = tell, len(steps)
        self._rows = motion_rows(plan, steps) if tell is not None else []
        ends = np.cumsum([row.duration_s for row in self._rows])
        self._begins = [0.0, *ends.tolist()]
        self._row = self._done = 0
        self._begin_ns = 0

    def note(self, event: Event) -> None:
        started = event.event in {"step_started", "connecting_started"}
        index = event.details.get("index") if event.event == "step_started" else None
        coming = range(self._row, len(self._rows))
        row = next((k for k in coming if started and self._rows[k].index == index), None)
        if row is not None:
            self._row, self._begin_ns = row, event.host_time_ns
        elif event.event in {"step_ended", "connecting_ended"} and self._row < len(self._rows):
            self._done += event.event == "step_ended"
            self._row, self._begin_ns = self._row + 1, event.host_time_ns

    def say(self, now_ns: int, doing: str = "") -> None:
        if self._tell is None or not self._rows:
            return
        last = self._row >= len(self._rows)
        row = self._rows[-1 if last else self._row]
        passed = 0.0 if last else min((now_ns - self._begin_ns) / NANOSECONDS, row.duration_s)
        time = self._begins[self._row] + max(passed, 0.0)
        done = min(self._done, self._steps - 1)
        self._tell(Progress(row.name, done, self._steps, time, self._begins[-1], doing))


class SampleMeter(Meter):
    """Tells about once a second how much of devices alone was recorded.

    Args:
        duration_s: Of the recording; None where it is open.
        counts: Asked for the number of samples of each device.
        tell: Called with the progress; None for nobody.
    """

    def __init__(
        self, duration_s: float | None, counts: Callable[[], dict[str, int]], tell: Tell | None
    ):
        self._duration, self._counts, self._tell = duration_s or 0.0, counts, tell
        self._told_ns = 0

    def note(self, event: Event) -> None:
        """Devices have no steps."""

    def say(self, now_ns: int, doing: str = "") -> None:
        if self._tell is None or now_ns - self._told_ns < NANOSECONDS:
            return
        self._told_ns = now_ns
        time = now_ns / NANOSECONDS
        self._tell(Progress("", 0, 0, time, self._duration, doing, self._counts()))
