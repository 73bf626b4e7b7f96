"""World and mounting from motion: recovered, blind to signs, and honest about what the motion
cannot show.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.frame_alignment import (
    findings_on,
    fit_frames_by_motion,
)
from testbench.estimation.alignment.hand_eye import solve_hand_eye
from testbench.model.frame_fit import apply_frames

TIME = np.linspace(0, 60, 1500)
RICH = np.stack([np.sin(TIME), 0.7 * np.sin(1.3 * TIME), 0.5 * np.sin(0.7 * TIME)], axis=1)


def pairs(motion, seed, noise_deg=0.0):
    """Orientations of a body, and of a sensor on it in another world, with the rotations that join
    them.
    """
    rng = np.random.default_rng(seed)
    body = Rotation.from_euler("XYZ", motion)
    X, Z = Rotation.random(rng=rng), Rotation.random(rng=rng)
    noise = Rotation.from_rotvec(np.radians(noise_deg) * rng.standard_normal((len(motion), 3)))
    sensor = Z.inv() * body * X * noise
    signs = rng.choice([-1, 1], (2, len(motion), 1))
    return (
        signs[0] * body.as_quat(scalar_first=True),
        signs[1] * sensor.as_quat(scalar_first=True),
        X,
        Z,
    )


def angle_deg(q, expected):
    return np.degrees((Rotation.from_quat(q, scalar_first=True) * expected.inv()).magnitude())


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_any_world_and_mounting_are_recovered_exactly_whatever_the_signs(seed):
    body, sensor, X, Z = pairs(RICH, seed)
    found = solve_hand_eye(body, sensor)
    assert angle_deg(found.q_body_from_sensor, X) < 1e-6
    assert angle_deg(found.q_world_from_earth, Z) < 1e-6
    assert found.warning() is None


def test_with_noise_the_error_agrees_with_the_stated_uncertainty():
    z = []
    for seed in range(30):
        body, sensor, X, _ = pairs(RICH[::10], seed, noise_deg=1.0)
        found = solve_hand_eye(body, sensor)
        error = (
            X.inv() * Rotation.from_quat(found.q_body_from_sensor, scalar_first=True)
        ).as_rotvec()
        z.append(error / found.mounting_sd)
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.4


def test_motion_about_a_single_axis_is_refused_and_the_axis_is_named():
    body, sensor, X, _ = pairs(RICH * [1, 0, 0], 1, noise_deg=0.3)
    found = solve_hand_eye(body, sensor)
    assert not found.trusted
    assert abs(found.blind_axis @ X.inv().apply([1, 0, 0])) > 0.99
    assert "one axis" in found.warning()


def test_small_motion_beside_the_axis_is_warned_of_but_solved():
    body, sensor, X, _ = pairs(RICH * [1, 0.2, 0], 2)
    found = solve_hand_eye(body, sensor)
    assert found.trusted
    assert "doubtful" in found.warning()
    assert angle_deg(found.q_body_from_sensor, X) < 1e-6


def test_the_frames_that_are_fitted_bring_the_filter_to_the_truth():
    body, sensor, _, _ = pairs(RICH, 3)
    fit = fit_frames_by_motion(sensor, body, 60.0)
    assert fit.method == "motion"
    assert not fit.undetermined
    error = (
        Rotation.from_quat(apply_frames(sensor, fit), scalar_first=True)
        * Rotation.from_quat(body, scalar_first=True).inv()
    )
    assert np.degrees(error.magnitude().max()) < 1e-6


def test_without_enough_motion_only_the_heading_is_taken():
    body = np.tile(Rotation.from_euler("Z", 0.3).as_quat(scalar_first=True), (50, 1))
    sensor = np.tile(Rotation.from_euler("Z", 1.0).as_quat(scalar_first=True), (50, 1))
    fit = fit_frames_by_motion(sensor, body, 1.0)
    assert fit.method == "heading"
    assert fit.heading_deg == pytest.approx(np.degrees(-0.7))
    assert len(fit.undetermined) == 3
    assert [found.code for found in findings_on(fit, "vqf_6d")] == ["frames.still"]


def test_about_one_axis_only_the_angle_about_it_is_held_and_the_errors_do_not_depend_on_it():
    body, sensor, X, _ = pairs(RICH * [1, 0, 0], 1)
    fit = fit_frames_by_motion(sensor, body, 60.0, up_known=False)
    assert (fit.method, fit.held_by, fit.up_known) == ("motion", "mounting", False)
    (direction,) = fit.undetermined
    axis = np.array(direction[:3]) / np.linalg.norm(direction[:3])
    found = Rotation.from_rotvec(np.radians(fit.mounting_deg))
    # the true mounting differs about the axis alone, and the one that is held is the smaller
    between = (X.inv() * found).as_rotvec()
    assert np.linalg.norm(np.cross(between, axis)) < 1e-6
    assert found.magnitude() <= X.magnitude() + 1e-9
    error = (
        Rotation.from_quat(apply_frames(sensor, fit), scalar_first=True)
        * Rotation.from_quat(body, scalar_first=True).inv()
    )
    assert np.degrees(error.magnitude().max()) < 1e-6


def test_two_pairs_are_refused():
    with pytest.raises(ValueError, match="at least 3"):
        solve_hand_eye(np.tile([1.0, 0, 0, 0], (2, 1)), np.tile([1.0, 0, 0, 0], (2, 1)))
