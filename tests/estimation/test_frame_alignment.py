"""Frame alignment: the heading of the filter's earth and the sensor's mounting, from one known
pose.
"""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.alignment.frame_alignment import fit_frames, fit_frames_by_motion
from testbench.model import rotation
from testbench.model.frame_fit import apply_frames
from testbench.records.results.estimate import FrameFit


def poses(n: int = 30, seed: int = 0) -> np.ndarray:
    return rotation.normalise(np.random.default_rng(seed).normal(size=(n, 4)))


def seen_by_filter(true: np.ndarray, heading_deg: float, mounting: np.ndarray) -> np.ndarray:
    """q_earth_from_sensor by a filter whose earth has a heading; `mounting` is
    q_believed_from_sensor.
    """
    earth_from_world = rotation.conjugate(rotation.from_heading(np.radians(heading_deg)))
    return rotation.multiply(rotation.multiply(earth_from_world, true), mounting)


def largest_error_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(rotation.angle(rotation.multiply(a, rotation.conjugate(b))).max()))


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, -120.0, 179.9])
@pytest.mark.parametrize("method", ["heading", "reference_pose"])
def test_a_heading_is_found_in_any_pose_and_taken_out_of_every_other(heading_deg, method):
    true = poses()
    estimated = seen_by_filter(true, heading_deg, rotation.IDENTITY)
    for reference in range(5):
        fit = fit_frames(estimated[[reference]], true[[reference]], method)
        assert fit.heading_deg == pytest.approx(heading_deg, abs=1e-9)
        assert np.abs(fit.mounting_deg).max() < 1e-6
        assert largest_error_deg(apply_frames(estimated, fit), true) < 1e-6


@pytest.mark.parametrize("tilt_deg", [(3.0, 0.0), (0.0, -5.0), (2.0, 4.0)])
def test_a_mounting_tilted_against_the_vertical_is_found_beside_the_heading(tilt_deg):
    true = poses()
    level = np.radians(
        [tilt_deg[0], tilt_deg[1], 0.0]
    )  # about a horizontal axis of the world, in the reference pose
    in_sensor = rotation.rotate(rotation.conjugate(true[0]), level)
    mounting = rotation.from_rotation_vector(in_sensor)
    estimated = seen_by_filter(true, 71.0, mounting)
    fit = fit_frames(estimated[:1], true[:1], "reference_pose")
    assert fit.heading_deg == pytest.approx(71, abs=1e-6)
    np.testing.assert_allclose(fit.mounting_deg, np.degrees(in_sensor), atol=1e-6)
    assert largest_error_deg(apply_frames(estimated, fit), true) < 1e-6


def test_the_reference_pose_itself_is_always_met_whatever_the_mounting():
    true = poses()
    estimated = seen_by_filter(
        true, -50.0, rotation.from_rotation_vector(np.array([0.2, -0.3, 0.4]))
    )
    fit = fit_frames(estimated[:1], true[:1], "reference_pose")
    assert largest_error_deg(apply_frames(estimated[:1], fit), true[:1]) < 1e-6


def test_one_pose_cannot_tell_a_mounting_about_the_vertical_from_a_heading():
    true = poses()
    vertical = rotation.rotate(rotation.conjugate(true[0]), np.array([0.0, 0.0, np.radians(6.0)]))
    estimated = seen_by_filter(true, 10.0, rotation.from_rotation_vector(vertical))
    fit = fit_frames(estimated[:1], true[:1], "reference_pose")
    assert fit.heading_deg == pytest.approx(10.0 - 6.0, abs=1e-6)  # all of it is put to the heading
    assert np.abs(fit.mounting_deg).max() < 1e-6


def test_the_method_heading_leaves_the_mounting_alone():
    true = poses()
    mounting = rotation.from_rotation_vector(
        rotation.rotate(rotation.conjugate(true[0]), np.array([0.05, 0.0, 0.0]))
    )
    fit = fit_frames(seen_by_filter(true, 30.0, mounting)[:1], true[:1], "heading")
    assert fit.mounting_deg == (0.0, 0.0, 0.0)
    assert fit.heading_deg == pytest.approx(30, abs=1e-6)


def test_no_alignment_changes_nothing():
    q = poses()
    np.testing.assert_array_equal(apply_frames(q, FrameFit()), q)


def test_the_fit_averages_over_the_reference_pose():
    rng = np.random.default_rng(2)
    true = np.tile(poses(1), (4000, 1))
    noise = rotation.from_rotation_vector(np.radians(1.0) * rng.standard_normal((4000, 3)))
    estimated = rotation.multiply(noise, seen_by_filter(true, 20.0, rotation.IDENTITY))
    fit = fit_frames(estimated * rng.choice([-1.0, 1.0], (4000, 1)), true[:7], "reference_pose")
    assert fit.heading_deg == pytest.approx(20, abs=4 / np.sqrt(4000))


@pytest.mark.parametrize("drift_deg", [0.0, 8.0, 20.0])
def test_a_world_whose_y_points_up_leans_however_the_truth_drifts(drift_deg):
    true = poses(400)
    part = np.clip((np.arange(400) - 150) / 50, 0, 1)[:, None]
    drift = rotation.from_rotation_vector(np.radians(drift_deg) * part * [0.0, 0.0, 1.0])
    y_up = rotation.from_rotation_vector(np.radians([[-90.0, 0.0, 0.0]]))
    fit = fit_frames_by_motion(true, rotation.multiply(y_up, rotation.multiply(drift, true)), 100.0)
    assert fit.leans
    assert np.linalg.norm(fit.tilt_deg) == pytest.approx(90, abs=drift_deg / 2 + 0.1)


def test_a_filter_that_is_wrong_by_as_much_does_not_make_a_world_lean():
    rng = np.random.default_rng(3)
    true = poses(400)
    wrong = rotation.from_rotation_vector(rng.normal(0.0, 0.6, (400, 3)))
    fit = fit_frames_by_motion(rotation.multiply(wrong, true), true, 100.0)
    assert not fit.leans
