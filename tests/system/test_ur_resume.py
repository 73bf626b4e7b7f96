"""A run on an arm that broke off goes on: with its missing steps, by the same protocol, on the same
arm.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.exceptions import ArmRefused, DriverError, InputError, RunInterrupted
from testbench.pipeline.prepared import Prepared, make_plan
from testbench.pipeline.request import ArmRequest
from testbench.pipeline.run import prepare, run
from testbench.pipeline.watcher import Consent, Watcher
from testbench.records.session.plan import Plan
from testbench.records.session.session import RunStatus, Session, list_sessions
from tests.asking import going_on, run_of
from tests.emulated_arms import ROOT, SHORT
from tests.lock_step.bench import VirtualArm, VirtualBench, virtual_bench

NO_ARM = ArmRequest(driver="ur", host="127.99.99.99", simulate_imus=True)


def resumption(session: Path, **run: Any) -> Prepared:
    """How a session would go on; nothing is connected."""
    return prepare(going_on(session, arm=NO_ARM, **run))


def broken_off(bench: VirtualBench, ur3e: VirtualArm, plan: Plan, logs: Path) -> Session:
    """A session that the operator stopped at once."""
    with pytest.raises(
        RunInterrupted, match=r"what was recorded is kept in .*: \d of \d steps are whole$"
    ):
        bench.drive(plan, ur3e, logs, progress=lambda progress: os.kill(os.getpid(), signal.SIGINT))
    (session,) = list_sessions(logs)
    return session


@pytest.fixture(scope="module")
def stopped(short_plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> Session:
    """A session of the short protocol; its files must not be changed."""
    with virtual_bench() as bench:
        return broken_off(bench, bench.ur(), short_plan, tmp_path_factory.mktemp("logs"))


def test_a_run_that_broke_off_goes_on_with_its_missing_steps_after_the_references(
    bench, ur3e, short_plan, short, tmp_path
):
    def strike(progress) -> None:
        if progress.index == 2:  # the sweep
            ur3e.control("fault protective_stop")

    with pytest.raises(DriverError):
        bench.drive(short_plan, ur3e, tmp_path, progress=strike)
    (broken,) = list_sessions(tmp_path)
    assert [step.index for step in broken.steps] == [0, 1]
    ur3e.control("clear")
    before = ur3e.control("status")
    dry = ["run", "--resume", str(broken.path), "--arm", "ur", "--host", ur3e.address]
    shown = CliRunner().invoke(app, dry)
    assert isinstance(shown.exception, ArmRefused) and shown.exception.exit_code == 2
    assert "dry run" in str(shown.exception)
    assert f"{short} is still the same" in shown.stderr
    lines = [line.strip() for line in shown.stdout.partition("Motion, from")[2].splitlines()]
    lines = [line for line in lines if re.match(r"[0-9] |- ", line)]
    assert [line.split()[0] for line in lines] == ["0", "-", "2", "3", "3"]
    assert lines[1].split()[1:4] == ["on", "to", "'wave'"] and "-70.0 90.0 40.0" in lines[1]
    assert "wrist_3 34.0..46.0" in lines[2]
    assert lines[4].startswith("3 steps of 4, reference and calibration once more,")
    assert ur3e.control("status") == before
    seen: list[str] = []
    arm = ArmRequest(driver="ur", host=ur3e.address, simulate_imus=True)
    watcher = Watcher(
        progress=lambda progress: progress.doing or seen.append(progress.step),
        consent=Consent(motion=True, hazards_checked=True),
    )
    result = run(going_on(broken.path, arm=arm, seed=1, logs=tmp_path), watcher)
    assert result.session.status is RunStatus.COMPLETED
    assert list(dict.fromkeys(seen)) == ["start", "on to 'wave'", "wave", "back"]
    ways = [event for event in result.session.events if event.event.startswith("connecting_")]
    assert [(way.event, way.details) for way in ways] == [
        ("connecting_started", {"towards": 2, "name": "wave"}),
        ("connecting_ended", {"towards": 2, "name": "wave"}),
    ]
    assert np.ptp([way.host_time_ns for way in ways]) > 2e9  # 40 deg at 15 deg/s
    assert [step.index for step in result.session.steps] == [0, 2, 3]
    assert result.session.manifest.resumes.session == broken.name


def test_more_ways_between_steps_than_are_known_in_advance_do_not_hold_up_the_arm(
    bench, ur3e, tmp_path
):
    steps = "".join(
        f"      - {{move_to_deg: {{wrist_3_joint: {2 * (k % 2)}}}}}\n" for k in range(15)
    )
    path = tmp_path / "many.yaml"
    path.write_text(
        SHORT.partition("  - name: moves")[0] + "  - name: moves\n    steps:\n" + steps,
        encoding="utf-8",
    )
    the_plan = make_plan(run_of(path))
    every_other = [the_plan.steps[0], *the_plan.steps[2::2]]
    session = bench.drive(the_plan, ur3e, tmp_path / "logs", steps=every_other)
    assert [step.index for step in session.steps] == [step.index for step in every_other]
    assert sum(event.event == "connecting_ended" for event in session.events) > 4


def test_a_changed_protocol_is_not_resumed_and_the_difference_shown(stopped, tmp_path):
    changed = tmp_path / "short.yaml"
    changed.write_text(SHORT.replace("dwell_s: 0.5", "dwell_s: 0.6"), encoding="utf-8")
    with pytest.raises(InputError, match=r"short\.yaml differs") as caught:
        run(going_on(stopped.path, protocol=changed, arm=NO_ARM, seed=1, logs=tmp_path))
    assert "dwell_s: 0.6" in str(caught.value)


def test_a_protocol_that_was_edited_since_is_not_resumed_unless_the_sessions_own_is_named(
    bench, ur3e, tmp_path
):
    edited = tmp_path / "short.yaml"
    edited.write_text(SHORT, encoding="utf-8")
    session = broken_off(bench, ur3e, make_plan(run_of(edited)), tmp_path / "logs")
    edited.write_text(SHORT.replace("wrist_3_joint: 40", "wrist_3_joint: 20"), encoding="utf-8")
    with pytest.raises(InputError, match=r"short\.yaml was edited since") as caught:
        resumption(session.path)
    assert "wrist_3_joint: 20" in str(caught.value)
    assert str(caught.value).endswith(f"--resume {session.path} {session.path / 'protocol.yaml'}")
    edited.write_text("name: [", encoding="utf-8")  # in the middle of an edit
    with pytest.raises(InputError, match="the protocol that the session keeps"):
        resumption(session.path)
    other = tmp_path / "other.yaml"
    other.write_text(SHORT.replace("wrist_3_joint: 40", "wrist_3_joint: 20"), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"called other\.yaml, that of the session short\.yaml"
    ) as caught:
        resumption(session.path, protocol=other)
    assert str(caught.value).count("\n+") == 2  # the head of the difference, and the line
    kept = resumption(session.path, protocol=session.path / "protocol.yaml")
    assert kept.note == f"resuming by {session.path / 'protocol.yaml'}"
    assert np.degrees(kept.plan.trajectory.q[:, 5]).max() > 39
    edited.unlink()
    assert resumption(session.path).note == "resuming by the protocol that the session keeps"


def test_another_arm_than_the_sessions_is_not_resumed(stopped, tmp_path):
    with pytest.raises(InputError, match="begun on ur3e, and cannot be resumed on ur5e"):
        resumption(stopped.path, robot="ur5e")
    assert resumption(stopped.path, robot="ur3e").plan.robot.name == "ur3e"
    changed = tmp_path / "ur3e"
    shutil.copytree(ROOT / "robots" / "ur3e", changed)
    text = (changed / "robot.yaml").read_text(encoding="utf-8")
    (changed / "robot.yaml").write_text(text + "# by another hand\n", encoding="utf-8")
    with pytest.raises(InputError, match="by another hand"):
        resumption(stopped.path, robot=changed)
