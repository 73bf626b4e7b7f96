"""What a session keeps is of one estimate, and the pipeline names its parts."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from testbench import pipeline
from testbench.evaluation import evaluate
from testbench.pipeline.analyse import judge_again
from testbench.pipeline.kept_estimate import make_estimate
from testbench.pipeline.noise import measure_noise
from testbench.pipeline.request import ViewRequest
from testbench.pipeline.show import show
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from tests.asking import analysis
from tests.command_line import command

LEFT = ("evaluation.json", "evaluation", "report.html")


@pytest.fixture
def session(quick, tmp_path) -> Session:
    """A copy of `quick` with estimate, evaluation and a report."""
    session = Session(shutil.copytree(quick.session.path, tmp_path / "quick"))
    quick.estimate.save(session.path)
    evaluate(session, quick.estimate).save(session.path)
    (session.path / "report.html").write_text("of the earlier estimate", encoding="utf-8")
    return session


def test_a_new_estimate_takes_the_evaluation_and_report_of_the_earlier_one_away(session):
    assert all((session.path / name).exists() for name in LEFT)
    make_estimate(session, analysis("madgwick_imu"))
    assert not any((session.path / name).exists() for name in LEFT)
    assert list(Estimate.load(session.path).filter_parameters) == ["madgwick_imu"]


def test_an_estimate_that_cannot_be_written_leaves_everything_of_the_earlier_one(
    session, monkeypatch
):
    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("testbench.records.results.estimate.write_json", full)
    with pytest.raises(Exception, match="no room left"):
        make_estimate(session, analysis("madgwick_imu"))
    assert all((session.path / name).exists() for name in LEFT)


def test_a_report_that_was_there_is_written_anew_with_the_new_evaluation(session):
    judge_again(session, analysis("madgwick_imu"))
    assert {row.filter for row in Evaluation.load(session.path).orientation} == {"madgwick_imu"}
    assert "madgwick_imu" in (session.path / "report.html").read_text(encoding="utf-8")


def test_why_a_short_recording_has_no_noise_is_said(session, capsys):
    found = measure_noise(session)
    names = session.sensor_names
    assert found.rows == [] and len(found.notes) == len(names)
    for name, note in zip(names, found.notes, strict=True):
        assert note.startswith(f"sensor {name}: no noise was measured, for that takes a rest of 10")
        assert 0.5 < float(note.split()[-2]) < 10
    assert command("noise", session.path, "--json") == 2
    assert json.loads(capsys.readouterr().out)["notes"] == found.notes


def test_the_pipeline_names_all_its_modules():
    folder = Path(str(pipeline.__file__)).parent
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert {name for name in modules if f"`{name}`" not in str(pipeline.__doc__)} == set()


def test_an_evaluation_that_cannot_be_read_does_not_keep_the_viewer_from_showing(session, tmp_path):
    (session.path / "evaluation.json").write_text("{}", encoding="utf-8")
    (written,) = show(session, ViewRequest(save=tmp_path / "shown.rrd"))
    assert written.stat().st_size > 10_000
