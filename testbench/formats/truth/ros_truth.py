"""Truth from a bag of ROS: joint states of an arm, frames of the transform tree, poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbench.exceptions import InputError, NotFoundError
from testbench.formats.recording import Recording
from testbench.formats.tables.ros_bag import JOINT_STATE, POSES, TRANSFORMS, Bag
from testbench.formats.truth.joint_log import RobotLog
from testbench.formats.truth.markers import set_truth
from testbench.formats.truth.tracked import quaternions
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.specs.strict import Placement

LEAST = 2
"""So many orientations at least tell a motion."""


@dataclass
class _Edge:
    """Orientations of a frame in its parent."""

    parent: str
    times: list[int] = field(default_factory=list)
    q: list[list[float]] = field(default_factory=list)

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Increasing times, shape (n,), int64, and unit quaternions, shape (n, 4)."""
        times, first = np.unique(np.array(self.times, np.int64), return_index=True)
        q = quaternions(np.array(self.q, dtype=float).reshape(-1, 4)[first])
        known = np.isfinite(q).all(axis=1)
        return times[known], rotation.normalise(q[known])


def joint_log(bag: Bag, joints: list[str], origin_ns: int | None) -> RobotLog:
    """Joint angles from the joint states of a bag.

    Args:
        bag: To read.
        joints: Names, in order.
        origin_ns: Stamp at host time zero [ns]; None for the first message's.

    Raises:
        FileProblems: No message has all joints.
    """
    topics = bag.of(JOINT_STATE)
    times, rows, seen = [], [], set()
    for _, logged, message in bag.messages(topics) if topics else ():
        names = list(message.name)
        seen |= set(names)
        if set(joints) <= set(names) and len(message.position) == len(names):
            times.append(_stamp(message.header) or logged)
            rows.append([float(message.position[names.index(joint)]) for joint in joints])
    if len(rows) < LEAST:
        raise bag.problem(
            f"no messages of {JOINT_STATE} with the joints {', '.join(joints)}; it has "
            f"{', '.join(sorted(seen)) or 'no joint states'}"
        )
    stamps = np.array(times, np.int64)
    order = np.argsort(stamps, kind="stable")
    start = int(stamps[order[0]]) if origin_ns is None else origin_ns
    q = np.array(rows)[order]
    return RobotLog(stamps[order] - start, q, problem=lambda said, row: bag.problem(said))


def give_bag_truth(
    recording: Recording,
    bag: Bag,
    bodies: Mapping[str, list[str]],
    mountings: Mapping[str, Placement],
    times: tuple[int | None, int],
) -> None:
    """Give sensors the orientation of frames or poses of a bag as truth.

    Args:
        recording: Whose sensors; is changed.
        bag: To read.
        bodies: Frame of the transform tree, or topic of poses, of each sensor.
        mountings: Sensor in the body ("" for all).
        times: Stamp at host time zero, None for the first of each body, and what is added [ns].

    Raises:
        InputError: A sensor's body is not named.
        NotFoundError: There is no such frame or topic.
        FileProblems: The bag is damaged.
    """
    edges = _edges(bag)
    topics = bag.of(*POSES)
    existing = [*topics, *edges]
    if not bodies:
        raise InputError(
            "which frame or topic of the bag carries the sensors? Answer with --truth-cluster "
            f"SENSOR=FRAME; it has {', '.join(existing) or 'neither transforms nor poses'}"
        )
    origin, shift = times
    for name, (body, *more) in bodies.items():
        if more or body not in existing:
            raise NotFoundError("frame or topic of poses", ",".join([body, *more]), existing)
        stamps, q, what = _poses(bag, body) if body in topics else _chain(bag, edges, body)
        start = int(stamps[0]) if origin is None else origin
        recording.sensors[name].details |= {"truth": f"ROS, {what}"}
        recording.findings.append(finding("truth.of_ros", name, count=len(q), what=what))
        mounting = mountings.get(name, mountings.get("", Placement()))
        set_truth(recording, name, stamps - start + shift, q, mounting)


def _stamp(header: Any) -> int:
    return int(header.stamp.sec) * NANOSECONDS + int(header.stamp.nanosec)


def _parts(q: Any) -> list[float]:
    return [float(q.w), float(q.x), float(q.y), float(q.z)]


def _edges(bag: Bag) -> dict[str, _Edge]:
    """The transform tree: of each frame its parent, and its orientations in it."""
    edges: dict[str, _Edge] = {}
    topics = bag.of(*TRANSFORMS)
    for _, logged, message in bag.messages(topics) if topics else ():
        for one in message.transforms:
            parent = str(one.header.frame_id).lstrip("/")
            child = str(one.child_frame_id).lstrip("/")
            edge = edges.setdefault(child, _Edge(parent))
            if edge.parent == parent:
                edge.times.append(_stamp(one.header) or logged)
                edge.q.append(_parts(one.transform.rotation))
    return edges


def _poses(bag: Bag, topic: str) -> tuple[np.ndarray, np.ndarray, str]:
    edge = _Edge("")
    for _, logged, message in bag.messages([topic]):
        body = getattr(message, "pose", None) or message.transform
        body = getattr(body, "pose", body)
        edge.times.append(_stamp(message.header) or logged)
        edge.q.append(_parts(body.orientation if hasattr(body, "orientation") else body.rotation))
    if len(edge.times) < LEAST:
        raise bag.problem(f"{topic} has {len(edge.times)} messages, which is no motion")
    times, q = edge.arrays()
    return times, q, f"the topic {topic}"


def _chain(bag: Bag, edges: dict[str, _Edge], frame: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Orientations of a frame in the root of its tree, at the times of its densest edge."""
    path: list[tuple[np.ndarray, np.ndarray]] = []
    at = frame
    while at in edges and len(path) <= len(edges):
        path.append(edges[at].arrays())
        at = edges[at].parent
    if len(path) > len(edges) or any(not len(times) for times, _ in path):
        raise bag.problem(
            f"the transforms of the frame {frame} go in a circle, or are no rotations"
        )
    moving = [times for times, _ in path if len(times) >= LEAST]
    if not moving:
        raise bag.problem(f"the frame {frame} does not move against {at}: it is no truth")
    begin, end = max(t[0] for t in moving), min(t[-1] for t in moving)
    base = max(moving, key=len)
    base = base[(base >= begin) & (base <= end)]
    if len(base) < LEAST:
        raise bag.problem(f"the transforms from {at} to {frame} have no time in common")
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(base), 1))
    for times, own in reversed(path):
        turn = rotation.interpolate(times, own, base) if len(times) > 1 else own[0]
        q = rotation.multiply(q, turn)
    return base, q, f"the frame {frame} in {at}"
