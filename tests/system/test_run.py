"""Whole runs from the command line: what is printed, what is kept, and how Ctrl-C ends."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from testbench import execute, plan
from testbench.cli.output import in_ranges
from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.records.session.session import RunStatus, Session
from tests.patience import PATIENCE_S
from tests.processes import bench, virtual_time

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run(tiny, tmp_path_factory):
    """The tiny protocol, run once from the command line of a shell: what it printed."""
    words = ["run", tiny, "--logs", tmp_path_factory.mktemp("logs"), "--seed", "4"]
    command = [sys.executable, "-m", "testbench", *words, "--no-report", "--json"]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)


def test_a_run_ends_with_one_json_object_that_names_session_outcome_and_report(run):
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout.splitlines()[-1])
    assert set(result) >= {"session", "outcome", "report"}
    assert result["report"] is None
    assert Session(result["session"]).status is RunStatus.COMPLETED


def test_evaluate_prints_the_evaluation_as_json(run):
    session = json.loads(run.stdout.splitlines()[-1])["session"]
    done = bench("evaluate", session, "--json")
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout.splitlines()[-1])
    assert printed == json.loads((Path(session) / "evaluation.json").read_text())


def test_the_command_line_writes_the_bytes_that_the_library_writes(run, tiny, tmp_path):
    session = Session(json.loads(run.stdout.splitlines()[-1])["session"])
    same = execute(plan(tiny), tmp_path, seed=4)
    for name in (
        "arm.parquet",
        "imu_hand.parquet",
        "truth_hand.parquet",
        "plan.parquet",
        "events.jsonl",
    ):
        assert (session.path / name).read_bytes() == (same.path / name).read_bytes(), name


@pytest.fixture(scope="module")
def interrupted(tiny, tmp_path_factory):
    """The tiny protocol in real time, ended by Ctrl-C during its first move: exit code, what was
    printed, session.
    """
    logs = tmp_path_factory.mktemp("logs")
    done = bench(
        *("run", tiny, "--speed", "realtime", "--logs", logs, "--no-report"),
        around=partial(virtual_time, 1.3, signal.SIGINT),
    )
    (folder,) = logs.iterdir()
    return done.returncode, done.stdout + done.stderr, Session(folder)


def test_ctrl_c_ends_with_130_a_sentence_and_no_traceback(interrupted):
    code, printed, session = interrupted
    assert code == 130
    assert "interrupted by the operator" in printed.replace("\n", " ")
    assert f"go on: testbench run --resume {session.path}" in printed
    assert "Traceback" not in printed
    assert session.status is RunStatus.INTERRUPTED


def test_ctrl_c_closes_the_session_with_its_arm_at_rest(interrupted):
    session = interrupted[2]
    assert not list(session.path.glob("*.arrows")) and not list(session.path.glob("*.partial"))
    assert session.events[-1].event == "run_interrupted"
    arm = session.arm()
    assert arm.host_time_ns[-1] > 2.2e9  # a second more, in which it comes to rest
    assert abs(arm.v_measured[-5:]).max() < 0.005
    assert [step.name for step in session.steps] == ["start"]  # only what was finished


def test_an_interrupted_session_is_estimated_and_evaluated_like_any_other(interrupted):
    session = interrupted[2]
    evaluation = evaluate(session, estimate(session))
    assert {row.filter for row in evaluation.orientation} == {"device", "vqf_6d"}
    assert any("interrupted" in note for note in evaluation.notes)
    done = bench("evaluate", session.path, "--json")
    assert done.returncode == 0, done.stderr


def test_a_session_killed_in_the_middle_is_recovered_from_the_command_line(tiny, tmp_path):
    killed = bench(
        *("run", tiny, "--speed", "realtime", "--logs", tmp_path, "--no-report"),
        around=partial(virtual_time, 2.5, signal.SIGKILL),
    )
    assert killed.returncode == -signal.SIGKILL
    (folder,) = tmp_path.iterdir()
    refused = bench("evaluate", folder)
    assert (
        refused.returncode == 2
        and "recover" in refused.stderr
        and "Traceback" not in refused.stderr
    )
    recovered = bench("recover", folder)
    assert recovered.returncode == 0, recovered.stderr
    assert (
        "and recovered" in recovered.stdout
        and f"go on: testbench run --resume {folder}" in recovered.stdout
    )
    again = json.loads(bench("recover", folder, "--json").stdout)
    assert again["message"].startswith(
        "nothing to recover; it was closed as aborted before: cut off after"
    )
    done = {step.index for step in Session(folder).steps}
    assert again["missing_steps"] == [
        index for index in range(max(again["missing_steps"]) + 1) if index not in done
    ]
    assert 0 not in again["missing_steps"]
    assert (
        f"missing: {len(again['missing_steps'])} of 3 steps: {in_ranges(again['missing_steps'])}\n"
        in recovered.stdout
    )
    assert bench("evaluate", folder, "--json").returncode == 0
    assert Session(folder).status is RunStatus.ABORTED
