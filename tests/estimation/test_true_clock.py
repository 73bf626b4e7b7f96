"""The clock of a joint against that of angles that another system gave of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from testbench.estimation.joints.true_clock import with_true_clocks
from testbench.estimation.signals.recording import JointTruth
from testbench.records.results.estimate import JointEstimate
from testbench.records.session.samples import TrueAngles
from testbench.records.specs.protocol import BodyJoint

KNEE = BodyJoint(proximal="thigh", distal="shank", definition="knee")
KEY = ("vqf_6d", "isb_knee")
TIME = np.arange(0, 30, 0.01)
SIZES_DEG = np.array([30.0, 6.0, 9.0])


def moved(seed: int) -> np.ndarray:
    """Three angles that move by themselves and never alike, shape (n, 3) [rad]."""
    noise = np.random.default_rng(seed).standard_normal((len(TIME), 3))
    smooth = gaussian_filter1d(noise, 25, axis=0)
    return np.radians(SIZES_DEG) * smooth / smooth.std(axis=0)


def clock(estimated, true, time=TIME, ahead_s=0.0, drift=0.0, same=False, near=False):
    """The joint with its clock, the truth's times ahead of the joint's."""
    own = JointEstimate(np.round(1e9 * TIME).astype(np.int64), {KEY: estimated})
    stamps = np.round(1e9 * (time / (1 + drift) + ahead_s)).astype(np.int64)
    truth = JointTruth(TrueAngles(stamps, true), same, near)
    return with_true_clocks({"knee": KNEE}, {"knee": own}, {"knee": truth})["knee"]


def codes(joint):
    return [own.code for own in joint.findings]


@pytest.mark.parametrize(("ahead_s", "drift"), [(0.0, 0.0), (7.3, 0.0), (-4.1, 200e-6)])
@pytest.mark.parametrize("sign", [1, -1])
def test_times_are_found_whatever_the_sign_and_the_zero(ahead_s, drift, sign):
    angles = moved(1)
    true = sign * angles + 0.3
    true[:, 1:] = np.nan
    found = clock(angles, true, ahead_s=ahead_s, drift=drift)
    assert found.true_clock.method == "angular_rate"
    at = found.true_clock.to_host(np.array([5e9, 25e9])) / 1e9
    np.testing.assert_allclose(at, np.array([5, 25]) / (1 + drift) + ahead_s, atol=1e-3)
    assert ("clock.shifted" in codes(found)) == (ahead_s != 0)


def test_angles_in_another_order_are_aligned_by_all_of_them_together():
    angles = moved(2)
    found = clock(angles, angles[:, [1, 0, 2]], ahead_s=3.0)
    assert found.true_clock.method == "angular_rate"
    assert found.true_clock.offset_s == pytest.approx(-3.0, abs=1e-3)


def test_a_truth_of_another_motion_is_refused():
    found = clock(moved(3), moved(4))
    assert found.true_clock.refused == "no common motion"
    assert codes(found) == ["clock.no_common_motion"]


def test_a_flexion_that_moves_as_another_angle_does_is_refused_and_named():
    angles = moved(5)
    true = np.full_like(angles, np.nan)
    true[:, 0] = angles[:, 2]
    found = clock(angles, true, ahead_s=2.0)
    assert found.true_clock.refused
    (said,) = [own for own in found.findings if own.code == "truth.angle_of_another"]
    assert said.values == {"angle": "flexion", "other": "internal rotation"}


def test_a_truth_that_stands_still_or_repeats_itself_tells_no_time():
    still = clock(moved(6), np.zeros((len(TIME), 3)))
    assert still.true_clock.refused == "still" and codes(still) == ["clock.still"]
    wave = np.column_stack([0.6 * np.sin(2 * np.pi * TIME), 0 * TIME, 0 * TIME])
    found = clock(wave, wave)
    assert found.true_clock.refused == "periodic" and codes(found) == ["clock.periodic"]
    stated = clock(wave, wave, near=True)
    assert not stated.true_clock.refused
    assert stated.true_clock.to_host(np.array([5e9]))[0] == pytest.approx(5e9, abs=1e6)


def test_a_truth_on_one_clock_is_taken_as_it_is_if_both_overlap():
    angles = moved(7)
    assert clock(angles, angles, same=True).true_clock.method == "none"
    apart = clock(angles, angles, same=True, ahead_s=100.0)
    assert apart.true_clock.refused == "no overlap" and codes(apart) == ["clock.no_overlap"]


def test_empty_rows_of_either_are_passed_over():
    angles = moved(8)
    true, estimated = angles.copy(), angles.copy()
    true[500:900] = np.nan
    estimated[1500:1700] = np.nan
    found = clock(estimated, true, ahead_s=1.0)
    assert found.true_clock.offset_s == pytest.approx(-1.0, abs=1e-3)


def test_a_truth_in_another_unit_of_time_is_named():
    angles = moved(9)
    found = clock(angles, angles, time=1000 * TIME)
    assert found.true_clock.refused == "unit" and codes(found) == ["clock.truth_unit"]


def test_a_joint_that_no_filter_computed_has_no_time_either():
    own = JointEstimate(np.arange(100), {})
    truth = JointTruth(TrueAngles(np.arange(100), np.zeros((100, 3))), False, False)
    found = with_true_clocks({"knee": KNEE}, {"knee": own}, {"knee": truth})["knee"]
    assert found.true_clock.refused == "unknown" and found.findings == []


@pytest.mark.parametrize(
    ("factor", "slow"), [(np.pi / 180, 1.0), (np.pi / 180, 0.1), (180 / np.pi, 0.05)]
)
def test_a_truth_in_another_unit_of_angle_is_aligned_so_that_the_errors_name_it(factor, slow):
    angles = slow * moved(10)
    found = clock(angles, factor * angles, ahead_s=2.003)
    assert found.true_clock.method == "angular_rate"
    assert found.true_clock.offset_s == pytest.approx(-2.003, abs=1e-3)


HIP = BodyJoint(proximal="pelvis", distal="thigh", definition="hip")


def of_two(knee, hip, true, same=False):
    """The clock of a knee beside a hip, and what is said of it."""
    time = np.round(1e9 * TIME).astype(np.int64)
    own = {
        "knee": JointEstimate(time, {KEY: knee}),
        "hip": JointEstimate(time, {("vqf_6d", "isb_hip"): hip}),
    }
    truth = JointTruth(TrueAngles(time, true), same, False)
    found = with_true_clocks({"knee": KNEE, "hip": HIP}, own, {"knee": truth})["knee"]
    return found.true_clock, codes(found)


@pytest.mark.parametrize("same", [False, True])
def test_the_angle_of_another_joint_that_moves_alike_is_named_and_judges_nothing(same):
    shared, knee, hip = moved(11), moved(12), moved(13)
    knee, hip = shared + 0.5 * knee, shared + 0.5 * hip  # of one rhythm
    right, said = of_two(knee, hip, knee, same)
    assert not right.refused and not said
    wrong, said = of_two(knee, hip, hip, same)
    assert wrong.refused and said == ["truth.of_another_joint"]
    _, said = of_two(knee, hip, moved(14), same)
    assert "truth.of_another_joint" not in said
