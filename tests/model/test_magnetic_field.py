"""The magnetic field about an arm, against formulas and kinematics written down anew; and what the
robot file says of it.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from testbench import plan
from testbench.exceptions import InputError
from testbench.model.kinematics import Kinematics, Pose
from testbench.model.magnetic_field import (
    MagneticField,
    describe_environment,
    dipole_field,
    induced_moment,
)
from testbench.records.specs.magnetism import MagneticDipole
from testbench.records.specs.protocol import Environment
from testbench.records.specs.robot import Robot, load_robot

EARTH = np.array([0.0, 24.0, -39.0])
MU_0 = 4e-7 * np.pi


@pytest.fixture(scope="module")
def arm() -> Robot:
    return load_robot("ur3e")


def link_pose(robot: Robot, link: str, q: np.ndarray) -> np.ndarray:
    """Pose of a link in the base, shape (4, 4), by the URDF's own numbers multiplied out."""
    tree = ElementTree.parse(robot.urdf)
    parent = {joint.find("child").get("link"): joint for joint in tree.iter("joint")}
    pose = np.eye(4)
    while link in parent:
        joint = parent[link]
        step = np.eye(4)
        origin = joint.find("origin")
        step[:3, :3] = Rotation.from_euler(
            "xyz", [float(v) for v in origin.get("rpy").split()]
        ).as_matrix()
        step[:3, 3] = [float(v) for v in origin.get("xyz").split()]
        if joint.get("name") in robot.joint_names:
            axis = np.array([float(v) for v in joint.find("axis").get("xyz").split()])
            step[:3, :3] @= Rotation.from_rotvec(
                q[robot.joint_names.index(joint.get("name"))] * axis
            ).as_matrix()
        pose = step @ pose
        link = joint.find("parent").get("link")
    return pose


def field_by_potential(place: np.ndarray, source: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """B = -mu_0 grad(m . r / (4 pi r^3)), by differences [uT]."""

    def potential(x: np.ndarray) -> float:
        r = x - source
        return float(MU_0 * moment @ r / (4 * np.pi * np.linalg.norm(r) ** 3))

    step = 1e-5
    return -1e6 * np.array(
        [(potential(place + e) - potential(place - e)) / (2 * step) for e in step * np.eye(3)]
    )


def test_the_field_about_the_arm_is_that_of_its_dipoles_where_the_joints_have_brought_them(arm):
    rng = np.random.default_rng(5)
    kinematics = Kinematics(arm)
    extra = MagneticDipole(
        link="forearm_link",
        position_mm=[-100, 20, 30],
        moment_A_m2=[0.1, -0.2, 0.05],
        iron_radius_mm=30,
    )
    field = MagneticField(Environment(dipoles=[extra]), kinematics)
    q = rng.uniform(-np.pi, np.pi, (6, 6))
    place = rng.uniform(-0.2, 0.2, (6, 3)) + [0.1, 0.4, 0.9]
    found = field.at(place, q)
    for row in range(6):
        expected = EARTH.copy()
        for dipole in [*arm.spec.magnetism.dipoles, extra]:
            pose = link_pose(arm, dipole.link, q[row])
            source = pose[:3, :3] @ (np.array(dipole.position_mm) / 1000) + pose[:3, 3]
            moment = pose[:3, :3] @ dipole.moment_A_m2
            moment = moment + 4 * np.pi * (dipole.iron_radius_mm / 1000) ** 3 * EARTH * 1e-6 / MU_0
            expected += field_by_potential(place[row], source, moment)
        np.testing.assert_allclose(found[row], expected, atol=1e-4)


def test_a_permanent_dipole_on_its_own_link_is_constant_in_the_sensor_and_iron_is_not(arm):
    kinematics = Kinematics(arm)
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (50, 6))
    motion = kinematics.frame_motion(
        "wrist_3_link", q, offset=Pose(np.eye(3), np.array([0.0, 0.03, 0.06]))
    )
    seen = {}
    for kind, values in {
        "hard": {"moment_A_m2": [0.01, 0.0, 0.02]},
        "soft": {"iron_radius_mm": 25.0},
    }.items():
        dipole = MagneticDipole(link="wrist_3_link", **values)  # type: ignore[arg-type]
        field = MagneticField(Environment(dipoles=[dipole], arm_magnetism=False), kinematics).at(
            motion.position, q
        )
        seen[kind] = np.einsum("nji,nj->ni", motion.R_world_from_frame, field - EARTH)
    np.testing.assert_allclose(seen["hard"], np.tile(seen["hard"][0], (50, 1)), atol=1e-10)
    assert np.linalg.norm(seen["hard"][0]) > 5
    assert seen["soft"].std(axis=0).min() > 1


def test_iron_of_large_permeability_lets_no_field_run_along_its_surface():
    radius, field = 0.08, np.array([3.0, -20.0, 31.0])
    moment = induced_moment(field, radius)
    normals = np.random.default_rng(2).standard_normal((30, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    total = field + dipole_field(radius * normals, moment)
    along = total - normals * np.sum(total * normals, axis=1, keepdims=True)
    np.testing.assert_allclose(along, 0, atol=1e-9)


def test_the_joints_of_the_ur3e_are_magnetic_by_the_rule_that_its_file_states(arm):
    tree = ElementTree.parse(arm.urdf)
    inertial = {link.get("name"): link.find("inertial") for link in tree.iter("link")}
    next_joint = {
        joint.find("parent").get("link"): joint
        for joint in tree.iter("joint")
        if joint.get("name") in arm.joint_names
    }
    joints = [dipole for dipole in arm.spec.magnetism.dipoles if dipole.name.startswith("joint")]
    assert [dipole.link for dipole in joints] == [
        next(link for link, joint in next_joint.items() if joint.get("name") == name)
        for name in arm.joint_names
    ]
    for dipole in joints:
        mass = float(inertial[dipole.link].find("mass").get("value"))
        centre = [float(v) for v in inertial[dipole.link].find("origin").get("xyz").split()]
        turn = [float(v) for v in next_joint[dipole.link].find("origin").get("rpy").split()]
        axis = Rotation.from_euler("xyz", turn).as_matrix()[:, 2]
        np.testing.assert_allclose(dipole.position_mm, 1000 * np.array(centre), atol=0.1)
        np.testing.assert_allclose(dipole.moment_A_m2, 0.025 * mass * axis, atol=6e-4)
        steel = (3 * 0.4 * mass / 7850 / (4 * np.pi)) ** (1 / 3)
        assert dipole.iron_radius_mm == pytest.approx(1000 * steel, abs=0.5)
    far = np.random.default_rng(0).standard_normal((100_000, 3))
    far *= 0.2 / np.linalg.norm(far, axis=1)[:, None]
    rms = np.sqrt(np.mean(np.sum(dipole_field(far, np.array([0, 0, 0.025 * 2.2])) ** 2, axis=1)))
    assert rms == pytest.approx(1.0, abs=0.05)


def test_bench_and_floor_turn_the_heading_of_the_field_as_was_measured_above_a_floor(arm):
    kinematics = Kinematics(arm)
    fixed = [dipole for dipole in arm.spec.magnetism.dipoles if dipole.link == "base_link"]
    assert len(fixed) == 14
    field = MagneticField(Environment(dipoles=fixed, arm_magnetism=False), kinematics)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 21), np.linspace(-0.5, 0.5, 21))
    for height, published in ((0.05, 29.0), (1.0, 3.0)):  # de Vries et al. 2009
        place = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])
        found = field.at(place, np.zeros((len(place), 6)))
        assert np.degrees(np.arctan2(-found[:, 0], found[:, 1])).std() == pytest.approx(
            published, rel=0.02
        )


def test_the_arms_own_disturbance_can_be_left_out(arm):
    kinematics = Kinematics(arm)
    place, q = np.array([[0.1, 0.2, 0.3]]), np.zeros((1, 6))
    np.testing.assert_allclose(
        MagneticField(Environment(arm_magnetism=False), kinematics).at(place, q), EARTH[None]
    )
    assert np.abs(MagneticField(Environment(), kinematics).at(place, q) - EARTH).max() > 1
    assert describe_environment(Environment(arm_magnetism=False), kinematics)["dipoles"] == []


def test_a_dipole_without_moment_or_iron_and_one_on_an_unknown_link_are_refused(arm, tmp_path):
    with pytest.raises(ValidationError, match="needs moment_A_m2 or iron_radius_mm"):
        MagneticDipole(link="wrist_3_link")
    folder = tmp_path / "bent"
    folder.mkdir()
    (folder / "ur3e.urdf").symlink_to(arm.urdf)
    (folder / "robot.yaml").write_text(
        arm.text.replace("link: shoulder_link, position", "link: shoulder, position")
    )
    with pytest.raises(InputError, match="magnetism, dipole 'joint 2'"):
        plan("quick", robot=folder)


def test_a_dipole_gives_twice_the_field_on_its_axis_that_it_gives_beside_it():
    moment, distance = 0.5, 0.2
    on_axis, beside = dipole_field(
        np.array([[0, 0, distance], [distance, 0, 0.0]]), np.array([0, 0, moment])
    )
    on_axis_uT = 1e6 * 4e-7 * np.pi / (2 * np.pi) * moment / distance**3  # mu_0 m / (2 pi r^3)
    np.testing.assert_allclose(on_axis, [0, 0, on_axis_uT], rtol=1e-9)
    np.testing.assert_allclose(beside, [0, 0, -on_axis_uT / 2], rtol=1e-9)


def test_a_dipoles_field_has_no_sources_and_no_whirls():
    moment, step = np.array([0.3, -0.2, 0.7]), 1e-5
    here = np.array([0.15, 0.1, -0.2])
    slope = np.stack(
        [
            (dipole_field(here[None] + e, moment)[0] - dipole_field(here[None] - e, moment)[0])
            / (2 * step)
            for e in step * np.eye(3)
        ]
    )  # slope[i, j] = d B_j / d x_i
    scale = np.abs(slope).max()
    assert abs(np.trace(slope)) < 1e-6 * scale
    np.testing.assert_allclose(slope, slope.T, atol=1e-6 * scale)
