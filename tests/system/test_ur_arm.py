"""The driver of Universal Robots arms against an emulated controller, in lock step: nothing here
depends on how busy the machine is. `test_real_clients` drives through the real client library.
"""

from __future__ import annotations

import os
import signal
import tempfile

import numpy as np
import pytest

from testbench.drivers.arms.remedies import UR_REMEDIES
from testbench.exceptions import ArmRefused, DriverError
from testbench.pipeline.analyse import analyse
from testbench.records.session.session import RunStatus, Session, list_sessions
from tests.asking import analysis
from tests.benchmarks.real_arm import following
from tests.emulated_arms import faulted_session
from tests.lock_step.bench import virtual_bench


@pytest.fixture(scope="module")
def done(short_plan, tmp_path_factory) -> Session:
    """The short protocol, run once; its files must not be changed."""
    with virtual_bench() as bench:
        robot = bench.ur()
        session = bench.drive(short_plan, robot, tmp_path_factory.mktemp("logs"))
        assert "at rest" in robot.control("status")
        return session


def test_static_poses_are_reached_to_a_hundredth_of_a_degree(done, short_plan):
    arm = done.arm()
    for step in done.steps:
        rest = (arm.host_time_ns > step.settled_ns) & (arm.host_time_ns < step.end_ns)
        assert rest.sum() > 10
        planned = short_plan.trajectory.at(np.array([short_plan.steps[step.index].settled_ns]))[0][
            0
        ]
        assert np.degrees(np.abs(np.median(arm.q_measured[rest], axis=0) - planned)).max() < 0.01


def test_a_sweep_is_followed_with_nothing_but_lag(done, short_plan):
    lag, rest, _ = following(done, short_plan)
    assert 0.05 < lag < 0.06  # lookahead 30 ms, servo 27 ms
    assert rest < 0.15  # of 6 deg


def test_the_session_says_what_arm_it_was_and_that_the_sensors_were_simulated(done):
    manifest = done.manifest.content
    assert done.status is RunStatus.COMPLETED
    assert manifest["arm"]["driver"] == "ur" and manifest["arm"]["model"] == "UR3"
    assert manifest["simulated_sensors"] is True
    assert manifest["arm"]["tool"] == {"mass_kg": 0.2, "centre_mm": [0, 0, 30]}
    assert manifest["arm"]["timing"]["cycles"] > 1000
    states = [event.details["state"] for event in done.events if event.event == "state"]
    assert states == ["approaching", "running", "stopping", "done"]


def test_the_controllers_time_stamps_and_modes_are_recorded(done):
    import pandas as pd

    table = pd.read_parquet(done.path / "arm.parquet")
    assert (table["robot_mode"] == 7).all() and (table["safety_mode"] == 1).all()
    steps = np.diff(table["controller_time_ns"])
    moving = table["host_time_ns"] < done.steps[-1].end_ns
    assert (steps % 8_000_000 == 0).all() and (steps[moving[1:]] == 8_000_000).all()
    drift = table["host_time_ns"] - table["controller_time_ns"]
    assert np.ptp(drift) <= 2e6  # a turn of the loop
    assert "current_elbow_joint_A" in table and "temperature_elbow_joint_degC" in table


def test_the_session_is_judged_like_any_other(done):
    result = analyse(done, analysis())
    device = next(row for row in result.evaluation.orientation if row.filter == "device")
    assert device.total_rmse_deg < 2


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("fault local_control", "not in remote control"),
        ("fault protective_stop", "protective stop"),
        ("fault emergency_stop", "safety system"),
        ("fault power_off", "not running"),
        ("fault slider 0.4", "speed slider stands at 40 %"),
    ],
)
def test_an_arm_that_must_not_be_driven_is_refused_before_anything_moves(
    bench, ur3e, short_plan, tmp_path, fault, sentence
):
    moved = ur3e.control("status").rpartition(",")[2]
    ur3e.control(fault)
    with pytest.raises(ArmRefused, match=sentence) as caught:
        bench.drive(short_plan, ur3e, tmp_path)
    assert caught.value.exit_code == 2
    assert not list(tmp_path.iterdir())
    assert ur3e.control("status").rpartition(",")[2] == moved


def test_another_model_or_an_old_controller_is_refused(bench, short_plan, tmp_path):
    with pytest.raises(ArmRefused, match="plan is for a ur3e, the controller calls"):
        bench.drive(short_plan, bench.ur("ur5e"), tmp_path)
    with pytest.raises(ArmRefused, match=r"PolyScope 5\.3"):
        bench.drive(short_plan, bench.ur(polyscope="5.3.0.1"), tmp_path)


def test_a_second_run_on_the_same_arm_is_refused_and_leaves_the_first_alone(
    bench, ur3e, short_plan, tmp_path, monkeypatch
):
    elsewhere = (
        tmp_path / "tmp"
    )  # where the lock of another machine would be: only the controller can tell then
    elsewhere.mkdir()
    told: list[str] = []
    second = []

    def intrude() -> None:
        for folder in (None, elsewhere):
            if folder is not None:
                monkeypatch.setattr(tempfile, "tempdir", str(folder))
            arm = bench.arm(short_plan, ur3e)
            try:
                arm.connect()
            except ArmRefused as refusal:
                told.append(str(refusal))
            finally:
                arm.close()

    def begin(progress) -> None:
        if not second:
            second.append(bench.clock.start(intrude))
            os.kill(os.getpid(), signal.SIGUSR1)
        elif second[0].ended:
            os.kill(os.getpid(), signal.SIGUSR2)

    session = bench.drive(short_plan, ur3e, tmp_path / "logs", progress=begin)
    assert "another run of the bench on this machine" in told[0]
    assert "a program is running on this controller (another bench, or the pendant?)" in told[1]
    assert session.status is RunStatus.COMPLETED


def test_nobody_at_the_address_is_a_clear_message(bench, short_plan):
    arm = bench.arm(short_plan, "127.99.99.99")
    with pytest.raises(DriverError, match=r"127\.99\.99\.99"):
        arm.connect()


def test_an_arm_whose_way_to_the_start_is_blocked_is_refused(bench, short_plan, tmp_path):
    far = bench.ur(q_deg=[0, 30, -10, -90, 90, 0])
    with pytest.raises(ArmRefused, match="by hand"):
        bench.drive(short_plan, far, tmp_path)


FAULTS = [
    ("fault protective_stop", "protective_stop"),
    ("fault emergency_stop", "emergency_stop"),
    ("fault power_off", "power_off"),
    ("fault disconnect", "disconnect"),
    ("fault rtde_silence", "report_silence"),
    ("fault slider 0.3", "speed_slider"),
    ("fault program_stop", "program_stopped"),
    ("fault slow_response 4", "slow_response"),
]


@pytest.mark.parametrize(("fault", "kind"), FAULTS, ids=[kind for _, kind in FAULTS])
def test_a_fault_in_motion_ends_in_a_stopped_arm_and_a_closed_session_that_names_it(
    bench, ur3e, short_plan, tmp_path, fault, kind
):
    struck: list[str] = []

    def strike(progress) -> None:
        if progress.index == 1 and not struck and "moving" in ur3e.control("status"):
            struck.append(ur3e.control(fault))

    unseen = kind == "disconnect"  # for ever: nobody can ask any more
    sentence = "the run was ended: .* nobody saw the arm" if unseen else "the arm was stopped: "
    with pytest.raises(DriverError, match=sentence) as caught:
        bench.drive(short_plan, ur3e, tmp_path, progress=strike)
    assert struck == ["ok"]
    assert caught.value.exit_code == 3
    ur3e.wait_until("at rest", 5)
    session = faulted_session(tmp_path, {kind})
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    seen = told.details["fault"]
    expected = {"disconnect": "unknown", "report_silence": "halted"}
    assert told.details["arm"] == expected.get(kind, "at rest")
    notes = [note for note in caught.value.__notes__ if "what to do" not in note]
    assert notes == [
        f"what was recorded is kept in {session.path}: {len(session.steps)} of 4 steps are whole"
    ]
    assert (f"what to do: {UR_REMEDIES.get(seen)}" in caught.value.__notes__) == (
        seen in UR_REMEDIES
    )


def test_late_and_lost_packages_do_not_stop_a_run_that_can_bear_them(
    bench, ur3e, short_plan, tmp_path
):
    ur3e.control("fault rtde_delay 0.05")
    ur3e.control("fault rtde_loss 0.2")
    session = bench.drive(short_plan, ur3e, tmp_path)
    assert session.status is RunStatus.COMPLETED
    lost = session.manifest.arm.timing.samples_missed
    expected = len(session.arm().host_time_ns) + lost
    assert 0.1 < lost / expected < 0.8


def test_stamps_that_fall_behind_in_motion_are_followed_before_the_next_one(
    bench, ur3e, short_plan, tmp_path
):
    struck: list[str] = []

    def strike(progress) -> None:
        if progress.index == 1 and not struck and "moving" in ur3e.control("status"):
            struck.append(ur3e.control("fault clock_step -0.4"))

    session = bench.drive(short_plan, ur3e, tmp_path, progress=strike)
    (step, *more) = [event for event in session.events if event.event == "arm_time_step"]
    assert 0.3 < step.details["by_s"] < 0.5
    assert sum(abs(event.details["by_s"]) for event in more) < 0.1
    arm = session.arm()
    for before, after in zip(session.steps[1:], session.steps[2:], strict=False):
        rest = (arm.host_time_ns > before.settled_ns) & (arm.host_time_ns < after.start_ns)
        assert rest.sum() > 10
        assert np.abs(np.ptp(arm.q_measured[rest], axis=0)).max() < np.radians(0.05), (
            "nothing moves before it is commanded"
        )


def test_a_controller_that_sends_nothing_is_told_with_what_to_do(bench, ur3e, short_plan, tmp_path):
    ur3e.control("fault rtde_silence")
    with pytest.raises(DriverError, match=r"sends no data: none came in 3 s") as caught:
        bench.drive(short_plan, ur3e, tmp_path)
    assert caught.value.exit_code == 3
    assert f"what to do: {UR_REMEDIES['silence']}" in caught.value.__notes__
    assert not list_sessions(tmp_path)
