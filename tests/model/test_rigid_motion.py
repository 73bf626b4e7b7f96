"""A body's motion by splines: rates and forces of motions that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.model.rigid_motion import RigidMotion

DOWN = np.array([0.0, 0.0, -9.80665])


def circling(rate: float, radius: float, hertz: float, seconds: float = 4.0) -> RigidMotion:
    """A body that goes round and keeps its face to the way."""
    t = np.arange(round(seconds * hertz) + 1) / hertz
    place = radius * np.column_stack([np.cos(rate * t), np.sin(rate * t), 0 * t])
    q = Rotation.from_euler("z", (rate * t)[:, None]).as_quat(scalar_first=True)
    q[::3] *= -1  # the sign of a quaternion says nothing
    return RigidMotion(np.round(1e9 * t).astype(np.int64), place, q)


def test_a_circle_has_its_rate_and_its_centripetal_force():
    rate, radius = 2.0, 0.5
    motion = circling(rate, radius, 100).at(np.arange(int(1e9), int(3e9), 7_000_000))
    np.testing.assert_allclose(
        motion.angular_velocity_in_frame, np.tile([0, 0, rate], (286, 1)), atol=1e-6
    )
    force = motion.specific_force_in_frame(DOWN)
    expected = np.tile([-(rate**2) * radius, 0, 9.80665], (286, 1))
    np.testing.assert_allclose(force, expected, atol=1e-4)
    np.testing.assert_allclose(motion.angular_acceleration, 0, atol=1e-3)


def test_rates_and_their_change_are_those_of_a_tumbling_body():
    """Against the rotation between neighbouring orientations, and its difference."""
    t = np.arange(401) / 100
    turns = Rotation.from_euler(
        "ZYX", np.column_stack([np.sin(t), 0.8 * np.sin(1.7 * t), 0.5 * np.cos(2.3 * t)])
    )
    body = RigidMotion(
        np.round(1e9 * t).astype(np.int64), np.zeros((401, 3)), turns.as_quat(scalar_first=True)
    )
    fine = np.arange(int(1e9), int(3e9), 1_000_000)
    found = body.at(fine)
    own = Rotation.from_matrix(found.R_world_from_frame)
    between = (own[:-1].inv() * own[1:]).as_rotvec() / 1e-3
    middle = 0.5 * (found.angular_velocity_in_frame[1:] + found.angular_velocity_in_frame[:-1])
    np.testing.assert_allclose(middle, between, atol=1e-5)
    change = np.diff(found.angular_velocity, axis=0) / 1e-3
    mean = 0.5 * (found.angular_acceleration[1:] + found.angular_acceleration[:-1])
    np.testing.assert_allclose(change, mean, atol=1e-4)


def test_it_rests_before_and_after():
    body = circling(2.0, 0.5, 100)
    outside = body.at(np.array([-int(1e9), int(60e9)]))
    np.testing.assert_array_equal(outside.angular_velocity, 0)
    np.testing.assert_array_equal(outside.acceleration, 0)
    np.testing.assert_allclose(outside.position[0], [0.5, 0, 0], atol=1e-9)
    assert body.duration == pytest.approx(4.0)
