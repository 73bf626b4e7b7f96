"""What is judged, and what stands beside it: flagged samples count nowhere, delays are as sure as
clocks, and each uncertainty stands beside the numbers that it belongs to.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from testbench.evaluation import evaluate
from testbench.evaluation.budgets import flexion_time_sd
from testbench.evaluation.chain import _row
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.flexion import joint_errors
from testbench.evaluation.orientation import (
    sensor_errors,
    summarise_sensor,
    sweep_rows,
)
from testbench.evaluation.uncertainty import combine
from testbench.evaluation.verdict import _SIGNED
from testbench.model import rotation
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import ClockFit, SensorEstimate
from testbench.records.session.plan import PlannedStep, judged_steps
from testbench.records.session.samples import Truth
from tests.evaluation.test_evaluate import true_flexion, with_flexion
from tests.evaluation.test_metrics import N, estimate, evaluate_sensor, true_orientations, truth

STEP_NS = 8_000_000
TIME_SD = 1e-4


def turned_by(degrees) -> np.ndarray:
    """The true orientations of `test_metrics`, wrong by a heading of so many degrees."""
    return rotation.multiply(rotation.from_heading(np.radians(degrees)), true_orientations())


def test_flagged_samples_of_a_sensor_are_not_judged():
    flagged = (np.arange(N) >= 100) & (np.arange(N) < 200)
    found = dataclasses.replace(estimate(turned_by(np.where(flagged, 90.0, 2.0))), flagged=flagged)
    (row,), series = evaluate_sensor(found, truth())
    assert row.n == N - 100
    assert row.total_rmse_deg == pytest.approx(2, abs=1e-9)
    assert row.total_max_deg == pytest.approx(2, abs=1e-9)
    np.testing.assert_array_equal(series["judged"], ~flagged)


@pytest.mark.parametrize("which", ["arm", "forearm"])
def test_flagged_samples_of_either_sensor_of_a_joint_are_not_judged(quick, which):
    joint, sensor = quick.estimate.joints["elbow"], quick.estimate.sensors[which]
    rows = evaluate(quick.session, with_flexion(quick, true_flexion(quick))).joint_angle
    step = next(s for s in quick.session.steps if s.index == rows[2].step)
    middle = (step.settled_ns + step.end_ns) // 2
    spoilt = sensor.flagged | (np.abs(sensor.host_time_ns - middle) < 200_000_000)
    wrong = np.abs(joint.host_time_ns - middle) < 190_000_000
    said = with_flexion(quick, true_flexion(quick) + np.where(wrong, 1.0, 0.0))
    flagged = dataclasses.replace(sensor, flagged=spoilt)
    said = dataclasses.replace(said, sensors=said.sensors | {which: flagged})
    found = evaluate(quick.session, said).joint_angle
    assert 15 < rows[2].n - found[2].n < 35  # 0.4 s at 60 Hz
    assert found[2].flexion_max_abs_error_deg < 1e-9


def test_a_hole_in_the_distal_sensors_samples_is_not_judged(quick):
    steps = judged_steps(quick.session.steps)
    whole = joint_errors(quick.session, "elbow", quick.estimate, steps)
    step, rows = whole.steps[2]
    forearm = quick.estimate.sensors["forearm"]
    kept = np.abs(forearm.host_time_ns - (step.settled_ns + step.end_ns) // 2) > 200_000_000
    cut = SensorEstimate(
        host_time_ns=forearm.host_time_ns[kept],
        static=forearm.static[kept],
        flagged=forearm.flagged[kept],
        orientation={},
    )
    said = dataclasses.replace(quick.estimate, sensors=quick.estimate.sensors | {"forearm": cut})
    found = joint_errors(quick.session, "elbow", said, steps)
    assert 20 < len(rows) - len(found.steps[2][1]) < 35


def swinging(n: int = 2500) -> Truth:
    """A turn about the vertical and a level axis at once, 0.7 Hz and 1.1 Hz, 125 Hz."""
    t = np.arange(n) * STEP_NS / 1e9
    turn = np.column_stack([0.4 * np.sin(2 * np.pi * 1.1 * t), 0 * t, 0.6 * np.sin(4.4 * t)])
    return Truth(np.arange(n) * STEP_NS, rotation.from_rotation_vector(turn))


def late_by(true: Truth, samples: int) -> np.ndarray:
    return true.q_world_from_sensor[np.maximum(np.arange(len(true.host_time_ns)) - samples, 0)]


@pytest.mark.parametrize("time_sd", [1e-4, 0.02])
def test_the_delay_of_an_orientation_is_found_and_no_surer_than_the_clock(time_sd):
    true = swinging()
    found = estimate(late_by(true, 3))
    found = dataclasses.replace(found, static=np.zeros(2500, bool))
    errors = sensor_errors("hand", found, true, None)
    rows = summarise_sensor(
        errors, [], TrueTurning.of(true.host_time_ns, true.q_world_from_sensor), time_sd
    )
    (total,) = [r.errors for r in rows if (r.motion, r.part) == ("dynamic", "total")]
    assert total.latency_ms == pytest.approx(24, abs=1)
    assert 1e3 * time_sd <= total.latency_sd_ms < 1e3 * time_sd + 2


def test_rest_and_motion_are_told_apart_and_signs_of_uncertainty_too():
    resting = np.arange(2500) < 1000
    true = swinging()
    size = np.radians(np.where(resting, 1.0, 5.0))
    q = rotation.multiply(rotation.from_heading(size), true.q_world_from_sensor)
    found = dataclasses.replace(estimate(q), static=resting)
    errors = sensor_errors("hand", found, true, None)
    budget = dataclasses.replace(
        combine("hand", "heading", None, [], []), expanded_deg=0.1, expanded_magnitude_deg=0.4
    )
    rows = summarise_sensor(
        errors, [budget], TrueTurning.of(true.host_time_ns, true.q_world_from_sensor), TIME_SD
    )
    by_motion = {r.motion: r for r in rows if r.part == "heading"}
    assert by_motion["static"].errors.n == 1000
    assert by_motion["static"].errors.rmse_deg == pytest.approx(1)
    assert by_motion["dynamic"].errors.n == 1500
    assert by_motion["dynamic"].errors.rmse_deg == pytest.approx(5)
    assert by_motion["all"].expanded_uncertainty_deg == 0.1
    assert by_motion["all"].expanded_uncertainty_magnitude_deg == 0.4


def poses(count: int, kind: str = "move") -> list[PlannedStep]:
    """Steps of 5 s, of which the first half second is the way there, and the last sample the next
    one's.
    """
    span, way = 5 * 10**9, 5 * 10**8
    return [
        PlannedStep(
            *(i, "s", "evaluation", "p", kind, {}, i * span, i * span + way),
            (i + 1) * span - STEP_NS,
        )
        for i in range(count)
    ]


def test_a_pose_in_which_the_error_does_not_settle_is_counted():
    n = 2500
    t = np.arange(n) * STEP_NS / 1e9
    true = Truth(np.arange(n) * STEP_NS, np.tile([1.0, 0, 0, 0], (n, 1)))
    within = t % 5
    decaying = 5 * np.exp(-within / 0.2) + 0.1
    growing = 1 + 2 * within
    error = np.radians(np.where(t < 15, decaying, growing))
    found = estimate(rotation.from_heading(error))
    errors = sensor_errors("hand", found, true, poses(4))
    rows = summarise_sensor(
        errors, [], TrueTurning.of(true.host_time_ns, true.q_world_from_sensor), TIME_SD
    )
    (total,) = [r.errors for r in rows if (r.motion, r.part) == ("all", "total")]
    assert total.convergence_s is not None and total.convergence_s < 2
    assert total.unsettled == 1


def test_a_sweep_has_the_amplitude_of_the_turn_about_its_main_axis():
    n = 2500
    t = np.arange(n) * STEP_NS / 1e9
    axis = np.array([0.6, 0.0, 0.8])
    q = rotation.from_rotation_vector(np.radians(25) * np.sin(2 * np.pi * t)[:, None] * axis)
    true = Truth(np.arange(n) * STEP_NS, q)
    step = PlannedStep(0, "s", "evaluation", "p", "sweep", {}, 0, 19 * 10**9, 19 * 10**9)
    errors = sensor_errors("hand", estimate(q), true, [step])
    (row,) = sweep_rows(errors)
    assert row.amplitude_deg == pytest.approx(25, rel=0.02)
    assert row.frequency_hz == pytest.approx(1, rel=0.02)


def test_every_metric_has_the_uncertainty_of_its_kind(quick):
    budgets = {(b.owner, b.quantity, b.section): b for b in quick.evaluation.uncertainty}
    seen = set()
    for metric in quick.evaluation.metrics:
        if metric.expanded_uncertainty is None or metric.unit != "deg":
            continue
        owner, _, kind = metric.name.partition(".")
        part = kind.partition("_")[0]
        budget = budgets[owner, part, metric.section if part == "flexion" else None]
        assert budget.expanded_deg != budget.expanded_magnitude_deg
        signed = kind in _SIGNED
        wanted = budget.expanded_deg if signed else budget.expanded_magnitude_deg
        assert metric.expanded_uncertainty == wanted, metric.name
        seen.add((part, signed))
    # no mean of a length is signed: total and inclination have magnitudes alone
    assert seen == {
        ("flexion", True),
        ("flexion", False),
        ("heading", True),
        ("heading", False),
        ("total", False),
        ("inclination", False),
    }


def test_the_delay_of_a_flexion_is_as_sure_as_the_clock_of_the_sensor_that_turns(quick):
    class Errors:
        clock = None
        time_ns = np.arange(1000) * STEP_NS
        turned = np.column_stack([0.3 * np.sin(np.arange(1000) / 20), np.zeros(1000)])
        steps = ((None, np.arange(1000)),)
        joint = quick.session.analysis.joints["elbow"]

    def with_sd(arm: float, forearm: float):
        sensors = {
            name: dataclasses.replace(own, clock=ClockFit(offset_sd_s=sd))
            for (name, own), sd in zip(
                sorted(quick.estimate.sensors.items()), (arm, forearm), strict=True
            )
        }
        return dataclasses.replace(quick.estimate, sensors=sensors)

    assert flexion_time_sd(quick.session, with_sd(0.002, 0.5), Errors()) == pytest.approx(0.002)
    assert flexion_time_sd(quick.session, with_sd(0.5, 0.002), Errors()) == pytest.approx(0.5)
    Errors.turned = Errors.turned[:, [0, 0]]  # either makes as much of it
    assert flexion_time_sd(quick.session, with_sd(0.003, 0.004), Errors()) == pytest.approx(
        np.sqrt((0.003**2 + 0.004**2) / 2)
    )


def test_a_chain_that_knows_its_errors_covers_nineteen_of_twenty():
    rng = np.random.default_rng(5)
    n = 20_000
    sd = np.radians(rng.uniform(0.1, 2.0, n))
    error = np.column_stack(
        [sd * rng.standard_normal(n), np.full(n, np.radians(3.0)), np.full(n, np.radians(7.0))]
    )
    angle = np.radians(np.where(np.arange(n) % 2, 40.0, 0.5))
    of = ChainEstimate.__new__(ChainEstimate)
    object.__setattr__(of, "section", "swing")
    object.__setattr__(of, "state", "kinematic")
    row = _row(of, "knee", angle, error, sd)
    assert row.covered_percent == pytest.approx(95.0, abs=0.5)
    assert row.normalised_error == pytest.approx(1.0, abs=0.02)
    assert row.uncertainty_deg == pytest.approx(np.degrees(np.sqrt(np.mean(sd**2))))
    assert row.rate_rmse_deg_s == pytest.approx(3.0)
    assert row.acceleration_rmse_deg_s2 == pytest.approx(7.0)
    sized = np.abs(angle) > np.radians(1)
    wanted = 100 * np.mean(np.abs(error[sized, 0]) / np.radians(40))
    assert row.relative_percent == pytest.approx(wanted)
    low, high = np.percentile(error[:, 0], [25, 75])
    reach = 1.5 * (high - low)
    beyond = (error[:, 0] > high + reach) | (error[:, 0] < low - reach)
    assert row.outliers_percent == pytest.approx(100 * beyond.mean())
