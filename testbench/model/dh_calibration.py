"""A URDF corrected by an arm's own DH parameters.

With standard DH (Craig 1989 calls it distal) the frame of joint i is T(i-1, i) = Rz(theta) Tz(d)
Tx(a) Rx(alpha). A URDF has link frames of its own: link i turns about its z axis behind a fixed
displacement O(i). Both describe one arm, so that O(i) Rz(q) X(i) = X(i-1) Rz(q) M(i) for every q,
with M(i) = Tz(d) Tx(a) Rx(alpha) and X(i) the DH frame in its link. Hence O(i) = X(i-1) Z(i) and
X(i) = inverse(Z(i)) M(i) for some Z(i) that commutes with Rz: a turn and a shift along the axis.
The nominal URDF gives Z(i); corrected parameters then give the corrected O(i). Calibrated shifts
along nearly parallel axes are large and cancel one another; each link frame is therefore shifted
along its own axis to where it is nearest to the nominal one, which moves no joint.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.records.specs.arm_calibration import ArmCalibration
from testbench.records.specs.robot import Robot

NOMINAL: dict[str, tuple[list[float], list[float], list[float]]] = {
    "ur3e": (
        [0.15185, 0, 0, 0.13105, 0.08535, 0.0921],
        [0, -0.24355, -0.2132, 0, 0, 0],
        [1, 0, 0, 1, -1, 0],
    ),
    "ur5e": (
        [0.1625, 0, 0, 0.1333, 0.0997, 0.0996],
        [0, -0.425, -0.3922, 0, 0, 0],
        [1, 0, 0, 1, -1, 0],
    ),
    "ur10e": (
        [0.1807, 0, 0, 0.17415, 0.11985, 0.11655],
        [0, -0.6127, -0.57155, 0, 0, 0],
        [1, 0, 0, 1, -1, 0],
    ),
}
"""d [m], a [m], alpha [quarter turns] (Universal Robots, DH Parameters for calculations of
kinematics and dynamics).
"""
BASE = np.diag([-1.0, -1.0, 1.0, 1.0])
"""The DH frame of the base in base_link: turned by pi about z."""
AGREEMENT = 1e-6
"""The URDF must agree with the nominal table to within this [m], [rad]."""


def corrected_urdf(robot: Robot, calibration: ArmCalibration) -> str:
    """The text of the robot's URDF with its joints where this arm has them.

    Raises:
        InputError: The calibration belongs to another robot, or the robot's URDF does not follow
            the nominal table.
    """
    if calibration.robot != robot.name or robot.name not in NOMINAL:
        raise InputError(f"the calibration is for {calibration.robot}, the robot is {robot.name}")
    root = ElementTree.parse(robot.urdf).getroot()
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    corrections, (d, a, quarters) = calibration.corrections, NOMINAL[robot.name]
    before = after = BASE  # the DH frame of the joint before, in its link: nominal and corrected
    nominal_pose = corrected_pose = np.eye(4)
    for i, name in enumerate(robot.joint_names):
        origin = joints[name].find("origin")
        if origin is None:
            raise InputError(f"{robot.urdf}: joint {name} has no origin")
        placement = _origin(origin)
        if i == 0:
            placement = _inherited(root, joints, name) @ placement
        Z = np.linalg.inv(before) @ placement
        if np.abs(Z[2, :3] - [0, 0, 1]).max() > AGREEMENT or np.abs(Z[:2, 3]).max() > AGREEMENT:
            raise InputError(
                f"{robot.urdf}: joint {name} does not follow the nominal DH table of {robot.name}"
            )
        M = _link(d[i], a[i], quarters[i] * np.pi / 2)
        M_corrected = _link(
            d[i] + corrections.d_m[i],
            a[i] + corrections.a_m[i],
            quarters[i] * np.pi / 2 + corrections.alpha_rad[i],
        )
        O_corrected = after @ _turn(corrections.theta_rad[i]) @ Z
        nominal_pose = nominal_pose @ placement
        shifted = corrected_pose @ O_corrected
        axis = shifted[:3, 2]
        shift = float(axis @ (nominal_pose[:3, 3] - shifted[:3, 3])) if i < len(d) - 1 else 0.0
        O_corrected = O_corrected @ _shift(shift)
        corrected_pose = corrected_pose @ O_corrected
        before, after = np.linalg.inv(Z) @ M, np.linalg.inv(Z @ _shift(shift)) @ M_corrected
        if (
            i == len(d) - 1
        ):  # the last link is the flange: its own shift along the axis belongs to the joint
            O_corrected = O_corrected @ _shift(corrections.d_m[i])
        _write(
            origin,
            O_corrected if i else np.linalg.inv(_inherited(root, joints, name)) @ O_corrected,
        )
    return ElementTree.tostring(root, encoding="unicode")


def calibrated(robot: Robot, calibration: ArmCalibration, folder: Path) -> Robot:
    """The robot with its own kinematics; its corrected URDF is written into a folder."""
    urdf = folder / f"{robot.name}_calibrated.urdf"
    urdf.write_text(corrected_urdf(robot, calibration), encoding="utf-8")
    return Robot(robot.spec, urdf, robot.text, robot.file)


def _inherited(
    root: ElementTree.Element, joints: dict[str | None, ElementTree.Element], first: str
) -> np.ndarray:
    """The fixed displacement from base_link to the parent of the first joint."""
    wanted = _end(joints[first], "parent")
    T = np.eye(4)
    while wanted not in {None, "base_link"}:
        below = (joint for joint in root.findall("joint") if _end(joint, "child") == wanted)
        above = next(below, None)
        if above is None or above.get("type") != "fixed":
            break
        origin = above.find("origin")
        T = (_origin(origin) if origin is not None else np.eye(4)) @ T
        wanted = _end(above, "parent")
    return T


def _end(joint: ElementTree.Element, end: str) -> str | None:
    """The link that a joint names as its `parent` or its `child`."""
    element = joint.find(end)
    return None if element is None else element.get("link")


def _origin(element: ElementTree.Element) -> np.ndarray:
    T = np.eye(4)
    roll, pitch, yaw = (float(x) for x in element.get("rpy", "0 0 0").split())
    T[:3, :3] = rotation.to_matrix(rotation.from_euler("ZYX", np.array([yaw, pitch, roll])))
    T[:3, 3] = [float(x) for x in element.get("xyz", "0 0 0").split()]
    return T


def _write(element: ElementTree.Element, T: np.ndarray) -> None:
    R = T[:3, :3]
    pitch = float(np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0])))
    roll, yaw = float(np.arctan2(R[2, 1], R[2, 2])), float(np.arctan2(R[1, 0], R[0, 0]))
    element.set("xyz", " ".join(f"{x:.12g}" for x in T[:3, 3]))
    element.set("rpy", f"{roll:.15g} {pitch:.15g} {yaw:.15g}")


def _turn(angle: float) -> np.ndarray:
    T = np.eye(4)
    T[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return T


def _shift(z: float) -> np.ndarray:
    T = np.eye(4)
    T[2, 3] = z
    return T


def _link(d: float, a: float, alpha: float) -> np.ndarray:
    T = np.eye(4)
    c, s = np.cos(alpha), np.sin(alpha)
    T[1:3, 1:3] = [[c, -s], [s, c]]
    T[0, 3], T[2, 3] = a, d
    return T
