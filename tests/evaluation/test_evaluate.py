"""The stage `evaluate` on a recording whose estimates have known errors."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from testbench.evaluation import evaluate, joint_summary, ranking
from testbench.evaluation.judged import SETTLING_NS, window
from testbench.exceptions import SessionError
from testbench.model import rotation
from testbench.records.results.estimate import CalibrationFit, Estimate, JointEstimate
from testbench.records.results.evaluation import Evaluation, Outcome
from testbench.records.results.evaluation_rows import MEAN_MAGNITUDE, MEAN_SQUARE
from testbench.records.session.plan import PlannedStep, judged_steps

JOINT_KEYS = {
    "joint",
    "filter",
    "sequence",
    "misalignment_deg",
    "flexion_deg",
    "n",
    "flexion_mean_error_deg",
    "flexion_mean_abs_error_deg",
    "flexion_sd_deg",
    "flexion_rmse_deg",
    "flexion_max_abs_error_deg",
}
ORIENTATION_KEYS = {
    "sensor",
    "filter",
    "total_rmse_deg",
    "heading_rmse_deg",
    "inclination_rmse_deg",
}
METRIC_KEYS = {"name", "value", "unit", "lower", "upper", "outcome", "meaning"}


def true_flexion(result) -> np.ndarray:
    """What the arm measured of its last joint, at the instants of the joint estimate [rad]."""
    arm, joint = result.session.arm(), result.estimate.joints["elbow"]
    return np.interp(joint.host_time_ns, arm.host_time_ns, arm.q_measured[:, 5])


def with_flexion(result, flexion: np.ndarray) -> Estimate:
    """The estimate of a run in which one filter says this flexion (and nothing else is said)."""
    joint = result.estimate.joints["elbow"]
    angles = joint.angles["device", "ZXZ"].copy()
    angles[:, 1] = flexion
    return dataclasses.replace(
        result.estimate,
        joints={"elbow": JointEstimate(joint.host_time_ns, {("device", "ZXZ"): angles})},
    )


@pytest.mark.parametrize("offset_deg", [2.0, -0.7, 0.0])
@pytest.mark.parametrize("turns", [0, 1, -2])
def test_a_constant_error_of_the_flexion_is_reported_as_it_is_in_every_row(
    quick, offset_deg, turns
):
    estimate = with_flexion(quick, true_flexion(quick) + np.radians(offset_deg + 360 * turns))
    rows = evaluate(quick.session, estimate).joint_angle
    assert len(rows) == 7  # two by three poses, one more before the sweep, and the sweep
    for row in rows:
        assert row.n > 10
        assert row.flexion_mean_error_deg == pytest.approx(offset_deg, abs=1e-9)
        assert row.flexion_mean_abs_error_deg == pytest.approx(abs(offset_deg), abs=1e-9)
        assert row.flexion_rmse_deg == pytest.approx(abs(offset_deg), abs=1e-9)
        assert row.flexion_max_abs_error_deg == pytest.approx(abs(offset_deg), abs=1e-9)
        assert row.flexion_sd_deg == pytest.approx(0, abs=1e-9)


def test_an_alternating_error_cancels_in_the_mean_and_not_in_the_magnitude(quick):
    flexion = true_flexion(quick)
    sign = np.where(np.arange(len(flexion)) % 2, 1.0, -1.0)
    for row in evaluate(
        quick.session, with_flexion(quick, flexion + np.radians(3.0) * sign)
    ).joint_angle:
        assert abs(row.flexion_mean_error_deg) < 3.0 * 1.01 / row.n
        assert row.flexion_mean_abs_error_deg == pytest.approx(3, abs=1e-9)
        assert row.flexion_sd_deg == pytest.approx(3, rel=0.05)


def test_an_error_outside_the_judged_windows_is_not_seen(quick):
    joint, flexion = quick.estimate.joints["elbow"], true_flexion(quick)
    moving = np.ones(len(flexion), dtype=bool)
    for step in judged_steps(quick.session.steps):
        begin, end = window(step)
        moving &= (joint.host_time_ns < begin) | (joint.host_time_ns > end)
    assert 0.2 < moving.mean() < 0.9
    rows = evaluate(
        quick.session, with_flexion(quick, flexion + np.where(moving, 1.0, 0.0))
    ).joint_angle
    assert max(row.flexion_max_abs_error_deg for row in rows) < 1e-9


def test_the_rows_name_the_commanded_pose_section_and_sequence(quick):
    rows = [
        row
        for row in quick.evaluation.joint_angle
        if row.filter == "device" and row.sequence == "ZXZ"
    ]
    static = [(row.misalignment_deg, row.flexion_deg) for row in rows if row.section == "static"]
    assert static == [(d, f) for d in (0, 20) for f in (0, 30, 60)]
    sweep = [row for row in rows if row.section == "sweep"]
    assert [row.flexion_deg for row in sweep] == [None]
    assert {row.sequence for row in quick.evaluation.joint_angle} == {"ZXZ", "YXZ"}


def test_in_gimbal_lock_the_two_other_angles_are_not_judged(quick):
    for row in quick.evaluation.joint_angle:
        if row.section == "static" and row.sequence == "ZXZ":
            if row.flexion_deg == 0:  # the outer axes of ZXZ coincide at no flexion
                assert row.other_mean_abs_error_deg == [None, None]
            else:
                assert all(0 <= value < 10 for value in row.other_mean_abs_error_deg)


@pytest.mark.parametrize(
    ("error_deg", "total", "heading", "inclination"),
    [((0, 0, 3.0), 3, 3, 0), ((1.2, 0, 0), 1.2, 0, 1.2)],
)
def test_a_constant_error_of_the_orientation_is_reported_as_it_is(
    quick, error_deg, total, heading, inclination
):
    sensors = {}
    turn = rotation.from_rotation_vector(np.radians(error_deg))
    for name, sensor in quick.estimate.sensors.items():
        truth = quick.session.truth(name)
        q = rotation.interpolate(truth.host_time_ns, truth.q_world_from_sensor, sensor.host_time_ns)
        sensors[name] = dataclasses.replace(
            sensor, orientation={"vqf_6d": rotation.multiply(turn, q)}
        )
    rows = evaluate(
        quick.session, dataclasses.replace(quick.estimate, sensors=sensors, joints={})
    ).orientation
    assert [row.sensor for row in rows] == ["arm", "forearm"]
    for row in rows:
        assert row.total_rmse_deg == pytest.approx(total, abs=1e-6)
        assert row.heading_rmse_deg == pytest.approx(heading, abs=1e-6)
        assert row.inclination_rmse_deg == pytest.approx(inclination, abs=1e-6)


def step(kind="move", role="evaluation", start=0, settled=10**9, end=3 * 10**9) -> PlannedStep:
    return PlannedStep(0, "s", role, "n", kind, {}, start, settled, end)


def test_a_dwell_counts_once_the_arm_has_swung_in_and_a_sweep_while_it_moves():
    assert window(step()) == (10**9 + SETTLING_NS, 3 * 10**9)
    assert window(step(end=10**9 + 400_000_000)) == (
        10**9 + 100_000_000,
        10**9 + 400_000_000,
    )  # a quarter of a short one
    assert window(step("sweep")) == (0, 10**9)


def test_evaluation_sections_are_judged_and_calibration_only_where_there_is_nothing_else():
    evaluation, reference, calibration = (
        step(role=role) for role in ("evaluation", "reference", "calibration")
    )
    assert judged_steps([calibration, reference, evaluation]) == [evaluation]
    assert judged_steps([calibration, reference]) == [reference]
    assert judged_steps([calibration]) == [calibration]


def test_evaluation_json_has_the_keys_that_others_build_on(quick):
    data = json.loads((quick.session.path / "evaluation.json").read_text())
    assert {"schema_version", "session", "joint_angle", "orientation", "metrics", "outcome"} <= set(
        data
    )
    assert data["schema_version"] == 2
    assert data["session"] == quick.session.name
    assert data["outcome"] in {"pass", "marginal", "fail", "not_measured"}
    for rows, keys in (
        ("joint_angle", JOINT_KEYS),
        ("orientation", ORIENTATION_KEYS),
        ("metrics", METRIC_KEYS),
    ):
        assert data[rows], rows
        for row in data[rows]:
            assert keys <= set(row), rows
    for row in data["metrics"]:
        assert row["name"].endswith("_" + row["unit"]) and row["meaning"]
        assert row["outcome"] in {None, "pass", "marginal", "fail", "not_measured"}


def test_every_filter_sensor_and_joint_is_evaluated(quick):
    filters = {"device", "vqf_6d", "vqf_9d", "fusion"}
    assert {row.filter for row in quick.evaluation.joint_angle} == filters
    assert {(row.sensor, row.filter) for row in quick.evaluation.orientation} == {
        (sensor, name) for sensor in ("arm", "forearm") for name in filters
    }


def test_the_error_signals_are_kept_on_the_time_of_the_estimate(quick):
    series = quick.evaluation.series
    assert set(series) == {
        "orientation_arm",
        "orientation_forearm",
        "joint_elbow",
        "magnetic_arm",
        "magnetic_forearm",
    }
    elbow = series["joint_elbow"]
    error = rotation.wrap(elbow["device_ZXZ_flexion_rad"] - elbow["reference_rad"])
    known = np.isfinite(error)
    np.testing.assert_allclose(elbow["device_ZXZ_error_rad"][known], error[known], atol=1e-12)
    judged = elbow["judged"]
    rows = [
        row
        for row in quick.evaluation.joint_angle
        if row.filter == "device" and row.sequence == "ZXZ"
    ]
    assert judged.sum() == sum(row.n for row in rows)


def test_an_evaluation_is_read_back_as_it_was_written(quick, tmp_path):
    quick.evaluation.save(tmp_path)
    back = Evaluation.load(tmp_path)
    assert back.to_dict() == quick.evaluation.to_dict()
    assert isinstance(back.outcome, Outcome)
    assert set(back.series) == set(quick.evaluation.series)
    for name, columns in quick.evaluation.series.items():
        for column, values in columns.items():
            np.testing.assert_array_equal(back.series[name][column], values)


def test_an_estimate_is_read_back_as_it_was_written(quick, tmp_path):
    quick.estimate.save(tmp_path)
    back = Estimate.load(tmp_path)
    assert back.session == quick.estimate.session
    for name, sensor in quick.estimate.sensors.items():
        found = back.sensors[name]
        np.testing.assert_array_equal(found.host_time_ns, sensor.host_time_ns)
        np.testing.assert_array_equal(found.static, sensor.static)
        assert found.clock == sensor.clock
        assert found.frames == sensor.frames
        assert found.skipped == sensor.skipped
        np.testing.assert_array_equal(found.calibration.acc_matrix, sensor.calibration.acc_matrix)
        assert list(found.orientation) == list(sensor.orientation)
        for key, q in sensor.orientation.items():
            np.testing.assert_array_equal(found.orientation[key], q)
    assert back.joints["elbow"].angles.keys() == quick.estimate.joints["elbow"].angles.keys()
    for key, angles in quick.estimate.joints["elbow"].angles.items():
        np.testing.assert_array_equal(back.joints["elbow"].angles[key], angles)


def test_evaluating_what_was_read_back_gives_the_same_numbers(quick):
    again = evaluate(quick.session, Estimate.load(quick.session.path))
    assert again.to_dict() == quick.evaluation.to_dict()


def test_an_evaluation_of_another_schema_is_refused(tmp_path):
    (tmp_path / "evaluation.json").write_text('{"schema_version": 99}')
    with pytest.raises(SessionError, match="schema 99"):
        Evaluation.load(tmp_path)


def test_the_summary_of_a_section_gives_every_pose_the_same_weight(quick):
    for summary in quick.evaluation.joint_summary:
        rows = [
            row
            for row in quick.evaluation.joint_angle
            if (row.filter, row.sequence, row.section)
            == (summary.filter, summary.sequence, summary.section)
            and (row.kind == "sweep") == (summary.motion == "dynamic")
        ]
        if summary.motion == "all":
            continue
        e = summary.errors
        assert (e.steps, e.n) == (len(rows), sum(row.n for row in rows))
        assert e.mean_error_deg == pytest.approx(
            np.mean([row.flexion_mean_error_deg for row in rows])
        )
        assert e.rmse_deg == pytest.approx(
            np.sqrt(np.mean([row.flexion_rmse_deg**2 for row in rows]))
        )
        for value, interval in (
            (e.mean_abs_error_deg, e.mean_abs_error_ci95_deg),
            (e.rmse_deg, e.rmse_ci95_deg),
        ):
            assert interval is None or interval[0] <= value <= interval[1]


def test_a_sweep_says_what_it_was_and_a_delay_put_into_it_is_found(quick):
    joint, arm = quick.estimate.joints["elbow"], quick.session.arm()
    late = 0.015
    delayed = np.interp(joint.host_time_ns - late * 1e9, arm.host_time_ns, arm.q_measured[:, 5])
    evaluation = evaluate(quick.session, with_flexion(quick, delayed))
    (row,) = [row for row in evaluation.joint_angle if row.kind == "sweep"]
    assert row.amplitude_deg == pytest.approx(20, abs=0.5)  # as the protocol commands it
    assert row.frequency_hz == pytest.approx(0.5, rel=0.15)  # the ramps are slower
    assert row.latency_ms == pytest.approx(1e3 * late, abs=0.3)
    assert row.flexion_correlation == pytest.approx(
        np.cos(2 * np.pi * row.frequency_hz * late), abs=3e-4
    )
    summary = next(s for s in evaluation.joint_summary if s.section == "sweep")
    assert summary.errors.latency_ms == pytest.approx(1e3 * late, abs=0.3)


def test_an_error_that_decays_after_each_move_is_seen_to_settle(quick):
    joint = quick.estimate.joints["elbow"]
    error, tau = np.zeros(len(joint.host_time_ns)), 0.1
    poses = [step for step in judged_steps(quick.session.steps) if step.section == "static"]
    for step in poses:
        since = (joint.host_time_ns - step.settled_ns) / 1e9
        error = np.where(
            (since >= 0) & (joint.host_time_ns <= step.end_ns),
            np.radians(1.0) * np.exp(-since / tau),
            error,
        )
    rows = evaluate(quick.session, with_flexion(quick, true_flexion(quick) + error)).joint_angle
    times = [row.convergence_s for row in rows if row.section == "static"]
    assert times == pytest.approx([tau * np.log(10)] * len(poses), abs=0.04)


def test_sections_of_seconds_are_not_ranked_and_say_why(quick):
    """Six poses and one sweep of 4 s, with errors that last for seconds."""
    assert not quick.evaluation.ranking and not quick.evaluation.comparisons
    for summary in (*quick.evaluation.joint_summary, *quick.evaluation.orientation_summary):
        e = summary.errors
        ends = (e.mean_error_ci95_deg, e.mean_abs_error_ci95_deg, e.rmse_ci95_deg)
        assert (e.no_interval is None) == all(end is not None for end in ends)
        if e.no_interval:
            assert e.no_interval.startswith("not known from this session: ")
    lacking = [
        metric
        for metric in quick.evaluation.metrics
        if metric.name == "elbow.flexion_rmse_deg" and metric.ci95 is None
    ]
    assert lacking and all(metric.no_interval for metric in lacking)


def test_filters_are_ranked_for_every_section_and_sensor(quick, monkeypatch):
    monkeypatch.setattr(ranking, "FEWEST_MEMORIES", 0.0)  # however few memories they hold
    found = evaluate(quick.session, quick.estimate)
    owners = {(row.owner, row.section) for row in found.ranking}
    assert ("elbow", "sweep") not in owners  # one short sweep
    monkeypatch.setattr(joint_summary, "SHORT_SWEEP_S", 0.0)
    found = evaluate(quick.session, quick.estimate)
    owners = {(row.owner, row.section) for row in found.ranking}
    assert owners == {("arm", None), ("forearm", None), ("elbow", "static"), ("elbow", "sweep")}
    for owner, section in owners:
        own = [row for row in found.ranking if (row.owner, row.section) == (owner, section)]
        criteria = {row.criterion for row in own}
        assert criteria == ({MEAN_SQUARE} if section is None else {MEAN_MAGNITUDE, MEAN_SQUARE})
        for criterion in criteria:
            check_ranking([row for row in own if row.criterion == criterion])


def check_ranking(rows):
    assert [row.value for row in rows] == sorted(row.value for row in rows)
    assert {row.filter for row in rows} == {"device", "vqf_6d", "vqf_9d", "fusion"}
    assert all(row.best_rank <= place <= row.worst_rank for place, row in enumerate(rows, start=1))


def test_the_total_error_of_a_joint_is_the_angle_between_the_true_and_the_estimated_rotation(quick):
    joint = quick.session.analysis.joints["elbow"]
    series = quick.evaluation.series["joint_elbow"]
    time, judged = series["host_time_ns"], series["judged"]
    for key in ("vqf_9d", "fusion"):
        relative = []
        for place in ("true", "estimated"):
            segments = []
            for name in (joint.proximal, joint.distal):
                truth, own = quick.session.truth(name), quick.estimate.sensors[name]
                at, q = (
                    (truth.host_time_ns, truth.q_world_from_sensor)
                    if place == "true"
                    else (own.host_time_ns, own.orientation[key])
                )
                found = Slerp(at, Rotation.from_quat(q, scalar_first=True))(
                    np.clip(time[judged], at[0], at[-1])
                )
                sensor = quick.session.analysis.sensors[name]
                (s, angles), (m, turns) = (
                    *sensor.segment.rotation_deg.items(),
                    *sensor.mounting.rotation_deg.items(),
                )
                turn = Rotation.from_euler(m, turns, degrees=True).inv() * Rotation.from_euler(
                    s, angles, degrees=True
                )
                segments.append(found * turn)
            relative.append(segments[0].inv() * segments[1])
        expected = (relative[0].inv() * relative[1]).magnitude()
        np.testing.assert_allclose(
            series[f"{key}_total_error_rad"][judged], expected, atol=np.radians(2e-3)
        )
        assert not np.isfinite(series[f"{key}_total_error_rad"][~judged]).any()


def test_an_error_put_into_the_calibrated_bias_is_reported_as_such(quick):
    wrong = np.radians([0.5, 0.0, -0.2])

    def evaluated(bias: np.ndarray):
        sensors = {
            name: dataclasses.replace(
                sensor, calibration=CalibrationFit(gyr_bias=bias, method="static_poses")
            )
            for name, sensor in quick.estimate.sensors.items()
        }
        return evaluate(
            quick.session, dataclasses.replace(quick.estimate, sensors=sensors)
        ).gyroscope_bias

    assert quick.evaluation.gyroscope_bias == []  # nothing was calibrated
    right, off = evaluated(np.zeros(3)), evaluated(wrong)
    assert len(right) == len(off) == 6
    shifts = [
        after.error_deg_s - before.error_deg_s for before, after in zip(right, off, strict=True)
    ]
    assert shifts == pytest.approx([-0.5, 0.0, 0.2] * 2, abs=1e-9)
    known = [row.error_sd_deg_s for row in right if row.error_sd_deg_s is not None]
    assert known and all(0 < sd < 0.05 for sd in known)  # null where its noise lasts too long
