"""Numbers of a row that are alike where errors are tame, and are told apart where they are not."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.evaluation import evaluate
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.orientation import sensor_errors, summarise_sensor
from testbench.model import rotation
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth
from tests.evaluation.test_evaluate import true_flexion, with_flexion
from tests.evaluation.test_metrics import estimate


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
    rows = summarise_sensor(errors, [], turning)
    (total,) = [r.errors for r in rows if (r.motion, r.part) == ("all", "total")]
    wanted = sorted(tau * np.log(3.0 / 0.1) for tau in (0.05, 0.1, 0.15, 0.6))
    assert total.unsettled == 0
    assert total.convergence_s == pytest.approx((wanted[1] + wanted[2]) / 2, abs=0.05)
    assert total.convergence_max_s == pytest.approx(wanted[3], abs=0.05)
