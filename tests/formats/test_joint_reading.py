"""A joint log whose columns were exchanged, or whose sign is wrong, is told by trying others."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.formats.recording import ImportedSensor
from testbench.formats.truth.joint_log import RobotLog
from testbench.formats.truth.joint_reading import read_otherwise
from testbench.model import rotation
from testbench.model.kinematics import Kinematics
from testbench.records.specs.robot import load_robot
from tests.benchmarks.recordings import of_arrays

ARM = Kinematics(load_robot("ur3e"))
JOINTS = ARM.robot.joint_names
LINK = "wrist_3_link"
T = np.arange(0, 60, 0.01)
Q = np.radians([180.0, -90, -90, 0, 90, 0]) + np.column_stack(
    [
        a * np.sin(f * T + p)
        for a, f, p in zip(
            [0.4, 0.3, 0.5, 0.6, 0.7, 0.9], [0.7, 1.1, 0.9, 1.3, 0.8, 1.7], range(6), strict=True
        )
    ]
)


@pytest.fixture(scope="module")
def sensor() -> ImportedSensor:
    """A sensor that sits askew on the last link, and began 7 s before the log."""
    pose = ARM.frame_motion(LINK, Q).q_world_from_frame
    turns = rotation.multiply(rotation.conjugate(pose[:-1]), pose[1:])
    rate = rotation.to_rotation_vector(turns) * 100
    askew = rotation.to_matrix(rotation.normalise(np.array([0.5, 0.1, -0.7, 0.3])))
    gyr = np.vstack([np.zeros((700, 3)), rate]) @ askew.T * 1.01 + 0.01
    gyr += np.random.default_rng(1).normal(0, 0.01, gyr.shape)
    return ImportedSensor([of_arrays(100.0, gyr, np.zeros_like(gyr))], 100.0, "made up")


def _read(sensor: ImportedSensor, q: np.ndarray, link: str = LINK):
    return read_otherwise(ARM, RobotLog(np.round(T * 1e9).astype(np.int64), q), link, sensor)


def test_a_right_log_is_left_as_it_is(sensor):
    assert _read(sensor, Q) is None


@pytest.mark.parametrize(("i", "j"), [(0, 3), (4, 5), (2, 5)])
def test_two_joints_that_were_exchanged_are_named(sensor, i, j):
    order = np.arange(6)
    order[[i, j]] = j, i
    found = _read(sensor, Q[:, order])
    assert found is not None
    assert found.values["how"] == f"the angles of {JOINTS[i]} and {JOINTS[j]} exchanged"


@pytest.mark.parametrize(
    ("order", "how"),
    [([5, 4, 3, 2, 1, 0], "in the reverse order"), ([1, 2, 3, 4, 5, 0], "one joint further on")],
)
def test_columns_in_another_order_are_named(sensor, order, how):
    found = _read(sensor, Q[:, order])
    assert found is not None and how in found.values["how"]


def test_joints_with_parallel_axes_turn_a_link_alike(sensor):
    assert _read(sensor, Q[:, [0, 2, 1, 3, 4, 5]]) is None


@pytest.mark.parametrize("joint", [1, 3, 5])
def test_a_joint_that_counts_the_other_way_is_named(sensor, joint):
    signs = np.ones(6)
    signs[joint] = -1
    found = _read(sensor, Q * signs)
    assert found is not None and f"the sign of {JOINTS[joint]} turned" in found.values["how"]


def test_a_sensor_on_another_link_is_named(sensor):
    found = _read(sensor, Q, "wrist_1_link")
    assert found is not None and f"the sensor on {LINK}" in found.values["how"]


def test_a_log_of_another_motion_is_not_called_anything(sensor):
    assert _read(sensor, np.roll(Q, 1_777, axis=0)[:, ::-1] * 0.6) is None
