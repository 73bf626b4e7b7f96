"""Files and folders take their names whole, from one writer, and never through a link."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
from errno import EACCES, EDQUOT, EFBIG, EIO, EISDIR, ENAMETOOLONG, ENOSPC, ENOTDIR, EROFS
from pathlib import Path

import pytest

from testbench.exceptions import InputError, StorageError
from testbench.records.disk.replacing import (
    clear_partials,
    replaced_file,
    replaced_folder,
    stored,
    stored_where_asked,
    write_text,
)
from tests.house import ROOT

HOLD = """\
import sys, time
from pathlib import Path
from testbench.records.disk.replacing import replaced_file, replaced_folder

with {manager}(Path(sys.argv[1])) as partial:
    (partial / "table" if partial.is_dir() else partial).write_text("half")
    print(partial, flush=True)
    time.sleep(600)
"""


@pytest.fixture(params=["replaced_file", "replaced_folder"])
def writer(request, tmp_path):
    """A living process that is in the midst of writing `tmp_path / "out"`."""
    command = [sys.executable, "-c", HOLD.format(manager=request.param), str(tmp_path / "out")]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.partial = Path(process.stdout.readline().strip())
        process.manager = {"replaced_file": replaced_file, "replaced_folder": replaced_folder}[
            request.param
        ]
        yield process
        process.kill()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_written_beside_its_place_and_then_takes_it(tmp_path):
    (tmp_path / "out").write_text("old")
    with replaced_file(tmp_path / "out") as partial:
        partial.write_text("new")
        assert (tmp_path / "out").read_text() == "old"
        assert partial.parent == tmp_path
    assert names(tmp_path) == ["out"] and (tmp_path / "out").read_text() == "new"


def test_a_file_may_be_read_by_whom_the_umask_lets(tmp_path):
    (tmp_path / "plain").write_text("")
    write_text(tmp_path / "out", "")
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "out")}
    assert len(modes) == 1


def test_a_failure_removes_what_was_written_and_leaves_the_earlier(tmp_path):
    write_text(tmp_path / "file", "old")
    (tmp_path / "folder").mkdir()
    write_text(tmp_path / "folder" / "table", "old")

    def fail(manager, name: str) -> None:
        with manager(tmp_path / name) as partial:
            (partial / "table" if name == "folder" else partial).write_text("half")
            raise KeyboardInterrupt

    for manager, name in ((replaced_file, "file"), (replaced_folder, "folder")):
        with pytest.raises(KeyboardInterrupt):
            fail(manager, name)
    assert names(tmp_path) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == (tmp_path / "folder" / "table").read_text() == "old"


def test_a_link_under_the_name_is_replaced_and_what_it_leads_to_is_not_touched(tmp_path):
    home, session = tmp_path / "home", tmp_path / "session"
    (home / "papers").mkdir(parents=True)
    session.mkdir()
    (home / "notes").write_text("precious")
    (home / "papers" / "thesis").write_text("precious")
    (session / "file").symlink_to(home / "notes")
    (session / "folder").symlink_to(home / "papers")
    write_text(session / "file", "ours")
    with replaced_folder(session / "folder") as partial:
        (partial / "table").write_text("ours")
    assert not (session / "file").is_symlink() and not (session / "folder").is_symlink()
    assert names(session) == ["file", "folder"] and names(session / "folder") == ["table"]
    assert names(home) == ["notes", "papers"] and names(home / "papers") == ["thesis"]
    assert (home / "notes").read_text() == "precious"


def test_two_writers_never_share_a_name(tmp_path):
    with replaced_file(tmp_path / "out") as first, replaced_file(tmp_path / "out") as second:
        first.write_text("first")
        second.write_text("second")
        assert first != second
    assert names(tmp_path) == ["out"] and (tmp_path / "out").read_text() == "first"


def test_what_another_process_writes_is_left_to_it(writer, tmp_path):
    with writer.manager(tmp_path / "out"):
        pass
    clear_partials(tmp_path)
    assert writer.partial.exists()


def test_what_a_killed_process_wrote_is_removed_by_the_next_writer(writer, tmp_path):
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    assert writer.partial.exists()
    with writer.manager(tmp_path / "out"):
        pass
    assert names(tmp_path) == ["out"]


def test_a_recovery_removes_what_killed_writers_of_any_file_have_left(writer, tmp_path):
    (tmp_path / "imu_hand.partial").write_text("as earlier versions called it")
    (tmp_path / "manifest.partial").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "elsewhere").write_text("precious")
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    clear_partials(tmp_path)
    assert names(tmp_path) == ["elsewhere"]


@pytest.mark.parametrize("manager", [replaced_file, replaced_folder])
def test_content_is_on_the_disk_before_the_name_and_the_name_before_the_end(
    manager, tmp_path, monkeypatch
):
    done: list[str] = []
    fsync = os.fsync

    def noted(opened: int) -> None:
        where = Path(f"/proc/self/fd/{opened}").readlink()
        done.append(where.name if where != tmp_path else "parent")
        fsync(opened)

    for name in ("rename", "replace"):
        real = getattr(os, name)
        monkeypatch.setattr(
            os, name, lambda a, b, real=real: (done.append("renamed"), real(a, b))[1]
        )
    monkeypatch.setattr(os, "fsync", noted)
    with manager(tmp_path / "out") as partial:
        content = partial / "table" if manager is replaced_folder else partial
        content.write_text("new")
    renamed = len(done) - 1 - done[::-1].index("renamed")
    assert content.name in done[:renamed] and "parent" in done[renamed:]


def test_a_file_that_is_to_be_new_does_not_replace_one(tmp_path):
    write_text(tmp_path / "out", "first", anew=True)
    with pytest.raises(InputError, match="out exists already; it is kept"):
        write_text(tmp_path / "out", "second", anew=True)
    with (
        pytest.raises(InputError, match="other exists already"),
        replaced_file(tmp_path / "other", anew=True),
    ):
        write_text(tmp_path / "other", "another writer was faster")
    assert names(tmp_path) == ["other", "out"]
    assert (tmp_path / "out").read_text() == "first"


@pytest.mark.parametrize("guarded", [stored, stored_where_asked])
def test_a_full_disk_is_told_in_the_same_words_everywhere(guarded, tmp_path):
    with (
        pytest.raises(
            StorageError, match=r"out cannot be written: there is no room left on the disk"
        ),
        guarded(tmp_path / "out"),
    ):
        raise OSError(ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("number", "kind", "said"),
    [
        (ENOSPC, StorageError, "there is no room left on the disk"),
        (EDQUOT, StorageError, "the quota of this disk is used up"),
        (EFBIG, StorageError, "it would be larger than a file may be here"),
        (EROFS, StorageError, "the disk is read-only"),
        (EACCES, StorageError, "the folder may not be written to"),
        (EIO, StorageError, "Input/output error"),
        (ENOTDIR, InputError, "Not a directory"),
        (EISDIR, InputError, "Is a directory"),
        (ENAMETOOLONG, InputError, "File name too long"),
    ],
)
def test_what_the_disk_refuses_is_no_fault_of_whoever_named_the_place(tmp_path, number, kind, said):
    expected = pytest.raises(kind, match=f"out cannot be written: {said}$")
    with expected as told, stored_where_asked(tmp_path / "out"):
        raise OSError(number, os.strerror(number))
    assert told.value.exit_code == (3 if kind is StorageError else 2)


def test_a_secret_is_for_its_owner_from_its_first_byte_on(tmp_path):
    with replaced_file(tmp_path / "key", mode=0o600) as partial:
        assert stat.S_IMODE(partial.stat().st_mode) == 0o600
        partial.write_text("secret")
    assert stat.S_IMODE((tmp_path / "key").stat().st_mode) == 0o600


def test_a_folder_that_is_made_anew_takes_nobody_elses_place(tmp_path):
    with replaced_folder(tmp_path / "made", anew=True) as folder:
        (folder / "file").write_text("whole")
    assert (tmp_path / "made" / "file").read_text() == "whole"
    taken = pytest.raises(InputError, match="exists already")
    with taken, replaced_folder(tmp_path / "made", anew=True):
        raise AssertionError("it began")
    with taken, replaced_folder(tmp_path / "meanwhile", anew=True):
        (tmp_path / "meanwhile").mkdir()
        (tmp_path / "meanwhile" / "mine").write_text("kept")
    assert {path.name for path in tmp_path.iterdir()} == {"made", "meanwhile"}
    assert (tmp_path / "meanwhile" / "mine").read_text() == "kept"


def test_a_place_that_a_person_named_wrongly_is_refused(tmp_path):
    out = tmp_path / "nowhere" / "out"
    with (
        pytest.raises(InputError, match="out cannot be written: No such file or directory"),
        stored_where_asked(out),
    ):
        write_text(out, "")
