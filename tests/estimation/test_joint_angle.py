"""Joint angles against SciPy and against the formulas of the reference."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.model import rotation
from testbench.model.joint_angle import (
    joint_angle_series,
    joint_angles,
    segment_from_sensor,
    segment_orientation,
)
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.protocol import Segment, Sensor
from testbench.records.specs.strict import Placement


def quaternion(turn: Rotation) -> np.ndarray:
    return turn.as_quat(scalar_first=True)


def random(n: int, seed: int) -> Rotation:
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=(n, 4)))


@pytest.mark.parametrize("sequence", ["ZXZ", "XYZ", "YXZ", "ZYX", "ZYZ"])
def test_a_known_relative_rotation_gives_its_angles_back_wherever_the_arm_points(sequence):
    angles = np.array([0.4, 0.9, -0.3])
    proximal = random(20, 1)
    distal = proximal * Rotation.from_euler(sequence, angles)
    found = joint_angles(quaternion(proximal), quaternion(distal), sequence)
    np.testing.assert_allclose(found, np.tile(angles, (20, 1)), atol=1e-12)


def test_xyz_angles_are_those_of_the_references_equations_2_7_to_2_9():
    proximal, distal = random(50, 2), random(50, 3)
    q0, q1, q2, q3 = quaternion(proximal.inv() * distal).T
    flexion = np.arctan2(-2 * q2 * q3 + 2 * q0 * q1, q3**2 - q2**2 - q1**2 + q0**2)
    abduction = np.arcsin(2 * q1 * q3 + 2 * q0 * q2)
    rotation_ = np.arctan2(-2 * q1 * q2 + 2 * q0 * q3, q1**2 + q0**2 - q3**2 - q2**2)
    found = joint_angles(quaternion(proximal), quaternion(distal), "XYZ")
    np.testing.assert_allclose(found, np.column_stack([flexion, abduction, rotation_]), atol=1e-9)


def test_an_earth_turned_for_both_sensors_alike_changes_no_joint_angle():
    proximal, distal = random(20, 4), random(20, 5)
    turn = Rotation.from_euler("z", 77, degrees=True)
    here = joint_angles(quaternion(proximal), quaternion(distal), "ZXZ")
    there = joint_angles(quaternion(turn * proximal), quaternion(turn * distal), "ZXZ")
    np.testing.assert_allclose(rotation.wrap(here - there), 0, atol=1e-10)


SENSOR = Sensor(
    preset="ideal",
    link="forearm_link",
    segment=Segment(name="forearm", rotation_deg={"XYZ": [90, 0, 0]}),
    mounting=Placement(rotation_deg={"ZYX": [20, -30, 40]}, position_mm=[1, 2, 3]),
)


def test_the_segment_stays_where_the_link_is_however_the_sensor_is_mounted():
    link = random(10, 6)
    sensor = link * Rotation.from_euler("ZYX", [20, -30, 40], degrees=True)
    expected = link * Rotation.from_euler("XYZ", [90, 0, 0], degrees=True)
    found = segment_orientation(quaternion(sensor), SENSOR)
    error = rotation.multiply(found, rotation.conjugate(quaternion(expected)))
    assert rotation.angle(error).max() < 1e-12


def test_the_rotation_between_sensor_and_segment_turns_vectors_of_the_sensor_into_the_segment():
    x = np.array([0.3, -0.5, 0.7])
    in_link = Rotation.from_euler("ZYX", [20, -30, 40], degrees=True).apply(x)
    in_segment = Rotation.from_euler("XYZ", [90, 0, 0], degrees=True).inv().apply(in_link)
    np.testing.assert_allclose(
        rotation.rotate(segment_from_sensor(SENSOR), x), in_segment, atol=1e-12
    )


def test_only_a_series_of_a_continuous_definition_is_followed_through_half_a_turn():
    turns = Rotation.from_rotvec(np.linspace(0, 7, 200)[:, None] * np.array([0, 0, 1.0]))
    still = quaternion(Rotation.identity(200))
    hinge = FlexionAngle(definition={"hinge": [0.0, 0.0, 1.0]})
    followed = hinge.model_copy(update={"continuous": True})
    principal = joint_angles(still, quaternion(turns), followed)[:, 0]
    assert np.ptp(principal) < 2 * np.pi
    np.testing.assert_array_equal(
        joint_angle_series(still, quaternion(turns), hinge)[:, 0], principal
    )
    np.testing.assert_allclose(
        np.diff(joint_angle_series(still, quaternion(turns), followed)[:, 0]), 7 / 199, atol=1e-9
    )
