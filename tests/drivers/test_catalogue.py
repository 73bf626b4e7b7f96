"""The catalogue of arms: who adds a vendor adds an entry, and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.drivers.arms import catalogue
from testbench.drivers.arms.catalogue import ARMS, find_arm
from testbench.drivers.arms.entry import ArmEntry
from testbench.exceptions import DriverError, InputError, NotFoundError
from testbench.pipeline.arm import refuse_arm
from testbench.pipeline.request import ArmRequest, RunRequest
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Consent, Watcher
from testbench.records.disk.json_file import read_json, write_json
from testbench.records.session.session import Session
from testbench.records.specs.robot import load_robot
from testbench.reporting.sections.run import simulated_parts
from tests.asking import run_of
from tests.conftest import FakeClock
from tests.drivers.trial_arm import ENTRY
from tests.patience import PATIENCE_S

ALLOWED = Watcher(FakeClock(), consent=Consent(motion=True, hazards_checked=True))
ROOT = Path(__file__).resolve().parents[2]
ON_TRIAL = """
import json, sys
from testbench.drivers.arms.catalogue import ARMS
from tests.drivers.trial_arm import ENTRY
ARMS[ENTRY.name] = ENTRY
from testbench.cli import main
for words in json.loads(sys.argv[1]):
    sys.argv = ["testbench", *words]
    try:
        main()
    except SystemExit:
        print("<ended>", flush=True)
"""
"""The command line of an installation whose catalogue has one more entry, command by command."""


@pytest.fixture
def trial(monkeypatch: pytest.MonkeyPatch) -> ArmEntry:
    """A vendor of its own for one test."""
    monkeypatch.setitem(ARMS, ENTRY.name, ENTRY)
    return ENTRY


def said(*commands: list[str]) -> list[str]:
    """What the command line with the trial's entry says to each command."""
    wide = os.environ | {"COLUMNS": "200", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", ON_TRIAL, json.dumps(commands)],
        env=wide,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    *told, rest = done.stdout.split("<ended>\n")
    assert not rest and len(told) == len(commands), done.stdout
    return [" ".join(text.replace("│", " ").split()) for text in told]


def test_a_new_entry_is_offered_and_asked_for_its_options(tiny):
    run, host = ["run", str(tiny)], ["--host", "1.2.3.4"]
    offered, no_host, no_log, no_arm, dry = said(
        ["run", "--help"],
        [*run, "--arm", "trial", "--simulate-imus"],
        [*run, "--arm", "trial", *host, "--log", "motion.csv"],
        [*run, *host],
        [*run, "--arm", "trial", *host, "--simulate-imus"],
    )
    assert "<sim|ur|xarm|replay|trial>" in offered
    assert "trial an arm for tests" in offered
    assert "--arm trial needs --host, the address of the trial" in no_host
    assert "--log needs --arm replay" in no_log
    assert "--host needs --arm ur, xarm or trial" in no_arm
    assert "this was a dry run" in dry


def test_a_new_entry_drives_a_run_whose_report_says_where_the_motion_is_from(trial, tiny, tmp_path):
    arm = ArmRequest(driver="trial", host="bright", simulate_imus=True)
    result = run(run_of(tiny, report=True, arm=arm, seed=3, logs=tmp_path), ALLOWED)
    session = Session(result.session.path)
    assert [step.name for step in session.steps] == ["start", "out", "wave"]
    assert session.manifest.arm.record == trial.record
    assert "which followed the motion that nobody measured" in result.report.read_text("utf-8")


def test_a_fault_of_a_new_entry_comes_with_its_own_words(trial, tiny, tmp_path):
    arm = ArmRequest(driver="trial", host="dark", simulate_imus=True)
    with pytest.raises(DriverError, match="it is dark") as caught:
        run(run_of(tiny, arm=arm, logs=tmp_path), ALLOWED)
    assert "what to do: put the plug back" in caught.value.__notes__


def test_an_arm_of_a_new_vendor_is_sent_to_its_driver(trial):
    with pytest.raises(InputError, match=r"the plan is for trial1: say --arm trial$"):
        catalogue.refuse_other_maker("xarm", "trial1")


def test_an_arm_that_no_entry_has_is_refused_with_those_that_there_are():
    with pytest.raises(NotFoundError, match="unknown arm 'trial'; known: sim, ur, xarm, replay"):
        find_arm("trial")


@pytest.mark.parametrize("name", list(ARMS))
def test_an_entry_holds_together(name, tiny):
    entry = ARMS[name]
    assert entry.name == name and find_arm(entry.record.driver) is entry
    assert entry.needs is None or entry.needs[0] in entry.options
    assert set(entry.former_faults.values()) <= set(entry.remedies)
    assert entry.commanded == bool(entry.remedies)
    unknown = entry.options - set(catalogue.CHECKED)
    assert not unknown, f"{unknown} is offered by no option of run"
    if entry.needs is not None:
        with pytest.raises(InputError, match=f"--arm {name} needs {entry.needs[0]}, "):
            refuse_arm(RunRequest(arm=ArmRequest(driver=name)), Consent())


@pytest.mark.parametrize(("name", "robot"), [("ur", "ur3e"), ("ur", "ur10e"), ("xarm", "xarm6")])
def test_the_robots_that_ship_have_a_driver(name, robot):
    assert [entry.name for entry in ARMS.values() if entry.extra and entry.drives(robot)] == [name]
    assert load_robot(robot).name == robot


def test_a_cause_of_an_earlier_session_has_the_words_of_today():
    for name in ("ur", "xarm"):
        remedy = find_arm(name).remedy("report_silence")
        assert remedy and find_arm(name).remedy("rtde_silence") == remedy
    assert find_arm("ur").remedy("connection") is None


@pytest.fixture
def earlier(quick, tmp_path) -> Session:
    """A session whose manifest names no more of its arm than the driver."""
    folder = tmp_path / "earlier"
    folder.mkdir()
    for file in quick.session.path.iterdir():
        if file.is_file():
            (folder / file.name).write_bytes(file.read_bytes())
    return Session(folder)


@pytest.mark.parametrize(
    ("driver", "said"),
    [
        ("ur", "models of the sensors, which followed the motion that the controller of an arm"),
        ("xarm", "models of the sensors, which followed the motion that the controller of an arm"),
        ("replay", "models of the sensors, which followed a recorded motion"),
        ("simulated", "models of the arm and of the sensors, not from real ones"),
    ],
)
def test_an_earlier_session_still_says_where_its_motion_is_from(earlier, driver, said):
    manifest = read_json(earlier.path / "manifest.json")
    write_json(earlier.path / "manifest.json", manifest | {"arm": {"driver": driver}})
    session = Session(earlier.path)
    assert simulated_parts(session).startswith(said)
    record = session.manifest.arm.record
    assert record is not None and record == find_arm(driver).record
    done = CliRunner().invoke(app, ["report", str(session.path)])
    assert done.exit_code == 0, done.output
    assert said in (session.path / "report.html").read_text("utf-8")


def test_the_catalogue_loads_no_driver_and_nothing_heavy():
    code = (
        "import sys, testbench.drivers.arms.catalogue\n"
        "heavy = {'numpy', 'pydantic', 'pyarrow', 'numba', 'rtde_control', 'xarm'}\n"
        "own = {m for m in sys.modules if m.startswith('testbench.')}\n"
        "print(sorted(heavy & set(sys.modules)), len(own))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded, own = done.stdout.rsplit(" ", 1)
    assert loaded == "[]" and int(own) < 10
