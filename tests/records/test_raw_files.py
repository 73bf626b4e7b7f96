"""Raw files that are no longer what was recorded are refused by name, whatever is remembered."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from pathlib import Path

import pytest

from testbench.exceptions import SessionError
from testbench.records.session import raw_files
from testbench.records.session.raw_files import (
    COARSEST_STAMP_NS,
    Memory,
    check_raw_files,
    open_for_analysis,
)
from testbench.records.session.session import Session


@pytest.fixture
def copy(quick, tmp_path, monkeypatch) -> Path:
    """A copy of a session, looked at with an empty cache folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return Path(shutil.copytree(quick.session.path, tmp_path / "session"))


def raw(session: Path) -> list[str]:
    return sorted(json.loads((session / "manifest.json").read_text())["files"])


def let_stamps_age(cache: Path) -> None:
    """What is remembered was written long after the files that it speaks of."""
    (file,) = cache.rglob("*.json")
    later = file.stat().st_mtime_ns + 2 * COARSEST_STAMP_NS
    os.utime(file, ns=(later, later))


def test_any_byte_of_any_raw_file_that_is_changed_names_the_file(copy):
    names = raw(copy)
    assert {"events.jsonl", "arm.parquet", "truth_arm.parquet", "robot.urdf"} <= set(names)
    for name in names:
        file = copy / name
        content = file.read_bytes()
        for place in (0, len(content) // 2, len(content) - 1):
            changed = bytearray(content)
            changed[place] ^= 1
            file.write_bytes(changed)
            with pytest.raises(SessionError) as told:
                open_for_analysis(copy)
            assert f"was recorded: {name} was changed" in str(told.value)
            assert "--no-verify" in str(told.value)
            assert open_for_analysis(copy, verify=False).name == "session"
        file.write_bytes(content)
    open_for_analysis(copy)


def test_what_is_missing_and_what_was_added_is_named(copy):
    (copy / "truth_arm.parquet").unlink()
    shutil.copy(copy / "arm.parquet", copy / "truth_stranger.parquet")
    (copy / "notes.txt").write_text("nobody reads this")
    with pytest.raises(SessionError) as told:
        open_for_analysis(copy)
    assert "truth_arm.parquet is missing" in str(told.value)
    assert "truth_stranger.parquet was added" in str(told.value)
    assert "notes.txt" not in str(told.value)


@pytest.mark.parametrize("name", ["../outside", "/etc/hostname", "..", "a/b", "x\x00y"])
def test_a_manifest_cannot_list_what_lies_elsewhere(copy, name):
    (copy.parent / "outside").write_text("secret")
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest["files"][name] = hashlib.sha256(b"secret").hexdigest()
    (copy / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(SessionError, match="is no name of a file"):
        open_for_analysis(copy)


def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(copy):
    (copy / "imu_arm.parquet").unlink()
    os.mkfifo(copy / "imu_arm.parquet")
    with pytest.raises(SessionError, match=r"imu_arm\.parquet cannot be read: it is no file"):
        open_for_analysis(copy)


def test_derived_files_and_seals_are_no_part_of_the_recording(copy):
    for name in ("evaluation.json", "report.html", "session.rrd", "manifest.json.sig"):
        (copy / name).write_text("anything")
    (copy / ".imu_arm.parquet.0123456789abcdef.partial").write_text("anything")
    open_for_analysis(copy)


def test_a_file_is_hashed_once_for_its_content(copy, tmp_path, monkeypatch):
    size = sum((copy / name).stat().st_size for name in raw(copy))
    session = Session(copy)
    assert check_raw_files(session, Memory.of(session)).hashed == size
    let_stamps_age(tmp_path / "cache")
    assert check_raw_files(session, Memory.of(session)).hashed == 0
    assert check_raw_files(session).hashed == size
    file = copy / "events.jsonl"
    content = file.read_bytes()
    file.write_bytes(content[:-1] + b" ")
    assert list(check_raw_files(session, Memory.of(session)).problems) == ["events.jsonl"]
    file.write_bytes(content)
    let_stamps_age(tmp_path / "cache")
    os.utime(file, ns=(file.stat().st_mtime_ns, 0))
    checked = check_raw_files(session, Memory.of(session))
    assert checked.hashed == len(content) and not checked.problems


def test_a_change_within_a_tick_of_the_clock_is_seen(copy, tmp_path):
    """The stamps of a file that is written to just after it was hashed may be the same."""
    session = Session(copy)
    check_raw_files(session, Memory.of(session))
    (file,) = (tmp_path / "cache").rglob("*.json")
    youngest = max((copy / name).stat().st_ctime_ns for name in raw(copy))
    just = youngest + COARSEST_STAMP_NS - 1
    os.utime(file, ns=(just, just))
    assert check_raw_files(session, Memory.of(session)).hashed > 0


def test_what_is_remembered_lies_with_the_user_and_not_with_the_session(copy, tmp_path):
    before = {path.name for path in copy.rglob("*")}
    open_for_analysis(copy)
    assert {path.name for path in copy.rglob("*")} == before
    (file,) = (tmp_path / "cache" / "testbench").rglob("*.json")
    assert file.parent.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("content", ["{", "[1]", '{"a": {}}', ""])
def test_a_memory_that_cannot_be_read_is_none(copy, tmp_path, content):
    session = Session(copy)
    check_raw_files(session, Memory.of(session))
    (file,) = (tmp_path / "cache").rglob("*.json")
    file.write_text(content)
    assert check_raw_files(session, Memory.of(session)).hashed > 0


def test_where_nothing_can_be_remembered_files_are_hashed_again(copy, tmp_path, monkeypatch):
    (tmp_path / "cache").write_text("no folder")
    open_for_analysis(copy)
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("HOME")

    def nobody() -> Path:
        raise RuntimeError("no home")

    monkeypatch.setattr(Path, "home", nobody)
    assert Memory.of(Session(copy)) is None
    open_for_analysis(copy)


def test_of_thousands_of_sessions_those_looked_at_last_are_remembered(copy, tmp_path, monkeypatch):
    monkeypatch.setattr(raw_files, "MOST_REMEMBERED", 4)
    folder = tmp_path / "cache" / "testbench" / "raw_files"
    folder.mkdir(parents=True)
    for number in range(4):
        (folder / f"{number}.json").write_text("{}")
        os.utime(folder / f"{number}.json", (number, number))
    open_for_analysis(copy)
    assert {"2.json", "3.json"} < {path.name for path in folder.iterdir()}
    assert len(list(folder.iterdir())) == 3
