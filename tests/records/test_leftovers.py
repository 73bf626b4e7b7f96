"""What killed commands leave among sessions is shown, and removed where nothing was recorded."""

from __future__ import annotations

import fcntl
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from testbench.records.disk.journal import Journal
from testbench.records.session.leftovers import clean, leftovers
from tests.command_line import command

BEGUN = "20260102T030405Z_quick"


@pytest.fixture
def logs(tmp_path) -> Path:
    """Sessions' folder with a run that was cut off before its manifest."""
    folder = tmp_path / "logs" / BEGUN
    folder.mkdir(parents=True)
    for name in ("events.jsonl", "protocol.yaml", "included_a.yaml", "robot.urdf"):
        (folder / name).write_text("")
    Journal(folder / "arm.arrows", {"host_time_ns": np.int64}).close()
    (folder / ".plan.parquet.0123456789abcdef.partial").write_text("")
    return tmp_path / "logs"


def names(found) -> list[str]:
    return [path.name for path in found]


def test_a_run_that_was_cut_off_before_its_manifest_is_shown_and_removed(logs, capsys):
    assert command("sessions", "--logs", logs) == 0
    out = capsys.readouterr().out
    assert "no session" in out and "--clean` removes" in out and (logs / BEGUN).exists()
    assert command("sessions", "--logs", logs, "--json") == 0
    (entry,) = json.loads(capsys.readouterr().out)["sessions"]
    assert entry["status"] == "no session" and "cut off before it began" in entry["left"]
    assert command("sessions", "--logs", logs, "--clean") == 0
    assert not list(logs.iterdir())


def test_a_journal_with_a_single_sample_is_never_removed(logs):
    journal = Journal(logs / BEGUN / "imu_hand.arrows", {"host_time_ns": np.int64})
    journal.append({"host_time_ns": np.array([5])})
    journal.close()
    assert not leftovers(logs) and not clean(logs)
    (logs / BEGUN / "imu_hand.arrows").write_bytes(b"\xff" * 500)
    assert not leftovers(logs) and not clean(logs)


@pytest.mark.parametrize("name", ["imu_hand.parquet", "notes.txt", ".git", "manifest.json"])
def test_a_folder_with_anything_else_is_not_touched(logs, name):
    (logs / BEGUN / name).write_text("")
    assert not leftovers(logs) and not clean(logs)


def test_a_run_that_begins_just_now_is_not_touched(logs):
    with (logs / BEGUN / "events.jsonl").open("a") as events:
        fcntl.flock(events, fcntl.LOCK_EX)
        assert not clean(logs)
    assert names(clean(logs)) == [BEGUN]


def test_an_empty_folder_is_left_over_only_by_the_name_of_a_run(tmp_path):
    for name in (BEGUN, "mine"):
        (tmp_path / name).mkdir()
    (tmp_path / f"{BEGUN}_2").symlink_to(tmp_path / "mine")
    assert names(clean(tmp_path)) == [BEGUN]
    assert (tmp_path / "mine").is_dir() and (tmp_path / f"{BEGUN}_2").is_symlink()


def test_what_was_being_written_when_it_was_killed_is_removed(quick, tmp_path):
    shutil.copytree(quick.session.path, tmp_path / "session")
    half = tmp_path / ".imported.0123456789abcdef.partial"
    half.mkdir()
    shutil.copy(quick.session.path / "manifest.json", half)
    within = tmp_path / "session" / ".report.html.0123456789abcdef.partial"
    within.write_text("half")
    assert names(one.path for one in leftovers(tmp_path)) == [half.name]
    assert set(clean(tmp_path)) == {half, within}
    assert names(tmp_path.iterdir()) == ["session"]


def test_an_import_that_an_earlier_version_left_half_is_refused_and_removed(
    quick, tmp_path, capsys
):
    session = tmp_path / "half"
    shutil.copytree(quick.session.path, session)
    manifest = json.loads((session / "manifest.json").read_text())
    manifest |= {"kind": "import", "status": "running", "files": {}}
    (session / "manifest.json").write_text(json.dumps(manifest))
    for verb in ("evaluate", "recover"):
        assert command(verb, session) == 2
        told = capsys.readouterr().err
        assert "an import that was cut off" in told and "--clean` removes it" in told
    assert command("sessions", "--logs", tmp_path, "--clean") == 0
    assert not list(tmp_path.iterdir())


def test_a_run_that_lost_its_journals_before_its_truth_was_written_is_not_judged(
    quick, tmp_path, capsys
):
    session = tmp_path / "half"
    shutil.copytree(quick.session.path, session)
    for name in ("truth_arm.parquet", "truth_forearm.parquet", "evaluation.json"):
        (session / name).unlink()
    shutil.rmtree(session / "estimate")
    manifest = json.loads((session / "manifest.json").read_text())
    manifest |= {"status": "running", "files": {}}
    (session / "manifest.json").write_text(json.dumps(manifest))
    assert command("evaluate", session) == 2
    assert f"`testbench recover {session}` makes it readable" in capsys.readouterr().err
    assert command("recover", session) == 0
    assert command("evaluate", session) in {0, 1}
