import numpy as np
import pinocchio as pin
import pytest

from testbench.estimation.chain.sensors import chain_sensors
from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.robot import load_robot

SOME = ["shoulder_lift_joint", "wrist_1_joint", "wrist_3_joint"]


def random_pose(rng):
    return Pose(
        rotation.to_matrix(rotation.normalise(rng.normal(size=4))), 0.1 * rng.normal(size=3)
    )


@pytest.fixture(params=["ur3e", "ur10e", "panda"])
def arm(request):
    return Kinematics(load_robot(request.param))


def test_readings_are_those_of_pinocchio(arm):
    """The oracle: angular velocity and classical acceleration of a frame, by Pinocchio's own
    algorithm.
    """
    rng = np.random.default_rng(3)
    n = len(arm.robot.joint_names)
    link = arm.link_names[-1]
    mounting = random_pose(rng)
    chain = chain_sensors(arm, {"s": (link, mounting)}, None, arm.robot.home)
    model = arm.model.copy()
    frame = model.getFrameId(link, pin.FrameType.BODY)
    placed = model.frames[frame].placement * pin.SE3(mounting.R, mounting.position)
    own = model.addFrame(
        pin.Frame("sensor", model.frames[frame].parentJoint, placed, pin.FrameType.OP_FRAME)
    )
    data = model.createData()
    for _ in range(5):
        q, v, a = rng.uniform(-2, 2, (3, n))
        columns = [arm.robot.joint_names.index(name) for name in chain.joints]
        order = [model.joints[model.getJointId(name)].idx_v for name in arm.robot.joint_names]
        rates, accelerations = np.zeros((2, model.nv))
        rates[order], accelerations[order] = v, a
        pin.forwardKinematics(model, data, arm.configuration(q), rates, accelerations)
        pin.updateFramePlacements(model, data)
        R = data.oMf[own].rotation
        force = (
            pin.getFrameClassicalAcceleration(model, data, own, pin.LOCAL).linear
            - R.T @ arm.robot.gravity
        )
        expected = np.concatenate(
            [pin.getFrameVelocity(model, data, own, pin.LOCAL).angular, force]
        )
        found = chain.readings(q[columns], v[columns], a[columns])[0][0]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("joints", [None, SOME])
def test_derivatives_are_those_of_finite_differences_also_with_joints_that_stand_still(
    kinematics, joints
):
    rng = np.random.default_rng(1)
    places = {"a": ("forearm_link", random_pose(rng)), "b": ("wrist_3_link", random_pose(rng))}
    standing = rng.normal(size=6)
    chain = chain_sensors(kinematics, places, joints, standing)
    m = len(chain.joints)
    for _ in range(5):
        state = rng.normal(size=(3, m)) * [[1], [3], [10]]
        _, *slopes = chain.readings(*state)
        for which, slope in enumerate(slopes):
            for j in range(m):
                step = np.zeros((3, m))
                step[which, j] = 1e-5
                numeric = (
                    chain.readings(*(state + step))[0] - chain.readings(*(state - step))[0]
                ) / 2e-5
                np.testing.assert_allclose(
                    slope[:, :, j], numeric, atol=2e-7 * max(1, np.abs(slope).max())
                )


def test_joints_that_stand_still_are_folded_into_the_chain(kinematics):
    rng = np.random.default_rng(2)
    places = {"b": ("wrist_3_link", random_pose(rng))}
    standing = rng.normal(size=6)
    chain = chain_sensors(kinematics, places, SOME, standing)
    q, v, a = rng.normal(size=(3, 3))
    full = np.stack([standing, np.zeros(6), np.zeros(6)])
    columns = [kinematics.robot.joint_names.index(name) for name in SOME]
    full[:, columns] = q, v, a
    motion = kinematics.frame_motion("wrist_3_link", *full, offset=places["b"][1])
    expected = [
        *motion.angular_velocity_in_frame[0],
        *motion.specific_force_in_frame(kinematics.robot.gravity)[0],
    ]
    np.testing.assert_allclose(chain.readings(q, v, a)[0][0], expected, atol=1e-12)


def test_a_joint_that_carries_no_sensor_is_refused(kinematics):
    places = {"b": ("forearm_link", Pose(np.eye(3), np.zeros(3)))}
    with pytest.raises(InputError, match="wrist_3_joint carries none of the sensors b"):
        chain_sensors(kinematics, places, ["elbow_joint", "wrist_3_joint"], kinematics.robot.home)
    with pytest.raises(InputError, match="no joint of ur3e"):
        chain_sensors(
            kinematics, {"base": ("base_link", places["b"][1])}, None, kinematics.robot.home
        )
