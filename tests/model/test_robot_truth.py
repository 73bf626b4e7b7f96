"""The URDFs of the e-series arms against the manufacturer's DH parameters, computed here from
nothing but NumPy.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest

from testbench.records.specs.robot import load_robot

# Universal Robots, "DH Parameters for calculations of kinematics and dynamics": d [m], a [m], alpha
# [rad] of joints 1 to 6.
ALPHA = [np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0]
DH = {
    "ur3e": ([0.15185, 0, 0, 0.13105, 0.08535, 0.0921], [0, -0.24355, -0.2132, 0, 0, 0]),
    "ur5e": ([0.1625, 0, 0, 0.1333, 0.0997, 0.0996], [0, -0.425, -0.3922, 0, 0, 0]),
    "ur10e": ([0.1807, 0, 0, 0.17415, 0.11985, 0.11655], [0, -0.6127, -0.57155, 0, 0, 0]),
}
LINKS = [
    "shoulder_link",
    "upper_arm_link",
    "forearm_link",
    "wrist_1_link",
    "wrist_2_link",
    "wrist_3_link",
]
TOLERANCE = 1e-9  # metres, and elements of the rotation matrix


def turn(axis: str, angle: float | np.ndarray) -> np.ndarray:
    """Homogeneous rotation by an angle [rad], or by many, about x or z."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.tile(np.eye(4), (*np.shape(angle), 1, 1))
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    matrix[..., i, i], matrix[..., i, j] = c, -s
    matrix[..., j, i], matrix[..., j, j] = s, c
    return matrix


def shift(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """Homogeneous translation [m]."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def dh_frames(name: str, angles: np.ndarray) -> list[np.ndarray]:
    """Poses of the DH frames 0 to 6 in the controller's Base frame, A_i = Rz(theta) Tz(d) Tx(a)
    Rx(alpha), for angles of shape (poses, 6).
    """
    frames = [np.tile(np.eye(4), (len(angles), 1, 1))]
    for theta, d, a, alpha in zip(angles.T, *DH[name], ALPHA, strict=True):
        frames.append(frames[-1] @ turn("z", theta) @ shift(z=d) @ shift(x=a) @ turn("x", alpha))
    return frames


def links_from_dh(name: str) -> dict[str, tuple[int, np.ndarray]]:
    """For each link of the URDF, the DH frame it is fixed to and its constant pose in that frame.

    A DH frame sits at the far end of its link with z along the next joint; the link frame of the
    URDF sits at the near end with z along the link's own joint. So they differ by the second half
    of the DH transform, Tx(a) Rx(alpha), undone; and Base looks the other way than base_link, which
    is turned by pi about z.
    """
    _, a = DH[name]
    fixed = {
        "shoulder_link": (1, turn("x", -np.pi / 2)),
        "upper_arm_link": (2, shift(x=-a[1])),
        "forearm_link": (3, shift(x=-a[2])),
        "wrist_1_link": (4, turn("x", -np.pi / 2)),
        "wrist_2_link": (5, turn("x", np.pi / 2)),
        "wrist_3_link": (6, np.eye(4)),
        "tool0": (6, np.eye(4)),
        # the axes of the flange are the z, x and y of the tool, in that order
        "flange": (6, np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])),
        "base": (0, np.eye(4)),
        "base_link_inertia": (0, np.eye(4)),
        "base_link": (0, turn("z", np.pi)),
    }
    return fixed


def pinocchio_configuration(model: pin.Model, names: list[str], angles: np.ndarray) -> np.ndarray:
    q = pin.neutral(model)
    for name, angle in zip(names, angles, strict=True):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            (np.cos(angle), np.sin(angle)) if joint.nq == 2 else angle
        )
    return q


@pytest.mark.parametrize("name", DH)
def test_every_link_agrees_with_the_dh_parameters_in_a_thousand_poses(name):
    robot = load_robot(name)
    model = pin.buildModelFromUrdf(str(robot.urdf))
    data, fixed = model.createData(), links_from_dh(name)
    bodies = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
    assert set(bodies) == set(fixed)  # no link is left out
    base_link_from_base = turn("z", np.pi)
    rng = np.random.default_rng(20230601)
    poses = rng.uniform(-2 * np.pi, 2 * np.pi, (1000, 6))
    numbers = {link: model.getFrameId(link, pin.FrameType.BODY) for link in fixed}
    found = {link: np.empty((len(poses), 4, 4)) for link in fixed}
    for i, angles in enumerate(poses):
        pin.framesForwardKinematics(
            model, data, pinocchio_configuration(model, robot.joint_names, angles)
        )
        for link, number in numbers.items():
            found[link][i] = data.oMf[number].homogeneous
    frames = dh_frames(name, poses)
    for link, (index, dh_from_link) in fixed.items():
        expected = base_link_from_base @ frames[index] @ dh_from_link
        np.testing.assert_allclose(found[link], expected, rtol=0, atol=TOLERANCE, err_msg=link)


@pytest.mark.parametrize("name", DH)
def test_every_joint_turns_about_the_z_axis_of_its_link(name):
    robot = load_robot(name)
    model = pin.buildModelFromUrdf(str(robot.urdf))
    data = model.createData()
    for column, (joint, link) in enumerate(zip(robot.joint_names, LINKS, strict=True)):
        assert model.joints[model.getJointId(joint)].idx_v == column
        assert model.frames[model.getFrameId(link)].parentJoint == model.getJointId(joint)
        pin.forwardKinematics(model, data, pin.neutral(model), np.eye(model.nv)[column])
        velocity = pin.getFrameVelocity(model, data, model.getFrameId(link), pin.LOCAL)
        np.testing.assert_allclose(velocity.vector, [0, 0, 0, 0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("name", DH)
def test_the_ur_stretches_along_minus_x_of_the_controllers_base_at_zero_angles(name):
    model = pin.buildModelFromUrdf(str(load_robot(name).urdf))
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    d, a = DH[name]
    base = data.oMf[model.getFrameId("base", pin.FrameType.BODY)]
    tool = base.actInv(data.oMf[model.getFrameId("tool0", pin.FrameType.BODY)])
    np.testing.assert_allclose(
        tool.translation, [a[1] + a[2], -(d[3] + d[5]), d[0] - d[4]], atol=1e-12
    )


@pytest.mark.parametrize("name", DH)
def test_the_urdf_holds_right_angles_in_full_precision_and_no_residues(name):
    root = ElementTree.parse(load_robot(name).urdf).getroot()
    exact = {0.0, np.pi / 2, -np.pi / 2, np.pi}
    for origin in root.iter("origin"):
        assert {float(number) for number in origin.get("rpy", "0 0 0").split()} <= exact
        assert all(
            number == 0 or abs(number) > 1e-6
            for number in map(float, origin.get("xyz", "0 0 0").split())
        )


@pytest.mark.parametrize("name", DH)
def test_the_urdf_holds_only_standard_elements_and_attributes(name):
    text = load_robot(name).urdf.read_text()
    tags = {element.tag for element in ElementTree.fromstring(text).iter()}
    assert tags <= {
        "robot",
        "link",
        "joint",
        "parent",
        "child",
        "origin",
        "axis",
        "limit",
        "visual",
        "collision",
        "geometry",
        "mesh",
        "cylinder",
        "inertial",
        "mass",
        "inertia",
        "material",
        "color",
    }
    assert "drake" not in text


@pytest.mark.parametrize("name", DH)
def test_every_moving_link_has_a_mass_and_a_possible_inertia(name):
    model = pin.buildModelFromUrdf(str(load_robot(name).urdf))
    for inertia in list(model.inertias)[1:]:
        principal = np.linalg.eigvalsh(inertia.inertia)
        assert inertia.mass > 0.2
        assert principal[0] > 0 and principal[2] <= principal[0] + principal[1] + 1e-9
