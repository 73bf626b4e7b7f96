"""Arms that exist nowhere: one of a vendor, which is exactly where its plan has it and whose power
fails at the address `dark`, and a second model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.catalogue import SIM
from testbench.drivers.arms.entry import REAL_ARM, SENSORS, ArmEntry, WantedArm
from testbench.drivers.arms.simulated import SimulatedArm
from testbench.drivers.session_time import SessionTime, VirtualTime
from testbench.exceptions import DriverError
from testbench.records.session.plan import Plan
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Event

ENTRY = ArmEntry(
    name="trial",
    title="an arm for tests",
    made_by="tests.drivers.trial_arm:TrialArm",
    options=REAL_ARM | SENSORS,
    needs=("--host", "the address of the trial"),
    provenance="the motion that nobody measured",
    robots=r"ur3e|trial\d",
    family="arms of tests",
    remedies={"dark": "put the plug back"},
)


TWIN = replace(
    SIM,
    name="twin",
    title="a second model",
    made_by="tests.drivers.trial_arm:twin_arm",
    recorded_as="",
)


class TwinArm(SimulatedArm):
    entry = TWIN


def twin_arm(plan: Plan, wanted: WantedArm, time: VirtualTime) -> TwinArm:
    return TwinArm(plan.robot, wanted.seed, plan.protocol.spec.environment.joint_errors, time)


class TrialArm(SteppingArm):
    entry = ENTRY

    def __init__(self, plan: Plan, wanted: WantedArm, time: SessionTime):
        self.plan, self.wanted, self.time = plan, wanted, time
        self.now_ns, self.due = 0, list(plan.steps)

    def read(self, until_ns: int) -> ArmSamples:
        self.time.wait_until(until_ns)
        times = np.arange(self.now_ns, until_ns, 8_000_000)
        if self.wanted.host == "dark" and until_ns > 2_000_000_000:
            raise DriverError("the arm was stopped: it is dark")
        self.now_ns = int(times[-1]) + 8_000_000 if len(times) else self.now_ns
        q, v, _ = self.plan.trajectory.at(times)
        return ArmSamples(self.plan.robot.joint_names, times, q, q, v)

    def events(self) -> list[Event]:
        found = [Event(self.now_ns, "arm_fault", {"fault": self.wanted.host, "message": "none"})]
        found = found if self.wanted.host == "dark" else []
        while self.due and self.due[0].end_ns <= self.now_ns:
            step = self.due.pop(0)
            times = {"started": step.start_ns, "settled": step.settled_ns, "ended": step.end_ns}
            found += [Event(t, f"step_{name}", {"index": step.index}) for name, t in times.items()]
        return found

    @property
    def finished(self) -> bool:
        return not self.due

    def kickoff(self) -> None:
        self.time.start()

    def nothing(self, *arguments: object) -> None:
        """What an arm without a controller has to do."""

    connect = check_way = prepare = pause = resume = stop = close = nothing
