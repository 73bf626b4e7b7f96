"""`testbench sessions`: what each session answers, and which of them are listed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from testbench.records.disk.json_file import read_json, write_json
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import MANIFEST
from tests.command_line import command


@pytest.fixture(scope="module")
def logs(tiny: Path, run_protocol, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of today, and the same as if it were older, of another protocol and with a tag."""
    folder = tmp_path_factory.mktemp("listed")
    made = run_protocol(tiny).session.path
    shutil.copytree(made, folder / "new")
    shutil.copytree(made, folder / "old")
    manifest = read_json(folder / "old" / MANIFEST)
    manifest["started_utc"] = "2025-03-04T10:00:00+00:00"
    manifest["protocol"]["name"] = "other"
    manifest["sensors"]["hand"]["device_tag"] = "DOT-7"
    write_json(folder / "old" / MANIFEST, manifest)
    return folder


def listed(capsys, logs: Path, *options: str) -> list[str]:
    assert command("sessions", "--logs", logs, *options, "--json") == 0
    return [own["session"] for own in json.loads(capsys.readouterr().out)["sessions"]]


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ((), {"new", "old"}),
        (("--since", "2025-03-05"), {"new"}),
        (("--until", "2025-03-04"), {"old"}),
        (("--since", "2025-03-04", "--until", "2025-03-04"), {"old"}),
        (("--protocol", "tiny"), {"new"}),
        (("--sensor", "hand"), {"new", "old"}),
        (("--sensor", "xsens_dot"), {"new", "old"}),
        (("--sensor", "foot"), set()),
        (("--tag", "DOT-7"), {"old"}),
        (("--tag", "DOT-7", "--protocol", "tiny"), set()),
    ],
)
def test_sessions_are_chosen(capsys, logs, options, names) -> None:
    assert set(listed(capsys, logs, *options)) == names


def test_a_date_that_is_none_is_refused(capsys, logs) -> None:
    assert command("sessions", "--logs", logs, "--since", "yesterday") == 2
    assert "write a day as 2026-11-30" in capsys.readouterr().err


def test_each_says_what_it_answers(capsys, logs) -> None:
    headline = Evaluation.load(logs / "new").headline
    assert "RMS error" in headline
    assert command("sessions", "--logs", logs) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert f"new: {' '.join(headline.split())}" in out
