"""A URDF with an arm's own DH corrections, against the DH product written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.exceptions import BenchError, InputError
from testbench.model.dh_calibration import calibrated
from testbench.model.kinematics import Kinematics
from testbench.records.specs.arm_calibration import ArmCalibration, DhTable, load_arm_calibration
from testbench.records.specs.robot import load_robot

# Universal Robots, DH parameters of the UR3e: d [m], a [m], alpha [rad]
D, A, ALPHA = (
    [0.15185, 0, 0, 0.13105, 0.08535, 0.0921],
    [0, -0.24355, -0.2132, 0, 0, 0],
    [np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0],
)


def flange(q, table: DhTable) -> np.ndarray:
    """The flange in base_link, by the product of the joints' matrices (Craig, Introduction to
    Robotics).
    """
    T = np.diag([-1.0, -1.0, 1.0, 1.0])
    for i in range(6):
        theta, alpha = q[i] + table.theta_rad[i], ALPHA[i] + table.alpha_rad[i]
        a, d = A[i] + table.a_m[i], D[i] + table.d_m[i]
        ct, st_, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        link = [
            [ct, -st_ * ca, st_ * sa, a * ct],
            [st_, ct * ca, -ct * sa, a * st_],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
        T = T @ np.array(link)
    return T


small = st.floats(-0.01, 0.01)
tables = st.builds(
    lambda theta, d, a, alpha: DhTable(
        theta_rad=theta, d_m=d, a_m=[*a, 0.0], alpha_rad=[*alpha, 0.0]
    ),
    st.lists(small, min_size=6, max_size=6),
    st.lists(st.floats(-0.4, 0.4), min_size=6, max_size=6),
    st.lists(small, min_size=5, max_size=5),
    st.lists(small, min_size=5, max_size=5),
)


@settings(max_examples=25)
@given(tables, st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_the_flange_is_where_the_corrected_dh_parameters_put_it(tmp_path_factory, table, q):
    folder = tmp_path_factory.mktemp("urdf")
    robot = calibrated(load_robot("ur3e"), ArmCalibration(robot="ur3e", corrections=table), folder)
    found = Kinematics(robot).frame_motion("wrist_3_link", np.array([q]))
    expected = flange(q, table)
    np.testing.assert_allclose(found.position[0], expected[:3, 3], atol=1e-9)
    np.testing.assert_allclose(found.R_world_from_frame[0], expected[:3, :3], atol=1e-9)


def test_without_corrections_nothing_moves(tmp_path):
    nominal = load_robot("ur5e")
    same = Kinematics(
        calibrated(nominal, ArmCalibration(robot="ur5e", corrections=DhTable()), tmp_path)
    )
    q = np.array([[0.3, -1.2, 0.8, -0.4, 1.1, 2.0]])
    for link in Kinematics(nominal).link_names:
        first, second = Kinematics(nominal).frame_motion(link, q), same.frame_motion(link, q)
        np.testing.assert_allclose(first.position, second.position, atol=1e-9)
        np.testing.assert_allclose(first.R_world_from_frame, second.R_world_from_frame, atol=1e-9)


def test_large_shifts_that_cancel_leave_the_links_where_they_are(tmp_path):
    """Calibrated d of the parallel joints 2 to 4 are large and sum to little; the links have not
    moved by that much.
    """
    table = DhTable(d_m=[0.0, 0.3, -0.25, -0.05, 0.0, 0.0])
    nominal = load_robot("ur3e")
    own = Kinematics(calibrated(nominal, ArmCalibration(robot="ur3e", corrections=table), tmp_path))
    q = np.array([[0.3, -1.2, 0.8, -0.4, 1.1, 2.0]])
    for link in ("upper_arm_link", "forearm_link", "wrist_1_link"):
        shift = (
            own.frame_motion(link, q).position - Kinematics(nominal).frame_motion(link, q).position
        )
        assert np.linalg.norm(shift) < 1e-6


def test_a_calibration_of_another_robot_or_off_the_flanges_axis_is_refused(tmp_path):
    other = ArmCalibration(robot="ur5e", corrections=DhTable())
    with pytest.raises(InputError, match="the calibration is for ur5e"):
        calibrated(load_robot("ur3e"), other, tmp_path)
    file = tmp_path / "calibration.yaml"
    file.write_text("robot: ur3e\ncorrections: {alpha_rad: [0.0, 0.0, 0.0, 0.0, 0.0, 0.1]}\n")
    with pytest.raises(BenchError, match="off its axis"):
        load_arm_calibration(file)
