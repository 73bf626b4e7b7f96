"""Axes of a body that are not the model's, against a knee that is turned in thigh and shank."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.estimation.chain.anatomy import anatomy_variance
from testbench.estimation.chain.sensors import chain_sensors
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.robot import load_robot

AXES_SD, STEP = np.radians(2.0), 1e-6
LINKS = ("pelvis", "thigh_r", "shank_r", "foot_r")


def on_links(name, links):
    robot = load_robot(name)
    places = {link: (link, Pose(np.eye(3), np.zeros(3))) for link in links}
    return chain_sensors(Kinematics(robot), places, None, robot.home)


def turned(angles, by, first):
    """Three angles about x, z and -y of a joint whose proximal or distal segment is turned."""
    R = Rotation.from_euler("XZY", angles * [1, 1, -1])
    R = Rotation.from_rotvec(by).inv() * R if first else R * Rotation.from_rotvec(by)
    return R.as_euler("XZY") * [1, 1, -1]


def test_hip_and_ankle_count_from_a_knee_that_is_turned_and_the_knee_does_not_feel_it():
    sensors = on_links("lower_limb", LINKS)
    angles = 0.4 * np.random.default_rng(0).standard_normal((5, len(sensors.joints)))
    found = anatomy_variance(sensors, angles, AXES_SD)
    place = [
        [i for i, name in enumerate(sensors.joints) if joint in name]
        for joint in ("hip", "knee", "ankle")
    ]
    assert not found[:, place[1]].any() and not found[:, :6].any()
    for own, first in ((place[0], False), (place[2], True)):
        for row, expected in zip(found[:, own], angles[:, own], strict=True):
            across = [turned(expected, STEP * axis, first) for axis in np.eye(3)[[0, 2]]]
            slopes = (np.array(across) - expected) / STEP
            np.testing.assert_allclose(row, AXES_SD**2 * np.sum(slopes**2, axis=0), rtol=1e-4)


def test_hinges_with_parallel_axes_turn_none_of_each_others_angles():
    sensors = on_links("squat_2dof", ("shank", "thigh"))
    assert sensors.joints == ["ankle", "knee"]
    found = anatomy_variance(sensors, np.array([[0.3, 0.7]]), AXES_SD)
    np.testing.assert_allclose(found, 0.0, atol=1e-12)
