"""Misalignment: the numbers that were printed, the closed form against quaternions, and the
equations against matrices.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.joint_angle import joint_rotation
from testbench.model.misalignment import (
    flexion_index,
    joint_from_start_pose,
    middle_angle_error,
    misalignment_errors,
    sensor_errors,
    with_errors,
)
from testbench.model.statistics.polynomial import fit_quadratic, fit_surface
from testbench.records.specs.joint_definition import FlexionAngle

MISALIGNMENT_DEG = np.arange(-20.0, 21, 2)
FLEXION_DEG = np.arange(0.0, 71, 5)


def flexion_error_deg(definition, about, flexion_deg, misalignment_deg=MISALIGNMENT_DEG, index=1):
    errors = misalignment_errors(
        definition, about, np.radians(flexion_deg), np.radians(misalignment_deg)
    )
    return np.degrees(np.abs(errors[..., index]))


def quaternion(turn: Rotation) -> np.ndarray:
    return turn.as_quat(scalar_first=True)


def random(n: int, seed: int) -> Rotation:
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=(n, 4)))


# What was printed


@pytest.mark.parametrize(
    ("flexion_deg", "a", "c", "r_squared", "adjusted", "rmse", "interval"),
    [
        (70, "0.02013", "0.1497", "0.9979", "0.9977", "0.13", ("0.01967", "0.02058")),
        (60, "0.01389", "0.05043", "0.9995", "0.9994", "0.04576", ("0.01373", "0.01405")),
    ],
)
def test_the_quadratic_fits_are_those_printed_to_the_last_digit(
    flexion_deg, a, c, r_squared, adjusted, rmse, interval
):
    fit = fit_quadratic(MISALIGNMENT_DEG, flexion_error_deg("ZYX", "X", [flexion_deg])[0])

    def printed(value: float, like: str) -> str:
        return f"{value:.{len(like.partition('.')[2])}f}"

    assert printed(fit.value("a"), a) == a
    assert printed(fit.value("c"), c) == c
    assert abs(fit.value("b")) < 1e-12
    assert printed(fit.r_squared, r_squared) == r_squared
    assert printed(fit.adjusted_r_squared, adjusted) == adjusted
    assert printed(fit.rmse, rmse) == rmse
    assert (
        tuple(printed(value, like) for value, like in zip(fit.interval("a"), interval, strict=True))
        == interval
    )


def test_ten_degrees_of_flexion_are_not_what_the_first_row_was_printed_for():
    assert fit_quadratic(MISALIGNMENT_DEG, flexion_error_deg("ZYX", "X", [10])[0]).value(
        "a"
    ) == pytest.approx(0.001523, abs=5e-7)


def test_the_surface_is_normed_by_the_printed_means_and_deviations():
    flexion, misalignment = np.meshgrid(FLEXION_DEG, MISALIGNMENT_DEG, indexing="ij")
    surface = fit_surface(
        flexion.ravel(),
        misalignment.ravel(),
        flexion_error_deg("ZYX", "X", FLEXION_DEG).ravel(),
        (4, 2),
    )
    np.testing.assert_allclose(surface.centre, [35, 0], atol=1e-12)
    assert [f"{value:.2f}" for value in surface.scale] == ["21.64", "12.13"]
    assert surface.r_squared > 0.997
    assert all(
        abs(surface.value(name)) < 1e-10 for name in ("p01", "p11", "p21", "p31")
    )  # symmetric in the misalignment


# What misalignment does


def test_about_the_flexion_axis_it_is_passed_on_one_to_one_and_about_z_not_at_all():
    error = np.degrees(
        misalignment_errors("ZYX", "Y", np.radians(FLEXION_DEG), np.radians(MISALIGNMENT_DEG))
    )[..., 1]
    np.testing.assert_allclose(error, np.tile(-MISALIGNMENT_DEG, (len(FLEXION_DEG), 1)), atol=1e-12)
    np.testing.assert_allclose(flexion_error_deg("ZYX", "Z", FLEXION_DEG), 0, atol=1e-12)


@given(st.floats(-89, 89), st.floats(-89, 89))
def test_the_closed_form_is_what_quaternions_give_for_every_sequence_whose_middle_axis_flexes(
    flexion, misalignment
):
    expected = np.degrees(middle_angle_error(np.radians(flexion), np.radians(misalignment)))
    for sequence, about in [("ZYX", "X"), ("XYZ", "Z")]:
        found = np.degrees(
            misalignment_errors(sequence, about, np.radians([flexion]), np.radians([misalignment]))[
                0, 0, 1
            ]
        )
        assert found == pytest.approx(expected, abs=1e-7)


def test_the_error_is_parabolic_in_the_misalignment_and_grows_with_flexion():
    error = flexion_error_deg("ZYX", "X", FLEXION_DEG)
    assert (np.diff(error[:, 0]) > 0).all()
    np.testing.assert_allclose(error, error[:, ::-1], atol=1e-12)
    assert (np.diff(error[-1], 2) > 0).all()


def test_a_symmetric_sequence_does_not_see_a_misalignment_about_its_outer_axes():
    errors = misalignment_errors("ZYZ", "Z", np.radians([30, 70]), np.radians(MISALIGNMENT_DEG))
    np.testing.assert_allclose(errors[..., 1], 0, atol=1e-12)
    np.testing.assert_allclose(
        np.degrees(errors[..., 0]), np.tile(-MISALIGNMENT_DEG, (2, 1)), atol=1e-9
    )


def test_any_definition_may_be_asked():
    hinge = FlexionAngle(definition={"hinge": [0.0, 1.0, 0.0]})
    error = misalignment_errors(hinge, "Y", np.radians([40]), np.radians([7.0]))[0, 0]
    assert np.degrees(error[0]) == pytest.approx(-7)
    assert np.isnan(error[2])  # no tilt, no direction of it
    reversed_ = FlexionAngle(definition={"hinge": [0.0, -1.0, 0.0]}, sign=-1)
    assert np.degrees(
        misalignment_errors(reversed_, "Y", np.radians([40]), np.radians([7.0]))[0, 0, 0]
    ) == pytest.approx(-7)


def test_angles_in_gimbal_lock_are_not_compared():
    errors = misalignment_errors("ZYZ", "X", np.radians([0.0]), np.radians([10.0]))[0, 0]
    assert np.isnan(errors[[0, 2]]).all()
    assert np.degrees(errors[1]) == pytest.approx(10)


def test_which_angle_is_the_flexion():
    assert [flexion_index(s) for s in ("ZYX", "YXZ", "XZY", "XYX")] == [1, 0, 2, 1]
    assert flexion_index(FlexionAngle(sequence="ZXZ", flexion="third")) == 2
    with pytest.raises(InputError, match="no single angle of YXY: the axis stands there 2 times"):
        flexion_index("YXY")


# The equations


def test_without_errors_the_start_pose_gives_the_joint_however_the_sensors_are_mounted():
    arm, forearm, start_arm, start_forearm = (
        random(40, 1),
        random(40, 2),
        random(1, 3)[0],
        random(1, 4)[0],
    )
    mount_arm, mount_forearm = random(1, 5)[0], random(1, 6)[0]  # segment from sensor
    found = joint_from_start_pose(
        quaternion(arm * mount_arm),
        quaternion(forearm * mount_forearm),
        quaternion(start_arm * mount_arm),
        quaternion(start_forearm * mount_forearm),
        quaternion(start_arm),
        quaternion(start_forearm),
    )
    error = rotation.multiply(
        found, rotation.conjugate(joint_rotation(quaternion(arm), quaternion(forearm)))
    )
    assert rotation.angle(error).max() < 1e-12


def test_errors_are_injected_as_printed():
    q, yaw, pitch, roll = random(30, 7), 0.1, -0.2, 0.05
    y, p, r = np.moveaxis(q.as_euler("ZYX"), -1, 0)
    expected = (
        (Rotation.from_rotvec([0, 0, yaw]) * Rotation.from_euler("Z", y[:, None]))
        * (Rotation.from_euler("Y", p[:, None]) * Rotation.from_rotvec([0, pitch, 0]))
        * (Rotation.from_euler("X", r[:, None]) * Rotation.from_rotvec([roll, 0, 0]))
    )
    found = with_errors(quaternion(q), yaw, pitch, roll)
    error = rotation.multiply(found, rotation.conjugate(quaternion(expected)))
    assert rotation.angle(error).max() < 1e-7


def test_a_yaw_of_the_whole_earth_is_no_error_but_a_yaw_of_one_sensor_is():
    flexion, error = np.radians([20.0, 60.0]), np.radians([-15.0, 0, 15.0])
    proximal = sensor_errors("ZYX", "Z", flexion, error)
    distal = sensor_errors("ZYX", "Z", flexion, error, which="distal")
    np.testing.assert_allclose(
        np.degrees(proximal[..., 1]), 0, atol=1e-12
    )  # the middle angle is blind to it
    np.testing.assert_allclose(
        np.degrees(proximal[..., 0]), np.tile([15, 0, -15], (2, 1)), atol=1e-9
    )
    np.testing.assert_allclose(np.degrees(distal[..., 0]), np.tile([-15, 0, 15], (2, 1)), atol=1e-9)


def test_a_pitch_of_the_distal_sensor_is_passed_on_one_to_one():
    error = sensor_errors(
        "ZYX", "Y", np.radians([10.0, 40.0]), np.radians([-5.0, 5.0]), which="distal"
    )
    np.testing.assert_allclose(np.degrees(error[..., 1]), np.tile([-5, 5], (2, 1)), atol=1e-9)
