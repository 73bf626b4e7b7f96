"""The emulated joints: trapezoids, servoing, stops, limits."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.emulation.joints import Joints
from testbench.records.specs.robot import Robot, load_robot

QUIET = {"encoder_resolution_deg": 0.0, "encoder_noise_deg": 0.0, "velocity_noise_deg_s": 0.0}


@pytest.fixture(scope="module")
def robot() -> Robot:
    arm = load_robot("ur3e")
    return Robot(
        arm.spec.model_copy(update={"servo": arm.spec.servo.model_copy(update=QUIET)}),
        arm.urdf,
        arm.text,
    )


def run(joints: Joints, count: int, scaling: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    q, v = [], []
    for _ in range(count):
        assert joints.step(scaling) is None
        q.append(joints.q_reference.copy())
        v.append(joints.v_reference.copy())
    return np.array(q), np.array(v)


@pytest.mark.parametrize(
    ("distance", "speed", "acceleration"), [(1.0, 0.8, 1.4), (0.1, 1.05, 1.4), (2.0, 0.3, 3.0)]
)
def test_movej_lasts_as_long_as_its_trapezoid_and_ends_where_it_was_sent(
    robot, distance, speed, acceleration
):
    joints = Joints(robot, robot.home)
    target = robot.home + np.array([distance, 0, 0, -distance / 2, 0, 0])
    joints.move(target, speed, acceleration)
    peak = min(speed, np.sqrt(distance * acceleration))
    expected = distance / peak + peak / acceleration  # by the area under a trapezoid
    q, v = run(joints, round(expected / joints.period) + 3)
    assert joints.at_rest
    moving = (np.abs(v[:, 0]) > 0).sum() * joints.period
    assert moving == pytest.approx(expected, abs=3 * joints.period)
    np.testing.assert_allclose(q[-1], target, atol=1e-12)
    assert np.abs(v[:, 0]).max() == pytest.approx(peak, rel=0.02)
    np.testing.assert_allclose(
        (q[:, 3] - robot.home[3]) * -2, q[:, 0] - robot.home[0], atol=1e-9
    )  # a straight line


def test_the_speed_slider_stretches_a_move_and_does_not_change_its_path(robot):
    full, half = Joints(robot, robot.home), Joints(robot, robot.home)
    target = robot.home + 0.5
    full.move(target, 0.8, 1.4)
    half.move(target, 0.8, 1.4)
    q_full, _ = run(full, 400)
    q_half, v_half = run(half, 800, 0.5)
    np.testing.assert_allclose(q_half[1::2], q_full, atol=1e-9)
    assert np.abs(v_half).max() <= 0.4 + 1e-9


def test_servoj_lags_a_ramp_by_the_lookahead_time_and_the_joint_by_its_servo_more(robot):
    joints = Joints(robot, robot.home)
    rate, lookahead = 0.5, 0.1
    for k in range(1500):
        joints.servo(
            robot.home + np.array([0, 0, 0, 0, 0, rate * k * joints.period]), lookahead, 300
        )
        joints.step(1.0)
    sent = robot.home[5] + rate * 1499 * joints.period
    servo_lag = (
        2 * robot.spec.servo.damping_ratio / (2 * np.pi * robot.spec.servo.natural_frequency_hz)
    )
    assert sent - joints.q_reference[5] == pytest.approx(
        rate * lookahead, abs=2 * rate * joints.period
    )
    assert joints.q_reference[5] - joints.q_measured[5] == pytest.approx(rate * servo_lag, rel=1e-3)


def test_stopping_decelerates_as_asked_and_ends_at_rest(robot):
    joints = Joints(robot, robot.home)
    joints.speed(np.array([0.6, -0.3, 0, 0, 0, 0]), 2.0)
    run(joints, 400)
    joints.stop(1.5)
    _, v = run(joints, 300)
    stopping = np.count_nonzero(v[:, 0]) * joints.period
    assert stopping == pytest.approx(0.6 / 1.5, abs=2 * joints.period)
    np.testing.assert_allclose(v[:100, 1], -v[:100, 0] / 2, atol=1e-12)  # along the same line
    assert joints.steady


def test_a_jump_of_the_servo_target_keeps_the_acceleration_limits_and_trips_at_the_speed_limit(
    robot,
):
    joints = Joints(robot, robot.home)
    trips, v = [], []
    for _ in range(500):
        joints.servo(robot.home + 3.0, 0.03, 300)
        trips.append(joints.step(1.0))
        v.append(joints.v_reference.copy())
    a = np.diff(v, axis=0) / joints.period
    assert (np.abs(a) <= robot.acceleration_limits * (1 + 1e-9)).all()
    assert any(trip is not None and "deg/s" in trip for trip in trips)


def test_leaving_a_joints_range_trips(robot):
    joints = Joints(robot, robot.home)
    joints.speed(np.array([0, 0, 2.0, 0, 0, 0]), 5.0)
    assert any(joints.step(1.0) == "a joint was asked to leave its range" for _ in range(5000))


def test_a_move_that_replaces_a_moving_one_stops_first(robot):
    joints = Joints(robot, robot.home)
    joints.move(robot.home + 1.0, 1.0, 2.0)
    run(joints, 200)
    joints.move(robot.home, 1.0, 2.0)
    q, v = run(joints, 1500)
    assert np.abs(np.diff(v, axis=0)).max() / joints.period <= 2.0 * 1.05
    np.testing.assert_allclose(q[-1], robot.home, atol=1e-12)
