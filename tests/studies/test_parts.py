"""Several parts: run side by side they are those that run alone, and their tables become one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.exceptions import InputError
from testbench.records.results.study import StudyRow, StudyTable
from testbench.studies.bench import StudyBench
from testbench.studies.parts import over_parts


def a_table(value: float, word: str, *more: StudyRow) -> StudyTable:
    rows = (StudyRow("a", ("deg", value, word), ("deg", 4.0, "b")), *more)
    return StudyTable("t", "Caption", ("unit", "value", "word"), rows, "How.", ratio_column=1)


def test_numbers_of_several_parts_become_their_mean_with_their_spread():
    extra = StudyRow("only in the last", (None, 7.0, None))
    merged = over_parts([a_table(1.0, "same"), a_table(2.0, "same"), a_table(6.0, "other", extra)])
    first, last = merged.rows
    assert first.values == ("deg", 3.0, None) and first.published == ("deg", 4.0, "b")
    assert first.spread == (None, pytest.approx(np.std([1, 2, 6], ddof=1)), None)
    assert first.ratio(1) == 0.75
    assert last.values == (None, 7.0, None) and last.spread == (None, None, None)
    assert merged.spread == "standard deviation over 3 parts"


def test_one_part_has_no_spread():
    table = a_table(1.0, "same")
    assert over_parts([table]) is table and not table.spread


@pytest.mark.slow
def test_parts_that_run_side_by_side_are_those_that_run_alone(tmp_path):
    said: list[str] = []
    bench = StudyBench(tmp_path / "many", SystemClock(), seed=3, parts=2, say=said.append)
    results = bench.results("static_noise")
    assert [result.session.manifest.seed for result in results] == [3, 4]
    assert [result.report is None for result in results] == [False, True]
    assert said[-1] == "2 of 2 runs are done"
    (alone,) = StudyBench(tmp_path / "one", SystemClock(), seed=4, parts=1).results("static_noise")
    beside = results[1]
    np.testing.assert_array_equal(beside.session.imu("dot").gyr, alone.session.imu("dot").gyr)
    assert beside.evaluation.noise == alone.evaluation.noise


@pytest.mark.slow
def test_a_recording_is_asked_and_not_written_to(tmp_path):
    (made,) = StudyBench(tmp_path, SystemClock(), parts=1).results("static_noise")
    path = made.session.path
    before = {file: file.stat().st_mtime_ns for file in path.rglob("*")}
    bench = StudyBench(tmp_path / "other", SystemClock(), parts=5, session=path)
    (asked,) = bench.results("elbow_tables", ["madgwick_imu"])
    assert {file: file.stat().st_mtime_ns for file in path.rglob("*")} == before
    assert set(asked.estimate.sensors["dot"].orientation) == {"madgwick_imu"}
    assert asked.evaluation.noise == made.evaluation.noise
    assert not (tmp_path / "other").exists() and bench.settings("x") == {"session": str(path)}
    with pytest.raises(InputError, match="the walk asks for a foot; for truth"):
        bench.refuse_without("the walk", ["a foot", "truth"])
    bench.refuse_without("the walk", [])


@pytest.mark.slow
def test_what_is_refused_in_another_process_is_refused_here(tmp_path):
    bench = StudyBench(tmp_path, SystemClock(), parts=2)
    with pytest.raises(InputError, match="no_such_protocol"):
        bench.results("no_such_protocol")
    assert list(Path(tmp_path).iterdir()) == []


def test_a_record_of_parts_says_whose_protocol_it_ran(tmp_path):
    bench = StudyBench(tmp_path, SystemClock(), seed=1, parts=2, protocol="mine.yaml")
    assert bench.settings("theirs") == {"protocol": "mine.yaml", "seed": 1, "parts": 2}
    assert bench.own and not StudyBench(tmp_path, SystemClock()).own
    with pytest.raises(InputError, match="no_such"):
        StudyBench(tmp_path, SystemClock(), parts=1).results("no_such")


@pytest.mark.slow
def test_a_run_that_finds_its_folder_taken_takes_another(tmp_path, monkeypatch):
    """Two runs of one second: both see the name free, and one makes the folder first."""
    from testbench.execution import recorder

    free, taken = recorder.dated_folder, []

    def beaten(logs, name, clock):
        folder = free(logs, name, clock)
        if len(taken) < 2:
            taken.append(folder)
            folder.mkdir(parents=True)
        return folder

    monkeypatch.setattr(recorder, "dated_folder", beaten)
    (made,) = StudyBench(tmp_path, SystemClock(), parts=1).results("static_noise")
    assert len(taken) == 2 and made.session.path not in taken
    assert all(not list(folder.iterdir()) for folder in taken)
