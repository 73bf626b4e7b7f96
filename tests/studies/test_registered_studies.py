"""The studies that are run by name: what they keep, what they find, and the command that runs all
of them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.exceptions import InputError, NotFoundError
from testbench.records.results.study import StudyRecord
from testbench.studies import get_study, references
from testbench.studies.pedestrian.walks import Extent, all_walks
from tests.studies.hostile import complaints, missing
from tests.studies.keeping import kept
from tests.studies.shorter import ShortBench

pytestmark = pytest.mark.slow

FIGURES = ["Path of the loop by place", "Error of the yaw", "Path"]
"""The source's paths over the true one, and its drifts."""


@pytest.fixture(scope="module")
def bench(altered_protocol, tmp_path_factory) -> ShortBench:
    """Swings of 14 and 20 cycles; those of 109 are in test_pedestrian."""

    def fewer(spec):
        spec["variables"]["gait_cycles"] = [14, 20]

    shorter = {"shank_swing": altered_protocol("shank_swing", fewer)}
    logs = tmp_path_factory.mktemp("logs")
    return ShortBench(logs, SystemClock(), seed=1, parts=1, shorter=shorter)


def test_reference_4_counts_every_cycle_and_drifts_as_published(bench, tmp_path, monkeypatch):
    short = partial(all_walks, extent=Extent(loop=12, repetitions=1, runs=1))
    monkeypatch.setattr("testbench.studies.pedestrian.study.all_walks", short)
    study = kept(get_study("reference-4").run(bench), tmp_path, seed=1)
    assert complaints(study) == [] and missing(study, FIGURES) == []
    assert {row.values[2] for row in study.table("cycles").rows} == {0}
    assert {row.values[0] for row in study.table("cycles").rows} == {14, 20}
    drift = {
        row.label: row
        for row in study.table("drift").rows
        if row.published and "cycles 14" in row.label
    }
    assert len(drift) == 2
    for label, row in drift.items():
        if "simple" in label:
            assert row.values[0] == pytest.approx(44, abs=3) and row.published[0] == 50
        else:
            assert row.values[0] < 10 and row.published[0] == 10
    assert any("counted exactly" in told for told in study.findings)
    (misprint,) = (row for row in study.table("table_13").rows if "59.63" in row.note)
    assert "NGIMU, chest" in misprint.label and misprint.published[0] == pytest.approx(25.994)
    assert any(
        "In walk, gait_cycles 14, roll_deg 3 the yaw drifts" in told for told in study.findings
    )


def test_reference_4_takes_a_protocol_of_ones_own_and_draws_its_paths(bench, own_swing, tmp_path):
    study = kept(get_study("reference-4").run(replace(bench, protocol=own_swing)), tmp_path, seed=1)
    assert {(row.values[0], row.values[1]) for row in study.table("cycles").rows} == {
        (5, 5),
        (9, 9),
    }
    assert study.findings[0].startswith("Gait cycles, 5 and 9 commanded")
    assert not [
        row for row in study.table("drift").rows if row.published
    ]  # published is of fourteen cycles
    assert study.settings["protocol"] == str(own_swing)
    paths = [curves for curves in study.curves if curves.plane]
    assert ["gait_cycles 5" in paths[0].caption, "gait_cycles 9" in paths[1].caption] == [
        True,
        True,
    ]
    for figure, cycles in zip(paths, (5, 9), strict=True):
        ends = {curve.name: np.array([curve.x[-1], curve.y[-1]]) for curve in figure.curves}
        assert all(
            len(curve.x) == cycles + 1 and curve.x[0] == curve.y[0] == 0 for curve in figure.curves
        )
        rows = {
            row.label.rpartition(", ")[2]: row.values
            for row in study.table("cycles").rows
            if f"cycles {cycles}" in row.label
        }
        assert set(ends) == {"true motion", *rows}
        for name, values in rows.items():
            assert np.linalg.norm(ends[name] - ends["true motion"]) == pytest.approx(
                values[6], abs=1e-9
            ), name


def test_a_protocol_that_a_study_cannot_use_is_refused_before_anything_runs(bench, tmp_path):
    empty = replace(bench, logs=tmp_path / "logs")
    with pytest.raises(InputError, match="static_noise has no sweep"):
        get_study("reference-4").run(replace(empty, protocol="static_noise"))
    with pytest.raises(InputError, match="name one of them"):
        get_study("reference-1").run(replace(empty, session="somewhere", protocol="shank_swing"))
    with pytest.raises(NotFoundError, match="option of reference-3 'interval'; known: every"):
        get_study("reference-3").run(replace(empty, options={"interval": "2"}))
    assert not (tmp_path / "logs").exists()


def test_a_study_is_kept_under_the_name_it_was_asked_for(bench, monkeypatch):
    gimvebo = StudyRecord(
        "gimvebo", "Title", "Why?", "Source", "2026-01-02T03:04:05Z", {}, (), (), ()
    )
    monkeypatch.setattr("testbench.studies.gimvebo.study.run", lambda bench: gimvebo)
    assert get_study("reference-3").run(bench) == replace(gimvebo, name="reference-3")
    assert get_study("gimvebo").run(bench) == gimvebo


def test_the_references_are_in_order():
    names = [study.name for study in references()]
    assert names == sorted(names) and {"reference-1", "reference-3", "reference-4"} <= set(names)
