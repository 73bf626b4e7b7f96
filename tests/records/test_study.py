"""A study survives being written and read; its box plots are those of a sample worked out by
hand.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from testbench.exceptions import SessionError
from testbench.records.results.study import (
    FILE,
    BoxNumbers,
    StudyBoxes,
    StudyCurve,
    StudyCurves,
    StudyReason,
    StudyRecord,
    StudyRow,
    StudyTable,
)


def a_study() -> StudyRecord:
    rows = (StudyRow("ours", (0.5, None), (20.0, "91.65")), StudyRow("more", (1.0, "2")))
    table = StudyTable(
        "4.3", "Angles", ("median [deg]", "outliers"), rows, "How.", "Because.", "4.3", (2, 0), 0
    )
    boxes = StudyBoxes(
        "Angles", "angle [deg]", {"a": BoxNumbers(0, 1, 2, 3, 4, (9.0,))}, {}, "How.", True
    )
    return StudyRecord(
        "demo",
        "Demo",
        "Why?",
        "Someone, 2018",
        "2026-01-02T03:04:05Z",
        {"seed": 1},
        ("logs/a",),
        ("It works.",),
        (table,),
        (boxes,),
        {"numpy": "2"},
    )


def test_a_study_is_read_back_as_it_was_written(tmp_path):
    study = a_study()
    study.save(tmp_path)
    assert StudyRecord.load(tmp_path) == study
    data = json.loads((tmp_path / FILE).read_text())
    assert [row["ratio"] for row in data["tables"][0]["rows"]] == [0.025, None]
    assert study.table("4.3").rows[0].ratio(1) is None


def test_a_damaged_study_is_refused(tmp_path):
    a_study().save(tmp_path)
    data = json.loads((tmp_path / FILE).read_text())
    for change in ({"schema_version": 99}, {"tables": [{"key": "x"}]}, {"nonsense": 1}):
        (tmp_path / FILE).write_text(json.dumps(data | change))
        with pytest.raises(SessionError, match=r"study\.json is"):
            StudyRecord.load(tmp_path)


def test_rows_must_fit_their_columns():
    with pytest.raises(ValueError, match="row 'r' does not have the 2 values"):
        StudyTable("k", "c", ("a", "b"), (StudyRow("r", (1.0,)),), "h")
    with pytest.raises(ValueError, match="row 'r'"):
        StudyTable("k", "c", ("a", "b"), (StudyRow("r", (1.0, 2.0), (1.0,)),), "h")


def test_a_box_plot_is_that_of_the_textbook():
    """Ten values: the quartiles are the third and the eighth smallest, (k - 1/2)/n being 0.25 and
    0.75; 40 lies beyond.
    """
    box = BoxNumbers.of(np.array([40.0, 3, 1, 2, 5, 4, 7, 6, 9, 8]))
    assert (box.q1, box.median, box.q3, box.iqr) == (3, 5.5, 8, 5)
    assert (box.lower, box.upper, box.outliers) == (1, 9, (40.0,))


def test_a_box_plot_of_one_value_or_of_equal_ones_is_that_value():
    assert BoxNumbers.of(np.array([2.0])) == BoxNumbers(2, 2, 2, 2, 2)
    assert BoxNumbers.of(np.full(7, 3.0)).iqr == 0


def test_a_ratio_is_only_of_two_values_of_one_definition():
    row = StudyRow("a", (1.0,), (4.0,))
    assert row.ratio(0) == 0.25
    other = replace(row, other="of the norm")
    assert other.ratio(0) is None and other.published_title == "published: of the norm"
    assert row.published_title == "published"


def test_a_row_says_whose_settings_and_which_print_it_is_of():
    row = StudyRow("imufilter", (1.0,), settings="published")
    assert row.title == "imufilter, published settings"
    assert replace(row, printed="listing").title == (
        "imufilter, published settings, as printed (listing)"
    )
    assert replace(row, settings="ours").title == "imufilter, our settings"
    assert replace(row, settings="").title == "imufilter"


def test_a_reason_needs_a_run_unless_it_is_open():
    StudyReason("Because.", "shown", "faults")
    StudyReason("Nobody knows.", "open")
    with pytest.raises(ValueError, match="candidate needs a run"):
        StudyReason("Because.", "candidate")
    with pytest.raises(ValueError, match="open needs no run"):
        StudyReason("Because.", "open", "faults")


def test_of_data_of_ones_own_nothing_published_is_left():
    study = a_study()
    table = replace(
        study.tables[0],
        rows=(*study.tables[0].rows, StudyRow("theirs", (None, None), (1.0, None))),
        reasons=(StudyReason("Because.", "shown", "4.3"),),
    )
    empty = StudyTable("x", "Theirs", ("a",), (StudyRow("theirs", (None,), (1.0,)),), "How.")
    x = np.arange(3.0)
    lines = tuple(StudyCurve(kind, x, x, kind) for kind in ("measurement", "published"))
    study = replace(
        study,
        tables=(table, empty),
        curves=(StudyCurves("c", "x", "y", lines), StudyCurves("d", "x", "y", lines[1:])),
        figures=(replace(study.figures[0], published={"b": study.figures[0].boxes["a"]}),),
    )
    assert study.beside_published
    own = study.without_published()
    assert not own.beside_published and [table.key for table in own.tables] == ["4.3"]
    (left,) = own.tables
    assert [row.label for row in left.rows] == ["ours", "more"]
    assert (left.why, left.table, left.ratio_column, left.reasons) == ("", "", None, ())
    assert [[c.name for c in figure.curves] for figure in own.curves] == [["measurement"]]
    assert own.figures[0].published == {} and own.figures[0].boxes
    assert own.findings == study.findings  # what a study says is its own business
