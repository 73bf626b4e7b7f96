"""Limits and verdicts."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

from testbench.evaluation.dynamics import settling_sd
from testbench.evaluation.outcomes import guard_band, otherwise_percent, outcome_of
from testbench.evaluation.repeatability import EqualSessions
from testbench.evaluation.verdict import judge, summarise_metrics
from testbench.records.results.evaluation import Evaluation, JointRow, OrientationRow, Outcome
from testbench.records.session.session import Session
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
    metrics, _ = judge(analysis, summarise_metrics(quick.evaluation))
    assert metrics[0].unit == "ms" and metrics[0].value is not None
    sd = next(
        row.errors.latency_sd_ms
        for row in quick.evaluation.joint_summary
        if (row.filter, row.section, row.motion) == ("vqf_6d", "sweep", "dynamic")
    )
    assert metrics[0].expanded_uncertainty == pytest.approx(1.96 * sd, rel=1e-3) != 0
    for away, wanted in ((-1.01, "fail"), (-0.5, "marginal"), (0.5, "marginal")):
        near = metrics[0].value + away * metrics[0].expanded_uncertainty
        limit = AcceptanceLimit(
            metric="elbow.flexion_latency_ms", filter="vqf_6d", section="sweep", max=near
        )
        assert judge(limits(limit), summarise_metrics(quick.evaluation))[1] == wanted


def test_a_settling_time_has_an_uncertainty_and_without_one_nothing_passes(quick):
    kind = "elbow.flexion_convergence_s"
    found = [m for m in summarise_metrics(quick.evaluation) if m.name == kind]
    assert found and all(m.expanded_uncertainty > 1.96 / 60 / np.sqrt(12) for m in found)
    limit = AcceptanceLimit(metric=kind, filter=found[0].filter, section=found[0].section, max=100)
    assert judge(limits(limit), found)[1] == "pass"
    rows = [
        replace(own, errors=replace(own.errors, convergence_sd_s=float("nan")))
        for own in quick.evaluation.joint_summary
    ]
    unknown = summarise_metrics(replace(quick.evaluation, joint_summary=rows))
    metrics, outcome = judge(limits(limit), unknown)
    assert outcome == "marginal" and "how sure" in metrics[0].no_uncertainty


def test_settling_times_scatter_are_sampled_and_wait_for_the_clock():
    assert settling_sd([0.5], 0.06, 0.0) == pytest.approx(0.06 / np.sqrt(12))
    assert settling_sd([0.5], 0.0, 0.003) == pytest.approx(0.003)
    rng = np.random.default_rng(2)
    drawn = rng.normal(1.0, 0.1, (4000, 15))
    stated = np.mean([settling_sd(times, 0.0, 0.0) for times in drawn[:200]])
    assert np.median(drawn, axis=1).std() == pytest.approx(stated, rel=0.1)


@pytest.mark.parametrize("expanded", [float("nan"), -0.1])
def test_an_uncertainty_that_is_no_number_passes_nothing(expanded):
    limit = AcceptanceLimit(metric=MEAN, max=0.5)
    assert outcome_of(0.05, limit, expanded) == "marginal"
    assert outcome_of(0.51, limit, expanded) == "fail"
    assert outcome_of(float("nan"), limit, expanded) == "not_measured"
    for bound in ("max", "min"):
        with pytest.raises(ValueError, match="finite"):
            AcceptanceLimit.model_validate({"metric": MEAN, bound: float("nan")})


NAMED = AcceptanceLimit(
    metric=MEAN, filter="device", section="static", max=1.0, marginal_percent=0, repeatability="."
)


def beside(quick, folder, values) -> Session:
    """A session and evaluated ones of the same protocol beside it, in which the metric came to
    these values.
    """
    for i, value in enumerate([None, *values]):
        own = folder / f"session_{i}"
        own.mkdir()
        for name in ("manifest.json", "events.jsonl"):
            shutil.copy(quick.session.path / name, own / name)
        manifest = json.loads((own / "manifest.json").read_text(encoding="utf-8"))
        manifest["files"]["raw/imu_arm.parquet"] = f"{i}"  # other samples: a copy counts once
        (own / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
        metrics = [
            replace(m, value=value) if (m.name, m.filter, m.section) == WHICH else m
            for m in quick.evaluation.metrics
        ]
        if value is not None:
            replace(quick.evaluation, metrics=metrics, series={}).save(own)
    return Session(folder / "session_0")


WHICH = (MEAN, "device", "static")


def among(quick, session, limit=NAMED):
    equal = {".": EqualSessions.beside(session, ".")}
    return judge(limits(limit), summarise_metrics(quick.evaluation), equal)


def test_the_scatter_of_equal_sessions_widens_the_guard_band(quick, tmp_path):
    alone, _ = judge(
        limits(NAMED.model_copy(update={"repeatability": None})),
        summarise_metrics(quick.evaluation),
    )
    value, expanded = alone[0].value, alone[0].expanded_uncertainty
    session = beside(quick, tmp_path, [value - 0.2, value, value + 0.2, value])
    sd = np.std([-0.2, 0, 0.2, 0], ddof=1)
    guard = np.hypot(expanded, t.ppf(0.975, 3) * sd)
    for away, wanted in ((1.01, "pass"), (0.99, "marginal"), (-0.99, "marginal"), (-1.01, "fail")):
        limit = NAMED.model_copy(update={"max": value + away * guard})
        metrics, outcome = among(quick, session, limit)
        assert outcome == wanted
        assert (metrics[0].sessions, metrics[0].session_sd) == (4, pytest.approx(sd))
        assert 5 < metrics[0].otherwise_percent < 60
    far = NAMED.model_copy(update={"max": value + 20 * guard})
    assert among(quick, session, far)[0][0].otherwise_percent == 0


def test_few_equal_sessions_say_nothing_and_so_nothing_passes(quick, tmp_path):
    session = beside(quick, tmp_path, [0.1, 0.2])
    metrics, outcome = among(quick, session, NAMED.model_copy(update={"max": 50.0}))
    assert outcome == "marginal" and metrics[0].session_sd is None
    assert metrics[0].no_uncertainty == "2 equal sessions in ., and 3 are needed"
    assert among(quick, session, NAMED.model_copy(update={"max": 0.0, "min": -9.0}))[1] != "pass"


def test_only_completed_sessions_of_the_same_protocol_are_equal(quick, tmp_path):
    session = beside(quick, tmp_path, [0.1, 0.2, 0.3, 0.4])
    for i, change in enumerate(({"status": "aborted"}, {"protocol": {"name": "another"}})):
        file = tmp_path / f"session_{i + 1}" / "manifest.json"
        file.write_text(json.dumps(json.loads(file.read_text()) | change))
    found = EqualSessions.beside(session, ".").values
    assert found[(*WHICH[:2], "ZXZ", WHICH[2])] == [0.3, 0.4]


def test_a_copy_of_a_session_counts_once(quick, tmp_path):
    session = beside(quick, tmp_path, [0.1, 0.2])
    shutil.copytree(tmp_path / "session_2", tmp_path / "session_3")
    shutil.copytree(tmp_path / "session_0", tmp_path / "session_4")
    found = EqualSessions.beside(session, ".").values
    assert found[(*WHICH[:2], "ZXZ", WHICH[2])] == [0.1, 0.2]


def test_how_often_an_equal_session_comes_out_otherwise_is_what_is_said():
    rng = np.random.default_rng(4)
    limit = AcceptanceLimit(metric=MEAN, max=0.7, marginal_percent=0)
    said, came = [], []
    for _ in range(200):
        *others, this, next_ = rng.normal(0.5, 0.1, 8).tolist()
        guard = guard_band(0.05, others)
        outcome = outcome_of(this, limit, guard)
        said.append(otherwise_percent(outcome, limit, guard, others))
        came.append(outcome_of(next_, limit, guard) is not outcome)
    assert np.mean(said) == pytest.approx(100 * np.mean(came), abs=8)


def test_the_uncertainty_of_the_metric_reaches_the_verdict(quick):
    found = {(m.name, m.filter, m.section, m.sequence): m for m in quick.evaluation.metrics}
    metric = found[MEAN, "device", "static", "ZXZ"]
    near = metric.value - metric.expanded_uncertainty / 2
    analysis = limits(AcceptanceLimit(metric=MEAN, filter="device", section="static", max=near))
    _, outcome = judge(analysis, summarise_metrics(quick.evaluation))
    assert outcome == "marginal"  # above the limit, but by less than its U
