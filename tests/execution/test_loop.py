"""The one loop of every run: who goes through it, and what it makes of stops and failures."""

from __future__ import annotations

import os
import shutil
import signal
from typing import Any

import numpy as np
import pytest

from testbench import execute, plan
from testbench.drivers import session_time
from testbench.drivers.arms.none import NoArm
from testbench.drivers.arms.replay import ReplayArm
from testbench.drivers.arms.simulated import SimulatedArm
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError, RunInterrupted
from testbench.execution import RunOptions
from testbench.execution.device_recorder import record_devices
from testbench.execution.devices import Devices
from testbench.execution.executor import execute_on_arm
from testbench.execution.loop import RunLoop
from testbench.execution.recovery import recover
from testbench.execution.run_progress import Progress
from testbench.execution.sensors import Sensors
from testbench.frames import NANOSECONDS
from testbench.records.session.plan import Plan
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import RunStatus, Session, list_sessions
from tests.execution.test_record import Scripted


@pytest.fixture
def looped(monkeypatch: pytest.MonkeyPatch) -> list[RunLoop]:
    """The loops that were run."""
    seen: list[RunLoop] = []
    honest = RunLoop.run

    def run(self: RunLoop) -> Session:
        seen.append(self)
        return honest(self)

    monkeypatch.setattr(RunLoop, "run", run)
    return seen


def test_a_simulated_run_a_replay_and_devices_alone_go_through_the_same_loop(
    tiny, tmp_path, clock, looped
):
    the_plan, options = plan(tiny), RunOptions(tmp_path, clock=clock)
    recorded = execute(the_plan, options=options)
    time = SessionTime(clock)
    arm = ReplayArm(the_plan.robot, recorded.path, time)
    replayed = execute_on_arm(the_plan, arm, Sensors.simulated(the_plan, 1), options)
    devices = Devices({"hand": Scripted()}, SessionTime(clock))
    alone = record_devices(devices, tmp_path, 1.0, options=options)
    assert [type(loop) for loop in looped] == [RunLoop] * 3
    assert [type(loop.arm) for loop in looped] == [SimulatedArm, ReplayArm, NoArm]
    for session in (recorded, replayed, alone):
        assert session.status is RunStatus.COMPLETED
        assert session.events[-1].event.endswith("_completed")
    assert [step.index for step in recorded.steps] == [step.index for step in replayed.steps]


def test_a_stretch_of_virtual_time_changes_no_bit(tiny, tmp_path, clock, monkeypatch):
    whole = execute(plan(tiny), tmp_path, 5, RunOptions(clock=clock))
    monkeypatch.setattr(session_time, "STRETCH_NS", 1_234_567_891)
    cut = execute(plan(tiny), tmp_path, 5, RunOptions(clock=clock))
    for name in ("arm.parquet", "imu_hand.parquet", "truth_hand.parquet", "events.jsonl"):
        assert (whole.path / name).read_bytes() == (cut.path / name).read_bytes(), name


class Dying(SimulatedImu):
    """It is lost after two seconds."""

    def read(self, until_ns: int) -> ImuSamples:
        if until_ns > 2 * NANOSECONDS:
            raise DriverError("the sensor was lost")
        return super().read(until_ns)


def test_a_sensor_that_fails_loses_neither_the_arms_samples_nor_counts_the_step_as_whole(
    tiny, tmp_path, clock, monkeypatch
):
    the_plan = plan(tiny)
    monkeypatch.setattr("testbench.execution.sensors.SimulatedImu", Dying)
    monkeypatch.setattr(session_time, "STRETCH_NS", 2 * NANOSECONDS)
    assert 2e9 < the_plan.steps[1].end_ns < 4e9
    with pytest.raises(DriverError, match="the sensor was lost") as caught:
        execute(the_plan, tmp_path, 1, RunOptions(clock=clock))
    (session,) = list_sessions(tmp_path)
    assert session.imu("hand").host_time_ns[-1] < 2.1e9 < 3.9e9 < session.arm().host_time_ns[-1]
    assert [step.index for step in session.steps] == [0]
    assert f"{session.path}: 1 of 3 steps are whole" in caught.value.__notes__[-1]


def test_a_run_that_is_stopped_while_it_is_paused_is_closed_as_interrupted(tiny, tmp_path, clock):
    said: list[str] = []

    def tell(progress: Progress) -> None:
        if progress.doing == "paused, the arm rests":
            os.kill(os.getpid(), signal.SIGINT)
        elif progress.time > 2:
            os.kill(os.getpid(), signal.SIGUSR1)

    options = RunOptions(tmp_path, 1, "realtime", clock, progress=tell, say=said.append)
    with pytest.raises(RunInterrupted) as caught:
        execute(plan(tiny), options=options)
    session = caught.value.session
    assert isinstance(session, Session) and session.status is RunStatus.INTERRUPTED
    assert said == ["PAUSED (asked for): SIGUSR2 goes on, SIGINT stops"]
    names = [event.event for event in session.events]
    assert names.index("paused") < names.index("run_interrupted")
    arm = session.arm()
    assert np.abs(arm.v_measured[-5:]).max() < np.radians(0.5)  # it came to rest


@pytest.mark.parametrize("when", ["on the way to the start", "at the first samples"])
def test_of_a_kill_all_that_was_seen_until_then_remains(tiny, tmp_path, clock, monkeypatch, when):
    """What lies on the disk at that moment is what a kill leaves: it is copied, and recovered."""
    left = tmp_path / "left"

    def strike() -> None:
        (session,) = (path for path in tmp_path.iterdir() if path != left)
        shutil.copytree(session, left)

    if when == "at the first samples":
        monkeypatch.setattr(session_time, "STRETCH_NS", 200_000_000)
        honest = RunLoop._advance

        def advance(loop: RunLoop, until_ns: int, operator: Any = None) -> None:
            honest(loop, until_ns, operator)
            if not left.exists():
                strike()

        monkeypatch.setattr(RunLoop, "_advance", advance)
    else:
        prepare = SimulatedArm.prepare

        def prepare_and_strike(arm: SimulatedArm, the_plan: Plan) -> None:
            strike()
            prepare(arm, the_plan)

        monkeypatch.setattr(SimulatedArm, "prepare", prepare_and_strike)
    monkeypatch.setattr(SimulatedArm, "attended", True)
    execute(plan(tiny), tmp_path, 1, RunOptions(clock=clock))
    session = recover(Session(left))
    states = [own.details["state"] for own in session.events if own.event == "state"]
    assert states[0] == "approaching" and session.status is RunStatus.ABORTED
    if when == "at the first samples":
        assert states[-1] == "running" and session.arm().host_time_ns[-1] > 150_000_000
        assert len(session.imu("hand").host_time_ns) > 5
    else:
        assert len(session.arm().host_time_ns) == 0
        assert str(session.manifest.message).startswith("cut off before the arm stood at its start")


class Silent(Scripted):
    """It delivers for half a second, then nothing."""

    def read(self, until_ns: int) -> ImuSamples:
        self.mute = until_ns > NANOSECONDS // 2
        return super().read(until_ns)


def test_a_device_that_falls_silent_is_told_and_the_others_are_recorded_on(
    clock: Any, tmp_path: Any
) -> None:
    said: list[str] = []
    told: list[Progress] = []
    options = RunOptions(clock=clock, say=said.append, progress=told.append)
    devices = Devices({"a": Silent(), "b": Scripted()}, SessionTime(clock))
    session = record_devices(devices, tmp_path, 4.0, options=options)
    assert [line.partition(":")[2].partition(":")[0] for line in said] == [" imu silence of a"]
    (guard,) = [event for event in session.events if event.event == "guard"]
    assert (guard.details["subject"], guard.details["action"]) == ("a", "warn")
    assert len(session.imu("b")) > 4 * len(session.imu("a"))
    assert [round(progress.time) for progress in told] == [1, 2, 3, 4]
    assert told[-1].samples == {"a": len(session.imu("a")), "b": len(session.imu("b"))}
    assert told[-1].duration == 4.0
