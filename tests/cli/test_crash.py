"""A fault of the program itself: exit code 70, one sentence, a file to attach, no traceback."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from testbench.pipeline import prepared
from tests.command_line import command


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """`testbench check` divides by zero, as if in the home folder of somebody; gives that folder
    of temporary files.
    """
    temporary, home = tmp_path / "temporary", tmp_path / "home" / "ada.lovelace"
    temporary.mkdir(), home.mkdir(parents=True)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.delenv("TESTBENCH_DEBUG", raising=False)

    def fails(asked):
        error = ZeroDivisionError(f"in {home}/secret.yaml")
        error.add_note("the recording is whole")
        raise error

    monkeypatch.setattr(prepared, "make_plan", fails)
    return temporary


def test_a_fault_of_the_program_is_exit_code_70_and_one_sentence_that_names_a_file(broken, capsys):
    assert command("check", "quick", "--robot", "ur3e") == 70
    out, told = capsys.readouterr()
    (file,) = broken.iterdir()
    assert out == "" and "Traceback" not in told
    assert told == (
        "error: this is a fault of testbench itself (ZeroDivisionError); please report it and "
        f"attach {file}\nthe recording is whole\n"
    )
    content = file.read_text()
    assert content.startswith("command: check --robot\nsystem: ")
    assert "\nnumpy: " in content and "Traceback" in content
    assert "ZeroDivisionError: in ~/secret.yaml" in content
    assert "lovelace" not in content and "ur3e" not in content
    assert file.stat().st_mode & 0o077 == 0


def test_with_json_a_fault_of_the_program_is_one_object(broken, capsys):
    assert command("check", "quick", "--json") == 70
    error = json.loads(capsys.readouterr().err)["error"]
    (file,) = broken.iterdir()
    assert (error["kind"], error["exit_code"]) == ("ProgramError", 70)
    assert str(file) in error["message"] and error["notes"] == ["the recording is whole"]


def test_where_no_file_can_be_written_the_sentence_says_where_it_happened(broken, capsys):
    broken.rmdir()
    assert command("check", "quick") == 70
    told = capsys.readouterr().err
    assert told.startswith("error: ") and "at test_crash.py:" in told and "Traceback" not in told


def test_whoever_looks_for_a_fault_sees_the_exception_itself(broken, monkeypatch):
    monkeypatch.setenv("TESTBENCH_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        command("check", "quick")
    assert not list(Path(broken).iterdir())


def test_a_reader_that_goes_away_is_no_fault(broken, monkeypatch):
    def gone(asked):
        raise BrokenPipeError

    monkeypatch.setattr(prepared, "make_plan", gone)
    assert command("check", "quick") == 128 + signal.SIGPIPE
    assert not list(broken.iterdir())


def test_one_is_the_exit_code_of_a_broken_limit_alone(broken, monkeypatch):
    """What typer itself would end by 1."""
    ends = {BrokenPipeError(errno.EPIPE, "gone"): 141, typer.Abort(): 130, KeyboardInterrupt(): 130}
    for raised, code in ends.items():

        def ends_so(asked, raised=raised):
            raise raised

        monkeypatch.setattr(prepared, "make_plan", ends_so)
        for more in ((), ("--json",)):
            assert command("check", "quick", *more) == code
    assert not list(broken.iterdir())


def test_a_reader_that_takes_no_more_is_told_by_the_exit_code():
    words = [sys.executable, "-m", "testbench", "robots"]
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as gone:
        done = subprocess.run(words, stdout=gone, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (141, b"")
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (3, b"error: there is no room left on the disk\n")


def test_the_file_names_nobody_and_nothing_that_was_typed(broken, monkeypatch, tmp_path):
    """Sessions are called after participants, and folders after projects."""
    session = tmp_path / "ada_lovelace_visit_2"
    monkeypatch.setattr("platform.node", lambda: "pc-of-ada")
    secret = f"{session}/imu_left.parquet of pc-of-ada"

    def fails(asked):
        raise ValueError(f"cannot read {secret}, here {Path.cwd()}/x")

    monkeypatch.setattr(prepared, "make_plan", fails)
    monkeypatch.chdir(tmp_path)
    assert command("check", session) == 70
    (file,) = broken.iterdir()
    content = file.read_text()
    assert "ValueError: cannot read ARGUMENT_1/imu_left.parquet of HOST, here ./x" in content
    assert str(tmp_path) not in content and "visit" not in content
