"""The compiled kinematics against Pinocchio's own algorithms and against finite differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from testbench import plan
from testbench.exceptions import FileProblems, NotFoundError
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.robot import Robot, list_robots, load_robot
from testbench.records.specs.strict import Placement

POSES = 25
TILTED = Placement(rotation_deg={"XYZ": [90, 20, -35]}, position_mm=[100, -200, 700])


def on_a_wall(robot: Robot) -> Robot:
    """The arm with its base turned and moved in the world."""
    return Robot(robot.spec.model_copy(update={"base": TILTED}), robot.urdf, robot.text)


def random_states(kinematics: Kinematics, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    n = len(kinematics.robot.joint_names)
    return (
        rng.uniform(-3, 3, (POSES, n)),
        rng.uniform(-4, 4, (POSES, n)),
        rng.uniform(-10, 10, (POSES, n)),
    )


def velocities(kinematics: Kinematics, values: np.ndarray) -> np.ndarray:
    """Joint rates in Pinocchio's order."""
    result = np.zeros(kinematics.model.nv)
    for name, value in zip(kinematics.robot.joint_names, values, strict=True):
        result[kinematics.model.joints[kinematics.model.getJointId(name)].idx_v] = value
    return result


@pytest.mark.parametrize("name", sorted(list_robots()))
def test_every_robot_moves_as_pinocchio_says_also_on_a_tilted_base(name):
    kinematics = Kinematics(on_a_wall(load_robot(name)))
    model = kinematics.model
    data = model.createData()
    world_from_base = pin.SE3(
        Rotation.from_euler("XYZ", [90, 20, -35], degrees=True).as_matrix(),
        np.array([0.1, -0.2, 0.7]),
    )
    q, v, a = random_states(kinematics, seed=len(name))
    links = [kinematics.link_names[i] for i in (1, len(kinematics.link_names) // 2, -1)]
    motions = {link: kinematics.frame_motion(link, q, v, a) for link in links}
    for i in range(POSES):
        pin.forwardKinematics(
            model,
            data,
            kinematics.configuration(q[i]),
            velocities(kinematics, v[i]),
            velocities(kinematics, a[i]),
        )
        for link, motion in motions.items():
            frame = model.getFrameId(link, pin.FrameType.BODY)
            pose = world_from_base * pin.updateFramePlacement(model, data, frame)
            velocity = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            acceleration = pin.getFrameClassicalAcceleration(
                model, data, frame, pin.LOCAL_WORLD_ALIGNED
            )
            turn = world_from_base.rotation
            expected = {
                "position": pose.translation,
                "R_world_from_frame": pose.rotation,
                "velocity": turn @ velocity.linear,
                "angular_velocity": turn @ velocity.angular,
                "acceleration": turn @ acceleration.linear,
                "angular_acceleration": turn @ acceleration.angular,
            }
            for quantity, value in expected.items():
                np.testing.assert_allclose(
                    getattr(motion, quantity)[i],
                    value,
                    rtol=1e-9,
                    atol=1e-9,
                    err_msg=f"{quantity} of {link}",
                )


def test_the_acceleration_is_the_classical_one_and_not_the_spatial_one():
    kinematics = Kinematics(load_robot("ur3e"))
    model, data = kinematics.model, kinematics.model.createData()
    q, v, a = random_states(kinematics, seed=4)
    motion = kinematics.frame_motion("wrist_3_link", q, v, a)
    pin.forwardKinematics(model, data, kinematics.configuration(q[0]), v[0], a[0])
    frame = model.getFrameId("wrist_3_link", pin.FrameType.BODY)
    spatial = pin.getFrameAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
    missing = np.cross(motion.angular_velocity[0], motion.velocity[0])
    assert np.linalg.norm(missing) > 0.1
    np.testing.assert_allclose(motion.acceleration[0], spatial + missing, atol=1e-10)


def test_a_joint_that_turns_without_end_takes_any_number_of_turns():
    kinematics = Kinematics(load_robot("ur3e"))
    joint = kinematics.model.joints[kinematics.model.getJointId("wrist_3_joint")]
    assert joint.nq == 2  # Pinocchio knows it by cosine and sine
    q = np.radians([[10.0, -80, -70, 20, 30, 40]])
    once, again = (
        kinematics.frame_motion("tool0", q),
        kinematics.frame_motion("tool0", q + np.eye(6)[5] * 6 * np.pi),
    )
    np.testing.assert_allclose(once.R_world_from_frame, again.R_world_from_frame, atol=1e-12)


def test_a_sensor_at_a_lever_arm_feels_the_centripetal_and_the_tangential_acceleration():
    kinematics = Kinematics(load_robot("ur3e"))
    q = np.radians([[0.0, -90, -90, 0, 90, 0]])
    rate, angular_acceleration, arm = 3.0, 7.0, 0.05
    v, a = rate * np.eye(6)[[5]], angular_acceleration * np.eye(6)[[5]]
    centre = kinematics.frame_motion("wrist_3_link", q, v, a)
    out = kinematics.frame_motion(
        "wrist_3_link", q, v, a, offset=Pose(np.eye(3), np.array([arm, 0.0, 0.0]))
    )
    no_gravity = np.zeros(3)
    felt = out.specific_force_in_frame(no_gravity) - centre.specific_force_in_frame(no_gravity)
    np.testing.assert_allclose(
        felt, [[-(rate**2) * arm, angular_acceleration * arm, 0]], atol=1e-12
    )
    np.testing.assert_allclose(out.angular_velocity_in_frame, [[0, 0, rate]], atol=1e-12)


def test_at_rest_an_accelerometer_feels_gravity_upwards_however_the_base_is_mounted():
    for robot in (load_robot("ur3e"), on_a_wall(load_robot("ur3e"))):
        kinematics = Kinematics(robot)
        motion = kinematics.frame_motion("tool0", random_states(kinematics, seed=2)[0])
        in_world = np.einsum(
            "nij,nj->ni", motion.R_world_from_frame, motion.specific_force_in_frame(robot.gravity)
        )
        np.testing.assert_allclose(in_world, np.tile([0, 0, 9.80665], (POSES, 1)), atol=1e-12)


@pytest.mark.parametrize("link", ["wrist_1_link", "wrist_3_link"])
def test_an_ideal_imu_agrees_with_finite_differences_of_its_pose_along_a_planned_motion(link):
    the_plan = plan("quick")
    kinematics = Kinematics(the_plan.robot)
    offset = Pose(
        Rotation.from_euler("ZYX", [0.3, -0.8, 1.1]).as_matrix(), np.array([0.02, 0.045, 0.03])
    )
    (moving,) = the_plan.trajectory.sample_moving(7_000_000, 1_000_000)
    times = moving[(moving > 10_000_000) & (moving < the_plan.trajectory.time_ns[-1] - 10_000_000)]
    step = 200_000  # ns

    def pose(shift: int) -> tuple[np.ndarray, np.ndarray]:
        motion = kinematics.frame_motion(
            link, *the_plan.trajectory.at(times + shift), offset=offset
        )
        return motion.position, motion.R_world_from_frame

    h = step * 1e-9
    (before, R_before), (here, R), (after, R_after) = pose(-step), pose(0), pose(step)
    acceleration = (before - 2 * here + after) / h**2
    turn = Rotation.from_matrix(np.swapaxes(R_before, 1, 2) @ R_after).as_rotvec() / (2 * h)
    # the turn is seen from the frame at the first instant; half of it brings it to the middle
    rate = Rotation.from_rotvec(-turn * h).apply(turn)
    force = np.einsum("nji,nj->ni", R, acceleration + np.array([0, 0, 9.80665]))

    motion = kinematics.frame_motion(link, *the_plan.trajectory.at(times), offset=offset)
    rate_error = np.linalg.norm(motion.angular_velocity_in_frame - rate, axis=1)
    force_error = np.linalg.norm(
        motion.specific_force_in_frame(the_plan.robot.gravity) - force, axis=1
    )
    assert np.linalg.norm(rate, axis=1).max() > 0.5
    assert np.linalg.norm(acceleration, axis=1).max() > 0.3
    assert rate_error.max() < 1e-4 * np.linalg.norm(rate, axis=1).max()
    assert force_error.max() < 1e-4 * np.linalg.norm(force, axis=1).max()


def test_the_angular_acceleration_is_the_derivative_of_the_angular_velocity():
    kinematics = Kinematics(load_robot("panda"))
    t = np.arange(-2, 3)[:, None] * 1e-4
    q0, v0, a0 = (x[:1] for x in random_states(kinematics, seed=9))
    motion = kinematics.frame_motion(
        "panda_link7", q0 + v0 * t + a0 * t**2 / 2, v0 + a0 * t, np.tile(a0, (5, 1))
    )
    slope = (motion.angular_velocity[3] - motion.angular_velocity[1]) / 2e-4
    np.testing.assert_allclose(motion.angular_acceleration[2], slope, rtol=1e-6, atol=1e-5)


def test_the_offset_of_a_sensor_is_written_in_the_axes_of_its_link():
    kinematics = Kinematics(load_robot("ur5e"))
    q = random_states(kinematics, seed=6)[0]
    placement = Placement(rotation_deg={"ZYX": [30, -40, 50]}, position_mm=[10, -20, 30])
    link, sensor = (
        kinematics.frame_motion("forearm_link", q, offset=offset)
        for offset in (None, Pose.from_placement(placement))
    )
    inside = Rotation.from_euler("ZYX", [30, -40, 50], degrees=True).as_matrix()
    np.testing.assert_allclose(
        sensor.R_world_from_frame, link.R_world_from_frame @ inside, atol=1e-14
    )
    np.testing.assert_allclose(
        sensor.position,
        link.position + link.R_world_from_frame @ np.array([0.01, -0.02, 0.03]),
        atol=1e-15,
    )


def test_a_link_the_arm_does_not_have_is_refused_with_those_it_has():
    kinematics = Kinematics(load_robot("ur3e"))
    with pytest.raises(NotFoundError, match=r"unknown link of ur3e 'hand'; known: .*wrist_3_link"):
        kinematics.frame_motion("hand", np.zeros(6))


def test_the_fixed_base_does_not_move():
    kinematics = Kinematics(on_a_wall(load_robot("ur3e")))
    q, v, a = random_states(kinematics, seed=3)
    motion = kinematics.frame_motion("base_link", q, v, a)
    np.testing.assert_allclose(motion.position, np.tile([0.1, -0.2, 0.7], (POSES, 1)), atol=1e-15)
    assert (
        not motion.velocity.any()
        and not motion.acceleration.any()
        and not motion.angular_velocity.any()
    )


def test_a_urdf_without_the_joints_of_the_robot_file_is_refused(tmp_path):
    robot = load_robot("ur3e")
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(robot.urdf.read_text().replace('"wrist_3_joint"', '"wrist_9_joint"'))
    with pytest.raises(FileProblems, match="no movable joint wrist_3_joint"):
        Kinematics(Robot(robot.spec, urdf, robot.text))
