"""Bags of ROS that kept libraries write: rosbags (ROS 1, ROS 2) and mcap-ros2-support."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

START_NS = 1_700_000_000_000_000_000
Message = tuple[str, str, int, Any]


@dataclass
class Ros:
    """The messages of one ROS, as rosbags has them."""

    store: Any
    ros1: bool

    @classmethod
    def of(cls, ros1: bool) -> Ros:
        typesys = pytest.importorskip("rosbags.typesys")
        stores = typesys.Stores
        store = typesys.get_typestore(stores.ROS1_NOETIC if ros1 else stores.ROS2_HUMBLE)
        if ros1:  # its packages of messages do not have the transforms
            text, kind = "geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"
            store.register(typesys.get_types_from_msg(text, kind))
        return cls(store, ros1)

    def make(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def header(self, time_ns: int, frame: str) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", *divmod(time_ns, 1_000_000_000))
        first = (0,) if self.ros1 else ()
        return self.make("std_msgs/msg/Header", *first, stamp, frame)

    def vector(self, values: Iterable[float]) -> Any:
        return self.make("geometry_msgs/msg/Vector3", *map(float, values))

    def quaternion(self, q: np.ndarray) -> Any:
        return self.make("geometry_msgs/msg/Quaternion", *np.roll(q, -1).tolist())

    def imus(self, m: Any, topic: str, known: bool = True, stamped: bool = True) -> list[Message]:
        """Inertial messages of a motion; where not `known`, without orientation."""
        kind, result = "sensor_msgs/msg/Imu", []
        covariance = np.zeros(9)
        covariance[0] = 0.0 if known else -1.0
        for i, t in enumerate(m.t):
            time = START_NS + round(1e9 * t)
            message = self.make(
                kind,
                self.header(time if stamped else 0, "imu_link"),
                self.quaternion(m.q[i] if known else np.zeros(4)),
                covariance,
                self.vector(m.gyr[i]),
                np.zeros(9),
                self.vector(m.acc[i]),
                np.zeros(9),
            )
            result.append((topic, kind, time, message))
        return result

    def fields(self, m: Any, topic: str, step: int = 2) -> list[Message]:
        kind = "sensor_msgs/msg/MagneticField"
        return [
            (
                topic,
                kind,
                START_NS + round(1e9 * t),
                self.make(
                    kind,
                    self.header(START_NS + round(1e9 * t), "imu_link"),
                    self.vector(1e-6 * mag),
                    np.zeros(9),
                ),
            )
            for t, mag in zip(m.t[::step], m.mag[::step], strict=True)
        ]

    def joints(self, t: np.ndarray, names: list[str], q: np.ndarray) -> list[Message]:
        kind = "sensor_msgs/msg/JointState"
        return [
            (
                "/joint_states",
                kind,
                START_NS + round(1e9 * time),
                self.make(
                    kind,
                    self.header(START_NS + round(1e9 * time), ""),
                    names,
                    np.array(row, dtype=float),
                    np.zeros(0),
                    np.zeros(0),
                ),
            )
            for time, row in zip(t, q, strict=True)
        ]

    def transform(self, time_ns: int, parent: str, child: str, q: np.ndarray) -> Any:
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            self.header(time_ns, parent),
            child,
            self.make(
                "geometry_msgs/msg/Transform", self.vector([0.1, 0.2, 0.3]), self.quaternion(q)
            ),
        )

    def transforms(
        self, t: np.ndarray, parent: str, child: str, q: np.ndarray, topic: str = "/tf"
    ) -> list[Message]:
        kind = "tf2_msgs/msg/TFMessage"
        times = [START_NS + round(1e9 * time) for time in t]
        return [
            (topic, kind, time, self.make(kind, [self.transform(time, parent, child, row)]))
            for time, row in zip(times, q, strict=True)
        ]

    def poses(self, t: np.ndarray, q: np.ndarray, topic: str) -> list[Message]:
        kind = "geometry_msgs/msg/PoseStamped"
        point = self.make("geometry_msgs/msg/Point", 1.0, 2.0, 3.0)
        return [
            (
                topic,
                kind,
                START_NS + round(1e9 * time),
                self.make(
                    kind,
                    self.header(START_NS + round(1e9 * time), "mocap"),
                    self.make("geometry_msgs/msg/Pose", point, self.quaternion(row)),
                ),
            )
            for time, row in zip(t, q, strict=True)
        ]


def write_bag(path: Path, ros: Ros, messages: list[Message]) -> Path:
    """A .bag, a folder of a .db3, or (path ends in .mcap) a single MCAP file."""
    ordered = sorted(messages, key=lambda message: message[2])
    if ros.ros1:
        from rosbags.rosbag1 import Writer

        with Writer(path) as writer:
            _write(writer, ros, ordered, ros.store.serialize_ros1)
        return path
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    single = path.suffix == ".mcap"
    folder = path.with_suffix("") if single else path
    plugin = StoragePlugin.MCAP if single else StoragePlugin.SQLITE3
    with Writer2(folder, version=9, storage_plugin=plugin) as writer:
        _write(writer, ros, ordered, ros.store.serialize_cdr)
    return next(folder.glob("*.mcap")) if single else folder


def _write(
    writer: Any, ros: Ros, messages: list[Message], serialize: Callable[[Any, str], Any]
) -> None:
    connections: dict[str, Any] = {}
    for topic, kind, time, message in messages:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=ros.store)
        writer.write(connections[topic], time, serialize(message, kind))
