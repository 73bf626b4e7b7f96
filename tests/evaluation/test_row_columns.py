"""Numbers of a row that are alike where errors are tame, and are told apart where they are not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from testbench.evaluation import evaluate
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.flexion import JointErrors, _others
from testbench.evaluation.orientation import sensor_errors, summarise_sensor
from testbench.model import rotation
from testbench.model.statistics.memory import error_series, intervals, layout, means
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth
from testbench.records.specs.protocol import JointDefinition
from tests.evaluation.test_evaluate import true_flexion, with_flexion
from tests.evaluation.test_metrics import N, estimate, evaluate_sensor, true_orientations, truth


def test_the_columns_of_a_flexions_row_are_what_they_are_called(quick):
    flexion = true_flexion(quick)
    error = np.abs(np.random.default_rng(3).standard_cauchy(len(flexion)) % 7)
    signed = error * np.where(np.arange(len(error)) % 3, 1, -1)
    said = with_flexion(quick, flexion + np.radians(signed))
    for row in evaluate(quick.session, said).joint_angle:
        middle = row.flexion_mean_abs_error_deg
        assert abs(row.flexion_mean_error_deg) < 0.8 * middle
        assert middle < row.flexion_rmse_deg < row.flexion_p95_abs_error_deg
        assert row.flexion_p95_abs_error_deg < row.flexion_max_abs_error_deg < 7
        spread = row.flexion_sd_deg * np.sqrt((row.n - 1) / row.n)
        assert row.flexion_rmse_deg == pytest.approx(np.hypot(row.flexion_mean_error_deg, spread))
        assert -middle < row.flexion_median_error_deg != row.flexion_mean_error_deg
        assert row.flexion_iqr_deg > 0


def test_settling_is_told_by_the_median_pose_and_the_slowest():
    n, span, step_ns = 2500, 5 * 10**9, 8_000_000
    t = np.arange(n) * step_ns / 1e9
    taus = np.array([0.05, 0.1, 0.15, 0.6])[np.minimum((t // 5).astype(int), 3)]
    error = np.radians(3.0) * np.exp(-(t % 5) / taus)
    true = Truth(np.arange(n) * step_ns, np.tile([1.0, 0, 0, 0], (n, 1)))
    steps = [
        PlannedStep(
            *(i, "s", "evaluation", "p", "move", {}, i * span, i * span + step_ns),
            (i + 1) * span - step_ns,
        )
        for i in range(4)
    ]
    errors = sensor_errors("hand", estimate(rotation.from_heading(error)), true, steps)
    turning = TrueTurning.of(true.host_time_ns, true.q_world_from_sensor)
    rows = summarise_sensor(errors, [], turning, 1e-4)
    (total,) = [r.errors for r in rows if (r.motion, r.part) == ("all", "total")]
    wanted = sorted(tau * np.log(3.0 / 0.1) for tau in (0.05, 0.1, 0.15, 0.6))
    assert total.unsettled == 0
    assert total.convergence_s == pytest.approx((wanted[1] + wanted[2]) / 2, abs=0.05)
    assert total.convergence_max_s == pytest.approx(wanted[3], abs=0.05)


def test_the_largest_total_error_is_the_largest():
    sizes = np.where(np.arange(N) == 77, 9.0, 1.0)
    q = rotation.multiply(rotation.from_heading(np.radians(sizes)), true_orientations())
    (row,), _ = evaluate_sensor(estimate(q), truth())
    assert row.total_max_deg == pytest.approx(9.0)
    assert row.total_rmse_deg == pytest.approx(np.sqrt((N - 1 + 81) / N))


def test_angles_beside_the_flexion_count_only_where_they_are_defined():
    joint = JointDefinition(sequence="ZXZ", flexion="second", proximal="a", distal="b")
    key = ("f", joint.label)
    true = np.tile(np.radians([10.0, 40.0, -20.0]), (8, 1))
    defined = np.tile((np.arange(8) % 2 == 0)[:, None], (1, 3))
    angles = true + np.radians(np.where(defined, 1.0, 90.0))
    rows = np.arange(8)
    errors = JointErrors(
        *("knee", joint, rows, true[:, 1], {}, {}, {joint.label: true}, {key: angles}),
        *([], {}, np.zeros((8, 2))),
    )
    (means_deg,) = _others(errors, key, rows, np.array([8]), defined)
    assert means_deg == pytest.approx([1.0, 1.0])


def test_an_interval_is_as_wide_as_students_t_has_it():
    noise = np.random.default_rng(1).standard_normal(2000)
    own = layout(np.arange(2000) / 20, [np.arange(2000)], equally=False)
    series = error_series(own, noise)
    known = means(own, series.mean[None])
    found = intervals(series)
    half = student.ppf(0.975, known.freedom[0]) * known.error[0]
    assert known.freedom[0] < 40
    assert found.mean == pytest.approx([known.mean[0] - half, known.mean[0] + half])
