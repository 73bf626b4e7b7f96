"""The tree of frames of a session over time.

Links stand by the arm's kinematics, sensors by their mounting and by the filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from testbench.formats.exporters.source import TRUTH, ExportSource, increasing
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.kinematics import FrameMotion, Kinematics, Pose
from testbench.model.statistics.intervals import median_interval
from testbench.records.session.samples import ArmSamples
from testbench.records.specs.robot import Robot

WORLD = "world"
RATE = 50.0
"""Transforms are thinned out to about this rate; the joint angles are not [Hz]."""


@dataclass(frozen=True)
class Transforms:
    """Transforms that share their instants.

    Attributes:
        time_ns: Host times, shape (n,).
        frames: (parent, child) of each transform.
        translation: By transform, shape (n, 3) [m].
        q_parent_from_child: By transform, shape (n, 4).
    """

    time_ns: np.ndarray
    frames: list[tuple[str, str]]
    translation: list[np.ndarray]
    q_parent_from_child: list[np.ndarray]


def sensor_frame(sensor: str) -> str:
    """Frame of a sensor where the arm, or the reference system, says it is."""
    return f"imu_{sensor}"


def estimated_frame(sensor: str) -> str:
    """Frame at the same place, with the axes as the filter estimates them."""
    return f"imu_{sensor}_estimated"


def frame_tree(source: ExportSource) -> tuple[Transforms | None, list[Transforms]]:
    """Transforms that never change, and those that do.

    Returns:
        The fixed ones, of one instant, or None without an arm; groups of moving ones.
    """
    robot, arm = source.session.robot, source.arm
    if robot is None or arm is None or not len(arm.host_time_ns):
        return None, [*_true_sensors(source), *_estimated_sensors(source, None, None)]
    kinematics = Kinematics(robot)
    fixed, moving = _links(robot, kinematics, arm)
    for name, sensor in source.session.analysis.sensors.items():
        pose = Pose.from_placement(sensor.mounting)
        fixed.frames.append((sensor.link, sensor_frame(name)))
        fixed.translation.append(pose.position[None])
        fixed.q_parent_from_child.append(pose.quaternion[None])
    return fixed, [moving, *_estimated_sensors(source, kinematics, arm)]


def _links(robot: Robot, kinematics: Kinematics, arm: ArmSamples) -> tuple[Transforms, Transforms]:
    rows = stride(arm.host_time_ns)
    time, q = arm.host_time_ns[rows], arm.q_measured[rows]
    motions = {link: kinematics.frame_motion(link, q) for link in kinematics.link_names}
    fixed, moving = (
        Transforms(np.zeros(1, dtype=np.int64), [], [], []),
        Transforms(time, [], [], []),
    )
    parents = _parents(robot)
    for link, motion in motions.items():
        joint, parent = parents.get(link, ("", None))
        if parent in motions:
            position, R = _relative(motions[parent], motion)
            target = moving if joint in robot.joint_names else fixed
        elif link == WORLD:
            continue  # the URDF's own world, which ours takes the place of
        else:
            parent, position, R, target = WORLD, motion.position, motion.R_world_from_frame, fixed
        n = len(target.time_ns)
        target.frames.append((parent, link))
        target.translation.append(position[:n])
        target.q_parent_from_child.append(rotation.from_matrix(R[:n]))
    return fixed, moving


def _relative(parent: FrameMotion, child: FrameMotion) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and axes of a frame in another, shapes (n, 3) and (n, 3, 3)."""
    R_parent_from_world = np.swapaxes(parent.R_world_from_frame, 1, 2)
    position = np.einsum("nij,nj->ni", R_parent_from_world, child.position - parent.position)
    return position, R_parent_from_world @ child.R_world_from_frame


def _parents(robot: Robot) -> dict[str, tuple[str, str]]:
    """By link: the joint that carries it, and that joint's parent link."""
    root = ElementTree.fromstring(robot.urdf.read_text(encoding="utf-8"))
    result = {}
    for joint in root.iterfind("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            result[child.get("link", "")] = (joint.get("name", ""), parent.get("link", ""))
    return result


def _true_sensors(source: ExportSource) -> list[Transforms]:
    """Without an arm: the true orientation of each sensor, at the world's origin."""
    result = []
    for name, truth in source.truths.items():
        if truth is None:
            continue
        rows = np.flatnonzero(np.isfinite(truth.q_world_from_sensor).all(axis=1))
        rows = rows[increasing(truth.host_time_ns[rows])]
        rows = rows[stride(truth.host_time_ns[rows])]
        q = truth.q_world_from_sensor[rows]
        frames = [(WORLD, sensor_frame(name))]
        result.append(Transforms(truth.host_time_ns[rows], frames, [np.zeros((len(q), 3))], [q]))
    return result


def _estimated_sensors(
    source: ExportSource, kinematics: Kinematics | None, arm: ArmSamples | None
) -> list[Transforms]:
    """The orientation by the chosen filter, where the arm carries the sensor.

    At the world's origin without an arm.
    """
    if source.filter == TRUTH:
        return []
    result = []
    for name in source.sensor_names:
        time, q_world_from_sensor = source.orientation(name)
        rows = stride(time)
        time, q_world_from_sensor = time[rows], q_world_from_sensor[rows]
        position = np.zeros((len(time), 3))
        mounted = source.session.analysis.sensors.get(name)
        if kinematics is not None and arm is not None and mounted is not None:
            q = np.column_stack(
                [np.interp(time, arm.host_time_ns, column) for column in arm.q_measured.T]
            )
            position = kinematics.frame_motion(
                mounted.link, q, offset=Pose.from_placement(mounted.mounting)
            ).position
        result.append(
            Transforms(time, [(WORLD, estimated_frame(name))], [position], [q_world_from_sensor])
        )
    return result


def stride(time_ns: np.ndarray) -> slice:
    """Rows that bring regular samples down to about RATE; never up.

    Args:
        time_ns: Increasing, shape (n,).
    """
    if len(time_ns) < 2:
        return slice(None)
    interval = median_interval(time_ns) / NANOSECONDS
    return slice(None, None, max(1, round(1 / (RATE * interval)))) if interval > 0 else slice(None)
