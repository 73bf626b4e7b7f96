"""The driver of Universal Robots arms: the real client library against an emulated controller, over
TCP.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from testbench.drivers.arms.controller_lock import ControllerLock
from testbench.drivers.arms.remedies import UR_REMEDIES
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.exceptions import ArmRefused, DriverError
from testbench.pipeline.analyse import analyse
from testbench.records.session import RunStatus, Session, list_sessions
from tests.asking import analysis
from tests.benchmarks.real_arm import following
from tests.emulated_arms import REAL_TIME, ROOT, drive_ur, emulated_ur, faulted_session, ur_command

pytest.importorskip("rtde_control", reason="ur_rtde is not installed")
pytestmark = REAL_TIME


@pytest.fixture(scope="module")
def done(ur_emulator, short_plan, tmp_path_factory) -> Session:
    """The short protocol, run once; its files must not be changed."""
    ur_emulator.control("clear")
    ur_emulator.wait_until("at rest")
    return drive_ur(short_plan, ur_emulator, tmp_path_factory.mktemp("logs"))


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
    assert 0.03 < lag < 0.15  # lookahead 30 ms, servo 27 ms, and what a busy machine adds
    assert rest < 0.6  # of 6 deg; a busy machine holds the emulator up at times


def test_the_session_says_what_arm_it_was_and_that_the_sensors_were_simulated(done, ur_emulator):
    manifest = done.manifest.content
    assert done.status is RunStatus.COMPLETED
    assert manifest["arm"]["driver"] == "ur" and manifest["arm"]["model"] == "UR3"
    assert manifest["simulated_sensors"] is True
    assert manifest["arm"]["tool"] == {"mass_kg": 0.2, "centre_mm": [0, 0, 30]}
    assert manifest["arm"]["timing"]["cycles"] > 1000
    states = [event.details["state"] for event in done.events if event.event == "state"]
    assert states == ["approaching", "running", "stopping", "done"]
    assert "200" not in ur_emulator.control("status")


def test_the_controllers_time_stamps_and_modes_are_recorded(done):
    import pandas as pd

    table = pd.read_parquet(done.path / "arm.parquet")
    assert (table["robot_mode"] == 7).all() and (table["safety_mode"] == 1).all()
    steps = np.diff(table["controller_time_ns"])
    assert (steps % 8_000_000 == 0).all() and np.median(steps) == 8_000_000
    drift = table["host_time_ns"] - table["controller_time_ns"]
    assert np.ptp(drift) < 20e6  # slewed, and a millisecond of jitter at most on an idle machine
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
    ur3e, short_plan, tmp_path, fault, sentence
):
    moved = ur3e.control("status").rpartition(",")[2]
    ur3e.control(fault)
    with pytest.raises(ArmRefused, match=sentence) as caught:
        drive_ur(short_plan, ur3e, tmp_path)
    assert caught.value.exit_code == 2
    assert not list(tmp_path.iterdir())
    assert ur3e.control("status").rpartition(",")[2] == moved


def test_another_model_or_an_old_controller_is_refused(short_plan, tmp_path):
    with (
        emulated_ur("--model", "ur5e") as other,
        pytest.raises(ArmRefused, match="plan is for a ur3e, the controller calls"),
    ):
        drive_ur(short_plan, other, tmp_path)
    with (
        emulated_ur("--polyscope", "5.3.0.1") as old,
        pytest.raises(ArmRefused, match=r"PolyScope 5\.3"),
    ):
        drive_ur(short_plan, old, tmp_path)


def test_a_second_run_on_the_same_arm_is_refused_and_leaves_the_first_alone(
    ur3e, short_plan, tmp_path, monkeypatch
):
    elsewhere = (
        tmp_path / "tmp"
    )  # where the lock of another machine would be: only the controller can tell then
    elsewhere.mkdir()
    told: list[str] = []

    def intrude() -> None:
        for folder in (None, elsewhere):
            if folder is not None:
                monkeypatch.setenv("TMPDIR", str(folder))
            arm = UrArm(short_plan.robot, ur_settings(short_plan, ur3e.address))
            try:
                arm.connect()
            except ArmRefused as refusal:
                told.append(str(refusal))
            finally:
                arm.close()

    second = threading.Thread(target=intrude)

    def begin(progress) -> None:
        if second.ident is None:
            second.start()
            os.kill(os.getpid(), signal.SIGUSR1)
        elif not second.is_alive():
            os.kill(os.getpid(), signal.SIGUSR2)

    session = drive_ur(short_plan, ur3e, tmp_path / "logs", progress=begin)
    assert "another run of the bench on this machine" in told[0]
    assert "a program is running on this controller (another bench, or the pendant?)" in told[1]
    assert session.status is RunStatus.COMPLETED


def test_nobody_at_the_address_is_a_clear_message(short_plan, tmp_path):
    arm = UrArm(short_plan.robot, ur_settings(short_plan, "127.99.99.99"))
    with pytest.raises(DriverError, match=r"127\.99\.99\.99"):
        arm.connect()


def test_an_arm_whose_way_to_the_start_is_blocked_is_refused(short_plan, tmp_path):
    with (
        emulated_ur("--at", "0,30,-10,-90,90,0") as far,
        pytest.raises(ArmRefused, match="by hand"),
    ):
        drive_ur(short_plan, far, tmp_path)


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
MAY_BE_SEEN_AS = {
    "disconnect": {"disconnect", "report_silence", "refused", "driver"},
    "program_stopped": {"program_stopped", "refused"},
    "slow_response": {
        "slow_response",
        "refused",
        "host_silence",
    },  # nothing feeds the watchdog while the client waits
}


@pytest.mark.parametrize(("fault", "kind"), FAULTS, ids=[kind for _, kind in FAULTS])
def test_a_fault_in_motion_ends_in_a_stopped_arm_and_a_closed_session_that_names_it(
    ur3e, short_plan, tmp_path, fault, kind
):
    struck: list[str] = []

    def strike(progress) -> None:
        if progress.index == 1 and not struck and "moving" in ur3e.control("status"):
            struck.append(ur3e.control(fault))

    with pytest.raises(DriverError, match="the arm was stopped") as caught:
        drive_ur(short_plan, ur3e, tmp_path, progress=strike)
    assert struck == ["ok"]
    assert caught.value.exit_code == 3
    ur3e.wait_until("at rest", 5)
    session = faulted_session(tmp_path, MAY_BE_SEEN_AS.get(kind, {kind}))
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    seen = told.details["fault"]
    notes = [note for note in caught.value.__notes__ if "what to do" not in note]
    assert notes == [
        f"what was recorded is kept in {session.path}: {len(session.steps)} of 4 steps are whole"
    ]
    assert (f"what to do: {UR_REMEDIES.get(seen)}" in caught.value.__notes__) == (
        seen in UR_REMEDIES
    )


def test_late_and_lost_packages_do_not_stop_a_run_that_can_bear_them(ur3e, short_plan, tmp_path):
    ur3e.control("fault rtde_delay 0.05")
    ur3e.control("fault rtde_loss 0.2")
    session = drive_ur(short_plan, ur3e, tmp_path)
    assert session.status is RunStatus.COMPLETED
    lost = session.manifest.arm.timing.samples_missed
    expected = len(session.arm().host_time_ns) + lost
    assert 0.1 < lost / expected < 0.8


def test_stamps_that_fall_behind_in_motion_are_followed_before_the_next_one(
    ur3e, short_plan, tmp_path
):
    struck: list[str] = []

    def strike(progress) -> None:
        if progress.index == 1 and not struck and "moving" in ur3e.control("status"):
            struck.append(ur3e.control("fault clock_step -0.4"))

    session = drive_ur(short_plan, ur3e, tmp_path, progress=strike)
    (step, *more) = [event for event in session.events if event.event == "arm_time_step"]
    assert 0.3 < step.details["by_s"] < 0.5
    assert sum(abs(event.details["by_s"]) for event in more) < 0.1
    arm, begun = session.arm(), {step.index: step.start_ns for step in session.steps}
    for index in (2, 3):
        before = (arm.host_time_ns > begun[index] - 0.3e9) & (arm.host_time_ns < begun[index])
        assert np.abs(np.ptp(arm.q_measured[before], axis=0)).max() < np.radians(0.05), (
            "nothing moves before it is commanded"
        )


def test_a_controller_that_sends_nothing_is_told_with_what_to_do(ur3e, short_plan, tmp_path):
    ur3e.control("fault rtde_silence")
    with pytest.raises(DriverError, match=r"sends no data: none came in 3 s") as caught:
        drive_ur(short_plan, ur3e, tmp_path)
    assert caught.value.exit_code == 3
    assert f"what to do: {UR_REMEDIES['silence']}" in caught.value.__notes__
    assert not list_sessions(tmp_path)


@pytest.mark.parametrize("whom", ["the bench", "the process that drives the arm"])
def test_a_kill_in_motion_stops_the_arm(ur3e, short, tmp_path, whom):
    before = int(ur3e.control("status").split()[-2])
    run = ur_command(
        ur3e, short, tmp_path / "logs", "--confirm-motion", "--hazards-checked", "--json"
    )
    bench = subprocess.Popen(
        run, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        end = time.monotonic() + 30
        while int(ur3e.control("status").split()[-2]) < before + 100 and time.monotonic() < end:
            time.sleep(0.01)
        if whom == "the bench":
            bench.kill()
        else:
            children = Path(f"/proc/{bench.pid}/task/{bench.pid}/children").read_text().split()
            os.kill(int(children[0]), signal.SIGKILL)
        ur3e.wait_until("at rest", 5)
        ur3e.wait_until("STOPPED", 5)
        bench.wait(15)
    finally:
        bench.kill()
        _, said = bench.communicate()
    lock, end = ControllerLock(ur3e.address), time.monotonic() + 10
    while not (free := lock.take()) and time.monotonic() < end:
        time.sleep(0.05)
    lock.release()
    assert free, "a process still drives the arm"
    (session,) = list_sessions(tmp_path / "logs")
    if whom == "the bench":
        assert session.status is RunStatus.RUNNING and not session.is_being_recorded
    else:
        assert bench.returncode == 3
        assert "watchdog" in said
        told = json.loads(said.splitlines()[-1])["error"]
        assert told["notes"][-1] == (
            f"go on: testbench run --resume {session.path} --arm ur --host {ur3e.address} "
            "--confirm-motion --simulate-imus "
            f"--logs {tmp_path / 'logs'}"
        )
        assert session.status is RunStatus.ERROR
        assert json.loads((session.path / "manifest.json").read_text())["message"] in said
