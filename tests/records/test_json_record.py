"""Results are read back as they were written; what is no result is refused in one sentence."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testbench.exceptions import SessionError
from testbench.records.disk.json_file import json_text, plain_values
from testbench.records.findings.catalogue import finding
from testbench.records.findings.earlier import NOTED
from testbench.records.results.estimate import CalibrationFit, ClockFit, Estimate, SensorEstimate
from testbench.records.results.evaluation import (
    TABLES,
    Evaluation,
    NoiseRow,
    OrientationRow,
    Outcome,
    ResultTables,
)
from tests.system.test_older_sessions import SESSIONS

NAN = float("nan")


def rows() -> Evaluation:
    known = {"sensor": "a", "quantity": "gyr", "axis": "x", "samples": 9, "random_walk": NAN}
    texts = {own.name: "" for own in fields(NoiseRow) if own.name.endswith("unit")}
    numbers = dict.fromkeys(("span_s", "mean", "sd"), 0.1)
    missing = {own.name: None for own in fields(NoiseRow)}
    noise = NoiseRow(**(missing | texts | numbers | known))
    return Evaluation(
        session="s",
        orientation=[OrientationRow("a", "vqf_6d", 9, 1.0, NAN, 0.5, 2.0)],
        noise=[noise],
        outcome=Outcome.MARGINAL,
        findings=[finding(NOTED, text="Ünïcode.")],
        series={"orientation_a": {"host_time_ns": np.arange(3), "x_rad": np.array([0, NAN, 1])}},
    )


def test_a_number_that_is_not_known_is_null_on_disk_and_comes_back(tmp_path: Path) -> None:
    rows().save(tmp_path)
    text = (tmp_path / "evaluation.json").read_text(encoding="utf-8")
    assert '"heading_rmse_deg": null' in text  # one value a line, to look for
    again = Evaluation.load(tmp_path)
    assert np.isnan(again.orientation[0].heading_rmse_deg)
    assert again.orientation[0].total_rmse_deg == 1.0
    assert again.noise[0].random_walk is None  # as for every number that may be missing
    assert again.outcome is Outcome.MARGINAL
    assert again.notes == ["Ünïcode."]
    np.testing.assert_array_equal(again.series["orientation_a"]["x_rad"], [0, NAN, 1])
    assert again.to_dict() == rows().to_dict()


def test_every_table_is_written_read_and_joined() -> None:
    assert {own.name for own in fields(ResultTables)} == {*TABLES, "series"}
    assert {*TABLES, "notes"} < set(rows().to_dict())
    one, two = (
        ResultTables(findings=[finding(NOTED, text="a")]),
        ResultTables(findings=[finding(NOTED, text="b")], series={"x": {}}),
    )
    joined = ResultTables.joined([one, two])
    assert (joined.notes, joined.series) == (["a", "b"], {"x": {}})
    assert one.notes == ["a"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"orientation": [{"sensor": "a"}]}, "orientation.*: the key 'filter' is missing"),
        ({"orientation": {}}, "orientation: must be a list"),
        ({"outcome": "splendid"}, "outcome: must be 'pass', "),
        ({"nonsense": 1}, "nonsense: unknown key"),
        ({"findings": [1]}, r"findings\[0\]: must be"),
        ({"schema_version": 1}, "is of schema 1; this version reads 2: run `testbench evaluate`"),
        ({"schema_version": {"a": 1}}, "is of schema"),
    ],
)
def test_an_evaluation_of_another_version_is_a_sentence(tmp_path, change, said) -> None:
    rows().save(tmp_path)
    file = tmp_path / "evaluation.json"
    file.write_text(json.dumps(json.loads(file.read_text(encoding="utf-8")) | change))
    with pytest.raises(SessionError, match=said) as refused:
        Evaluation.load(tmp_path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["[]", "3", '"x"', "null", "{", "[" * 100_000])
def test_what_is_no_result_at_all_is_a_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "evaluation.json").write_text(text)
    with pytest.raises(SessionError, match=r"evaluation\.json"):
        Evaluation.load(tmp_path)


def test_fits_that_are_not_known_come_back_as_arrays_and_numbers(tmp_path: Path) -> None:
    sensor = SensorEstimate(
        host_time_ns=np.arange(4),
        static=np.ones(4, dtype=bool),
        flagged=np.zeros(4, dtype=bool),
        orientation={"vqf_6d": np.tile([1.0, 0, 0, 0], (4, 1))},
        clock=ClockFit(),
        calibration=CalibrationFit(),
    )
    Estimate("s", "f", {"a": sensor}, {}).save(tmp_path)
    found = Estimate.load(tmp_path).sensors["a"]
    assert np.isnan(found.clock.offset_sd_s)
    assert np.isnan(found.calibration.gyr_bias_sd).all()
    assert found.calibration.gyr_bias_sd.shape == (3,)
    np.testing.assert_array_equal(found.calibration.acc_matrix, np.eye(3))
    assert found.timing.nominal_rate_hz is None
    assert plain_values(found.calibration) == plain_values(sensor.calibration)


def test_an_estimate_with_a_matrix_of_words_is_a_sentence(tmp_path: Path) -> None:
    summary: dict[str, Any] = json.loads(
        (SESSIONS / "imported" / "estimate" / "estimate.json").read_text(encoding="utf-8")
    )
    summary["sensors"]["imu"]["calibration"]["acc_matrix"] = {"a": "b"}
    (tmp_path / "estimate").mkdir()
    (tmp_path / "estimate" / "estimate.json").write_text(json.dumps(summary))
    with pytest.raises(SessionError, match=r"acc_matrix: these are no numbers; run"):
        Estimate.load(tmp_path)


def test_a_name_that_is_no_text_and_a_huge_number_are_written_all_the_same() -> None:
    odd = {"path": "a\udcff", "number": 10**30, "clock": ClockFit()}
    again = json.loads(json_text(odd))
    assert again["path"] == odd["path"]
    assert again["number"] == odd["number"]
    assert again["clock"]["offset_sd_s"] is None
