"""Robots are found by name, by path and as bare URDFs; what is wrong with a robot file is said with
its place.
"""

from __future__ import annotations

import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.records.specs.robot import Robot, list_robots, load_robot
from testbench.records.specs.shipped import shipped_folder

OWN = ["ur3e", "ur5e", "ur10e"]
UFACTORY = ["xarm6"]
GIMBALS = ["gimvebo"]
CATALOGUE = ["ur3", "ur5", "ur10", "panda", "kinova", "xarm7", "z1", "so100", "so101"]
MODELS = ["pendulum", "squat_2dof", "lower_limb"]
VENDOR_ORDER = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]

ONE_JOINT = """<robot name="one">
  <link name="a"/><link name="b"/>
  <joint name="swing" type="revolute">
    <parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" velocity="3" effort="1"/>
  </joint>
</robot>
"""

# The protocol poses of the elbow bench [deg].
CALIBRATION_3D = [
    (0, -90, -90, -90, 90, 180),
    (0, -90, -90, 90, 90, 180),
    (0, -90, -90, -90, 180, 180),
    (0, -90, -90, -90, 0, 180),
    (0, -90, -90, -180, 0, 180),
    (0, -90, -90, 0, 0, 180),
]
CALIBRATION_2D = [(0, -90, -90, 0, 90, 0), (0, -90, -90, -90, 90, 0), (0, -90, -90, 90, 90, 0)]
EVALUATION = [(180 + d, -90, -90, 0, 90 - d, f) for d in range(-20, 21, 2) for f in range(0, 71, 5)]


class Bodies:
    """Clearances of a robot, computed here from its URDF alone."""

    def __init__(self, robot: Robot):
        full = pin.buildModelFromUrdf(str(robot.urdf))
        folders = [str(folder) for folder in robot.mesh_folders()]
        geometry = pin.buildGeomFromUrdf(full, str(robot.urdf), pin.COLLISION, package_dirs=folders)
        locked = [i for i in range(1, full.njoints) if full.names[i] not in robot.joint_names]
        if locked:
            full, geometry = pin.buildReducedModel(full, geometry, locked, pin.neutral(full))
        self.robot, self.model, self.geometry = robot, full, geometry
        joints = [body.parentJoint for body in geometry.geometryObjects]
        exempt = [{*pair} for pair in robot.spec.collision.ignore]
        for i in range(geometry.ngeoms):
            for j in range(i + 1, geometry.ngeoms):
                first, second = joints[i], joints[j]
                neighbours = (
                    first == second
                    or first == full.parents[second]
                    or second == full.parents[first]
                )
                if not neighbours and {self.link(i), self.link(j)} not in exempt:
                    geometry.addCollisionPair(pin.CollisionPair(i, j))
        self.data, self.geometry_data = full.createData(), pin.GeometryData(geometry)

    def link(self, body: int) -> str:
        return self.model.frames[self.geometry.geometryObjects[body].parentFrame].name

    def configuration(self, degrees) -> np.ndarray:
        q = pin.neutral(self.model)
        for name, angle in zip(self.robot.joint_names, np.radians(degrees), strict=True):
            joint = self.model.joints[self.model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                (np.cos(angle), np.sin(angle)) if joint.nq == 2 else angle
            )
        return q

    def touching(self, degrees, margin_mm: float) -> set[frozenset[str]]:
        """Pairs of links closer than the margin."""
        for request in self.geometry_data.collisionRequests:
            request.security_margin = 1e-3 * margin_mm
        pin.computeCollisions(
            self.model,
            self.data,
            self.geometry,
            self.geometry_data,
            self.configuration(degrees),
            False,
        )
        results = zip(
            self.geometry.collisionPairs, self.geometry_data.collisionResults, strict=True
        )
        return {
            frozenset((self.link(p.first), self.link(p.second)))
            for p, result in results
            if result.isCollision()
        }

    def lowest_mm(self, degrees) -> float:
        """Lowest point above the plane z = 0 of the cylinders that do not stand on it, [mm]."""
        pin.forwardKinematics(self.model, self.data, self.configuration(degrees))
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.geometry_data)
        lowest = np.inf
        for i, (body, place) in enumerate(
            zip(self.geometry.geometryObjects, self.geometry_data.oMg, strict=True)
        ):
            if self.link(i) not in self.robot.spec.floor.ignore:
                upright = abs(place.rotation[2, 2])
                reach = (
                    upright * body.geometry.halfLength
                    + np.sqrt(max(0.0, 1 - upright**2)) * body.geometry.radius
                )
                lowest = min(lowest, place.translation[2] - reach)
        return 1e3 * lowest


def between(first, second, step_deg: float = 2.0) -> np.ndarray:
    """Poses on the straight line in joint space from one pose to another, both included."""
    count = max(1, int(np.ceil(np.abs(np.subtract(second, first)).max() / step_deg)))
    return np.linspace(first, second, count + 1)


@pytest.mark.parametrize("name", OWN + UFACTORY + GIMBALS + MODELS + CATALOGUE)
def test_every_shipped_robot_loads_and_its_urdf_has_the_joints(name):
    robot = load_robot(name)
    model = pin.buildModelFromUrdf(str(robot.urdf))
    assert robot.name == name
    assert [joint for joint in robot.joint_names if not model.existJointName(joint)] == []
    assert robot.home.shape == robot.velocity_limits.shape == (len(robot.joint_names),)


@pytest.mark.parametrize("name", OWN + UFACTORY + GIMBALS + MODELS + CATALOGUE)
def test_every_limit_has_a_why(name):
    for joint in load_robot(name).spec.joints:
        assert len(joint.why) > 30, joint.name


@pytest.mark.parametrize("name", OWN + UFACTORY + GIMBALS + MODELS + CATALOGUE)
def test_every_home_is_within_limits_and_free_of_collisions(name):
    robot = load_robot(name)
    assert np.all(robot.position_limits[:, 0] <= robot.home) and np.all(
        robot.home <= robot.position_limits[:, 1]
    )
    assert Bodies(robot).touching(robot.spec.home_deg, robot.spec.collision.margin_mm) == set()


def test_the_list_names_every_robot_with_a_line_on_each():
    robots = list_robots()
    assert set(OWN + UFACTORY + GIMBALS + MODELS + CATALOGUE) == set(robots)
    assert all(robots.values())


def test_every_folder_of_a_robot_says_where_it_comes_from():
    for name in MODELS:
        text = (shipped_folder("robots") / name / "SOURCE.md").read_text()
        assert "Winter" in text and "licence" in text.lower()
    for name in OWN + UFACTORY:
        text = (shipped_folder("robots") / name / "SOURCE.md").read_text()
        assert "DH" in text and "licence" in text.lower()


@pytest.mark.parametrize("name", OWN)
def test_an_e_series_arm_keeps_the_vendors_joint_order_and_explains_floor_servo_and_collisions(
    name,
):
    spec = load_robot(name).spec
    assert [joint.name for joint in spec.joints] == VENDOR_ORDER
    assert spec.floor.why and spec.servo.why and spec.collision.why


def test_wrist_3_of_the_ur3e_alone_turns_without_end():
    assert np.isinf(load_robot("ur3e").position_limits).all(axis=1).tolist() == [False] * 5 + [True]
    assert not np.isinf(load_robot("ur5e").position_limits).any()
    assert not np.isinf(load_robot("ur10e").position_limits).any()


@pytest.mark.parametrize("name", OWN + MODELS)
def test_robot_file_and_urdf_agree_on_position_and_velocity(name):
    robot = load_robot(name)
    model = pin.buildModelFromUrdf(str(robot.urdf))
    for i, joint in enumerate(robot.joint_names):
        found = model.joints[model.getJointId(joint)]
        assert model.velocityLimit[found.idx_v] == pytest.approx(
            robot.velocity_limits[i], abs=1e-12
        )
        if np.isfinite(robot.position_limits[i]).all():
            limits = [model.lowerPositionLimit[found.idx_q], model.upperPositionLimit[found.idx_q]]
            assert limits == pytest.approx(robot.position_limits[i], abs=1e-12)
        else:
            assert found.nq == 2  # a continuous joint


@pytest.mark.parametrize("name", OWN)
def test_every_mesh_the_urdf_names_exists(name):
    robot = load_robot(name)
    model = pin.buildModelFromUrdf(str(robot.urdf))
    folders = [str(folder) for folder in robot.mesh_folders()]
    visual = pin.buildGeomFromUrdf(model, str(robot.urdf), pin.VISUAL, package_dirs=folders)
    assert visual.ngeoms >= 7
    for body in visual.geometryObjects:
        assert name == "ur10e" or Path(body.meshPath).is_file()


def test_the_protocol_poses_and_the_moves_between_them_are_free_on_the_ur3e():
    robot = load_robot("ur3e")
    bodies, home = Bodies(robot), robot.spec.home_deg
    margin = robot.spec.collision.margin_mm
    for poses in (CALIBRATION_3D, CALIBRATION_2D, EVALUATION):
        tour = [home, *poses, home]
        for first, second in pairwise(tour):
            for pose in between(first, second):
                assert bodies.touching(pose, margin) == set(), pose
                assert bodies.lowest_mm(pose) > margin, pose


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("elbow_deg", [175, -175])
def test_folding_the_forearm_onto_the_shoulder_collides(name, elbow_deg):
    assert frozenset(("shoulder_link", "forearm_link")) in Bodies(load_robot(name)).touching(
        (0, -90, elbow_deg, 0, 0, 0), 0.0
    )


def test_folding_the_forearm_into_the_base_collides():
    touching = Bodies(load_robot("ur3e")).touching((0, -165, -150, 0, 0, 0), 0.0)
    assert frozenset(("base_link_inertia", "forearm_link")) in touching


@pytest.mark.parametrize("name", OWN)
def test_an_arm_that_bends_below_its_base_reaches_through_the_floor(name):
    assert Bodies(load_robot(name)).lowest_mm((0, 30, 0, 0, 0, 0)) < 0


def test_a_robot_loads_by_the_path_of_its_file_or_folder():
    folder = shipped_folder("robots") / "ur3e"
    by_name = load_robot("ur3e")
    for path in (folder, str(folder), folder / "robot.yaml"):
        assert load_robot(path).spec == by_name.spec
        assert load_robot(path).urdf == by_name.urdf


def test_the_text_of_a_robot_is_its_file_verbatim():
    assert load_robot("ur3e").text == (shipped_folder("robots") / "ur3e" / "robot.yaml").read_text()


def test_a_robot_folder_can_be_copied_elsewhere(tmp_path):
    copy = shutil.copytree(shipped_folder("robots") / "ur3e", tmp_path / "mine")
    assert load_robot(copy).urdf == (copy / "ur3e.urdf").resolve()


def test_a_bare_urdf_loads_with_what_it_does_not_say_assumed_and_said(tmp_path):
    path = tmp_path / "one.urdf"
    path.write_text(ONE_JOINT)
    robot = load_robot(path)
    assert robot.joint_names == ["swing"]
    np.testing.assert_allclose(robot.position_limits, [[-1, 2]])
    np.testing.assert_allclose(robot.velocity_limits, [3])
    np.testing.assert_allclose(robot.home, [0.5])
    assert "assumed" in robot.spec.joints[0].why


def test_a_bare_urdf_with_continuous_joints_has_unlimited_positions(tmp_path):
    path = tmp_path / "one.urdf"
    path.write_text(
        ONE_JOINT.replace("revolute", "continuous").replace('lower="-1" upper="2" ', "")
    )
    assert np.isinf(load_robot(path).position_limits).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "not a readable URDF"),
        ("<sdf/>", "not a URDF"),
        ('<robot name="x"><link name="a"/></robot>', "movable joint"),
    ],
)
def test_a_file_that_is_no_urdf_is_refused(tmp_path, text, message):
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(FileProblems, match=message):
        load_robot(path)


def test_an_unknown_name_lists_those_that_exist():
    with pytest.raises(NotFoundError) as caught:
        load_robot("ur4e")
    assert all(name in str(caught.value) for name in ["ur4e", *OWN, *MODELS, *CATALOGUE])


def test_a_path_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.yaml does not exist"):
        load_robot(tmp_path / "nowhere.yaml")


def test_a_malformed_robot_file_gives_file_and_line_of_every_fault(tmp_path):
    path = tmp_path / "robot.yaml"
    text = (shipped_folder("robots") / "ur5e" / "robot.yaml").read_text()
    shutil.copy(load_robot("ur5e").urdf, tmp_path)
    faulty = text.replace("velocity_deg_s: 180", "velocity_deg_s: fast", 1).replace(
        "margin_mm:", "margin_cm:", 1
    )
    path.write_text(faulty)
    with pytest.raises(FileProblems) as caught:
        load_robot(path)
    lines = faulty.splitlines()
    for needle, message in (
        ("velocity_deg_s: fast", "velocity_deg_s"),
        ("margin_cm", "unknown key 'margin_cm'"),
    ):
        number = 1 + next(i for i, line in enumerate(lines) if needle in line)
        assert any(
            part.startswith(f"{path}:{number}:") and message in part
            for part in str(caught.value).splitlines()
        )


def test_a_missing_urdf_is_reported_at_its_line(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text((shipped_folder("robots") / "ur5e" / "robot.yaml").read_text())
    number = 1 + next(
        i for i, line in enumerate(path.read_text().splitlines()) if line.startswith("urdf:")
    )
    with pytest.raises(FileProblems, match=rf"robot\.yaml:{number}:.*ur5e\.urdf does not exist"):
        load_robot(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("[-360, 360]", "[360, -360]"), "must be ordered"),
        (("home_deg: [0, ", "home_deg: ["), "home_deg has 5 angles, the arm has 6 joints"),
        (
            ("joint_angle_deg: 0.1", "joint_angle_deg: [0.1, 0.1]"),
            "joint_angle_deg has 2 values, the arm has 6 joints",
        ),
        (("joint_angle_deg: 0.1", "joint_angle_deg: -0.1"), "must not be negative"),
    ],
)
def test_limits_out_of_order_and_a_home_of_the_wrong_length_are_refused(tmp_path, change, message):
    shutil.copy(load_robot("ur5e").urdf, tmp_path)
    (tmp_path / "robot.yaml").write_text(
        (shipped_folder("robots") / "ur5e" / "robot.yaml").read_text().replace(*change, 1)
    )
    with pytest.raises(FileProblems, match=message):
        load_robot(tmp_path)


def test_the_uncertainty_of_the_kinematics_is_one_number_or_one_for_each_joint(tmp_path):
    shutil.copy(load_robot("ur5e").urdf, tmp_path)
    text = (shipped_folder("robots") / "ur5e" / "robot.yaml").read_text()
    np.testing.assert_allclose(load_robot("ur5e").joint_angle_uncertainty, np.radians([0.1] * 6))
    each = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]
    (tmp_path / "robot.yaml").write_text(
        text.replace("joint_angle_deg: 0.1", f"joint_angle_deg: {each}", 1)
    )
    np.testing.assert_allclose(load_robot(tmp_path).joint_angle_uncertainty, np.radians(each))


def test_numbers_known_to_a_quarter_have_eight_degrees_of_freedom():
    assert load_robot("ur3e").spec.uncertainty.degrees_of_freedom == pytest.approx(
        8
    )  # JCGM 100:2008, G.4.2
