"""The bench as it is drawn: bodies where the arm has them, sensors where the protocol puts them."""

from __future__ import annotations

import re
from html import unescape

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from testbench.frames import NANOSECONDS
from testbench.model.collision import Solid, solids
from testbench.model.kinematics import Kinematics
from testbench.records.specs.robot import load_robot
from testbench.reporting.page.scene import (
    HEIGHT,
    WIDTH,
    Body,
    Placed,
    Scene,
    drawing,
    turnable,
    view_of,
)
from testbench.reporting.sections.bench import bench_scene
from tests.reporting.conftest import Judged


def enclosed(solid: Solid) -> float:
    """Volume by the divergence theorem: positive where every face looks outwards [m^3]."""
    a, b, c = (solid.corners[solid.triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", ["ur3e", "xarm6", "lower_limb", "pendulum"])
def test_bodies_are_closed_and_look_outwards(name: str) -> None:
    robot = load_robot(name)
    found = solids(Kinematics(robot), np.radians(robot.spec.home_deg))
    assert found
    for solid in found:
        assert enclosed(solid) == pytest.approx(ConvexHull(solid.corners).volume, rel=1e-6)


def test_a_body_goes_with_its_link() -> None:
    robot = load_robot("ur3e")
    kinematics = Kinematics(robot)
    q = np.radians([[0.0, -90, 0, -90, 0, 0], [90.0, -60, 40, -30, 20, 10]])
    for link in ("forearm_link", "wrist_3_link"):
        motion = kinematics.frame_motion(link, q)
        seen = []
        for i in range(2):
            own = [solid.corners for solid in solids(kinematics, q[i]) if solid.link == link]
            corners = np.concatenate(own) - motion.position[i]
            seen.append(corners @ motion.R_world_from_frame[i])
        assert seen[0] == pytest.approx(seen[1], abs=1e-9)


def test_sensors_sit_where_the_truth_says(quick: Judged) -> None:
    scene = bench_scene(quick.session)
    assert scene is not None and "reference pose" in scene.words
    reference = [step for step in quick.session.steps if step.role == "reference"][-1]
    for sensor in scene.sensors:
        truth = quick.session.truth(sensor.name)
        assert truth is not None
        row = int(np.searchsorted(truth.host_time_ns, reference.end_ns - 0.2 * NANOSECONDS))
        w, x, y, z = truth.q_world_from_sensor[row]
        first_column = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
        assert sensor.R[:, 0] == pytest.approx(first_column, abs=2e-3)


def test_what_has_no_arm_has_no_picture(imported: Judged) -> None:
    assert bench_scene(imported.session) is None


def cube(middle: tuple[float, float, float], side: float) -> Body:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    hull = ConvexHull(signs * side / 2 + middle)
    triangles = hull.simplices.copy()
    a, b, c = (hull.points[triangles[:, i]] for i in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return Body(hull.points, triangles)


def test_the_drawing_shows_front_faces_only_and_keeps_words_apart() -> None:
    where = np.array([0.05, 0.0, 0.5])
    sensors = [Placed(name, where, np.eye(3)) for name in ("thigh <left>", "shank_left")]
    scene = Scene([cube((0, 0, 0.5), 0.2), cube((0, 0, 0.1), 0.2)], sensors, 0.0, 'an "arm"')
    svg = drawing(scene)
    assert 'aria-label="an &quot;arm&quot;"' in svg and "thigh &lt;left&gt;" in svg
    faces = re.findall(r'<path color="#\w+" d="M([-\d. ]+)L([-\d. ]+)L([-\d. ]+)Z"', svg)
    # of each of the four boxes three sides of two triangles
    assert len(faces) == 4 * 3 * 2
    points = np.array([[float(v) for v in p.split()] for face in faces for p in face])
    assert points.min() >= 0 and (points <= [WIDTH, HEIGHT]).all()
    words = [
        (float(x), float(y), unescape(said))
        for x, y, said in re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*>([^<]+)<', svg)
    ]
    assert len(words) >= 4
    for i, (x, y, said) in enumerate(words):
        for other_x, other_y, other in words[:i]:
            wide = 3.5 * (len(said) + len(other))
            assert abs(x - other_x) >= wide or abs(y - other_y) >= 14, (said, other)


def test_the_view_has_the_sensors_in_front() -> None:
    arm = [cube((0, 0, z), 0.1) for z in (0.1, 0.2, 0.3)]
    for x, y in ((0.1, 0.0), (-0.1, 0.0), (0.0, 0.1)):
        scene = Scene(arm, [Placed("imu", np.array([x, y, 0.2]), np.eye(3))], None, "")
        view = view_of(scene)
        assert view.towards(np.array([[x, y, 0.2]]))[0] > view.towards(np.array([[0, 0, 0.2]]))[0]


def test_what_can_be_turned_has_the_same_bodies(quick: Judged) -> None:
    scene = bench_scene(quick.session)
    assert scene is not None
    figure = turnable(scene)
    kinds = [trace["type"] for trace in figure["data"]]
    assert kinds.count("mesh3d") == 1 + len(scene.sensors)
    assert kinds.count("scatter3d") == 3 * len(scene.sensors)
    arm = figure["data"][0]
    assert max(arm["i"]) < sum(len(body.corners) for body in scene.bodies)
    assert len(arm["i"]) == sum(len(body.triangles) for body in scene.bodies)
