"""How a run that ended is told: what a guard stopped, what was cut off, what may go on."""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path

import pytest

from testbench import execute, plan
from testbench.exceptions import RunInterrupted, SessionError
from testbench.execution import RunOptions
from testbench.execution.guards import GuardTripped
from testbench.execution.recovery import recover
from testbench.execution.resume import differences, missing_steps
from testbench.execution.run_progress import Progress
from testbench.execution.sensors import Sensors
from testbench.records.disk.json_file import read_json, write_json
from testbench.records.session.plan import Plan
from testbench.records.session.raw_files import open_for_analysis
from testbench.records.session.session import RunStatus, Session, list_sessions
from tests.conftest import FakeClock


def with_rule(tiny: Path, folder: Path, rule: str) -> Plan:
    file = folder / "tiny.yaml"
    file.write_text(tiny.read_text(encoding="utf-8") + rule, encoding="utf-8")
    return plan(file)


def test_a_guard_that_is_to_stop_a_run_stops_it(tiny, tmp_path, clock):
    guarded = with_rule(tiny, tmp_path, "guards: {sample_gap_s: {limit: 0.001, action: stop}}\n")
    with pytest.raises(GuardTripped, match="a guard stopped the run: sample gap of hand"):
        execute(guarded, tmp_path / "logs", options=RunOptions(clock=clock, speed="realtime"))
    (session,) = list_sessions(tmp_path / "logs")
    assert session.status is RunStatus.ERROR
    assert "a guard stopped the run" in session.manifest.message
    # the arm came to rest, and no step that it was in counts as done
    assert session.events[-1].event == "run_error"
    assert session.manifest.duration_s < guarded.duration - 1
    assert not session.steps


@pytest.fixture(scope="module")
def whole(tiny, tmp_path_factory) -> tuple[Plan, Session]:
    the_plan = plan(tiny)
    logs = tmp_path_factory.mktemp("logs")
    return the_plan, execute(the_plan, logs, 5, RunOptions(clock=FakeClock()))


def described(the_plan: Plan) -> dict:
    return Sensors.simulated(the_plan, 5).described()


def changed(session: Session, folder: Path, edit) -> Session:
    shutil.copytree(session.path, folder / "copy")
    file = folder / "copy" / "manifest.json"
    content = read_json(file)
    edit(content)
    write_json(file, content)
    return Session(folder / "copy")


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda c: c["plan"].update(hash="0" * 64), "the plan made from the same files is another"),
        (lambda c: c["sensors"]["hand"].update(rate_hz=1.0), "sensor hand differs"),
        (lambda c: c["sensors"].pop("hand"), "sensor hand differs"),
        (lambda c: c["software"].update(numpy="0.1"), "software numpy: 0.1 before"),
        (lambda c: c["software"].update(python="2.7"), "software python: 2.7 before"),
    ],
)
def test_what_is_gone_on_with_is_what_began(whole, tmp_path, edit, said):
    the_plan, session = whole
    assert differences(session, the_plan, described(the_plan)) == []
    found = differences(changed(session, tmp_path, edit), the_plan, described(the_plan))
    assert len(found) == 1 and said in found[0]


def test_another_urdf_is_not_gone_on_with(whole, tmp_path):
    the_plan, session = whole
    shutil.copytree(session.path, tmp_path / "copy")
    with (tmp_path / "copy" / "robot.urdf").open("a") as urdf:
        urdf.write("<!-- another -->\n")
    found = differences(Session(tmp_path / "copy"), the_plan, described(the_plan))
    assert "the robot's URDF differs" in found


def test_events_that_were_changed_afterwards_are_refused(whole, tmp_path):
    _, session = whole
    shutil.copytree(session.path, tmp_path / "copy")
    file = tmp_path / "copy" / "events.jsonl"
    text = file.read_text()
    file.write_text(text.replace('"step_settled"', '"step_ended__"', 1))
    with pytest.raises(SessionError, match=r"events\.jsonl was changed"):
        open_for_analysis(tmp_path / "copy")
    file.write_text(text)
    assert open_for_analysis(tmp_path / "copy").events == session.events


def test_a_table_that_is_lost_is_missed(whole, tmp_path):
    _, session = whole
    shutil.copytree(session.path, tmp_path / "copy")
    (tmp_path / "copy" / "truth_hand.parquet").unlink()
    with pytest.raises(SessionError, match="though the manifest lists it"):
        Session(tmp_path / "copy").truth("hand")


def test_a_stopped_run_is_told_by_the_steps_that_are_whole(tiny, tmp_path, clock):
    def stop(progress: Progress) -> None:
        if progress.time > 4:
            os.kill(os.getpid(), signal.SIGINT)

    the_plan = plan(tiny)
    options = RunOptions(tmp_path, speed="realtime", clock=clock, progress=stop)
    with pytest.raises(RunInterrupted) as caught:
        execute(the_plan, options=options)
    session = caught.value.session
    done = len(session.steps)
    assert 0 < done < len(the_plan.steps)
    assert f"{done} of {len(the_plan.steps)} steps are whole" in str(caught.value)
    assert session.status is RunStatus.INTERRUPTED
    # a break loses references: those steps come again, and then what is missing
    again = missing_steps(session, the_plan)
    wanted = [s.index for s in the_plan.steps if s.index >= done or s.role != "evaluation"]
    assert [s.index for s in again] == wanted


def test_a_session_that_was_cut_off_lasted_as_long_as_its_arm(tiny, tmp_path, clock):
    class Killed(BaseException):
        pass

    kept: list[Path] = []

    def kill(progress: Progress) -> None:
        if progress.time > 3 and not kept:
            (folder,) = (tmp_path / "logs").iterdir()
            shutil.copytree(folder, tmp_path / "cut")
            kept.append(tmp_path / "cut")

    options = RunOptions(tmp_path / "logs", speed="realtime", clock=clock, progress=kill)
    session = execute(plan(tiny), options=options)
    assert session.status is RunStatus.COMPLETED
    found = recover(Session(kept[0]))
    assert found.status is RunStatus.ABORTED
    arm = found.arm()
    assert found.manifest.duration_s == pytest.approx(arm.host_time_ns[-1] / 1e9)
    assert 2.5 < found.manifest.duration_s < 3.6
    assert set(found.manifest.files) >= {"arm.parquet", "imu_hand.parquet", "truth_hand.parquet"}


def test_the_manifest_has_the_hash_of_every_raw_file(whole):
    import hashlib

    _, session = whole
    stated = session.manifest.files
    present = {f.name for f in session.path.iterdir() if f.name != "manifest.json"}
    assert set(stated) == present
    for name, digest in stated.items():
        assert hashlib.sha256((session.path / name).read_bytes()).hexdigest() == digest
