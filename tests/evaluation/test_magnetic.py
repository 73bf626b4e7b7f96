"""The disturbance of the field as evaluated, against fields that were put in; and what it does to
filters.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench import execute, plan
from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.evaluation.judged import sound_truth
from testbench.evaluation.magnetic import EDGES, field_deviation, field_error_rows, field_rows
from testbench.evaluation.orientation import sensor_errors
from testbench.evaluation.outliers import outlier_rows
from testbench.records.results.estimate import CalibrationFit
from testbench.records.session.plan import judged_steps

PASSAGE = """
name: short_passage
purpose: Swings to the bench and back, then a minute beside it
robot: ur3e
sensors:
  arm:
    preset: xsens_dot
    link: forearm_link
    segment: {name: upper_arm}
    mounting: {position_mm: [-100, 0, 60]}
  forearm:
    preset: xsens_dot
    link: wrist_3_link
    segment: {name: forearm}
    mounting: {position_mm: [0, 0, 10]}
joints:
  wrist: {proximal: arm, distal: forearm, sequence: ZXZ, flexion: second}
variables: {frequency_hz: [0.3, 0.35, 0.4, 0.45]}
sections:
  - name: reference
    role: reference
    steps: [{move_to_deg: [0, -67.5, -90, -112.5, 90, 0], dwell_s: 15}]
  - name: passes
    for_each: [frequency_hz]
    steps:
      - sweep:
          shoulder_pan_joint:
            sine: {amplitude_deg: 40, frequency_hz: frequency_hz / 2, cycles: 1, ramp_cycles: 0.5}
          shoulder_lift_joint:
            sine: {amplitude_deg: 22.5, frequency_hz: frequency_hz, cycles: 2, ramp_cycles: 1}
          wrist_1_joint:
            sine: {amplitude_deg: -22.5, frequency_hz: frequency_hz, cycles: 2, ramp_cycles: 1}
  - {name: stay, steps: [{move_to_deg: [0, -45, -90, -135, 90, 0], dwell_s: 60}]}
estimate: {filters: [ecompass, triad, vqf_9d], align: reference_pose, calibrate: none}
"""


def with_field(quick, norm_percent: np.ndarray, dip_deg: np.ndarray, heading_deg: np.ndarray):
    """The forearm of a run, and readings of the field of the earth with known deviations."""
    session = quick.session
    steps = judged_steps(session.steps)
    estimated = dataclasses.replace(quick.estimate.sensors["forearm"], calibration=CalibrationFit())
    errors = sensor_errors("forearm", estimated, sound_truth(session, "forearm")[0], steps)
    dip, turn = np.radians(50 + dip_deg), np.radians(90 + heading_deg)
    north = np.column_stack([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), -np.sin(dip)])
    known = np.isfinite(errors.q_true[:, 0])
    mag = np.full((len(known), 3), np.nan)
    from_sensor = Rotation.from_quat(errors.q_true[known], scalar_first=True)
    mag[known] = from_sensor.inv().apply(
        45 * (1 + norm_percent[known] / 100)[:, None] * north[known]
    )
    return errors, mag


def test_deviations_put_into_the_field_are_found_in_norm_dip_and_heading(quick):
    time = quick.estimate.sensors["forearm"].host_time_ns
    reference_end = max(step.end_ns for step in quick.session.steps if step.role == "reference")
    after = (time > reference_end).astype(float)
    wave = np.sin(time / 1e9)
    put_in = 12 * after * wave, 7 * after * wave**2, -160 * after * np.cos(time / 1e9)
    errors, mag = with_field(quick, *put_in)
    found = field_deviation(errors, mag, quick.session.steps)
    assert found is not None
    assert (found.norm, np.degrees(found.dip)) == pytest.approx((45, 50), abs=1e-6)
    known = np.isfinite(found.norm_percent)
    assert known[errors.judged].all()
    for own, expected in zip(
        (found.norm_percent, np.degrees(found.dip_rad), np.degrees(found.heading_rad)),
        put_in,
        strict=True,
    ):
        np.testing.assert_allclose(own[known], expected[known], atol=1e-6)
    row = next(row for row in field_rows(errors, found) if row.motion == "all")
    assert row.n == errors.judged.sum()
    assert row.norm_rms_percent == pytest.approx(np.sqrt(np.mean(put_in[0][errors.judged] ** 2)))
    assert row.field_heading_p95_deg == pytest.approx(
        np.quantile(np.abs(put_in[2][errors.judged]), 0.95), abs=1e-6
    )


def test_heading_errors_are_sorted_by_how_far_the_field_was_disturbed(quick):
    time = quick.estimate.sensors["forearm"].host_time_ns
    rising = np.linspace(0, 30, len(time)) * (
        time > max(s.end_ns for s in quick.session.steps if s.role == "reference")
    )
    errors, mag = with_field(quick, rising, 0 * rising, 0 * rising)
    found = field_deviation(errors, mag, quick.session.steps)
    assert found is not None
    rows = [
        row
        for row in field_error_rows(errors, found)
        if (row.quantity, row.filter) == ("norm", "vqf_9d")
    ]
    assert sum(row.n for row in rows) <= errors.judged.sum()
    for row in rows:
        inside = (
            errors.judged
            & (rising >= row.low)
            & (rising < (np.inf if row.high is None else row.high))
        )
        assert (row.low, np.inf if row.high is None else row.high) in set(pairwise(EDGES))
        heading = np.degrees(errors.errors["vqf_9d"].heading[inside])
        assert abs(row.n - inside.sum()) <= 1
        assert row.heading_rmse_deg == pytest.approx(np.sqrt(np.mean(heading**2)), rel=0.01)


def test_without_a_magnetometer_nothing_is_said_of_the_field(quick):
    errors, _ = with_field(
        quick, *np.zeros((3, len(quick.estimate.sensors["forearm"].host_time_ns)))
    )
    assert field_deviation(errors, None, quick.session.steps) is None


@pytest.fixture(scope="module")
def passage(tmp_path_factory):
    folder = tmp_path_factory.mktemp("passage")
    (folder / "short_passage.yaml").write_text(PASSAGE, encoding="utf-8")
    session = execute(plan(folder / "short_passage.yaml"), folder, 3)
    return session, evaluate(session, estimate(session))


def test_a_compass_follows_every_disturbance_it_passes_and_vqf_does_not(passage):
    """ecompass and TRIAD have no memory; VQF averages the heading over 9 s while the gyroscope
    carries it.
    """
    _, evaluation = passage
    field = {(row.sensor, row.motion): row for row in evaluation.magnetic_field}
    heading = {
        (item.sensor, item.filter): item.errors.rmse_deg
        for item in evaluation.orientation_summary
        if item.part == "heading" and item.motion == "dynamic"
    }
    for sensor in ("arm", "forearm"):
        disturbed = field[sensor, "dynamic"].field_heading_rms_deg
        assert disturbed > 2
        assert heading[sensor, "ecompass"] == pytest.approx(heading[sensor, "triad"], rel=1e-6)
        assert heading[sensor, "ecompass"] > 0.6 * disturbed
        assert heading[sensor, "vqf_9d"] < 0.7 * heading[sensor, "ecompass"]
    series = evaluation.series["joint_wrist"]
    total = {
        key: np.sqrt(np.mean(series[f"{key}_total_error_rad"][series["judged"]] ** 2))
        for key in ("vqf_9d", "ecompass", "triad")
    }
    assert total["vqf_9d"] < min(total["ecompass"], total["triad"])


def test_a_disturbance_that_stays_turns_vqf_as_well(passage):
    session, evaluation = passage
    end = next(step.end_ns for step in session.steps if step.section == "stay")
    series = evaluation.series["orientation_forearm"]
    last = (
        (series["host_time_ns"] > end - 5_000_000_000)
        & (series["host_time_ns"] < end)
        & series["judged"]
    )
    headings = {
        key: np.degrees(series[f"{key}_heading_rad"][last]).mean() for key in ("ecompass", "vqf_9d")
    }
    assert abs(headings["ecompass"]) > 2
    assert headings["vqf_9d"] == pytest.approx(headings["ecompass"], abs=0.5)


def test_the_manifest_says_what_disturbed_the_field(passage):
    session, _ = passage
    environment = session.manifest.content["environment"]
    assert environment["magnetic_field_uT"] == [0.0, 24.0, -39.0]
    assert [d["name"] for d in environment["dipoles"]] == [
        d.name for d in session.robot.spec.magnetism.dipoles
    ]
    assert "de Vries" in environment["why"] and len(environment["dipoles"]) == 20
    assert Path(session.path / "robot.yaml").read_text(encoding="utf-8").count("moment_A_m2") == 20


def test_a_filter_that_runs_away_is_an_outlier_with_what_is_known_of_it(quick):
    summaries = []
    for item in quick.evaluation.orientation_summary:
        away = item.filter == "fusion" and item.sensor == "arm" and item.part == "heading"
        errors = dataclasses.replace(item.errors, rmse_deg=80.0) if away else item.errors
        summaries.append(dataclasses.replace(item, errors=errors))
        if item.filter == "vqf_9d":
            summaries.append(
                dataclasses.replace(item, filter="another")
            )  # of four filters none is said to be far
    found = outlier_rows(
        dataclasses.replace(quick.evaluation, orientation_summary=summaries), {"fusion": "It runs."}
    )
    mine = [row for row in found if (row.owner, row.quantity) == ("arm", "heading")]
    assert {(row.filter, row.known) for row in mine} == {("fusion", "It runs.")}
    assert all(row.value_deg == 80 and 1 < row.fence_deg < 80 for row in mine)


def test_the_estimate_carries_what_the_catalogue_says_of_its_filters(quick, tmp_path):
    assert "slow sweep looks like rest" in quick.estimate.behaviour["vqf_6d"]
    quick.estimate.save(tmp_path)
    assert type(quick.estimate).load(tmp_path).behaviour == quick.estimate.behaviour
