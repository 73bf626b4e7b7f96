"""How sure a number is said to be: by which axes, by which of several sources, at which level."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import t as student

from testbench.evaluation.budgets import TrueArm, _fitted_sd, sensor_budgets
from testbench.evaluation.cycles import joint_cycles
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.flexion import JointErrors, covered
from testbench.evaluation.orientation import aligned_errors
from testbench.evaluation.ranking import Difference, _exceeds
from testbench.evaluation.verdict import judge, outcome_of, summarise_metrics
from testbench.model import rotation
from testbench.model.truth import truth_at
from testbench.records.results.estimate import FrameFit, JointEstimate
from testbench.records.results.evaluation import ChainRow, Evaluation, Metric, Outcome
from testbench.records.specs.protocol import AcceptanceLimit, Analysis, JointDefinition
from testbench.reporting.page.figures import Curve, flat_on_a_linear_axis
from tests.evaluation.test_cycles import HZ, IN_STEP, STEP, instants, phase, wave
from tests.evaluation.test_metrics import estimate, true_orientations


@pytest.fixture(scope="module")
def mounted(quick) -> dict[str, dict[str, float]]:
    """What one degree of mounting is in each part of the forearm's error, without an alignment."""
    session, name = quick.session, "forearm"
    sensor = quick.estimate.sensors[name]
    truth = truth_at(session.truth(name), sensor.host_time_ns)
    true = TrueTurning.of(sensor.host_time_ns, truth)
    loose = session.analysis.estimate.model_copy(update={"align": "none"})
    analysis = session.analysis.model_copy(update={"estimate": loose})
    free = type(session)(session.path)
    free.__dict__["analysis"] = analysis
    arm = TrueArm.of(free)
    judged = np.isfinite(truth[:, 0])
    budgets = sensor_budgets(free, quick.estimate, name, true, judged, free.steps, arm)
    found = {}
    for budget in budgets:
        lines = {line.source: line for line in budget.sources}
        mounting = lines["mounting of the sensors"]
        levelled = lines.get("levelling of the base")
        found[budget.quantity] = {
            "mounting": mounting.magnitude_deg / mounting.standard_uncertainty,
            "level": 0.0
            if levelled is None
            else levelled.magnitude_deg / levelled.standard_uncertainty,
            "joint": max(
                line.magnitude_deg / line.standard_uncertainty
                for source, line in lines.items()
                if source.startswith("kinematic calibration")
            ),
        }
    return found


def test_a_mounting_error_counts_by_the_axes_that_it_can_turn_a_part_about(mounted):
    counted = {part: own["mounting"] for part, own in mounted.items()}
    assert counted == pytest.approx(
        {"total": np.sqrt(3), "heading": 1.0, "inclination": np.sqrt(2)}
    )


def test_a_tilted_base_counts_by_its_two_level_axes_and_not_for_the_heading(mounted):
    counted = {part: own["level"] for part, own in mounted.items()}
    assert counted == pytest.approx(
        {"total": np.sqrt(2), "heading": 0.0, "inclination": np.sqrt(2)}
    )


def test_the_joint_that_turns_most_turns_a_sensor_by_its_own_error(mounted):
    # the first joint of an upright arm turns the heading alone, by what it is wrong
    assert mounted["heading"]["joint"] == pytest.approx(1.0, abs=1e-6)
    assert mounted["total"]["joint"] == pytest.approx(1.0, abs=1e-6)


def test_of_several_alignments_by_motion_the_least_sure_one_counts():
    fits = {
        "a": FrameFit(mounting_sd_deg=(0.1, 0.2, 0.2)),
        "b": FrameFit(mounting_sd_deg=(1, 2, 2)),
    }
    sensor = dataclasses.replace(estimate(true_orientations()), frames=fits)
    assert _fitted_sd(sensor) == pytest.approx(3.0)


def test_p_is_of_both_sides():
    found = Difference(0.03, 0.01, 10, 100.0, 100)
    assert _exceeds(found, 0.01) == pytest.approx(2 * student.sf(2.0, 10))


def chain_row(joint: str, signed: float, size: float) -> ChainRow:
    numbers = {f.name: 1.0 for f in dataclasses.fields(ChainRow)}
    row = ChainRow(**numbers | {"section": "s", "state": "k", "joint": joint, "n": 9})
    return dataclasses.replace(
        row, expanded_uncertainty_deg=signed, expanded_uncertainty_magnitude_deg=size
    )


def test_a_whole_chain_is_as_sure_as_its_least_sure_joint():
    rows = [chain_row("hip", 0.1, 0.2), chain_row("knee", 0.3, 0.7)]
    metrics = summarise_metrics(Evaluation(session="s", chain=rows))
    found = {metric.name: metric.expanded_uncertainty for metric in metrics}
    assert found["chain.angle_rmse_deg"] == 0.7
    assert (found["hip.angle_rmse_deg"], found["hip.angle_mean_error_deg"]) == (0.2, 0.1)


def test_a_limit_is_not_kept_where_nobody_knows_how_sure_the_number_is():
    name = "elbow.flexion_rmse_deg"
    metric = Metric(name, 0.1, "deg", None, None, None, "", "f", "ZXZ", "s")
    analysis = Analysis(
        joints={"elbow": JointDefinition(sequence="ZXZ", proximal="a", distal="b")},
        accept=[AcceptanceLimit(metric=name, max=1.0)],
    )
    for lacking, outcome in ((None, Outcome.PASS), ("the time is not known", Outcome.MARGINAL)):
        judged, worst = judge(analysis, [dataclasses.replace(metric, no_uncertainty=lacking)])
        assert judged[0].outcome is worst is outcome
    assert outcome_of(0.95, analysis.accept[0], 0.1) is Outcome.MARGINAL


@pytest.mark.parametrize("leans", [False, True])
def test_without_a_vertical_an_error_has_no_heading(leans):
    true = true_orientations()
    q = rotation.multiply(rotation.from_heading(0.02), true)
    errors = aligned_errors(q, true, FrameFit(up_known=False))
    np.testing.assert_allclose(errors.total, 0.02, atol=1e-9)
    assert np.isnan(errors.heading).all() and np.isnan(errors.inclination).all()


def test_a_world_that_leans_has_its_own_vertical():
    tilt_deg = (0.0, 30.0, 0.0)
    level_from_world = rotation.from_rotation_vector(np.radians(tilt_deg))
    up = rotation.rotate(level_from_world, np.array([0.0, 0.0, 1.0]))
    true = true_orientations()
    q = rotation.multiply(rotation.from_rotation_vector(0.02 * up), true)
    errors = aligned_errors(q, true, FrameFit(tilt_deg=tilt_deg, leans=True))
    np.testing.assert_allclose(errors.heading, 0.02, atol=1e-9)
    np.testing.assert_allclose(errors.inclination, 0, atol=1e-7)


def cycles_of(true: np.ndarray, error: np.ndarray):
    key = ("vqf_6d", "ZXZ")
    rows = np.flatnonzero(IN_STEP)
    nothing = np.zeros((len(true), 2))
    errors = JointErrors(
        *("knee", None, instants, true, {key: true + error}, {key: error}, {}, {}),
        *([(STEP, rows)], {}, nothing),
    )
    ((row, average),) = joint_cycles(errors)
    return row, average


def test_spreads_over_cycles_are_of_what_they_are_called():
    which = np.floor((instants / 1e9 - 3.0) * HZ)
    true = wave() + np.radians(2.0) * np.where(which % 2, 1.0, -1.0)
    error = np.radians(0.5) * np.sin(2 * np.pi * which / 4) * np.sin(phase()) ** 2
    row, average = cycles_of(true, error)
    n = row.cycles
    assert row.true_sd_deg == pytest.approx(2.0 * np.sqrt(n / (n - 1)), rel=0.05)
    assert row.error_sd_deg < 0.5 < 1.5 < row.true_sd_deg
    estimated = np.degrees(np.sqrt(np.mean(average["estimated_sd"] ** 2)))
    assert estimated == pytest.approx(np.hypot(row.true_sd_deg, row.error_sd_deg), rel=0.1)


def test_joint_angles_that_know_their_errors_are_covered_in_nineteen_of_twenty():
    n = 20_000
    rng = np.random.default_rng(8)
    sd = np.radians(rng.uniform(0.2, 2.0, n))
    joint = JointDefinition(sequence="ZXZ", flexion="second", proximal="a", distal="b")
    key = ("f", joint.label)
    error = {key: sd * rng.standard_normal(n)}
    errors = JointErrors(
        *("knee", joint, np.arange(n), np.zeros(n), {}, error, {}, {}),
        *([(STEP, np.arange(n))], {}, np.zeros((n, 2))),
    )
    stated = np.column_stack([100 * sd, sd, 100 * sd])
    (told,) = covered(errors, JointEstimate(np.arange(n), {}, sd={key: stated}))
    assert float(told.values["percent"]) == pytest.approx(95.0, abs=0.5)


def test_signed_errors_have_no_place_on_a_logarithmic_axis():
    def curves(least: float) -> list[Curve]:
        flat = [Curve(name, [0.0, 1.0], [0.1, least], "#112233") for name in "abc"]
        return [*flat, Curve("far", [0.0, 1.0], [500.0, 500.0], "#112233")]

    assert flat_on_a_linear_axis(curves(0.2))
    assert not flat_on_a_linear_axis(curves(-0.2))
