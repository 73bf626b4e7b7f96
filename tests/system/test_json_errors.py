"""With --json every refusal is one JSON object on stderr, with the exit code that people get."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from testbench.cli import main
from tests.patience import PATIENCE_S

CALLS = {
    "an unknown protocol": (["check", "nothing_like_it"], "NotFoundError", 2),
    "a folder that is no session": (["evaluate", "no/such/folder"], "SessionError", 2),
    "an unknown filter": (["run", "quick", "--filters", "crystal_ball"], "NotFoundError", 2),
    "an unknown option": (["sessions", "--colour"], "InputError", 2),
    "an unknown command": (["evaluat"], "InputError", 2),
    "a missing argument": (["export"], "InputError", 2),
    "a number that is none": (["run", "quick", "--seed", "many"], "InputError", 2),
    "a file that is not there": (
        ["import", "broad", "nowhere.mat", "--out", "nowhere"],
        "FileProblems",
        2,
    ),
    "a port that is not there": (
        ["record", "--serial", "/dev/no_such_port:mpu6050", "--duration", "1"],
        "DriverError",
        3,
    ),
}


@pytest.fixture
def bench(monkeypatch, capsys):
    """Calls the command line as a shell would; gives exit code, stdout and stderr."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["testbench", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        return ended.value.code or 0, out, err

    return call


@pytest.mark.parametrize("name", CALLS)
def test_an_error_is_one_json_object_with_the_same_exit_code(name, bench):
    words, kind, code = CALLS[name]
    told_code, out, told = bench(*words, "--json")
    plain_code, _, plain = bench(*words)
    assert told_code == plain_code == code, (told, plain)
    assert out == "" and told.count("\n") == 1
    error = json.loads(told)["error"]
    assert (error["kind"], error["exit_code"]) == (kind, code)
    assert error["message"]
    if not plain.startswith("Usage"):
        assert plain == "".join(f"error: {line}\n" for line in error["message"].splitlines())


def test_problems_of_a_file_are_told_one_by_one_with_their_places(tmp_path, bench):
    (tmp_path / "p.yaml").write_text("name: p\nrobot: ur3e\nspeed: 3\n")
    code, _, err = bench("check", tmp_path / "p.yaml", "--json")
    error = json.loads(err)["error"]
    assert code == 2 and error["file"].endswith("p.yaml")
    assert len(error["problems"]) > 1  # all at once
    assert next(p for p in error["problems"] if p["path"] == "speed")["line"] == 3


def test_what_works_is_still_one_object_on_stdout(tmp_path, bench):
    assert bench("sessions", "--logs", tmp_path, "--json") == (
        0,
        '{"sessions": [], "removed": []}\n',
        "",
    )
    code, out, err = bench("sessions", "--json", "--help")
    assert (code, err) == (0, "") and "Usage" in out


def test_a_shell_sees_the_same():
    command = [sys.executable, "-m", "testbench", "evaluate", "no/such/folder", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 2 and json.loads(done.stderr)["error"]["kind"] == "SessionError"
