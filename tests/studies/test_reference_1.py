"""The study reference-1: its published numbers, its bars, and a model of the table that grows; and
the study of misalignment, which takes its elbow.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.model import rotation
from testbench.pipeline.analyse import Result
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import StudyRecord
from testbench.records.session.session import Session
from testbench.records.specs.published import load_published, load_published_tables
from testbench.reporting.study_report import render_study, study_report
from testbench.studies import get_study
from testbench.studies.bench import StudyBench
from testbench.studies.elbow.flexion import heading_fit, heading_model
from testbench.studies.elbow.misalignment_session import session_curves
from testbench.studies.folder import new_folder
from tests.studies.keeping import kept

pytestmark = pytest.mark.slow

# Sums of each published table as printed: a digit that was copied wrongly changes one.
SUMS = {
    "5.1": 12.58,
    "rest": 5.8236,
    "annex G readings": 11.3144,
    "annex G forces": -2,
    "annex G": -1.2836,
}


@dataclass(frozen=True)
class OnceBench(StudyBench):
    """Runs a protocol once, however many studies ask for it."""

    done: dict[tuple[object, object], Result] = field(default_factory=dict)

    def run(self, protocol, filters=None, planned=lambda plan: None):
        if (protocol, filters) not in self.done:
            self.done[protocol, filters] = super().run(protocol, filters, planned)
        return self.done[protocol, filters]


@pytest.fixture(scope="module")
def bench(tmp_path_factory) -> OnceBench:
    return OnceBench(tmp_path_factory.mktemp("logs"), SystemClock(), parts=1)


@pytest.fixture(scope="module")
def study(bench) -> StudyRecord:
    return get_study("reference-1").run(bench)


def test_published_tables_are_those_of_the_source():
    tables = load_published_tables("reference_1_static").tables
    assert set(tables) == set(SUMS)
    for name, table in tables.items():
        total = sum(value for row in table.rows for value in row.values if value is not None)
        assert total == pytest.approx(SUMS[name], abs=1e-9), name


def test_the_sensors_are_as_noisy_at_rest_as_the_published_ones(study):
    rows = {row.label: row for row in study.table("noise").rows}
    assert len(rows) == 5
    for label, row in rows.items():
        compared = (
            [1, 2, 3] if label != "MATRIX, gyroscope" else [1, 3]
        )  # 0.72 deg/s of y is of one part
        for column in compared:
            assert row.ratio(column) == pytest.approx(1, abs=0.12), (label, column)
    for row in study.table("rest").rows:
        x, y, z, error = row.values
        assert error == pytest.approx(100 * abs(np.linalg.norm([x, y, z]) / 9.80665 - 1), abs=0.01)
        assert 0 < error < 4


def test_a_bias_in_the_model_takes_what_the_published_map_leaves(study):
    rows = {row.label: row for row in study.table("calibration").rows}
    assert len(rows) == 8 and sum(bool(row.published) for row in rows.values()) == 4
    for label, row in rows.items():
        if row.published:
            assert 2 < row.values[6] < 40, label
            assert row.published[6] == max(row.published[:3])
        else:
            assert row.values[6] < 1, label
    for kind, sd in (("Xsens DOT", (0.69, 0.67, 1.1)), ("MATRIX", (2.8, 3.0, 2.85))):
        assert rows[f"3D, {kind}, attitude_aided"].values[3:6] == pytest.approx(sd, rel=0.1)


def test_the_worked_example_is_that_of_the_source_to_the_digits_printed(study):
    rows = study.table("annex G").rows
    for row in rows[:4]:
        for ours, theirs in zip(row.values, row.published, strict=True):
            assert ours is theirs is None or ours == pytest.approx(theirs, abs=5.1e-5), row.label
    before, after = (row.values for row in rows[-2:])
    assert before[2] > 15 and after[2] < 1  # the bias in z


def test_every_filter_and_sequence_stands_beside_the_published_tables(study):
    rows = {row.label: row for row in study.table("flexion").rows}
    wanted = {
        f"Xsens DOT, {name}, {seq}"
        for name in ("device", "imufilter", "ecompass", "triad")
        for seq in ("ZXZ", "YXZ", "ZYZ")
    }
    assert set(rows) == wanted | {f"MATRIX, imufilter, {seq}" for seq in ("ZXZ", "YXZ", "ZYZ")}
    beside = {label: row.published[:15] for label, row in rows.items() if row.published}
    assert beside == {
        f"{row.sensor}, {row.filters[0]}, {row.sequence}": tuple(row.mean_abs_error_deg)
        for row in load_published().flexion_mean_abs_error
    }
    for label, row in rows.items():
        assert row.values[15] == pytest.approx(np.mean(row.values[:15])) and row.values[15] < 0.5, (
            label
        )


def test_yxz_grows_with_the_flexion_and_zxz_does_not(study):
    rows = {row.label: row.values[:15] for row in study.table("growth").rows}
    assert rows["YXZ, theory"][14] == pytest.approx(7.9909, abs=1e-4)
    for name in ("device", "vqf_6d"):
        grown = np.array(rows[f"YXZ, {name}"])
        assert 7 < grown[14] < 10 and (np.diff(grown) > 0).all()
        assert max(rows[f"ZXZ, {name}"]) < 0.5


def test_the_heading_model_is_what_turned_sensors_give():
    """An elbow about x that starts at 4 deg, its distal sensor seen turned about the vertical by 24
    deg, by scipy's angles.
    """
    from scipy.spatial.transform import Rotation

    flexion = np.arange(0, 71, 5.0)
    joint = Rotation.from_euler("z", 24, degrees=True) * Rotation.from_rotvec(
        np.radians(flexion + 4.0)[:, None] * [1.0, 0, 0]
    )
    seen = joint.as_euler("YXZ", degrees=True)[:, 1]
    np.testing.assert_allclose(heading_model(flexion, 4.0, 24.0), np.abs(seen - flexion), atol=1e-9)
    q = rotation.from_euler("ZXY", np.radians([24.0, 4.0, 0.0]))
    assert np.degrees(rotation.to_euler("YXZ", q))[1] == pytest.approx(
        heading_model(np.array([0.0]), 4.0, 24.0)[0]
    )


def test_what_an_offset_and_a_heading_leave_of_the_table_that_grows_is_said_in_full(study):
    fit = heading_fit(load_published())
    assert fit.heading_deg == pytest.approx(23.8, abs=0.2) and fit.offset_deg == pytest.approx(
        4.3, abs=0.1
    )
    flexion, table57 = (
        np.arange(0, 71, 5.0),
        [3.68, 3.42, 3.07, 2.68, 2.22, 1.71, 1.16, 0.53, 0.20, 1.01, 1.97, 3.11, 4.47, 6.17, 8.29],
    )
    angle = np.degrees(
        np.arcsin(
            np.sin(np.radians(flexion + fit.offset_deg)) * np.cos(np.radians(fit.heading_deg))
        )
    )
    left = np.abs(angle - flexion) - table57
    assert fit.rms_deg == pytest.approx(np.sqrt(np.mean(left**2))) and fit.rms_deg < 0.12
    assert fit.largest_deg == pytest.approx(abs(left).max()) and fit.largest_deg > 2 * fit.rms_deg
    assert fit.largest_at_deg == flexion[abs(left).argmax()] == 0
    (said,) = [finding for finding in study.findings if "5.7" in finding]
    assert (
        "consistent with" in said
        and f"{fit.rms_deg:.2f} deg RMS and {fit.largest_deg:.2f} deg at most" in said
    )
    assert study.table("heading").rows[1].values[:15] == pytest.approx(left)
    assert not [finding for finding in study.findings if "explain" in finding]


def test_an_offset_and_a_heading_that_made_a_table_are_found_again():
    known = heading_model(np.array(load_published().flexion_deg), 2.5, 31.0)
    table = load_published().flexion_mean_abs_error
    other = [
        row.model_copy(update={"mean_abs_error_deg": known.tolist()}) if row.table == "5.7" else row
        for row in table
    ]
    found = heading_fit(load_published().model_copy(update={"flexion_mean_abs_error": other}))
    assert (found.offset_deg, found.heading_deg) == pytest.approx(
        (2.5, 31.0), abs=1e-4
    ) and found.largest_deg < 1e-6


def test_theory_simulation_and_measurement_are_in_one_figure_of_the_report(study):
    figures = {curves.caption: curves for curves in study.curves}
    kinds = {
        curve.kind
        for curve in figures["elbow: |error| of the YXZ flexion over the misalignment"].curves
    }
    assert kinds == {"theory", "simulation", "measurement"}
    assert len(study.surfaces) == 3
    page = render_study(study)
    assert all(caption in page for caption in figures)


def test_every_number_can_be_traced(study):
    assert [Session(path).manifest.seed for path in study.sessions] == [0] * 4
    assert all(Session(path).name in study.trace for path in study.sessions)
    assert study.name == "reference-1"
    assert study.table("fits").rows[-1].ratio(0) == pytest.approx(1, abs=3e-4)
    assert json.loads(json.dumps(study.to_dict(), allow_nan=False))["curves"]


# --- the study of misalignment, which runs the same elbow


@pytest.fixture(scope="module")
def misalignment(bench) -> StudyRecord:
    return get_study("misalignment").run(bench)


def test_misalignment_runs_an_elbow_and_lays_it_on_the_theory(misalignment, tmp_path):
    study = kept(misalignment, tmp_path, seed=0)
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


def test_sessions_of_a_study_have_reports_that_it_links_to(bench, misalignment):
    study = misalignment
    folder = new_folder(bench.logs, "misalignment", bench.clock)
    page = study_report(study, folder).read_text(encoding="utf-8")
    (link,) = re.findall(r'<a href="(\.\./[^"]+)">', page)
    assert (folder / link).resolve() == (Path(study.sessions[0]) / "report.html").resolve()
    assert (folder / link).is_file()
