"""A fault of the program itself: exit code 70, one sentence, a file to attach, no traceback."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

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
    assert command("check", "quick") == 1
    assert not list(broken.iterdir())
