"""URDFs as exporters and people leave them: limits, axes, mimics and meshes, right or refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from testbench.exceptions import FileProblems, InputError
from testbench.model.collision import CollisionModel
from testbench.model.kinematics import Kinematics
from testbench.records.specs.robot import load_robot

LIMIT = '<limit lower="-3" upper="3" effort="10" velocity="2"/>'


@pytest.fixture
def arm(tmp_path):
    """Writes an arm of three joints whose second one is as told, and gives its path."""

    def write(second=LIMIT, axis='<axis xyz="0 1 0"/>', kind="revolute", third="", mesh="") -> Path:
        joints = [("revolute", '<axis xyz="0 0 1"/>', LIMIT), (kind, axis, second)]
        joints.append(("revolute", '<axis xyz="0 1 0"/>', LIMIT + third))
        lines = ['<robot name="arm">', '<link name="l0"/>']
        lines += [f'<link name="l{i}"/>' for i in (1, 3)]
        lines += [f'<link name="l2">{mesh}</link>']
        lines += [
            f'<joint name="j{i}" type="{of}"><parent link="l{i - 1}"/><child link="l{i}"/>'
            f'<origin xyz="0 0 0.2"/>{about}{limit}</joint>'
            for i, (of, about, limit) in enumerate(joints, 1)
        ]
        path = tmp_path / "my_arm" / "urdf" / "arm.urdf"
        path.parent.mkdir(parents=True)
        path.write_text("\n".join([*lines, "</robot>\n"]))
        return path

    return write


def limit(**given: str) -> str:
    stated = {"effort": "10", "velocity": "2"} | given
    return f"<limit {' '.join(f'{key}=' + repr(value) for key, value in stated.items())}/>"


@pytest.mark.parametrize(
    ("second", "range_deg"),
    [
        (limit(lower="-1.0"), [np.degrees(-1), 0]),
        (limit(upper="1.0"), [0, np.degrees(1)]),
        (limit(lower="-1e16", upper="1e16"), None),
        (limit(lower="-3.1e0", upper=" 3 "), np.degrees([-3.1, 3])),
    ],
)
def test_a_limit_that_is_not_stated_is_zero_and_said(arm, second, range_deg):
    spec = load_robot(arm(second)).spec
    found = spec.joints[1].position_deg
    if range_deg is None:
        assert found is None
    else:
        np.testing.assert_allclose(found, range_deg)
    said = [one for one in spec.assumptions if "joint j2 states no" in one]
    assert len(said) == (second.count("lower") + second.count("upper") == 1)


@pytest.mark.parametrize(
    ("second", "said"),
    [
        (limit(lower="0", upper="0", velocity="0"), "no range: lower 0, upper 0 rad"),
        (limit(lower="2", upper="-2"), "lower 2, upper -2 rad.*they are swapped"),
        (limit(lower="1"), r"lower 1, upper 0 rad \(upper not stated, which URDF takes for 0\)"),
        (limit(), r"\(lower and upper not stated, which URDF takes for 0\)"),
        ("", r"is revolute and has no <limit .*type=\"continuous\""),
        (limit(lower="-inf", upper="inf"), 'limits are -inf to inf.*type="continuous"'),
        (limit(lower="-1", upper="inf"), "limits are -1 to inf"),
        (limit(lower="nan", upper="1"), "limits are nan to 1"),
        (limit(lower="-pi/2", upper="1"), "its lower '-pi/2' is no number.*in radians"),
        (limit(lower="-1", upper="90deg"), "its upper '90deg' is no number"),
        (limit(lower="-1", upper="1", velocity="fast"), "its velocity 'fast' is no number"),
        (limit(lower="-1", upper="1", velocity="-2"), "its velocity is -2"),
        (limit(lower="-1", upper="1", velocity="inf"), "its velocity is inf"),
        ('<limit lower="-1" upper="1" effort="1"/>', "states no velocity"),
        ('<limit lower="-1" upper="1" velocity="1"/>', "states no effort"),
    ],
)
def test_limits_that_leave_no_range_are_refused_with_joint_and_line(arm, second, said):
    path = arm(second)
    with pytest.raises(FileProblems, match=rf"arm\.urdf:7: joint j2: .*{said}"):
        load_robot(path)


def test_every_joint_without_a_range_is_named_at_once(arm):
    path = arm()
    path.write_text(path.read_text().replace(LIMIT, limit(lower="0", upper="0")))
    with pytest.raises(FileProblems) as refused:
        load_robot(path)
    assert [problem.line for problem in refused.value.problems] == [6, 7, 8]


@pytest.mark.parametrize("xyz", ["0 0 0", "0 0", "nan 0 0", "z"])
def test_a_joint_without_an_axis_is_refused(arm, xyz):
    with pytest.raises(FileProblems, match=r"arm\.urdf:7: joint j2: .*(no axis|no number)"):
        load_robot(arm(axis=f'<axis xyz="{xyz}"/>'))


def test_a_zero_axis_below_a_robot_file_is_refused_too(arm):
    robot = load_robot(arm())
    path = robot.urdf
    path.write_text(path.read_text().replace('xyz="0 1 0"', 'xyz="0 0 0"', 1))
    with pytest.raises(FileProblems, match=r"arm\.urdf:7: joint j2: it has no axis"):
        Kinematics(robot)


def test_an_axis_of_any_length_and_one_not_stated_turn_the_link(arm):
    for text, expected in (('<axis xyz="0 5 0"/>', [0, 1, 0]), ("", [1, 0, 0])):
        path = arm(axis=text)
        motion = Kinematics(load_robot(path)).frame_motion(
            "l2", np.zeros((1, 3)), np.array([[0, 1.0, 0]])
        )
        np.testing.assert_allclose(motion.angular_velocity_in_frame[0], expected, atol=1e-12)
        path.unlink()
        path.parent.rmdir()
        path.parent.parent.rmdir()


@pytest.mark.parametrize(
    ("second", "said"),
    [
        (limit(lower="-180", upper="180", velocity="180"), "j2 may turn 29 times .*at 10313 deg/s"),
        (limit(lower="-5", upper="5", velocity="90"), "by them j2 turns at 5157 deg/s"),
        (limit(lower="0", upper="270"), "by them j2 may turn 43 times round"),
    ],
)
def test_limits_in_degrees_are_doubted(arm, second, said):
    (sentence,) = [one for one in load_robot(arm(second)).spec.assumptions if "degrees?" in one]
    assert re.search(said, sentence) and "j1" not in sentence


def test_limits_in_radians_are_not_doubted(arm):
    second = limit(lower="-6.29", upper="6.29", velocity="12.6")
    assert len(load_robot(arm(second)).spec.assumptions) == 1


def test_a_link_beyond_a_mimic_joint_carries_no_sensor(arm):
    path = arm(third='<mimic joint="j2" multiplier="-1" offset="0"/>')
    kinematics = Kinematics(load_robot(path))
    assert kinematics.robot.joint_names == ["j1", "j2"]
    kinematics.check_carrier("l2")
    said = r"arm\.urdf:8: joint j3: it mimics j2, which is not followed.*the link l3"
    with pytest.raises(FileProblems, match=said):
        kinematics.check_carrier("l3")


def cube(path: Path) -> None:
    """A tetrahedron of 0.1 m as STL."""
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    lines = ["solid s"]
    for left_out in range(4):
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex " + " ".join(map(str, c)) for i, c in enumerate(corners) if i != left_out]
        lines += ["endloop", "endfacet"]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([*lines, "endsolid s\n"]))


@pytest.mark.parametrize(
    "address",
    ["package://my_arm/meshes/l2.stl", "package://beside/l2.stl", "../meshes/l2.stl"],
)
def test_a_mesh_is_found_in_the_package_that_the_urdf_is_in_or_beside(arm, tmp_path, address):
    cube(tmp_path / "my_arm" / "meshes" / "l2.stl")
    cube(tmp_path / "beside" / "l2.stl")
    mesh = f'<collision><geometry><mesh filename="{address}"/></geometry></collision>'
    model = CollisionModel(Kinematics(load_robot(arm(mesh=mesh))))
    assert model.links == ["l2"]


def test_a_mesh_that_is_not_there_says_where_it_is_looked_for(arm):
    mesh = '<collision><geometry><mesh filename="package://other/l2.stl"/></geometry></collision>'
    kinematics = Kinematics(load_robot(arm(mesh=mesh)))
    with pytest.raises(InputError, match=r"package://other/l2.stl.*folder NAME.*mesh_packages"):
        CollisionModel(kinematics)
