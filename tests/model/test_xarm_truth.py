"""The URDF of the xArm 6 against the maker's standard DH table, computed here from nothing but
NumPy, and its limits.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from testbench.records.specs.robot import load_robot
from tests.records.test_robot import Bodies

# UFACTORY, "Kinematic and Dynamic Parameters of xArm 6", standard D-H parameters: d, alpha, a [mm],
# offset of theta.
A2, T2 = np.hypot(284.5, 53.5), -np.arctan2(284.5, 53.5)
DH = [
    (267.0, -np.pi / 2, 0.0, 0.0),
    (0.0, 0.0, A2, T2),
    (0.0, -np.pi / 2, 77.5, -T2),
    (342.5, np.pi / 2, 0.0, 0.0),
    (0.0, -np.pi / 2, 76.0, 0.0),
    (97.0, 0.0, 0.0, 0.0),
]
TOLERANCE = 1e-9  # metres, and elements of rotation matrices


def standard(theta: float, d: float, alpha: float, a: float) -> np.ndarray:
    """Rz(theta) Tz(d) Tx(a) Rx(alpha), multiplied out; lengths in [mm], the result in [m]."""
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct / 1000],
            [st, ct * ca, -ct * sa, a * st / 1000],
            [0, sa, ca, d / 1000],
            [0, 0, 0, 1],
        ]
    )


def dh_frames(angles: np.ndarray) -> list[np.ndarray]:
    frames = [np.eye(4)]
    for angle, (d, alpha, a, offset) in zip(angles, DH, strict=True):
        frames.append(frames[-1] @ standard(angle + offset, d, alpha, a))
    return frames


@pytest.fixture(scope="module")
def model() -> pin.Model:
    return pin.buildModelFromUrdf(str(load_robot("xarm6").urdf))


def test_every_joint_axis_and_the_flange_are_where_the_makers_table_has_them(model):
    data, rng = model.createData(), np.random.default_rng(6)
    limits = load_robot("xarm6").position_limits
    for _ in range(1000):
        q = rng.uniform(limits[:, 0], limits[:, 1])
        pin.framesForwardKinematics(model, data, q)
        frames = dh_frames(q)
        for i, frame in enumerate(frames[:-1]):
            joint = data.oMi[i + 1]
            np.testing.assert_allclose(joint.rotation[:, 2], frame[:3, 2], atol=TOLERANCE)
            away = np.cross(
                joint.translation - frame[:3, 3], frame[:3, 2]
            )  # zero where the origins share the axis
            assert np.abs(away).max() < TOLERANCE
        flange = data.oMf[model.getFrameId("link_eef")]
        np.testing.assert_allclose(flange.homogeneous, frames[-1], atol=TOLERANCE)


def test_the_controllers_zero_pose_is_where_the_maker_says(model):
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.zeros(6))
    flange = data.oMf[model.getFrameId("link_eef")]
    np.testing.assert_allclose(
        1000 * flange.translation, [207, 0, 112], atol=1e-6
    )  # user manual, initial position
    np.testing.assert_allclose(
        flange.rotation, np.diag([1.0, -1, -1]), atol=TOLERANCE
    )  # roll 180 deg


def test_the_ranges_lie_within_those_of_both_generations_of_the_client_library(
    monkeypatch, tmp_path, capsys
):
    monkeypatch.setenv(
        "HOME", str(tmp_path)
    )  # the library makes a folder there when it is imported
    x_config = pytest.importorskip("xarm.core.config.x_config")
    tables = x_config.XCONF.Robot.JOINT_LIMITS[6]
    limits = load_robot("xarm6").position_limits
    for kind in (6, 61305):
        low, high = np.array(tables[kind]).T
        assert (limits[:, 0] >= low - 1e-5).all() and (limits[:, 1] <= high + 1e-5).all()
    narrow = np.array([tables[6], tables[61305]])
    assert np.degrees(limits[:, 0] - narrow[:, :, 0].max(axis=0)).max() < 1.0
    assert np.degrees(narrow[:, :, 1].min(axis=0) - limits[:, 1]).max() < 1.0


def test_speeds_of_the_first_joints_keep_the_makers_limit_of_the_flange(model):
    arm = load_robot("xarm6")
    reach = 0.7  # m, data sheet
    assert (arm.velocity_limits[:3] * reach <= 1.0).all()
    assert np.degrees(arm.velocity_limits).max() <= 180 + 1e-9


def test_the_robot_file_keeps_the_urdfs_ranges_and_stays_below_its_speeds(model):
    arm = load_robot("xarm6")
    np.testing.assert_allclose(arm.position_limits[:, 0], model.lowerPositionLimit, atol=1e-12)
    np.testing.assert_allclose(arm.position_limits[:, 1], model.upperPositionLimit, atol=1e-12)
    assert (arm.velocity_limits <= model.velocityLimit + 1e-12).all()


def test_the_makers_zero_pose_and_home_are_free_and_folding_onto_itself_or_the_floor_is_not():
    arm = load_robot("xarm6")
    bodies, margin = Bodies(arm), arm.spec.collision.margin_mm
    for pose in ([0] * 6, arm.spec.home_deg):
        assert bodies.touching(pose, margin) == set()
        assert bodies.lowest_mm(pose) > margin
    assert frozenset(("link1", "link4")) in bodies.touching((0, -90, 10, 0, 0, 0), 0.0)
    assert frozenset(("link_base", "link5")) in bodies.touching((0, 60, 0, 0, 0, 0), 0.0)
    assert bodies.lowest_mm((0, 90, -90, 0, 0, 0)) < 0
