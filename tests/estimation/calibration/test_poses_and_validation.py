"""Means of rests with their variance, and what a calibration leaves in poses it has not seen."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.calibration.methods import METHODS
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import StaticPoses, TrueVector, static_poses
from testbench.estimation.calibration.static_intervals import by_gyroscope, by_variance
from testbench.estimation.calibration.validation import cross_validate, validate
from testbench.exceptions import InputError
from testbench.records.results.calibration import TriadCalibration
from tests.estimation.calibration.simulated import GRAVITY, SIX, UP, part, poses_of, rng, turned


def test_means_variances_and_times_are_those_of_the_samples():
    draw = rng(1)
    samples = draw.normal(5.0, 0.1, (1000, 3))
    samples[120] = np.nan
    times = 0.01 * np.arange(1000)
    temperature = np.linspace(20, 30, 1000)
    poses = static_poses(
        samples,
        np.array([[100, 200], [500, 501], [600, 1000]]),
        times=times,
        true=TrueVector(expected=np.eye(3)),
        temperature=temperature,
        floor=0.02,
    )
    assert len(poses) == 2  # one sample is no pose
    kept = np.delete(samples[100:200], 20, axis=0)
    np.testing.assert_allclose(poses.mean[0], kept.mean(axis=0))
    np.testing.assert_allclose(poses.variance[0], kept.var(axis=0, ddof=1) / 99 + 0.02**2)
    np.testing.assert_array_equal(poses.expected, np.eye(3)[[0, 2]])
    np.testing.assert_array_equal(poses.count, [99, 400])
    np.testing.assert_allclose(
        poses.temperature, [temperature[100:200].mean(), temperature[600:].mean()], atol=0.01
    )
    np.testing.assert_allclose([*poses.start, *poses.end], [1.0, 6.0, 1.99, 9.99])
    with pytest.raises(InputError, match="no static pose"):
        static_poses(samples, np.array([[5, 6]]), times=times)
    with pytest.raises(InputError, match="floor above 0"):
        static_poses(np.ones((50, 3)), np.array([[0, 50]]), times=times, floor=0.0)
    with pytest.raises(ValueError, match="shape"):
        StaticPoses(np.zeros((2, 3)), np.zeros((3, 3)))


def test_an_error_of_the_direction_lies_across_it():
    poses = poses_of(SIX, np.eye(3), np.zeros(3), 1e-3, rng(1), direction_sd=1e-3)
    covariance = poses.covariance()
    np.testing.assert_allclose(covariance[0, 0, 0], poses.variance[0, 0])
    np.testing.assert_allclose(covariance[0, 1, 1], poses.variance[0, 1] + (GRAVITY * 1e-3) ** 2)


def test_held_out_figures_against_arithmetic():
    poses = poses_of(SIX, np.eye(3), np.array([0.03, 0.0, 0.0]))
    figures = validate(TriadCalibration("none"), poses)
    assert figures["held_out_poses"] == 6
    assert figures["bias_x_mg"] == pytest.approx(30 / GRAVITY)
    assert figures["bias_y_mg"] == pytest.approx(0)
    lengths = np.array([GRAVITY + 0.03, GRAVITY - 0.03, *[np.hypot(GRAVITY, 0.03)] * 4])
    assert figures["gravity_norm_rms_mm_s2"] == pytest.approx(
        1e3 * np.sqrt(np.mean((lengths - GRAVITY) ** 2))
    )
    tilt = np.degrees(np.arctan(0.03 / GRAVITY))
    assert figures["direction_rms_deg"] == pytest.approx(tilt * np.sqrt(4 / 6))
    assert figures["direction_max_deg"] == pytest.approx(tilt)


def test_no_pose_is_judged_by_a_fit_that_has_seen_it():
    """One pose is spoilt: a fit that had seen it would bend towards it; the fold's error there is
    the whole spoiling.
    """
    forces = turned(UP, 40)
    poses = poses_of(forces, *part())
    poses.mean[7] += [0.5, 0.0, 0.0]
    asked: list[int] = []

    def spy(given: StaticPoses) -> TriadCalibration:
        assert given.expected is not None
        spoilt = np.isclose(given.expected, forces[7]).all(axis=1).any()
        asked.append(len(given))
        return (
            METHODS["attitude_aided"].function(given) if not spoilt else TriadCalibration("spoilt")
        )

    figures = cross_validate(spy, poses, folds=40)
    assert asked == [39] * 40
    assert figures["held_out_poses"] == 40


def test_folds_that_cannot_be_fitted_are_left_out():
    assert (
        cross_validate(METHODS["six_position"].function, poses_of(SIX, np.eye(3), np.zeros(3)))
        == {}
    )
    twice = poses_of(np.vstack([SIX, SIX]), np.eye(3), np.zeros(3))
    assert cross_validate(METHODS["six_position"].function, twice, 2)["held_out_poses"] == 12


IMU_TK_GRAVITY = 9.81744
"""Where imu_tk's example was recorded [m/s^2]."""


@pytest.mark.data
def test_imu_tks_recording_is_calibrated_by_the_length_of_gravity(data):
    counts = np.loadtxt(data / "imu_tk" / "xsens_acc.mat")
    acc = (counts[:, 1:] - 32768) / 413.0
    gyr = (np.loadtxt(data / "imu_tk" / "xsens_gyro.mat")[:, 1:] - 32768) / 4800.0
    found = by_variance(acc, 0.01, initial_s=30.0, gravity=IMU_TK_GRAVITY)
    fits = []
    for intervals in (found.intervals, by_gyroscope(gyr, 0.01)):
        assert 36 <= len(intervals) <= 42
        poses = static_poses(acc, intervals, times=counts[:, 0], true=TrueVector(IMU_TK_GRAVITY))
        assert cross_validate(norm_only, poses)["gravity_norm_rms_mm_s2"] < 2.0
        calibration = norm_only(poses)
        halves = [norm_only(poses.subset(np.arange(len(poses)) % 2 == k)).fits[0] for k in (0, 1)]
        # stated uncertainties are honest: two halves of the poses differ by no more than they say
        apart = (halves[0].values - halves[1].values) / np.hypot(halves[0].sd, halves[1].sd)
        assert np.abs(apart).max() < 4
        assert np.sqrt(np.mean(apart**2)) < 2
        assert (calibration.fits[0].sd[3:6] < 3e-4).all()
        assert (
            calibration.fits[0].residual_rms > 1
        )  # the model leaves more than noise, and the uncertainties are widened by it
        fits.append(calibration.fits[0])
    np.testing.assert_allclose(fits[0].values, fits[1].values, atol=6 * float(np.max(fits[0].sd)))
