"""Errors of a joint by angle, and what in a truth of angles is counted otherwise."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from testbench.evaluation.angle_errors import angle_error_rows, convention_findings
from testbench.evaluation.flexion import JointErrors
from testbench.model.joint_angle import decomposition_of
from testbench.model.told_angles import told_angles
from testbench.records.results.estimate import ClockFit, JointEstimate
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import TrueAngles
from testbench.records.specs.protocol import BodyJoint

COUNT = 3000
KNEE = BodyJoint(proximal="thigh", distal="shank", definition="knee")
PLAIN = BodyJoint(
    proximal="thigh", distal="shank", sequence="ZXY", flexion="first", sign=-1, compare=[]
)
TIME_NS = np.arange(COUNT) * 10_000_000
DEG = np.pi / 180


def moved(seed: int = 1) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal((COUNT, 3))
    smooth = gaussian_filter1d(noise, 25, axis=0)
    return DEG * np.array([30.0, 6.0, 9.0]) * smooth / smooth.std(axis=0)


def errors(true: np.ndarray, estimated: np.ndarray, joint: BodyJoint = KNEE) -> JointErrors:
    """Of one filter, over the whole."""
    step = PlannedStep(0, "recording", "evaluation", "recording", "sweep", {}, 0, 1, 1)
    key, known = ("vqf_6d", joint.label), np.flatnonzero(np.isfinite(true[:, 0]))
    blank = np.zeros(COUNT)
    return JointErrors(
        "knee",
        joint,
        TIME_NS,
        blank,
        {key: blank},
        {key: blank},
        {joint.label: true},
        {key: estimated},
        [(step, known)],
        {},
        np.full((COUNT, 2), np.nan),
        clock=ClockFit(),
    )


def codes(found: JointErrors) -> list[str]:
    return [own.code for own in convention_findings(found)]


def test_each_angle_has_its_error_with_and_without_what_is_constant_in_it():
    true = moved()
    noise = DEG * np.random.default_rng(2).standard_normal(true.shape)
    rows = angle_error_rows(errors(true, true + noise + DEG * np.array([10.0, 0.0, -4.0])))
    assert [(row.angle, row.name) for row in rows] == [
        ("first", "flexion"),
        ("second", "adduction"),
        ("third", "internal rotation"),
    ]
    for row, offset in zip(rows, (10.0, 0.0, -4.0), strict=True):
        assert row.n == COUNT and row.flexion == (row.angle == "first")
        assert row.mean_error_deg == pytest.approx(offset, abs=0.1)
        assert row.rmse_without_mean_deg == pytest.approx(1.0, abs=0.05)
        assert row.rmse_deg == pytest.approx(np.hypot(offset, 1.0), abs=0.1)


def test_the_flexion_has_the_sign_that_the_joint_counts_by():
    true = moved()
    rows = angle_error_rows(errors(true, true + 5 * DEG, PLAIN))
    assert [row.mean_error_deg for row in rows] == pytest.approx([-5.0, 5.0, 5.0])


def test_an_offset_near_half_a_turn_does_not_spread_the_errors():
    true = moved()
    noise = DEG * np.random.default_rng(2).standard_normal(true.shape)
    row = angle_error_rows(errors(true, true + noise + np.pi))[0]
    assert abs(row.mean_error_deg) == pytest.approx(180, abs=0.2)
    assert row.rmse_without_mean_deg == pytest.approx(1.0, abs=0.05)


def test_a_truth_that_fits_is_not_spoken_of():
    true = moved()
    assert codes(errors(true, true + DEG)) == []


def test_what_is_counted_otherwise_is_named_and_not_mended():
    estimated = moved()
    turned = estimated * [-1, 1, 1]
    assert codes(errors(turned, estimated)) == ["truth.angle_reversed"]
    row = angle_error_rows(errors(turned, estimated))[0]
    assert row.rmse_deg == pytest.approx(2 * 30.0, rel=0.03)  # twice the angle's own size
    exchanged = errors(estimated[:, [0, 2, 1]], estimated)
    assert codes(exchanged) == ["truth.angles_exchanged"]
    zero = errors(estimated - [20 * DEG, 0, 0], estimated)
    (told,) = convention_findings(zero)
    assert told.code == "truth.angle_offset"
    assert told.values["offset_deg"] == pytest.approx(20) and told.values["spread_deg"] < 1e-6


@pytest.mark.parametrize("factor", [DEG, 1 / DEG])
def test_degrees_taken_for_radians_are_named(factor):
    estimated = moved()
    found = errors(estimated * [factor, 1, 1], estimated)
    (told,) = convention_findings(found)
    assert told.code == "truth.angle_unit"
    assert told.values["ratio"] == pytest.approx(factor, rel=1e-6)
    assert told.values["factor"] == pytest.approx(1 / factor, rel=1e-6)
    still = estimated * [0.02, 1, 1]  # an angle that hardly moves tells no unit
    assert "truth.angle_unit" not in codes(errors(still * [factor, 1, 1], still))


def session_of(true: TrueAngles, joint: BodyJoint) -> SimpleNamespace:
    """As much of a session as holds true angles."""
    analysis = SimpleNamespace(joints={"knee": joint})
    return SimpleNamespace(true_angles=lambda name: true, analysis=analysis)


def test_a_truth_of_all_angles_is_one_of_every_definition():
    joint = BodyJoint(
        proximal="thigh", distal="shank", definition="knee", compare=[{"sequence": "XYZ"}]
    )
    angles = moved()
    estimate = JointEstimate(TIME_NS, {}, true_clock=ClockFit())
    found, _ = told_angles(session_of(TrueAngles(TIME_NS, angles), joint), "knee", estimate)
    np.testing.assert_allclose(found["isb_knee"], angles, atol=1e-9)
    q = decomposition_of(joint).rotation(angles)
    np.testing.assert_allclose(found["XYZ"], decomposition_of("XYZ").angles(q), atol=1e-9)


def test_a_truth_of_one_angle_is_known_where_it_is_and_of_its_own_definition_alone():
    joint = BodyJoint(
        proximal="thigh", distal="shank", definition="knee", compare=[{"sequence": "XYZ"}]
    )
    angles = moved()
    angles[:, 1:] = np.nan
    angles[1000:1100] = np.nan
    shifted = JointEstimate(TIME_NS + 5_000_000, {}, true_clock=ClockFit(offset_s=0.005))
    found, said = told_angles(session_of(TrueAngles(TIME_NS, angles), joint), "knee", shifted)
    assert not said
    assert list(found) == ["isb_knee"]
    lost = np.isnan(found["isb_knee"][:, 0])
    assert lost[1001:1098].all() and lost.sum() <= 102
    np.testing.assert_allclose(found["isb_knee"][~lost, 0], angles[~lost, 0], atol=1e-9)


def test_a_truth_whose_time_is_not_known_judges_nothing():
    estimate = JointEstimate(TIME_NS, {}, true_clock=ClockFit(refused="no common motion"))
    assert told_angles(session_of(TrueAngles(TIME_NS, moved()), KNEE), "knee", estimate) is None


def held_at(true: np.ndarray, estimated: np.ndarray, joint: BodyJoint = KNEE):
    """True angles of a joint with an estimate, and what is said of them."""
    estimate = JointEstimate(TIME_NS, {("vqf_6d", joint.label): estimated}, true_clock=ClockFit())
    found, said = told_angles(session_of(TrueAngles(TIME_NS, true), joint), "knee", estimate)
    return found[joint.label], said


@pytest.mark.parametrize("joint", [KNEE, PLAIN])
def test_a_goniometer_at_its_end_is_named_and_not_judged_there(joint):
    angles = moved()
    true = np.minimum(angles, 40 * DEG)
    true[:, 1:] = np.nan
    own, (said,) = held_at(true, angles, joint)
    assert (
        said.code == "truth.angle_held" and said.values["angle"] == decomposition_of(joint).names[0]
    )
    assert said.values["at_deg"] == pytest.approx(40 * joint.sign)
    lost = np.isnan(own[:, 0])
    assert said.values["count"] == lost.sum() > 100
    assert not lost[angles[:, 0] < 40 * DEG].any()  # what was measured is judged
    far = angles[:, 0] > 50 * DEG
    assert lost[far].all() and far.sum() > 50


def test_a_truth_that_rests_with_the_joint_or_moves_in_steps_or_never_is_judged():
    angles = moved()
    rests = angles.copy()
    rests[1000:1500] = rests[1000]
    assert not held_at(rests, rests)[1]
    coarse = np.round(angles / (2 * DEG)) * 2 * DEG
    assert not held_at(coarse, angles)[1]
    locked = angles * [1, 0, 1]  # a model whose knee has no adduction
    own, said = held_at(locked, angles)
    assert not said and np.isfinite(own).all()


def test_a_flexion_that_goes_its_own_way_is_said_to_be_hardly_alike():
    true = moved()
    loose = true + moved(2) * 1.2
    assert "truth.angle_unlike" in codes(errors(true, loose))
    assert "truth.angle_unlike" not in codes(errors(true, true + moved(2) * 0.5))
