"""The gimbal GIMVEBO: its axes, its clearances, its sensor, and the protocol that calibrates on
it.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from testbench import plan
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.robot import load_robot
from testbench.records.specs.sensor import load_preset

NEIGHBOURS = [("base_link", "y_arm", 0), ("y_arm", "x_arm", 1), ("x_arm", "z_arm", 2)]


@pytest.fixture(scope="module")
def robot():
    return load_robot("gimvebo")


@pytest.fixture(scope="module")
def calibration_plan():
    return plan("gimvebo_gyro")


def test_the_axes_turn_in_the_order_y_x_z_and_cross_in_one_point(robot):
    q = np.radians([[30.0, -50.0, 70.0]])
    motion = Kinematics(robot).frame_motion("z_arm", q)
    y, x, z = q[0]
    Ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    Rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    Rz = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    assert np.allclose(motion.R_world_from_frame[0], Ry @ Rx @ Rz, atol=1e-12)
    assert np.allclose(motion.position[0], [0, 0, 0.14], atol=1e-12)


def test_gravity_is_that_of_the_place_where_it_stood(robot):
    felt = (
        Kinematics(robot)
        .frame_motion("z_arm", np.zeros((1, 3)))
        .specific_force_in_frame(robot.gravity)
    )
    assert felt[0] == pytest.approx([0, 0, 9.7992])


def test_limits_are_those_of_the_servo_in_the_robot_file_and_in_the_urdf(robot):
    model = pin.buildModelFromUrdf(str(robot.urdf))
    assert np.degrees(robot.position_limits).tolist() == [pytest.approx([-150, 150])] * 3
    assert model.velocityLimit == pytest.approx(robot.velocity_limits)
    assert model.velocityLimit * 60 / (2 * np.pi) == pytest.approx(114)
    assert np.column_stack([model.lowerPositionLimit, model.upperPositionLimit]) == pytest.approx(
        robot.position_limits
    )
    assert model.effortLimit == pytest.approx(0.39)


@pytest.mark.parametrize(("first", "second", "joint"), NEIGHBOURS)
def test_neighbours_turn_inside_one_another_without_touching(robot, first, second, joint):
    model = pin.buildModelFromUrdf(str(robot.urdf))
    geometry = pin.buildGeomFromUrdf(model, str(robot.urdf), pin.COLLISION)
    links = [model.frames[body.parentFrame].name for body in geometry.geometryObjects]
    for i, a in enumerate(links):
        for j, b in enumerate(links):
            if (a, b) == (first, second):
                geometry.addCollisionPair(pin.CollisionPair(i, j))
    data, geometry_data = model.createData(), pin.GeometryData(geometry)
    for angle in np.radians(np.arange(-150, 151, 2.0)):
        q = np.zeros(3)
        q[joint] = angle
        pin.computeDistances(model, data, geometry, geometry_data, q)
        assert min(result.min_distance for result in geometry_data.distanceResults) > 0.006


def test_the_sensor_follows_its_data_sheet():
    sheet = load_preset("mpu6050")
    acc, gyr = sheet.accelerometer.triad(), sheet.gyroscope.triad()
    assert sheet.rate_hz == 50 and sheet.magnetometer is None
    assert acc.range == pytest.approx(2 * 9.80665) and acc.resolution == pytest.approx(
        4 * 9.80665 / 2**16
    )
    assert np.degrees(gyr.range) == pytest.approx(250) and np.degrees(
        gyr.resolution
    ) == pytest.approx(500 / 2**16, rel=1e-3)


def test_the_protocol_has_ten_moves_to_fit_and_ten_to_judge_each_within_two_hundred_samples(
    calibration_plan,
):
    assert calibration_plan.check.clearance.distance_mm > 20
    for section in ("fit", "held_out"):
        steps = [step for step in calibration_plan.steps if step.section == section]
        assert len(steps) == 10
        for step in steps:
            assert 3.3 < (step.settled_ns - step.start_ns) / NANOSECONDS < 3.75
            assert (step.end_ns - step.settled_ns) / NANOSECONDS >= 2
    roles = {step.section: step.role for step in calibration_plan.steps}
    assert roles == {
        "poses": "calibration",
        "fit_start": "calibration",
        "fit": "calibration",
        "held_out_start": "reference",
        "held_out": "evaluation",
    }


def test_the_poses_turn_every_side_of_the_sensor_up(calibration_plan, robot):
    kinematics, mounting = (
        Kinematics(robot),
        Pose.from_placement(calibration_plan.protocol.spec.sensors["imu"].mounting),
    )
    ends = np.array([step.end_ns for step in calibration_plan.steps if step.section == "poses"])
    q, _, _ = calibration_plan.trajectory.at(ends)
    up = kinematics.frame_motion("z_arm", q, offset=mounting).R_world_from_frame[:, 2]
    assert len(up) == 24
    for side in (*np.eye(3), *-np.eye(3)):
        assert (
            np.degrees(np.arccos((up @ side).max())) < 45
        )  # 150 deg of travel cannot turn -z right up
