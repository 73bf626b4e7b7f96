"""The studies that are run by name: what they keep, what they find, and the command that runs all
of them.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.exceptions import InputError
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import StudyRecord
from testbench.records.session.session import Session
from testbench.reporting.study_report import study_report
from testbench.studies import get_study, references
from testbench.studies.bench import StudyBench
from testbench.studies.elbow.misalignment_session import session_curves
from testbench.studies.folder import new_folder

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bench(tmp_path_factory) -> StudyBench:
    return StudyBench(tmp_path_factory.mktemp("logs"), SystemClock(), seed=1, parts=1)


def kept(study: StudyRecord, folder) -> StudyRecord:
    """The record as it comes back from its file; its sessions exist."""
    study.save(folder)
    again = StudyRecord.load(folder)
    assert again.to_dict() == study.to_dict()
    assert all(Session(path).manifest.seed == 1 for path in again.sessions)
    return again


@pytest.fixture(scope="module")
def misalignment(bench) -> StudyRecord:
    return get_study("misalignment").run(bench)


def test_misalignment_runs_an_elbow_and_lays_it_on_the_theory(misalignment, tmp_path):
    study = kept(misalignment, tmp_path)
    rows = {row.label: row.values for row in study.table("elbow measured").rows}
    assert set(rows) == {
        f"{sequence}, {name}" for sequence in ("ZXZ", "YXZ") for name in ("device", "vqf_6d")
    }
    for name in ("device", "vqf_6d"):
        assert rows[f"YXZ, {name}"][0] == 315
        assert rows[f"YXZ, {name}"][2] == pytest.approx(7.99, abs=0.01)  # by the definition
        assert rows[f"YXZ, {name}"][3] == pytest.approx(
            rows[f"YXZ, {name}"][1], abs=1
        )  # measured, in the mean
        assert (
            7 < rows[f"YXZ, {name}"][4] < 15
        )  # a heading that drifts adds to the misalignment or takes from it
        assert rows[f"ZXZ, {name}"][2] < 0.01 and rows[f"ZXZ, {name}"][4] < 0.6
    by_yxz = next(curves for curves in study.curves if "YXZ" in curves.caption)
    assert {curve.kind for curve in by_yxz.curves} == {"theory", "simulation", "measurement"}
    assert len(study.surfaces) == 3 and len(study.sessions) == 1


def test_the_elbow_grows_wrong_with_flexion_by_yxz_and_not_by_zxz_and_the_sensors_follow_the_theory(
    misalignment,
):
    session = Session(misalignment.sessions[0])
    evaluation = Evaluation.load(session.path)
    zxz, yxz = session_curves(session, evaluation, "elbow", [10, 40, 70])
    curves = {curve.name: curve for curve in yxz.curves}
    assert curves["theory, 70 deg"].y.max() == pytest.approx(7.99, abs=0.005)
    for flexion in (10, 40, 70):
        theory, simulation = curves[f"theory, {flexion} deg"], curves[f"simulation, {flexion} deg"]
        np.testing.assert_array_equal(theory.x, np.arange(-20, 21, 2))
        np.testing.assert_allclose(simulation.y, theory.y, atol=0.02)
        np.testing.assert_allclose(
            curves[f"device, {flexion} deg"].y, theory.y, atol=0.2 + 0.2 * theory.y.max()
        )
    flat = {curve.name: curve for curve in zxz.curves}
    # A heading error is a misalignment to YXZ and nothing to ZXZ: so the sensors scatter about the
    # theory there, not here.
    assert np.abs(curves["device, 70 deg"].y - curves["theory, 70 deg"].y).max() > 0.3
    assert max(flat[f"vqf_6d, {flexion} deg"].y.max() for flexion in (10, 40, 70)) < 0.6


def test_reference_4_counts_every_cycle_and_drifts_as_published(bench, tmp_path):
    study = kept(get_study("reference-4").run(bench), tmp_path)
    assert {row.values[2] for row in study.table("cycles").rows} == {0}
    assert {row.values[0] for row in study.table("cycles").rows} == {14, 109}
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
    assert "counted exactly" in study.findings[0]
    assert "In walk, gait_cycles 14, roll_deg 3 the yaw drifts" in study.findings[1]


def test_reference_4_takes_a_protocol_of_ones_own_and_draws_its_paths(bench, own_swing, tmp_path):
    study = kept(get_study("reference-4").run(replace(bench, protocol=own_swing)), tmp_path)
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
    with pytest.raises(InputError, match="taken by: reference-4"):
        get_study("reference-1").run(replace(empty, protocol="shank_swing"))
    assert not (tmp_path / "logs").exists()


def test_sessions_of_a_study_have_reports_that_it_links_to(bench, misalignment):
    study = misalignment
    folder = new_folder(bench.logs, "misalignment", bench.clock)
    page = study_report(study, folder).read_text(encoding="utf-8")
    (link,) = re.findall(r'<a href="(\.\./[^"]+)">', page)
    assert (folder / link).resolve() == (Path(study.sessions[0]) / "report.html").resolve()
    assert (folder / link).is_file()


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
