"""The chain filter on runs of the simulated bench: what it finds, what it refuses, and that it
never looks at the arm.
"""

from dataclasses import replace

import numpy as np
import pytest

from testbench import execute, plan
from testbench.estimation import estimate
from testbench.estimation.chain.period import base_frequency
from testbench.estimation.chain.run import ChainSamples
from testbench.evaluation import evaluate
from testbench.exceptions import InputError
from testbench.records.disk.tables import read_parquet, write_parquet
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation


@pytest.fixture(scope="module")
def squat(altered_protocol, tmp_path_factory):
    def shorten(spec):
        for joint in ("ankle", "knee"):
            spec["sections"][1]["steps"][0]["sweep"][joint]["sine"]["cycles"] = 10

    session = execute(
        plan(altered_protocol("squat", shorten)), tmp_path_factory.mktemp("logs"), seed=3
    )
    return session, estimate(session)


def test_angles_are_found_to_a_tenth_of_a_degree_and_the_uncertainty_says_so(squat):
    session, estimated = squat
    rows = {(row.state, row.joint): row for row in evaluate(session, estimated).chain}
    assert set(rows) == {
        (state, joint) for state in ("kinematic", "fourier") for joint in ("ankle", "knee")
    }
    for row in rows.values():
        assert row.rmse_deg < 0.1
        assert row.correlation > 0.99999
        assert 0.2 < row.normalised_error < 2.0
        assert (
            abs(row.smallest_error_deg) <= abs(row.median_error_deg) <= abs(row.largest_error_deg)
        )
    for joint in ("ankle", "knee"):
        fourier, kinematic = rows["fourier", joint], rows["kinematic", joint]
        assert fourier.rate_rmse_deg_s < kinematic.rate_rmse_deg_s
        assert fourier.acceleration_rmse_deg_s2 < 0.5 * kinematic.acceleration_rmse_deg_s2


def test_the_truth_that_two_states_share_has_one_budget_a_joint(squat):
    session, estimated = squat
    rng = np.random.default_rng(0)  # errors so large that estimate less error rounds
    shaken = [
        replace(one, mean=one.mean + rng.uniform(1, 9, one.mean.shape)) for one in estimated.chain
    ]
    budgets = evaluate(session, replace(estimated, chain=shaken)).uncertainty
    assert sorted(b.owner for b in budgets if b.quantity == "angle") == ["ankle", "knee"]


def test_the_base_frequency_is_found(squat):
    chain = next(chain for chain in squat[1].chain if chain.state == "fourier")
    assert chain.facts["frequency_hz"] == pytest.approx(0.5, abs=1e-3)


def test_estimate_and_evaluation_come_back_from_disk(squat, tmp_path):
    session, estimated = squat
    estimated.save(tmp_path)
    back = Estimate.load(tmp_path)
    for one, other in zip(estimated.chain, back.chain, strict=True):
        assert (one.key, one.joints, one.facts) == (other.key, other.joints, other.facts)
        np.testing.assert_array_equal(one.mean, other.mean)
        np.testing.assert_array_equal(one.sd, other.sd)
    evaluated = evaluate(session, estimated)
    evaluated.save(tmp_path)
    assert Evaluation.load(tmp_path).chain == evaluated.chain


def test_what_the_arm_measured_changes_nothing(squat, tmp_path):
    """The truth files are falsified: clocks are fitted to the truth's rates as always, so only its
    angles are.
    """
    session, estimated = squat
    file = session.path / "arm.parquet"
    kept = file.read_bytes()
    table = read_parquet(file)
    try:
        file.unlink()
        write_parquet(
            file,
            {key: value + 0.3 if key.startswith("q_") else value for key, value in table.items()},
            {},
        )
        again = estimate(session)
    finally:
        file.unlink()
        file.write_bytes(kept)
    for one, other in zip(estimated.chain, again.chain, strict=True):
        np.testing.assert_array_equal(one.mean, other.mean)


def test_a_wrong_mounting_shows_in_the_error_of_the_joint_beyond_it(altered_protocol, tmp_path):
    """A fault put in: the thigh's sensor sits 3 deg off about the knee's axis."""

    def turn(spec):
        spec["sensors"]["thigh"]["mounting_error"] = {"rotation_deg": {"XYZ": [0, 3, 0]}}
        spec["estimate"]["chain"] |= {"states": ["kinematic"], "start_sd_deg": 20, "biases": False}
        for joint in ("ankle", "knee"):
            spec["sections"][1]["steps"][0]["sweep"][joint]["sine"]["cycles"] = 4

    session = execute(plan(altered_protocol("squat", turn)), tmp_path, seed=3)
    rows = {row.joint: row for row in evaluate(session, estimate(session)).chain}
    assert abs(rows["knee"].mean_error_deg) == pytest.approx(3, abs=0.7)
    assert abs(rows["ankle"].mean_error_deg) < 0.7  # the chain shares a little of it out


def test_a_smoothed_run_is_better(altered_protocol, tmp_path):
    found = {}
    for smooth in (False, True):

        def change(spec, smooth=smooth):
            spec["sections"][1]["steps"][0]["sweep"]["knee"]["sine"]["cycles"] = 8
            spec["estimate"]["chain"] |= {"states": ["kinematic"], "smooth": smooth}

        session = execute(plan(altered_protocol("pendulum", change)), tmp_path, seed=2)
        (found[smooth],) = evaluate(session, estimate(session)).chain
    assert found[True].rate_rmse_deg_s < found[False].rate_rmse_deg_s
    assert found[True].acceleration_rmse_deg_s2 < found[False].acceleration_rmse_deg_s2


def test_a_section_without_rest_before_it_is_remarked_on_and_left_out(altered_protocol, tmp_path):
    def restless(spec):
        spec["sections"] = spec["sections"][1:]
        spec["sections"][0]["steps"][0]["sweep"]["knee"]["sine"]["cycles"] = 2
        spec["estimate"]["chain"]["settling_s"] = 1

    session = execute(plan(altered_protocol("pendulum", restless)), tmp_path, seed=2)
    estimated = estimate(session)
    assert estimated.chain == []
    assert any(
        "section swing: no rest comes before it" in str(found) for found in estimated.findings
    )
    assert any("no rest comes before it" in note for note in evaluate(session, estimated).notes)


def test_the_period_is_the_shortest_that_repeats_also_of_several_joints():
    t = np.arange(0, 40, 0.01)
    rate = np.zeros((len(t), 6))
    rate[:, 0] = np.sin(2 * np.pi * 0.5 * t) + 0.3 * np.sin(2 * np.pi * 1.0 * t)
    rate[:, 1] = np.cos(2 * np.pi * 1.5 * t)
    samples = ChainSamples(0.0, np.zeros((1, 6)), np.ones(1), t, np.zeros(len(t), dtype=int), rate)
    assert base_frequency(samples, 0.0) == pytest.approx(0.5, rel=1e-3)


def test_a_motion_that_does_not_repeat_has_no_period():
    rng = np.random.default_rng(1)
    t = np.arange(0, 40, 0.01)
    rate = np.cumsum(rng.normal(size=(len(t), 6)), axis=0)
    samples = ChainSamples(
        0.0,
        np.zeros((1, 6)),
        np.ones(1),
        t,
        np.zeros(len(t), dtype=int),
        np.diff(rate, axis=0, prepend=0),
    )
    with pytest.raises(InputError, match="does not repeat"):
        base_frequency(samples, 0.0)
