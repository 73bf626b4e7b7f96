"""The studies that are run by name: what they keep, what they find, and the command that runs all of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from testbench.clock import SystemClock
from testbench.records.session import Session
from testbench.records.study import StudyRecord
from testbench.studies import get_study, references
from testbench.studies.bench import StudyBench


@pytest.fixture(scope="module")
def bench(tmp_path_factory) -> StudyBench:
    return StudyBench(tmp_path_factory.mktemp("logs"), SystemClock(), seed=1, parts=1)


def kept(study: StudyRecord, folder) -> StudyRecord:
    """The record as it comes back from its file; its sessions exist."""
    study.save(folder)
    again = StudyRecord.load(folder)
    assert again.to_dict() == study.to_dict()
    assert all(Session(path).manifest["seed"] == 1 for path in again.sessions)
    return again


def test_misalignment_runs_an_elbow_and_lays_it_on_the_theory(bench, tmp_path):
    study = kept(get_study("misalignment").run(bench), tmp_path)
    rows = {row.label: row.values for row in study.table("elbow measured").rows}
    assert set(rows) == {f"{sequence}, {name}" for sequence in ("ZXZ", "YXZ") for name in ("device", "vqf_6d")}
    for name in ("device", "vqf_6d"):
        assert rows[f"YXZ, {name}"][0] == 315
        assert rows[f"YXZ, {name}"][2] == pytest.approx(7.99, abs=0.01)  # by the definition
        assert rows[f"YXZ, {name}"][3] == pytest.approx(rows[f"YXZ, {name}"][1], abs=1)  # measured, in the mean
        assert 7 < rows[f"YXZ, {name}"][4] < 15  # a heading that drifts adds to the misalignment or takes from it
        assert rows[f"ZXZ, {name}"][2] < 0.01 and rows[f"ZXZ, {name}"][4] < 0.6
    by_yxz = next(curves for curves in study.curves if "YXZ" in curves.caption)
    assert {curve.kind for curve in by_yxz.curves} == {"theory", "simulation", "measurement"}
    assert len(study.surfaces) == 3 and len(study.sessions) == 1


def test_reference_4_counts_every_cycle_and_drifts_as_published(bench, tmp_path):
    study = kept(get_study("reference-4").run(bench), tmp_path)
    assert {row.values[2] for row in study.table("cycles").rows} == {0}
    assert {row.values[0] for row in study.table("cycles").rows} == {14, 109}
    drift = {row.label: row for row in study.table("drift").rows if row.published and "cycles 14" in row.label}
    assert len(drift) == 2
    for label, row in drift.items():
        if "simple" in label:
            assert row.values[0] == pytest.approx(44, abs=3) and row.published[0] == 50
        else:
            assert row.values[0] < 10 and row.published[0] == 10
    assert "counted exactly" in study.findings[0] and "Over 14 cycles" in study.findings[1]


def test_a_study_is_kept_under_the_name_it_was_asked_for(bench, monkeypatch):
    gimvebo = StudyRecord("gimvebo", "Title", "Why?", "Source", "2026-01-02T03:04:05Z", {}, (), (), ())
    monkeypatch.setattr("testbench.studies.gimvebo.run", lambda bench: gimvebo)
    assert get_study("reference-3").run(bench) == replace(gimvebo, name="reference-3")
    assert get_study("gimvebo").run(bench) == gimvebo


def test_the_references_are_in_order():
    names = [study.name for study in references()]
    assert names == sorted(names) and {"reference-1", "reference-3", "reference-4"} <= set(names)
