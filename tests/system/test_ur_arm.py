"""Runs on a Universal Robots arm: the real client library against an emulated controller, over TCP."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench.arm_pipeline import ArmSetup, prepare_resume, resume
from testbench.cli.running import ArmChoice, approve
from testbench.clock import SystemClock
from testbench.drivers.arms.remedies import REMEDIES
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.imus.streamed import SessionTime
from testbench.exceptions import ArmRefused, BenchError, DriverError, InputError, RunInterrupted
from testbench.execution.arm_run import ArmRunOptions, Sensors, execute_on_arm
from testbench.execution.checklist import HAZARDS
from testbench.execution.guards import GuardTripped
from testbench.pipeline import analyse, make_plan
from testbench.records.plan import Plan
from testbench.records.session import RunStatus, Session, list_sessions
from tests.benchmarks.real_arm import following
from tests.emulated_arms import ROOT, EmulatedUr, emulated_ur, faulted_session

pytest.importorskip("rtde_control", reason="ur_rtde is not installed")

SHORT = """\
name: short
purpose: A reference, a pose and a sweep, for tests on an arm in real time
robot: ur3e
sensors:
  hand:
    preset: xsens_dot
    link: wrist_3_link
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
motion: {speed: 0.8, acceleration: 0.8, jerk: 0.8}
arm: {tool: {mass_kg: 0.2, centre_mm: [0, 0, 30]}}
sections:
  - name: rest
    role: reference
    steps: [{name: start, dwell_s: 1}]
  - name: moves
    steps:
      - {name: out, move_to_deg: {wrist_3_joint: 40, wrist_1_joint: -70}, dwell_s: 0.5}
      - {name: wave, sweep: {wrist_3_joint: {sine: {amplitude_deg: 6, frequency_hz: 1.5, cycles: 1}}}, dwell_s: 0.3}
      - {name: back, move_to: home, dwell_s: 0.5}
estimate: {filters: [device, vqf_6d], align: heading, calibrate: none}
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("short") / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def short_plan(short) -> Plan:
    return make_plan(short)


@pytest.fixture(scope="module")
def emulator():
    with emulated_ur() as robot:
        yield robot


@pytest.fixture
def robot(emulator: EmulatedUr):
    emulator.control("clear")
    emulator.wait_until("at rest")
    return emulator


def drive(plan: Plan, robot: EmulatedUr, logs: Path, **options) -> Session:
    time_ = SessionTime(SystemClock())
    settings = replace(ur_settings(plan, robot.address), watchdog=1.5, arm_silence=1.5, host_silence=8)  # it may be busy
    arm = UrArm(plan.robot, settings, time_)
    return execute_on_arm(plan, arm, Sensors.simulated(plan, 1), time_, ArmRunOptions(logs, 1, **options))


@pytest.fixture(scope="module")
def done(emulator, short_plan, tmp_path_factory) -> Session:
    """The short protocol, run once; its files must not be changed."""
    emulator.control("clear")
    emulator.wait_until("at rest")
    return drive(short_plan, emulator, tmp_path_factory.mktemp("logs"))


def test_static_poses_are_reached_to_a_hundredth_of_a_degree(done, short_plan):
    arm = done.arm()
    for step in done.steps:
        rest = (arm.host_time_ns > step.settled_ns) & (arm.host_time_ns < step.end_ns)
        assert rest.sum() > 10
        planned = short_plan.trajectory.at(np.array([short_plan.steps[step.index].settled_ns]))[0][0]
        assert np.degrees(np.abs(np.median(arm.q_measured[rest], axis=0) - planned)).max() < 0.01


def test_a_sweep_is_followed_with_nothing_but_lag(done, short_plan):
    lag, rest, _ = following(done, short_plan)
    assert 0.03 < lag < 0.15  # lookahead 30 ms, servo 27 ms, and what a busy machine adds
    assert rest < 0.6  # of 6 deg; a busy machine holds the emulator up at times


def test_the_session_says_what_arm_it_was_and_that_the_sensors_were_simulated(done, emulator):
    manifest = done.manifest
    assert done.status is RunStatus.COMPLETED
    assert manifest["arm"]["driver"] == "ur" and manifest["arm"]["model"] == "UR3"
    assert manifest["simulated_sensors"] is True
    assert manifest["arm"]["timing"]["cycles"] > 1000
    states = [event.details["state"] for event in done.events if event.event == "state"]
    assert states == ["approaching", "running", "stopping", "done"]
    assert "200" not in emulator.control("status")


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
    result = analyse(done, with_report=False)
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
def test_an_arm_that_must_not_be_driven_is_refused_before_anything_moves(robot, short_plan, tmp_path, fault, sentence):
    moved = robot.control("status").rpartition(",")[2]
    robot.control(fault)
    with pytest.raises(ArmRefused, match=sentence) as caught:
        drive(short_plan, robot, tmp_path)
    assert caught.value.exit_code == 2
    assert not list(tmp_path.iterdir())
    assert robot.control("status").rpartition(",")[2] == moved


def test_another_model_or_an_old_controller_is_refused(short_plan, tmp_path):
    with emulated_ur("--model", "ur5e") as other, pytest.raises(ArmRefused, match="plan is for a ur3e, the controller calls"):
        drive(short_plan, other, tmp_path)
    with emulated_ur("--polyscope", "5.3.0.1") as old, pytest.raises(ArmRefused, match=r"PolyScope 5\.3"):
        drive(short_plan, old, tmp_path)


def test_a_second_run_on_the_same_arm_is_refused_and_leaves_the_first_alone(robot, short_plan, tmp_path, monkeypatch):
    elsewhere = tmp_path / "tmp"  # where the lock of another machine would be: only the controller can tell then
    elsewhere.mkdir()
    told: list[str] = []

    def intrude() -> None:
        for folder in (None, elsewhere):
            if folder is not None:
                monkeypatch.setenv("TMPDIR", str(folder))
            arm = UrArm(short_plan.robot, ur_settings(short_plan, robot.address))
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

    session = drive(short_plan, robot, tmp_path / "logs", progress=begin)
    assert "another run of the bench on this machine" in told[0]
    assert "a program is running on this controller (another bench, or the pendant?)" in told[1]
    assert session.status is RunStatus.COMPLETED


def test_nobody_at_the_address_is_a_clear_message(short_plan, tmp_path):
    arm = UrArm(short_plan.robot, ur_settings(short_plan, "127.99.99.99"))
    with pytest.raises(DriverError, match=r"127\.99\.99\.99"):
        arm.connect()


def test_an_arm_whose_way_to_the_start_is_blocked_is_refused(short_plan, tmp_path):
    with emulated_ur("--at", "0,30,-10,-90,90,0") as far, pytest.raises(ArmRefused, match="by hand"):
        drive(short_plan, far, tmp_path)


FAULTS = [
    ("fault protective_stop", "protective_stop"),
    ("fault emergency_stop", "emergency_stop"),
    ("fault power_off", "power_off"),
    ("fault disconnect", "disconnect"),
    ("fault rtde_silence", "rtde_silence"),
    ("fault slider 0.3", "speed_slider"),
    ("fault program_stop", "program_stopped"),
    ("fault slow_response 4", "slow_response"),
]
MAY_BE_SEEN_AS = {
    "disconnect": {"disconnect", "rtde_silence", "refused", "driver"},
    "program_stopped": {"program_stopped", "refused"},
    "slow_response": {"slow_response", "refused", "host_silence"},  # nothing feeds the watchdog while the client waits
}


@pytest.mark.parametrize(("fault", "kind"), FAULTS, ids=[kind for _, kind in FAULTS])
def test_a_fault_in_motion_ends_in_a_stopped_arm_and_a_closed_session_that_names_it(robot, short_plan, tmp_path, fault, kind):
    struck: list[str] = []

    def strike(progress) -> None:
        if progress.index == 1 and not struck and "moving" in robot.control("status"):
            struck.append(robot.control(fault))

    with pytest.raises(DriverError, match="the arm was stopped") as caught:
        drive(short_plan, robot, tmp_path, progress=strike)
    assert struck == ["ok"]
    assert caught.value.exit_code == 3
    robot.wait_until("at rest", 5)
    session = faulted_session(tmp_path, MAY_BE_SEEN_AS.get(kind, {kind}))
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    seen = told.details["fault"]
    notes = [note for note in caught.value.__notes__ if "what to do" not in note]
    assert notes == [f"what was recorded is kept in {session.path}: {len(session.steps)} of 4 steps are whole"]
    assert (f"what to do: {REMEDIES.get(seen)}" in caught.value.__notes__) == (seen in REMEDIES)


def test_late_and_lost_packages_do_not_stop_a_run_that_can_bear_them(robot, short_plan, tmp_path):
    robot.control("fault rtde_delay 0.05")
    robot.control("fault rtde_loss 0.2")
    session = drive(short_plan, robot, tmp_path)
    assert session.status is RunStatus.COMPLETED
    lost = session.manifest["arm"]["timing"]["samples_missed"]
    expected = len(session.arm().host_time_ns) + lost
    assert 0.1 < lost / expected < 0.8


def test_stamps_that_fall_behind_in_motion_are_followed_before_the_next_one(robot, short_plan, tmp_path):
    struck: list[str] = []

    def strike(progress) -> None:
        if progress.index == 1 and not struck and "moving" in robot.control("status"):
            struck.append(robot.control("fault clock_step -0.4"))

    session = drive(short_plan, robot, tmp_path, progress=strike)
    (step, *more) = [event for event in session.events if event.event == "arm_time_step"]
    assert 0.3 < step.details["by_s"] < 0.5
    assert sum(abs(event.details["by_s"]) for event in more) < 0.1
    arm, begun = session.arm(), {step.index: step.start_ns for step in session.steps}
    for index in (2, 3):
        before = (arm.host_time_ns > begun[index] - 0.3e9) & (arm.host_time_ns < begun[index])
        assert np.abs(np.ptp(arm.q_measured[before], axis=0)).max() < np.radians(0.05), "nothing moves before it is commanded"


def test_a_controller_that_sends_nothing_is_told_with_what_to_do(robot, short_plan, tmp_path):
    robot.control("fault rtde_silence")
    with pytest.raises(DriverError, match=r"sends no data: none came in 3 s") as caught:
        drive(short_plan, robot, tmp_path)
    assert caught.value.exit_code == 3
    assert f"what to do: {REMEDIES['silence']}" in caught.value.__notes__
    assert not list_sessions(tmp_path)


def test_a_run_that_broke_off_goes_on_with_its_missing_steps_after_the_references(robot, short_plan, short, tmp_path):
    def strike(progress) -> None:
        if progress.index == 2:  # the sweep
            robot.control("fault protective_stop")

    with pytest.raises(DriverError):
        drive(short_plan, robot, tmp_path, progress=strike)
    (broken,) = list_sessions(tmp_path)
    assert [step.index for step in broken.steps] == [0, 1]
    robot.control("clear")
    before = robot.control("status")
    dry = [sys.executable, "-m", "testbench", "run", "--resume", str(broken.path), "--arm", "ur", "--host", robot.address]
    shown = subprocess.run(dry, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert shown.returncode == 2 and "dry run" in shown.stderr
    assert f"{short} is still the same" in shown.stderr
    lines = [line.strip() for line in shown.stdout.partition("Motion, from")[2].splitlines()]
    lines = [line for line in lines if re.match(r"[0-9] |- ", line)]
    assert [line.split()[0] for line in lines] == ["0", "-", "2", "3", "3"]
    assert lines[1].split()[1:4] == ["on", "to", "'wave'"] and "-70.0 90.0 40.0" in lines[1]
    assert "wrist_3 34.0..46.0" in lines[2]
    assert lines[4].startswith("3 steps of 4, reference and calibration once more,")
    assert robot.control("status") == before
    seen: list[str] = []
    setup = ArmSetup(host=robot.address, simulate_imus=True, seed=1)
    options = ArmRunOptions(tmp_path, 1, progress=lambda progress: progress.doing or seen.append(progress.step))
    result = resume(broken.path, setup, options, with_report=False)
    assert result.session.status is RunStatus.COMPLETED
    assert list(dict.fromkeys(seen)) == ["start", "on to 'wave'", "wave", "back"]
    ways = [event for event in result.session.events if event.event.startswith("connecting_")]
    assert [(way.event, way.details) for way in ways] == [
        ("connecting_started", {"towards": 2, "name": "wave"}),
        ("connecting_ended", {"towards": 2, "name": "wave"}),
    ]
    assert np.ptp([way.host_time_ns for way in ways]) > 2e9  # 40 deg at 15 deg/s
    assert [step.index for step in result.session.steps] == [0, 2, 3]
    assert result.session.manifest["resumes"]["session"] == broken.name


def test_a_changed_protocol_is_not_resumed_and_the_difference_shown(robot, short_plan, short, tmp_path):
    with pytest.raises(RunInterrupted):
        drive(short_plan, robot, tmp_path, progress=lambda progress: os.kill(os.getpid(), signal.SIGINT))
    (session,) = list_sessions(tmp_path)
    changed = tmp_path / "short.yaml"
    changed.write_text(SHORT.replace("dwell_s: 0.5", "dwell_s: 0.6"), encoding="utf-8")
    setup = ArmSetup(host=robot.address, simulate_imus=True, seed=1)
    with pytest.raises(InputError, match=r"short\.yaml differs") as caught:
        resume(session.path, setup, ArmRunOptions(tmp_path, 1), changed)
    assert "dwell_s: 0.6" in str(caught.value)


def test_more_ways_between_steps_than_are_known_in_advance_do_not_hold_up_the_arm(robot, tmp_path):
    steps = "".join(f"      - {{move_to_deg: {{wrist_3_joint: {2 * (k % 2)}}}}}\n" for k in range(15))
    path = tmp_path / "many.yaml"
    path.write_text(SHORT.partition("  - name: moves")[0] + "  - name: moves\n    steps:\n" + steps, encoding="utf-8")
    the_plan = make_plan(path)
    every_other = [the_plan.steps[0], *the_plan.steps[2::2]]
    session = drive(the_plan, robot, tmp_path / "logs", steps=every_other)
    assert [step.index for step in session.steps] == [step.index for step in every_other]
    assert sum(event.event == "connecting_ended" for event in session.events) > 4


def broken_off(robot: EmulatedUr, plan: Plan, logs: Path) -> Session:
    """A session that the operator stopped at once."""
    with pytest.raises(RunInterrupted):
        drive(plan, robot, logs, progress=lambda progress: os.kill(os.getpid(), signal.SIGINT))
    (session,) = list_sessions(logs)
    return session


def test_a_protocol_that_was_edited_since_is_not_resumed_unless_the_sessions_own_is_named(robot, tmp_path):
    edited = tmp_path / "short.yaml"
    edited.write_text(SHORT, encoding="utf-8")
    session = broken_off(robot, make_plan(edited), tmp_path / "logs")
    edited.write_text(SHORT.replace("wrist_3_joint: 40", "wrist_3_joint: 20"), encoding="utf-8")
    with pytest.raises(InputError, match=r"short\.yaml was edited since") as caught:
        prepare_resume(session.path)
    assert "wrist_3_joint: 20" in str(caught.value)
    assert str(caught.value).endswith(f"--resume {session.path} {session.path / 'protocol.yaml'}")
    edited.write_text("name: [", encoding="utf-8")  # in the middle of an edit
    with pytest.raises(InputError, match="the protocol that the session keeps"):
        prepare_resume(session.path)
    other = tmp_path / "other.yaml"
    other.write_text(SHORT.replace("wrist_3_joint: 40", "wrist_3_joint: 20"), encoding="utf-8")
    with pytest.raises(InputError, match=r"called other\.yaml, that of the session short\.yaml") as caught:
        prepare_resume(session.path, other)
    assert str(caught.value).count("\n+") == 2  # the head of the difference, and the line
    kept = prepare_resume(session.path, session.path / "protocol.yaml")
    assert kept.note == f"resuming by {session.path / 'protocol.yaml'}"
    assert np.degrees(kept.plan.trajectory.q[:, 5]).max() > 39
    edited.unlink()
    assert prepare_resume(session.path).note == "resuming by the protocol that the session keeps"


def test_another_arm_than_the_sessions_is_not_resumed(robot, short_plan, tmp_path):
    session = broken_off(robot, short_plan, tmp_path / "logs")
    with pytest.raises(InputError, match="begun on ur3e, and cannot be resumed on ur5e"):
        prepare_resume(session.path, robot="ur5e")
    assert prepare_resume(session.path, robot="ur3e").plan.robot.name == "ur3e"
    changed = tmp_path / "ur3e"
    shutil.copytree(ROOT / "robots" / "ur3e", changed)
    text = (changed / "robot.yaml").read_text(encoding="utf-8")
    (changed / "robot.yaml").write_text(text + "# by another hand\n", encoding="utf-8")
    with pytest.raises(InputError, match="by another hand"):
        prepare_resume(session.path, robot=changed)


def test_a_pause_waits_between_two_steps_with_the_arm_at_rest(robot, short_plan, tmp_path):
    paused: list[float] = []
    said: list[str] = []

    def pause(progress) -> None:
        if progress.index == 1 and not paused:
            paused.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGUSR1)
        elif paused and time.monotonic() - paused[0] > 2.5:
            os.kill(os.getpid(), signal.SIGUSR2)

    session = drive(short_plan, robot, tmp_path, progress=pause, say=said.append)
    assert session.status is RunStatus.COMPLETED
    assert [line for line in said if "controller's samples" not in line] == [
        "pause requested (asked for): the arm rests after this step",
        "PAUSED (asked for): SIGUSR2 goes on, SIGINT stops",
        "going on",
    ]
    events = {event.event: event.host_time_ns for event in session.events}
    assert events["resumed"] - events["paused"] > 0.5e9
    arm = session.arm()
    waiting = (arm.host_time_ns > events["paused"] + 0.2e9) & (arm.host_time_ns < events["resumed"])
    assert np.abs(arm.v_measured[waiting]).max() < np.radians(0.3)
    states = [event.details["state"] for event in session.events if event.event == "state"]
    assert states == ["approaching", "running", "paused", "running", "stopping", "done"]
    (state,) = [event for event in session.events if event.details.get("state") == "paused"]
    assert state.host_time_ns == events["paused"]
    assert events["pause_requested"] < events["paused"] - 0.1e9


def test_a_guard_stops_the_arm(robot, short, tmp_path):
    guarded = tmp_path / "guarded.yaml"
    rule = "guards: {temperature_degC: {limit: 25, action: stop}}\n"  # the emulated joints have 30 degC
    guarded.write_text(SHORT + rule, encoding="utf-8")
    with pytest.raises(GuardTripped, match=r"temperature of .*: 30 degC, the limit is 25 degC"):
        drive(make_plan(guarded), robot, tmp_path / "logs")
    (session,) = list_sessions(tmp_path / "logs")
    assert session.status is RunStatus.ERROR
    assert any(event.event == "guard" for event in session.events)
    robot.wait_until("at rest", 5)


def test_a_guard_that_pauses_says_why_and_how_to_go_on(robot, tmp_path):
    guarded = tmp_path / "guarded.yaml"
    rule = "guards: {temperature_degC: {limit: 25, action: pause}}\n"
    guarded.write_text(SHORT + rule, encoding="utf-8")
    said: list[str] = []

    def hear(line: str) -> None:
        said.append(line)
        if line.startswith("PAUSED"):
            os.kill(os.getpid(), signal.SIGUSR2)

    session = drive(make_plan(guarded), robot, tmp_path / "logs", say=hear)
    why = "guard: temperature of wrist_3_joint: 30 degC, the limit is 25 degC"  # the last of six that trip at once
    assert said[:6] == [
        f"warning: temperature of {joint}: 30 degC, the limit is 25 degC" for joint in session.robot.joint_names
    ]
    assert said[6:9] == [
        f"pause requested ({why}): the arm rests after this step",
        f"PAUSED ({why}): SIGUSR2 goes on, SIGINT stops",
        "going on",
    ]
    assert said[9].startswith("guards: temperature_degC of elbow_joint 1, ")
    (state,) = [event for event in session.events if event.details.get("state") == "paused"]
    assert state.details["why"] == why
    assert session.status is RunStatus.COMPLETED


def command(robot: EmulatedUr, protocol: Path, logs: Path, *options: str) -> list[str]:
    start = [
        sys.executable,
        "-m",
        "testbench",
        "run",
        str(protocol),
        "--arm",
        "ur",
        "--host",
        robot.address,
        "--logs",
        str(logs),
    ]
    return [*start, "--simulate-imus", "--no-report", "--filters", "device", *options]


def test_without_confirmation_the_whole_motion_is_shown_and_nothing_moves(robot, short, tmp_path):
    before = robot.control("status")
    done = subprocess.run(command(robot, short, tmp_path / "logs"), cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "--confirm-motion" in done.stderr
    for name in ("start", "out", "wave", "back"):
        assert name in done.stdout
    assert not (tmp_path / "logs").exists()
    assert robot.control("status") == before


def test_without_a_look_at_the_hazards_nothing_moves(robot, short, tmp_path):
    asked = command(robot, short, tmp_path / "logs", "--confirm-motion")
    done = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL)
    assert done.returncode == 2
    assert "--hazards-checked" in done.stderr


@pytest.mark.parametrize(
    ("choice", "sentence"),
    [
        (ArmChoice("ur", "127.0.0.1", confirmed=True), "name the sensors on the arm with --serial or --dot"),
        (ArmChoice("ur", "127.99.99.99", simulate_imus=True, confirmed=True), r"127\.99\.99\.99"),
    ],
    ids=["no sensors", "no controller"],
)
def test_a_person_is_asked_only_when_nothing_else_would_refuse_the_run(short_plan, choice, sentence, monkeypatch):
    asked: list[str] = []
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("testbench.cli.running._ask", lambda question: bool(asked.append(question)))
    with pytest.raises(BenchError, match=sentence):
        approve(short_plan, choice, choice.setup())
    assert not asked


def test_a_person_is_asked_of_an_arm_that_can_be_driven_and_that_was_let_go(robot, short_plan, monkeypatch):
    asked: list[str] = []

    def ask(question: str) -> bool:
        asked.append(robot.dashboard("programState"))
        return True

    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("testbench.cli.running._ask", ask)
    choice = ArmChoice("ur", robot.address, simulate_imus=True, confirmed=True)
    assert approve(short_plan, choice, choice.setup())["by"] == "asked on the terminal"
    assert asked == ["STOPPED null"] * len(HAZARDS)


@pytest.mark.parametrize("whom", ["the bench", "the process that drives the arm"])
def test_a_kill_in_motion_stops_the_arm(robot, short, tmp_path, whom):
    before = int(robot.control("status").split()[-2])
    run = command(robot, short, tmp_path / "logs", "--confirm-motion", "--hazards-checked", "--json")
    bench = subprocess.Popen(run, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        end = time.monotonic() + 30
        while int(robot.control("status").split()[-2]) < before + 100 and time.monotonic() < end:
            time.sleep(0.01)
        if whom == "the bench":
            bench.kill()
        else:
            children = Path(f"/proc/{bench.pid}/task/{bench.pid}/children").read_text().split()
            os.kill(int(children[0]), signal.SIGKILL)
        robot.wait_until("at rest", 5)
        robot.wait_until("STOPPED", 5)
        bench.wait(15)
    finally:
        bench.kill()
        _, said = bench.communicate()
    (session,) = list_sessions(tmp_path / "logs")
    if whom == "the bench":
        assert session.status is RunStatus.RUNNING and not session.is_being_recorded
    else:
        assert bench.returncode == 3
        assert "watchdog" in said
        told = json.loads(said.splitlines()[-1])["error"]
        assert told["notes"][-1] == (
            f"go on: testbench run --resume {session.path} --arm ur --host {robot.address} --confirm-motion --simulate-imus "
            f"--logs {tmp_path / 'logs'}"
        )
        assert session.status is RunStatus.ERROR
        assert json.loads((session.path / "manifest.json").read_text())["message"] in said
