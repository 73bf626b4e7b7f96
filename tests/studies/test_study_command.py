"""The command `study`, as people and programs call it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from testbench.cli.studying import _with_spread, study
from testbench.exceptions import InputError
from testbench.records.results.study import StudyRecord
from testbench.studies import Study
from testbench.studies.folder import new_folder
from tests.processes import bench


def test_studies_are_listed(tmp_path):
    assert "gimvebo" in bench("study", "--list", cwd=tmp_path).stdout
    listed = json.loads(bench("study", "--list", "--json", cwd=tmp_path).stdout)
    assert {"gimvebo", "misalignment", "reference-1", "reference-3", "reference-4"} <= {
        e["name"] for e in listed["studies"]
    }


def test_an_unknown_study_is_refused_before_anything_runs(tmp_path):
    for arguments in (["study", "bode"], ["study"]):
        result = bench(*arguments, cwd=tmp_path)
        assert result.returncode == 2
        assert "known: " in result.stderr and "gimvebo" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_study_keeps_its_sessions_its_tables_and_its_report(own_swing, tmp_path):
    result = bench(
        *("study", "reference-4", "--logs", "kept", "--seed", "2", "--parts", "1", "--json"),
        *("--protocol", own_swing),
        cwd=tmp_path,
    )
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    folder = tmp_path / said["study"]
    record = StudyRecord.load(folder)
    assert (folder / "report.html").is_file() and record.settings["seed"] == 2
    (cycles,) = (table for table in said["tables"] if table["key"] == "cycles")
    assert {tuple(row["values"][:3]) for row in cycles["rows"]} == {(5, 5, 0), (9, 9, 0)}
    assert [table["key"] for table in said["tables"]] == [table.key for table in record.tables]
    (session,) = record.sessions
    assert (tmp_path / session / "evaluation.json").is_file()
    sessions = json.loads(bench("sessions", "--logs", "kept", "--json", cwd=tmp_path).stdout)[
        "sessions"
    ]
    assert [entry["session"] for entry in sessions] == [
        Path(session).name
    ]  # the study's own folder is no session


def test_reproduce_takes_no_name(tmp_path):
    result = bench("study", "gimvebo", "--reproduce", cwd=tmp_path)
    assert result.returncode == 2
    assert "--reproduce takes no name" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_reproduce_runs_the_protocols_of_the_publications_alone(tmp_path):
    for own in (("--protocol", "shank_swing"), ("--session", "somewhere")):
        result = bench("study", "--reproduce", *own, cwd=tmp_path)
        assert result.returncode == 2
        assert "takes neither --protocol nor --session" in result.stderr.replace("\n", " ")
    assert list(tmp_path.iterdir()) == []


def test_a_value_is_said_no_finer_than_its_spread():
    assert _with_spread(0.28731, 0.0312) == "0.287 ± 0.031"
    assert _with_spread(12.3, None) == 12.3 and _with_spread("deg", 0.1) == "deg"
    assert _with_spread(3.0, 0.0) == 3.0


def test_every_publication_is_reproduced_and_says_where_its_report_lies(
    tmp_path, monkeypatch, capsys
):
    """Each that stands for one, in order; what they find is in the tests of each."""
    names = ("reference-8", "gimvebo", "reference-4")  # one has no publication
    chosen = {name: Study(name, "tiny", "tests.studies.tiny_study") for name in names}
    monkeypatch.setattr("testbench.studies.STUDIES", chosen)
    study(None, tmp_path / "kept", 7, 2, reproduce=True, json=True)
    entries = json.loads(capsys.readouterr().out)["studies"]
    records = [StudyRecord.load(Path(entry["study"])) for entry in entries]
    assert [record.name for record in records] == ["reference-4", "reference-8"]
    for entry in entries:
        assert "The first of 2 parts has seed 7." in Path(entry["report"]).read_text("utf-8")
        assert entry["seconds"] < 60
        assert entry["findings"] == ["The first of 2 parts has seed 7."]


def test_a_folder_for_a_study_is_new_and_an_impossible_one_is_refused(tmp_path, clock):
    first, second = new_folder(tmp_path, "gimvebo", clock), new_folder(tmp_path, "gimvebo", clock)
    assert first.name == "20260102T030405Z_study_gimvebo" and second.name == f"{first.name}_2"
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        new_folder(tmp_path / "file", "gimvebo", clock)
