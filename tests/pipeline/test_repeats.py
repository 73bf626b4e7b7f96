"""Which sessions count as repetitions of one, and what is said of those that do not."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from testbench import Session, report
from testbench.exceptions import InputError
from testbench.pipeline.analyse import judge_again
from testbench.pipeline.request import AnalysisRequest
from testbench.records.results.evaluation import Evaluation
from tests.conftest import RunMaker


@pytest.fixture(scope="module")
def folder(tiny: Path, run_protocol: RunMaker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three sessions of one protocol, a copy of the first, and one of another protocol."""
    logs = tmp_path_factory.mktemp("repeats")
    for seed in (1, 2, 3):
        shutil.copytree(run_protocol(tiny, seed=seed).session.path, logs / f"seed_{seed}")
    shutil.copytree(logs / "seed_1", logs / "seed_1_again")
    return logs


def _judged(folder: Path, **asked: object) -> Evaluation:
    return judge_again(Session(folder / "seed_1"), AnalysisRequest(repeats=str(folder), **asked))


def test_sessions_of_other_seeds_count_once_each(folder):
    found = _judged(folder)
    assert [own.session for own in found.repeated_sessions] == ["seed_1", "seed_2", "seed_3"]
    assert len({own.part for own in found.repeated_sessions}) == 3
    row = found.repeats[0]
    assert len(row.values) == 3
    own = [Evaluation.load(folder / f"seed_{seed}").metrics for seed in (1, 2, 3)]
    key = (row.name, row.filter, row.sequence, row.section)
    for value, metrics in zip(row.values, own, strict=True):
        stored = next(m for m in metrics if (m.name, m.filter, m.sequence, m.section) == key)
        assert value == pytest.approx(stored.value, abs=1e-9)


def test_a_copy_is_named_and_not_counted(folder):
    notes = [note for note in _judged(folder).notes if "seed_1_again" in note]
    assert len(notes) == 1
    assert "the same samples as seed_1" in notes[0]


def test_the_report_shows_them(folder):
    _judged(folder)
    page = report(Session(folder / "seed_1")).read_text(encoding="utf-8")
    assert "Repeated sessions" in page
    assert "another session, 95 %" in page


def test_without_a_folder_nothing_of_it_stays(folder):
    _judged(folder)
    assert judge_again(Session(folder / "seed_1")).repeats == []


def test_other_parameters_of_a_filter_are_no_repetition(folder):
    """Asked for nothing, each session keeps the estimate that it has."""
    judge_again(
        Session(folder / "seed_2"), AnalysisRequest(parameters={"vqf_6d": {"tau_acc_s": 1.0}})
    )
    found = _judged(folder)
    assert [own.session for own in found.repeated_sessions] == ["seed_1", "seed_3"]
    assert any("seed_2" in note and "parameters" in note for note in found.notes)


def test_a_folder_without_any_is_refused(folder, tmp_path):
    session = Session(folder / "seed_1")
    with pytest.raises(InputError, match="is no folder"):
        judge_again(session, AnalysisRequest(repeats=str(tmp_path / "none")))
    shutil.copytree(folder / "seed_1", tmp_path / "copy")
    with pytest.raises(InputError, match=r"no further session.*copy: it holds the same samples"):
        judge_again(session, AnalysisRequest(repeats=str(tmp_path)))
