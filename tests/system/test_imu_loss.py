"""A sensor falls silent or is unplugged while an arm moves: what the guards do, what is kept, and
how the run goes on.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench import execute, plan
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.execution import RunOptions, sensors
from testbench.execution.devices import Devices
from testbench.execution.executor import execute_on_arm
from testbench.execution.guards import GuardTripped
from testbench.execution.resume import missing_steps
from testbench.execution.run_progress import Progress
from testbench.execution.sensors import Sensors
from testbench.frames import NANOSECONDS
from testbench.pipeline.analyse import analyse
from testbench.pipeline.prepared import make_plan
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Watcher
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import RunStatus, Session, list_sessions
from tests.asking import analysis, going_on, run_of
from tests.conftest import TINY, FakeClock
from tests.lock_step.bench import VirtualArm, VirtualBench
from tests.lock_step.serial_board import VirtualBoard
from tests.system.crashes import comparable

SILENT_NS = (round(2.5 * NANOSECONDS), round(3.6 * NANOSECONDS))


def guarded(text: str, action: str, limit_s: float) -> str:
    return text + f"guards: {{imu_silence_s: {{limit: {limit_s}, action: {action}}}}}\n"


class Silent(SimulatedImu):
    """Nothing of it arrives for a while; what it measured then is lost."""

    def read(self, until_ns: int) -> ImuSamples:
        samples = super().read(until_ns)
        heard = (samples.host_time_ns < SILENT_NS[0]) | (samples.host_time_ns >= SILENT_NS[1])
        arrays = {
            key: value[heard]
            for key, value in vars(samples).items()
            if isinstance(value, np.ndarray)
        }
        return replace(samples, **arrays)


class Listening(FakeClock):
    """Time that passes only when somebody sleeps; the operator lets a paused run go on after three
    seconds of it.
    """

    def __init__(self) -> None:
        super().__init__()
        self.short = 0

    def sleep(self, seconds: float) -> None:
        super().sleep(seconds)
        self.short += seconds == 0.02  # the rhythm of a pause
        if self.short == 150:
            os.kill(os.getpid(), signal.SIGUSR2)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "tiny.yaml").write_text(guarded(TINY, "stop", 0.5), encoding="utf-8")
    session = execute(
        plan(folder / "tiny.yaml"), folder, 5, RunOptions(speed="realtime", clock=FakeClock())
    )
    return session, analyse(session, analysis()).evaluation


@pytest.mark.parametrize("action", ["warn", "pause"])
def test_a_sensor_that_is_heard_again_leaves_a_gap_in_a_run_that_is_judged_without_it(
    action, tmp_path, monkeypatch, undisturbed
):
    monkeypatch.setattr(sensors, "SimulatedImu", Silent)
    (tmp_path / "tiny.yaml").write_text(guarded(TINY, action, 0.5), encoding="utf-8")
    session = execute(
        plan(tmp_path / "tiny.yaml"), tmp_path, 5, RunOptions(speed="realtime", clock=Listening())
    )
    assert session.status is RunStatus.COMPLETED
    guard = next(event for event in session.events if event.event == "guard")
    assert (guard.details["guard"], guard.details["subject"], guard.details["action"]) == (
        "imu_silence_s",
        "hand",
        action,
    )
    assert 0.5e9 < guard.host_time_ns - SILENT_NS[0] < 0.8e9
    assert [event.event for event in session.events if event.event in {"paused", "resumed"}] == (
        ["paused", "resumed"] if action == "pause" else []
    )
    whole, expected = undisturbed
    kept, all_ = session.imu("hand"), whole.imu("hand")
    heard = (all_.host_time_ns < SILENT_NS[0]) | (all_.host_time_ns >= SILENT_NS[1])
    np.testing.assert_array_equal(kept.counter, all_.counter[heard])
    np.testing.assert_array_equal(kept.gyr, all_.gyr[heard])
    evaluation = analyse(session, analysis()).evaluation
    (note,) = (own for own in evaluation.notes if "after a gap" in own)
    assert "cut the file there" in note
    for found, usual in zip(evaluation.orientation, expected.orientation, strict=True):
        assert found.inclination_rmse_deg == pytest.approx(usual.inclination_rmse_deg, abs=0.5)


def test_a_run_that_silence_stopped_is_resumed_to_the_undisturbed_one(
    tmp_path, monkeypatch, undisturbed
):
    (tmp_path / "tiny.yaml").write_text(guarded(TINY, "stop", 0.5), encoding="utf-8")
    with monkeypatch.context() as silence:
        silence.setattr(sensors, "SimulatedImu", Silent)
        with pytest.raises(GuardTripped, match="imu silence of hand") as caught:
            execute(
                plan(tmp_path / "tiny.yaml"),
                tmp_path,
                5,
                RunOptions(speed="realtime", clock=FakeClock(), session_name="stopped"),
            )
    assert caught.value.exit_code == 3
    session = Session(tmp_path / "stopped")
    assert session.status is RunStatus.ERROR and session.events[-1].event == "run_error"
    assert session.imu("hand").host_time_ns[-1] < SILENT_NS[0] < session.arm().host_time_ns[-1]
    result = run(going_on(session.path), Watcher(clock=FakeClock()))
    whole, expected = undisturbed
    for key, value in vars(whole.imu("hand")).items():
        np.testing.assert_array_equal(getattr(result.session.imu("hand"), key), value)
    np.testing.assert_array_equal(result.session.arm().q_measured, whole.arm().q_measured)
    assert comparable(result.evaluation) == comparable(expected)


SHORT = """\
name: short
purpose: A rest, a pose and a way back, for a real arm with a live sensor
robot: ur3e
sensors:
  hand:
    preset: mpu6050
    link: wrist_3_link
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
motion: {speed: 0.8, acceleration: 0.8, jerk: 0.8}
sections:
  - name: rest
    role: reference
    steps: [{name: start, dwell_s: 0.4}]
  - name: moves
    steps:
      - {name: out, move_to_deg: {wrist_3_joint: 20}, dwell_s: 0.9}
      - {name: back, move_to: home, dwell_s: 0.2}
estimate: {filters: [vqf_6d], align: heading, calibrate: none}
"""


@pytest.fixture
def board(bench: VirtualBench, monkeypatch: pytest.MonkeyPatch) -> VirtualBoard:
    return VirtualBoard(bench.clock, monkeypatch)


@pytest.fixture
def drive(
    bench: VirtualBench, ur3e: VirtualArm, board: VirtualBoard, tmp_path: Path
) -> Callable[..., Session]:
    """Runs the protocol on the arm, with the board as its sensor."""

    def run(action: str, progress: Callable[[Progress], None]) -> Session:
        protocol = tmp_path / "short.yaml"
        protocol.write_text(guarded(SHORT, action, 0.4), encoding="utf-8")
        the_plan, time = make_plan(run_of(protocol)), bench.time()
        live = Sensors.live(the_plan, Devices({"hand": board.sensor(time)}, time))
        arm = bench.arm(the_plan, ur3e, time)
        return execute_on_arm(the_plan, arm, live, RunOptions(tmp_path, progress=progress))

    return run


def named(session: Session, *names: str) -> list[str]:
    return [event.event for event in session.events if event.event in names]


def test_an_unplugged_sensor_that_comes_back_is_a_gap_in_a_run_on_an_arm(bench, board, drive):
    pulled: list[int] = []

    def pull(progress) -> None:
        if progress.index == 1 and not pulled:
            pulled.append(bench.clock.now_ns)
            board.plugged = False
        elif pulled and bench.clock.now_ns - pulled[0] > 0.6e9:
            board.plugged = True

    session = drive("warn", pull)
    assert session.status is RunStatus.COMPLETED
    assert [step.index for step in session.steps] == [0, 1, 2]
    assert named(session, "disconnected", "reconnected") == ["disconnected", "reconnected"]
    (guard,) = (
        event
        for event in session.events
        if event.event == "guard" and event.details["guard"] == "imu_silence_s"
    )
    lost, found = (
        event for event in session.events if event.event in {"disconnected", "reconnected"}
    )
    assert lost.host_time_ns < guard.host_time_ns and found.details["gap_s"] > 0.5
    samples = session.imu("hand")
    gap = np.diff(samples.host_time_ns).argmax()
    assert np.diff(samples.host_time_ns)[gap] > 0.5e9
    assert samples.counter[gap + 1] - samples.counter[gap] > 40
    assert "after a gap" in " ".join(analyse(session, analysis()).evaluation.notes)


def test_a_sensor_that_falls_silent_stops_the_arm_and_the_missing_steps_are_known(
    ur3e, board, drive, tmp_path
):
    def mute(progress) -> None:
        board.muted |= progress.index == 1

    with pytest.raises(GuardTripped, match="imu silence of hand") as caught:
        drive("stop", mute)
    assert caught.value.exit_code == 3
    ur3e.wait_until("at rest", 5)
    (session,) = list_sessions(tmp_path)
    assert session.status is RunStatus.ERROR and "imu silence of hand" in session.manifest.message
    assert not list(session.path.glob("*.arrows"))
    assert len(session.imu("hand")) > 20 and named(session, "guard", "run_error") == [
        "guard",
        "run_error",
    ]
    assert [
        step.index for step in missing_steps(session, make_plan(run_of(tmp_path / "short.yaml")))
    ] == [
        0,
        1,
        2,
    ]
    assert analyse(session, analysis()).evaluation.outcome == "not_measured"


def test_a_sensor_that_falls_silent_pauses_the_arm_until_it_is_heard(bench, board, drive):
    seen: list[int] = []

    def look(progress) -> None:
        if progress.index == 1 and not seen:
            seen.append(bench.clock.now_ns)
            board.muted = True
        elif seen and bench.clock.now_ns - seen[0] > 1e9 and "rests" in progress.doing:
            board.muted = False
            os.kill(os.getpid(), signal.SIGUSR2)

    session = drive("pause", look)
    assert session.status is RunStatus.COMPLETED
    assert [step.index for step in session.steps] == [0, 1, 2]
    states = [event.details["state"] for event in session.events if event.event == "state"]
    assert states == ["approaching", "running", "paused", "running", "stopping", "done"]
    assert np.diff(session.imu("hand").host_time_ns).max() > 0.8e9
