"""Limits and verdicts."""

from __future__ import annotations

import pytest

from testbench.evaluation.verdict import judge, outcome_of, summarise_metrics
from testbench.records.results.evaluation import Evaluation, JointRow, OrientationRow, Outcome
from testbench.records.specs.protocol import AcceptanceLimit, Analysis, JointDefinition


def joint_row(
    error: float, name: str = "device", sequence: str = "ZXZ", section: str = "static"
) -> JointRow:
    return JointRow(
        joint="elbow",
        filter=name,
        sequence=sequence,
        section=section,
        step=0,
        kind="move",
        misalignment_deg=0.0,
        flexion_deg=0.0,
        variables={},
        n=10,
        flexion_mean_error_deg=error,
        flexion_mean_abs_error_deg=abs(error),
        flexion_sd_deg=0.0,
        flexion_rmse_deg=abs(error),
        flexion_max_abs_error_deg=abs(error),
        other_mean_abs_error_deg=[],
    )


def limits(*accept: AcceptanceLimit) -> Analysis:
    return Analysis(
        joints={"elbow": JointDefinition(sequence="ZXZ", proximal="a", distal="b")},
        accept=list(accept),
    )


def verdict(rows: list[JointRow], *accept: AcceptanceLimit) -> tuple[list, Outcome]:
    analysis = limits(*accept)
    return judge(analysis, summarise_metrics(judged(rows, [])))


def judged(rows: list[JointRow], orientation: list[OrientationRow]) -> Evaluation:
    return Evaluation(session="session", joint_angle=rows, orientation=orientation)


MEAN = "elbow.flexion_mean_abs_error_deg"


@pytest.mark.parametrize(
    ("value", "outcome"),
    [
        (0.0, "pass"),
        (0.45, "pass"),
        (0.4501, "marginal"),
        (0.5, "marginal"),
        (0.5001, "fail"),
        (None, "not_measured"),
        (float("nan"), "not_measured"),
        (float("inf"), "not_measured"),
    ],
)
def test_beyond_a_limit_is_a_failure_and_near_it_is_marginal(value, outcome):
    assert outcome_of(value, AcceptanceLimit(metric=MEAN, max=0.5)) == outcome


@pytest.mark.parametrize(
    ("value", "expanded", "outcome"),
    [
        (0.25, 0.2, "pass"),
        (0.31, 0.2, "marginal"),
        (0.5, 0.2, "marginal"),
        (0.69, 0.2, "marginal"),
        (0.71, 0.2, "fail"),
        (0.44, 0.01, "pass"),
        (0.46, 0.01, "marginal"),
        (0.505, 0.01, "marginal"),
        (0.52, 0.01, "fail"),
        (0.0, 0.6, "marginal"),
        (0.52, None, "fail"),
    ],
)
def test_within_its_uncertainty_of_a_limit_a_value_is_marginal_on_either_side(
    value, expanded, outcome
):
    assert outcome_of(value, AcceptanceLimit(metric=MEAN, max=0.5), expanded) == outcome
    assert outcome_of(-value, AcceptanceLimit(metric=MEAN, min=-0.5), expanded) == outcome


@pytest.mark.parametrize(
    ("value", "outcome"),
    [
        (-1.01, "fail"),
        (-1.0, "marginal"),
        (-0.85, "marginal"),
        (-0.7, "pass"),
        (0.9, "pass"),
        (2.0, "fail"),
    ],
)
def test_a_lower_limit_works_the_other_way_round_and_both_together(value, outcome):
    assert (
        outcome_of(value, AcceptanceLimit(metric=MEAN, min=-1.0, max=1.5, marginal_percent=20))
        == outcome
    )


def test_a_metric_is_the_mean_over_poses_and_not_over_samples():
    metrics, _ = verdict([joint_row(1.0), joint_row(-3.0)], AcceptanceLimit(metric=MEAN, max=5))
    values = {metric.name: metric.value for metric in metrics}
    assert values[MEAN] == 2.0
    assert values["elbow.flexion_mean_error_deg"] == -1.0
    assert values["elbow.flexion_rmse_deg"] == pytest.approx(5**0.5)
    assert values["elbow.flexion_max_abs_error_deg"] == 3.0


def test_the_worst_limit_decides():
    rows = [joint_row(0.4), joint_row(0.9, "vqf_6d")]
    fine, broken = (
        AcceptanceLimit(metric=MEAN, filter=name, max=0.5) for name in ("device", "vqf_6d")
    )
    assert verdict(rows, fine)[1] == "pass"
    assert verdict(rows, fine, broken)[1] == "fail"
    assert verdict(rows, broken, fine)[1] == "fail"


def test_a_limit_without_a_filter_holds_for_every_filter():
    metrics, outcome = verdict(
        [joint_row(0.4), joint_row(0.9, "vqf_6d")], AcceptanceLimit(metric=MEAN, max=0.5)
    )
    assert outcome == "fail"
    assert {m.filter: m.outcome for m in metrics if m.outcome is not None} == {
        "device": "pass",
        "vqf_6d": "fail",
    }


def test_a_limit_holds_for_the_joints_own_sequence_unless_it_names_another():
    rows = [joint_row(0.1), joint_row(8.0, sequence="YXZ")]
    assert verdict(rows, AcceptanceLimit(metric=MEAN, max=0.5))[1] == "pass"
    assert verdict(rows, AcceptanceLimit(metric=MEAN, max=0.5, sequence="YXZ"))[1] == "fail"


def test_a_limit_of_a_section_looks_at_that_section_only():
    rows = [joint_row(0.1), joint_row(8.0, section="sweep")]
    assert verdict(rows, AcceptanceLimit(metric=MEAN, max=0.5, section="static"))[1] == "pass"
    assert verdict(rows, AcceptanceLimit(metric=MEAN, max=0.5, section="sweep"))[1] == "fail"


def test_what_was_not_measured_is_said_and_outweighs_a_pass_but_not_a_failure():
    missing = AcceptanceLimit(metric=MEAN, filter="vqf_9d", max=0.5)
    metrics, outcome = verdict(
        [joint_row(0.1)], AcceptanceLimit(metric=MEAN, filter="device", max=0.5), missing
    )
    assert outcome == "not_measured"
    absent = next(m for m in metrics if m.filter == "vqf_9d")
    assert absent.value is None and absent.outcome == "not_measured" and absent.upper == 0.5
    assert (
        verdict([joint_row(9.0)], AcceptanceLimit(metric=MEAN, filter="device", max=0.5), missing)[
            1
        ]
        == "fail"
    )


def test_without_limits_nothing_is_judged():
    metrics, outcome = verdict([joint_row(0.1)])
    assert outcome == "not_measured"
    assert metrics and all(metric.outcome is None for metric in metrics)


def test_sensors_have_metrics_of_their_own():
    row = OrientationRow("arm", "vqf_6d", 10, 1.5, 1.2, 0.9, 2.0)
    analysis = limits(AcceptanceLimit(metric="arm.inclination_rmse_deg", max=0.5))
    metrics, outcome = judge(analysis, summarise_metrics(judged([], [row])))
    assert outcome == "fail"
    assert {m.name: m.value for m in metrics} == {
        "arm.total_rmse_deg": 1.5,
        "arm.heading_rmse_deg": 1.2,
        "arm.inclination_rmse_deg": 0.9,
    }


def test_a_limit_may_be_set_on_a_delay(quick):
    analysis = limits(
        AcceptanceLimit(
            metric="elbow.flexion_latency_ms", filter="vqf_6d", section="sweep", max=0.001
        )
    )
    metrics, outcome = judge(analysis, summarise_metrics(quick.evaluation))
    assert outcome in {"pass", "fail"}
    assert metrics[0].unit == "ms" and metrics[0].value is not None


def test_the_uncertainty_of_the_metric_reaches_the_verdict(quick):
    found = {(m.name, m.filter, m.section, m.sequence): m for m in quick.evaluation.metrics}
    metric = found[MEAN, "device", "static", "ZXZ"]
    near = metric.value - metric.expanded_uncertainty / 2
    analysis = limits(AcceptanceLimit(metric=MEAN, filter="device", section="static", max=near))
    _, outcome = judge(analysis, summarise_metrics(quick.evaluation))
    assert outcome == "marginal"  # above the limit, but by less than its U
