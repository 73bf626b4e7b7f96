"""What happens around a run of an arm: a bench that is held up, a clock that is set back, a second
bench at the same controller, another weight on the flange. In lock step, on a move of four seconds.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testbench.drivers.arms.remedies import UR_REMEDIES, XARM_REMEDIES
from testbench.exceptions import ArmRefused, DriverError
from testbench.frames import NANOSECONDS
from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from testbench.records.session.session import RunStatus, list_sessions
from tests.asking import run_of
from tests.emulated_arms import faulted_session
from tests.lock_step.bench import VirtualArm, VirtualBench

MOTION = """\
name: slow
purpose: A move that takes longer than a bench may be silent
robot: {robot}
sensors: {{hand: {{preset: xsens_dot, link: {link}}}}}
motion: {{speed: 0.05, acceleration: 0.5, jerk: 0.5}}
arm: {{tool: {{mass_kg: 0.2, centre_mm: [0, 0, 30]}}}}
sections:
  - name: moves
    role: reference
    steps: [{{name: out, move_to_deg: {{{joint}: {angle}}}, dwell_s: 0.1}}]
estimate: {{filters: [device], align: none, calibrate: none}}
"""
REMEDIES = {"ur": UR_REMEDIES, "xarm": XARM_REMEDIES}


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Plan]:
    folder, made = tmp_path_factory.mktemp("plans"), {}
    for maker, robot, link, joint, angle in (
        ("ur", "ur3e", "wrist_3_link", "wrist_3_joint", 80),
        ("xarm", "xarm6", "link6", "joint6", 40),
    ):
        path = folder / f"{maker}.yaml"
        path.write_text(
            MOTION.format(robot=robot, link=link, joint=joint, angle=angle), encoding="utf-8"
        )
        made[maker] = make_plan(run_of(path))
    return made


@pytest.fixture(params=["ur", "xarm"])
def maker(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def robot(bench: VirtualBench, maker: str) -> VirtualArm:
    return bench.ur() if maker == "ur" else bench.xarm()


def while_moving(robot: VirtualArm, do: Callable[[], object]) -> Callable[[Any], None]:
    """What a run tells of its progress to: does something once, while the arm moves."""
    done: list[object] = []

    def heed(progress: Any) -> None:
        if not done and progress.time > 0 and ", moving" in robot.control("status"):
            done.append(None)
            do()

    return heed


def test_a_bench_that_is_held_up_for_less_than_three_seconds_loses_nothing(
    bench, robot, plans, maker, tmp_path
):
    heed = while_moving(robot, lambda: bench.clock.sleep(2.5))
    session = bench.drive(plans[maker], robot, tmp_path, progress=heed)
    assert session.status is RunStatus.COMPLETED and len(session.steps) == 1
    times = session.arm().host_time_ns
    assert np.diff(times).max() < 0.05 * NANOSECONDS
    assert session.manifest.arm.timing.samples_missed == 0


def test_a_bench_that_is_held_up_for_longer_finds_its_arm_stopped(
    bench, robot, plans, maker, tmp_path
):
    heed = while_moving(robot, lambda: bench.clock.sleep(3.5))
    with pytest.raises(
        DriverError, match="arm was stopped: the bench was silent for 3 s"
    ) as caught:
        bench.drive(plans[maker], robot, tmp_path, progress=heed)
    assert caught.value.exit_code == 3
    assert "at rest" in robot.control("status")
    session = faulted_session(tmp_path, {"host_silence"})
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    assert told.details["arm"] == "at rest"
    assert 3 <= (session.arm().host_time_ns[-1] - told.host_time_ns) / NANOSECONDS + 3 < 4
    assert f"what to do: {REMEDIES[maker]['host_silence']}" in caught.value.__notes__


def test_a_clock_of_this_machine_that_is_set_back_changes_nothing_that_is_recorded(
    bench, robot, plans, maker, tmp_path
):
    began = bench.clock.utc()

    def set_back() -> None:
        bench.clock.utc = lambda: began - timedelta(hours=1)

    heed = while_moving(robot, set_back)
    first = bench.drive(plans[maker], robot, tmp_path, progress=heed)
    assert bench.clock.utc() < began
    assert first.status is RunStatus.COMPLETED and first.started == began
    times = first.arm().host_time_ns
    assert (np.diff(times) > 0).all() and np.diff(times).max() < 0.05 * NANOSECONDS
    told = [event.host_time_ns for event in first.events if event.event.startswith("step_")]
    assert told == sorted(told)
    assert not [event for event in first.events if event.event.startswith("arm_time")]
    robot.wait_until("at rest")
    second = bench.drive(plans[maker], robot, tmp_path)
    assert second.status is RunStatus.COMPLETED and second.path != first.path
    assert {session.name for session in list_sessions(tmp_path)} == {first.name, second.name}


def test_a_second_bench_is_refused_while_the_first_one_moves_the_arm_and_leaves_it_alone(
    bench, robot, plans, maker, tmp_path, monkeypatch
):
    elsewhere = tmp_path / "tmp"  # where the lock of another machine would be
    elsewhere.mkdir()
    told: list[str] = []

    def intrude() -> None:
        for folder in (None, elsewhere):
            if folder is not None:
                monkeypatch.setattr(tempfile, "tempdir", str(folder))
            arm = bench.arm(plans[maker], robot)
            try:
                arm.connect()
            except ArmRefused as refusal:
                told.append(str(refusal))
            finally:
                arm.close()

    heed = while_moving(robot, lambda: bench.clock.start(intrude))
    session = bench.drive(plans[maker], robot, tmp_path / "logs", progress=heed)
    assert session.status is RunStatus.COMPLETED and len(session.steps) == 1
    assert "another run of the bench on this machine" in told[0]
    whose = {"ur": "a program is running on this controller", "xarm": "something else drives it"}
    assert whose[maker] in told[1]


def test_nothing_moves_where_the_controller_goes_by_another_weight(
    bench, robot, plans, maker, tmp_path
):
    moved = robot.control("status").rpartition(",")[2]
    robot.control("fault payload 2")
    with pytest.raises(DriverError, match="weigh") as caught:
        bench.drive(plans[maker], robot, tmp_path)
    assert caught.value.exit_code == 3
    assert f"what to do: {REMEDIES[maker]['payload']}" in caught.value.__notes__
    status = robot.control("status")
    assert "STOPPED" in status and status.rpartition(",")[2] == moved


def test_another_weight_in_motion_stops_the_arm(bench, robot, plans, maker, tmp_path):
    heed = while_moving(robot, lambda: robot.control("fault payload 2"))
    with pytest.raises(DriverError, match="arm was stopped: the controller goes by 2 kg") as caught:
        bench.drive(plans[maker], robot, tmp_path, progress=heed)
    assert caught.value.exit_code == 3
    session = faulted_session(tmp_path, {"payload"})
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    assert told.details["arm"] == "at rest"


def test_a_run_that_says_nothing_of_the_flange_takes_what_the_controller_has(
    bench, robot, plans, maker, tmp_path
):
    path: Path = tmp_path / "bare.yaml"
    text = plans[maker].protocol.document.file.read_text(encoding="utf-8")
    bare = "\n".join(line for line in text.splitlines() if not line.startswith("arm:")) + "\n"
    path.write_text(bare, encoding="utf-8")
    robot.control("fault payload 2")
    session = bench.drive(make_plan(run_of(path)), robot, tmp_path / "logs")
    assert session.status is RunStatus.COMPLETED
