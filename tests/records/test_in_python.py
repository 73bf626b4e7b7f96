"""What the records look like to who uses them in Python."""

from __future__ import annotations

import json

import numpy as np
import pytest

from testbench.exceptions import NotFoundError
from testbench.records.disk.tables import rows_to_arrow
from testbench.records.results.evaluation import TABLES
from testbench.records.session.session import Session
from tests.asking import planned


def test_whoever_prints_a_record_reads_one_line(quick) -> None:
    result = quick
    for record in (
        planned("quick"),
        Session(result.session.path),
        result.estimate,
        result.evaluation,
    ):
        shown = repr(record)
        assert "\n" not in shown and len(shown) < 400
        assert shown.startswith(f"<{type(record).__name__} ")
    assert "pass" in repr(result.evaluation) and "vqf_6d" in repr(result.estimate)


def test_every_table_of_an_evaluation_is_a_data_frame_with_the_numbers_of_its_file(
    quick,
) -> None:
    evaluation = quick.evaluation
    written = json.loads((quick.session.path / "evaluation.json").read_text(encoding="utf-8"))
    for name in ("metrics", *TABLES):
        if not written[name]:
            continue
        frame = evaluation.to_pandas(name)
        assert len(frame) == len(written[name]), name
    rows, frame = written["joint_angle"], evaluation.to_pandas("joint_angle")
    np.testing.assert_array_equal(
        frame["flexion_rmse_deg"], [row["flexion_rmse_deg"] for row in rows]
    )
    summary = evaluation.to_arrow("joint_summary")
    assert "errors.rmse_deg" in summary.column_names
    with pytest.raises(NotFoundError, match="unknown table 'joints'; known: metrics, joint_angle"):
        evaluation.to_arrow("joints")


def test_nested_rows_become_columns_and_what_some_lack_is_missing() -> None:
    table = rows_to_arrow([{"a": 1, "b": {"c": 2.0}}, {"a": 2, "b": {"c": 3.0}, "d": [1, 2]}])
    assert table.to_pylist()[0] == {"a": 1, "b.c": 2.0}
