"""What the operator of an arm is shown, asked and told, before it moves and while it does."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.exceptions import ArmRefused, BenchError
from testbench.execution.checklist import HAZARDS
from testbench.execution.guards import GuardTripped
from testbench.pipeline.approval import approve
from testbench.pipeline.loaded_analysis import load_analysis
from testbench.pipeline.prepared import Prepared, make_plan
from testbench.pipeline.request import ArmRequest, RunRequest
from testbench.pipeline.watcher import Consent, Watcher
from testbench.records.session.plan import Plan
from testbench.records.session.session import RunStatus, list_sessions
from tests.asking import analysis, run_of
from tests.command_line import command
from tests.emulated_arms import SHORT, run_on_ur


def test_a_pause_waits_between_two_steps_with_the_arm_at_rest(bench, ur3e, short_plan, tmp_path):
    paused: list[int] = []
    said: list[str] = []

    def pause(progress) -> None:
        if progress.index == 1 and not paused:
            paused.append(bench.clock.now_ns)
            os.kill(os.getpid(), signal.SIGUSR1)
        elif paused and bench.clock.now_ns - paused[0] > 2.5e9:
            os.kill(os.getpid(), signal.SIGUSR2)

    session = bench.drive(short_plan, ur3e, tmp_path, progress=pause, say=said.append)
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


def test_a_guard_stops_the_arm(bench, ur3e, tmp_path):
    guarded = tmp_path / "guarded.yaml"
    # the emulated joints have 30 degC
    rule = "guards: {temperature_degC: {limit: 25, action: stop}}\n"
    guarded.write_text(SHORT + rule, encoding="utf-8")
    with pytest.raises(GuardTripped, match=r"temperature of .*: 30 degC, the limit is 25 degC"):
        bench.drive(make_plan(run_of(guarded)), ur3e, tmp_path / "logs")
    (session,) = list_sessions(tmp_path / "logs")
    assert session.status is RunStatus.ERROR
    assert any(event.event == "guard" for event in session.events)
    ur3e.wait_until("at rest", 5)


def test_a_guard_that_pauses_says_why_and_how_to_go_on(bench, ur3e, tmp_path):
    guarded = tmp_path / "guarded.yaml"
    rule = "guards: {temperature_degC: {limit: 25, action: pause}}\n"
    guarded.write_text(SHORT + rule, encoding="utf-8")
    said: list[str] = []

    def hear(line: str) -> None:
        said.append(line)
        if line.startswith("PAUSED"):
            os.kill(os.getpid(), signal.SIGUSR2)

    session = bench.drive(make_plan(run_of(guarded)), ur3e, tmp_path / "logs", say=hear)
    # the last of six that trip at once
    why = "guard: temperature of wrist_3_joint: 30 degC, the limit is 25 degC"
    assert said[:6] == [
        f"warning: temperature of {joint}: 30 degC, the limit is 25 degC"
        for joint in session.robot.joint_names
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


def test_without_confirmation_the_whole_motion_is_shown_and_nothing_moves(ur3e, short, tmp_path):
    before = ur3e.control("status")
    done = CliRunner().invoke(app, run_on_ur(ur3e.address, short, tmp_path / "logs"))
    assert isinstance(done.exception, ArmRefused) and done.exception.exit_code == 2
    assert "--confirm-motion" in str(done.exception)
    for name in ("start", "out", "wave", "back"):
        assert name in done.stdout
    assert not (tmp_path / "logs").exists()
    assert ur3e.control("status") == before


def test_without_a_look_at_the_hazards_nothing_moves(ur3e, short, tmp_path):
    before = ur3e.control("status")
    asked = run_on_ur(ur3e.address, short, tmp_path / "logs", "--confirm-motion")
    done = CliRunner().invoke(app, asked)
    assert isinstance(done.exception, ArmRefused) and done.exception.exit_code == 2
    assert "--hazards-checked" in str(done.exception)
    assert ur3e.control("status") == before


@pytest.mark.parametrize(
    ("arm", "sentence"),
    [
        (
            ArmRequest(driver="ur", host="127.0.0.1"),
            "name the sensors on the arm with --serial or --dot",
        ),
        (ArmRequest(driver="ur", host="127.99.99.99", simulate_imus=True), r"127\.99\.99\.99"),
    ],
    ids=["no sensors", "no controller"],
)
def test_a_person_is_asked_only_when_nothing_else_would_refuse_the_run(
    bench, short_plan, arm, sentence
):
    asked: list[str] = []
    with pytest.raises(BenchError, match=sentence):
        approved(short_plan, arm, lambda question: bool(asked.append(question)))
    assert not asked


def approved(plan: Plan, arm: ArmRequest, ask: Callable[[str], bool]) -> dict[str, Any]:
    """What a person allowed who wants the arm to move, and is asked for the hazards."""
    prepared = Prepared(plan, load_analysis(analysis()))
    watcher = Watcher(consent=Consent(motion=True, ask=ask))
    return approve(prepared, RunRequest(arm=arm), watcher)


def test_a_person_is_asked_of_an_arm_that_can_be_driven_and_that_was_let_go(
    bench, ur3e, short_plan
):
    asked: list[str] = []

    def ask(question: str) -> bool:
        asked.append(ur3e.dashboard("programState"))
        return True

    arm = ArmRequest(driver="ur", host=ur3e.address, simulate_imus=True)
    assert approved(short_plan, arm, ask)["by"] == "asked on the terminal"
    assert asked == ["STOPPED null"] * len(HAZARDS)


def test_a_driving_process_that_is_gone_ends_the_run_with_how_to_go_on(
    bench, ur3e, short, tmp_path, capsys
):
    logs = tmp_path / "logs"
    bench.kill_driving_process(after_s=1.0)
    confirmed = ("--confirm-motion", "--hazards-checked", "--json")
    assert command(*run_on_ur(ur3e.address, short, logs, *confirmed)) == 3
    ur3e.wait_until("at rest", 2)
    ur3e.wait_until("STOPPED", 2)
    said = capsys.readouterr().err
    assert "the arm was stopped: the process that drives the arm has ended" in said
    (session,) = list_sessions(logs)
    told = json.loads(said.splitlines()[-1])["error"]
    assert told["notes"][-1] == (
        f"go on: testbench run --resume {session.path} --arm ur --host {ur3e.address} "
        f"--confirm-motion --simulate-imus --logs {logs} "
        "--filters device --no-report"
    )
    assert session.status is RunStatus.ERROR
    assert json.loads((session.path / "manifest.json").read_text())["message"] in said
