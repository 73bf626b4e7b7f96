"""The chain filter's joints in the verdict, the budgets, the report and on the terminal, from one
short run of the pendulum.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench import plan
from testbench.cli.output import say_evaluation
from testbench.drivers.arms.simulated import SimulatedArm
from testbench.evaluation import evaluate
from testbench.evaluation.budgets import chain_budget
from testbench.evaluation.verdict import summarise_metrics
from testbench.exceptions import FileProblems
from testbench.records.results.evaluation import Evaluation, Outcome
from testbench.records.specs.protocol_chain import CHAIN_METRICS
from testbench.records.specs.protocol_file import load_protocol
from testbench.reporting.report import report

LIMITS = [
    {"metric": "knee.angle_rmse_deg", "filter": "kinematic", "section": "swing", "max": 5},
    {"metric": "chain.angle_max_abs_error_deg", "max": 0.001},
    {"metric": "knee.angle_mean_error_deg", "min": -5, "max": 5},
]


def short(spec, joint_errors=False):
    spec["sections"][1]["steps"][0]["sweep"]["knee"]["sine"]["cycles"] = 6
    spec["environment"] = {"joint_errors": joint_errors}
    spec["estimate"]["chain"] = {
        "states": ["kinematic"],
        "settling_s": 2,
        "jerk_deg_s3_sqrthz": 2000,
    }
    spec["accept"] = LIMITS


@pytest.fixture(scope="module")
def result(run_protocol, altered_protocol):
    return run_protocol(altered_protocol("pendulum", short))


def test_limits_on_joints_of_the_chain_give_a_verdict(result):
    judged = {
        metric.name: metric for metric in result.evaluation.metrics if metric.outcome is not None
    }
    assert list(judged) == [limit["metric"] for limit in LIMITS]
    (row,) = result.evaluation.chain
    rms, largest, mean = judged.values()
    assert (rms.value, rms.filter, rms.section, rms.outcome) == (
        row.rmse_deg,
        "kinematic",
        "swing",
        Outcome.PASS,
    )
    assert largest.value == abs(row.largest_error_deg)
    assert mean.value == row.mean_error_deg
    assert largest.outcome is (
        Outcome.FAIL if largest.value > largest.expanded_uncertainty + 0.001 else Outcome.MARGINAL
    )
    assert result.evaluation.outcome is largest.outcome


def test_metrics_over_all_joints_count_every_joint_alike(result):
    row = result.evaluation.chain[0]
    other = type(row)(
        **{
            **vars(row),
            "joint": "hip",
            "rmse_deg": 3.0,
            "largest_error_deg": -7.0,
            "covered_percent": 50.0,
        }
    )
    several = Evaluation(session="s", chain=[row, other])
    found = {metric.name: metric.value for metric in summarise_metrics(several)}
    assert len(found) == 3 * len(CHAIN_METRICS) - 1  # no signed mean over all
    assert found["chain.angle_rmse_deg"] == pytest.approx(np.sqrt((row.rmse_deg**2 + 9) / 2))
    assert found["chain.angle_max_abs_error_deg"] == 7
    assert found["chain.angle_covered_percent"] == pytest.approx((row.covered_percent + 50) / 2)
    assert found["hip.angle_rmse_deg"] == 3


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        (
            {"metric": "knee.angle_rms"},
            "unknown metric 'knee.angle_rms'; known: .*chain.angle_rmse_deg",
        ),
        ({"metric": "chain.angle_mean_error_deg"}, "unknown metric"),
        ({"metric": "hip.angle_rmse_deg"}, "unknown joint of pendulum 'hip'; known: knee"),
        (
            {"metric": "knee.angle_rmse_deg", "filter": "fourier"},
            "unknown state of the chain 'fourier'; known: kinematic",
        ),
        (
            {"metric": "knee.angle_rmse_deg", "sequence": "XYZ"},
            "sequence goes with metrics of a joint only",
        ),
    ],
)
def test_a_limit_that_nothing_meets_is_refused_with_what_there_is(altered_protocol, limit, said):
    def change(spec):
        short(spec)
        spec["accept"] = [limit | {"max": 1}]

    with pytest.raises(FileProblems, match=said):
        plan(altered_protocol("pendulum", change))


def test_without_a_chain_there_are_no_such_metrics(altered_protocol):
    def change(spec):
        short(spec)
        spec["estimate"].pop("chain")

    with pytest.raises(FileProblems, match="unknown metric"):
        load_protocol(altered_protocol("pendulum", change))


def test_settling_that_leaves_nothing_is_refused_at_the_key(altered_protocol):
    def change(spec):
        short(spec)
        spec["estimate"]["chain"]["settling_s"] = 800

    with pytest.raises(
        FileProblems,
        match=r"pendulum.yaml:\d+:\d+: estimate.chain.settling_s: .* nothing would be evaluated",
    ) as refused:
        plan(altered_protocol("pendulum", change))
    lasts = float(str(refused.value).split("must be below ")[1].split(" s")[0])
    for settling, fits in ((lasts - 0.1, True), (lasts + 0.1, False)):

        def another(spec, settling=settling):
            short(spec)
            spec["estimate"]["chain"]["settling_s"] = settling

        if fits:
            plan(altered_protocol("pendulum", another))
        else:
            with pytest.raises(FileProblems):
                plan(altered_protocol("pendulum", another))


def test_a_chain_of_which_nothing_is_judged_says_why(result):
    from dataclasses import replace

    analysis = result.session.analysis
    settling = analysis.estimate.chain.model_copy(update={"settling_s": 800.0})
    changed = analysis.model_copy(
        update={"estimate": analysis.estimate.model_copy(update={"chain": settling})}
    )

    class Settled(type(result.session)):
        analysis = changed

    again = evaluate(Settled(result.session.path), result.estimate)
    assert again.chain == []
    [note] = [
        note
        for note in again.notes
        if note.startswith("chain, section swing, kinematic: not evaluated")
    ]
    assert "settling_s" in note
    page = report(result.session, result.estimate, replace(again, series={})).read_text()
    assert note in page
    assert "nobody knows" not in page


def test_the_truths_uncertainty_is_that_of_the_arms_joint(result):
    (budget,) = [b for b in result.evaluation.uncertainty if b.quantity == "angle"]
    assert (budget.owner, budget.section) == ("knee", "swing")
    robot = result.session.robot
    once = {source.source: source for source in budget.sources}
    zero = once["kinematic calibration, knee"]
    stated = np.degrees(robot.joint_angle_uncertainty[0])
    assert (zero.sensitivity, zero.contribution_deg) == (pytest.approx(1), pytest.approx(stated))
    assert once["repeatability of the arm"].contribution_deg == pytest.approx(
        robot.spec.servo.repeatability_deg
    )
    assert budget.combined_deg == pytest.approx(
        np.sqrt(sum(s.contribution_deg**2 for s in budget.sources))
    )
    (row,) = result.evaluation.chain
    assert (
        row.expanded_uncertainty_deg
        == budget.expanded_deg
        == pytest.approx(2.306 * budget.combined_deg, rel=1e-3)  # 8 degrees of freedom
    )
    assert row.expanded_uncertainty_magnitude_deg == budget.expanded_magnitude_deg


def test_zeros_that_encoders_do_not_see_are_the_error_that_the_budget_speaks_of(
    altered_protocol, run_protocol
):
    results = [
        run_protocol(
            altered_protocol("pendulum", lambda spec: short(spec, joint_errors=True)), seed
        )
        for seed in range(4)
    ]
    rows = [result.evaluation.chain[0] for result in results]
    drawn = [
        np.degrees(SimulatedArm(result.session.robot, seed, True).zero_errors[0])
        for seed, result in enumerate(results)
    ]
    assert np.ptp(drawn) > 0.1
    np.testing.assert_allclose([row.mean_error_deg for row in rows], drawn, atol=0.08)
    assert all(abs(row.mean_error_deg) < 1.5 * row.expanded_uncertainty_deg for row in rows)


def test_rows_come_back_from_disk(result, tmp_path):
    result.evaluation.save(tmp_path)
    assert Evaluation.load(tmp_path).chain == result.evaluation.chain


def test_the_terminal_and_the_cards_show_the_joints(result, capsys):
    say_evaluation(result.evaluation, "s", None)
    shown = capsys.readouterr().out
    assert "Joints of the chain, error [deg]" in shown
    assert any(
        "knee" in line and "kinematic" in line and "swing" in line for line in shown.splitlines()
    )
    page = report(result.session, result.estimate, result.evaluation).read_text()
    said = "RMS error of one joint angle "
    assert said in page and said in shown
    assert (
        page.index('id="chain"') < page.index('id="orientation"') < page.index('id="uncertainty"')
    )


def test_states_that_share_their_truth_have_one_budget_though_its_last_digits_differ(
    result, monkeypatch
):
    """The truth is found again as estimate less error, which rounds otherwise for another state."""

    def rounded(session, estimate, one, *others):
        budget = chain_budget(session, estimate, one, *others)
        last = 1 + 2**-52 * (one.state == "fourier")
        return replace(budget, combined_deg=budget.combined_deg * last)

    monkeypatch.setattr("testbench.evaluation.chain.chain_budget", rounded)
    estimate = result.estimate
    (one,) = estimate.chain
    two = replace(estimate, chain=[one, replace(one, state="fourier")])
    again = evaluate(result.session, two)
    assert {row.state for row in again.chain} == {"kinematic", "fourier"}
    assert [b.owner for b in again.uncertainty if b.quantity == "angle"] == ["knee"]
