"""No arm: sensors are recorded alone, for a time or until somebody says so."""

from __future__ import annotations

import numpy as np

from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.entry import ArmEntry
from testbench.drivers.session_time import SessionTime
from testbench.frames import NANOSECONDS
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Event
from testbench.records.specs.protocol_arm import Guard, Guards

WARNINGS = Guards(imu_silence_s=Guard(limit=2.0, action="warn"))
"""The usual guards; a sensor that falls silent does not end the recording of the others."""


class NoArm(SteppingArm):
    """Stands where an arm would: does not move, reports nothing, is finished when its time is over.

    Args:
        time: Of the session.
        duration_s: Until it is finished [s]; None for never.
    """

    entry = ArmEntry("none", "no arm", "", commanded=False, provenance="")
    usual_guards = WARNINGS
    attended = False
    takes_pauses = False
    coming = ""
    tail_ns = 0

    def __init__(self, time: SessionTime, duration_s: float | None = None):
        self.time = time
        self.ends = duration_s is not None
        self._end_ns = None if duration_s is None else round(duration_s * NANOSECONDS)
        self._read_ns = 0

    def connect(self) -> None:
        """Nothing to connect to."""

    def check_way(self, plan: Plan, steps: list[PlannedStep] | None = None) -> None:
        """There is none."""

    def prepare(self, plan: Plan) -> None:
        """It stands wherever it must."""

    def kickoff(self) -> None:
        self.time.start()

    def next_ns(self, after_ns: int) -> int:
        until_ns = super().next_ns(after_ns)
        return until_ns if self._end_ns is None else min(until_ns, self._end_ns)

    def read(self, until_ns: int) -> ArmSamples:
        self.time.wait_until(until_ns)
        self._read_ns = until_ns
        none = np.zeros((0, 0))
        return ArmSamples([], np.zeros(0, np.int64), none, none, none)

    @property
    def finished(self) -> bool:
        return self._end_ns is not None and self._read_ns >= self._end_ns

    def events(self) -> list[Event]:
        return []

    def pause(self) -> bool:
        return True

    def resume(self) -> None:
        """It rests anyhow."""

    def stop(self) -> None:
        """It rests anyhow."""

    def close(self) -> None:
        """Nothing to let go of."""
