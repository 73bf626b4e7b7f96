"""Bags of ROS: .bag of ROS 1, .db3 and .mcap of ROS 2, and folders of these with a metadata.yaml.

The package rosbags reads the containers. Inertial messages are decoded here, many at once: what
follows their header has a fixed length, so that it is the end of each message. That holds for the
serialisation of ROS 1 and for CDR alike (definitions: sensor_msgs/Imu, sensor_msgs/MagneticField;
OMG DDS-XTypes 1.3, 7.4.1).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbench.exceptions import BenchError, FileProblems, InputError, Problem
from testbench.extras import missing_extra
from testbench.frames import NANOSECONDS

IMU = "sensor_msgs/msg/Imu"
MAGNETIC_FIELD = "sensor_msgs/msg/MagneticField"
JOINT_STATE = "sensor_msgs/msg/JointState"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    "nav_msgs/msg/Odometry",
)
NUMBERS = {IMU: 37, MAGNETIC_FIELD: 12}
"""Doubles behind the header of a message."""
SUFFIXES = (".bag", ".db3", ".mcap")
MENDS = {".bag": "rosbag reindex", ".mcap": "mcap recover"}
"""Programs that mend a recording whose writer was killed."""
MESSAGES_PER_CHUNK = 20_000


@dataclass
class Bag:
    """One recording, in one file or several that follow one another.

    Attributes:
        paths: Files, or a folder with a metadata.yaml.
        topics: Type of the messages of each topic, in the spelling of ROS 2.
    """

    paths: list[Path]
    topics: dict[str, str] = field(default_factory=dict)

    @property
    def ros1(self) -> bool:
        """Whether it is of ROS 1."""
        return self.paths[0].suffix.lower() == ".bag"

    def of(self, *kinds: str) -> list[str]:
        """Topics of the given types."""
        return [topic for topic, kind in self.topics.items() if kind in kinds]

    def raw(self, topics: list[str]) -> Iterator[tuple[str, int, bytes]]:
        """Topic, time of recording [ns] and bytes of each message, in the order of recording.

        Raises:
            FileProblems: A file is damaged.
        """
        for path in self.paths:
            try:
                with _reader(path) as reader:
                    wanted = [c for c in reader.connections if c.topic in topics]
                    for connection, time, data in reader.messages(wanted) if wanted else ():
                        yield connection.topic, int(time), bytes(data)
            except BenchError:
                raise
            except Exception as error:  # the readers raise errors of many kinds
                raise _damaged(path, error) from None

    def numbers(self, topic: str) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Stamps, times of recording [ns] and numbers of inertial messages, chunk by chunk.

        Args:
            topic: Of type `IMU` or `MAGNETIC_FIELD`.

        Returns:
            Arrays of shapes (n,) and (n,), int64, and (n, k).

        Raises:
            FileProblems: A file or a message is damaged.
        """
        count = NUMBERS[self.topics[topic]]
        times: list[int] = []
        messages: list[bytes] = []
        done = 0
        for _, time, data in self.raw([topic]):
            times.append(time)
            messages.append(data)
            if len(messages) == MESSAGES_PER_CHUNK:
                yield self._decoded(topic, times, messages, count, done)
                done += len(messages)
                times, messages = [], []
        if messages:
            yield self._decoded(topic, times, messages, count, done)

    def _decoded(
        self, topic: str, times: list[int], messages: list[bytes], count: int, done: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        order = "<" if self.ros1 or messages[0][1:2] == b"\x01" else ">"
        for i, data in enumerate(messages):
            if not _whole(data, 8 * count, self.ros1, order):
                raise self.problem(f"message {done + i + 1} of {topic} is damaged")
        stamps = np.frombuffer(b"".join(data[4:12] for data in messages), f"{order}u4")
        values = np.frombuffer(b"".join(data[-8 * count :] for data in messages), f"{order}f8")
        stamp_ns = stamps.reshape(-1, 2).astype(np.int64) @ np.array([NANOSECONDS, 1])
        return stamp_ns, np.array(times, np.int64), values.reshape(-1, count).astype(float)

    def messages(self, topics: list[str]) -> Iterator[tuple[str, int, Any]]:
        """Topic, time of recording [ns] and content of each message, one by one.

        Raises:
            FileProblems: A file or a message is damaged.
        """
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        for kind in TRANSFORMS:
            if kind not in store.types:
                store.register(
                    get_types_from_msg("geometry_msgs/TransformStamped[] transforms", kind)
                )
        decode = store.deserialize_ros1 if self.ros1 else store.deserialize_cdr
        for topic, time, data in self.raw(topics):
            try:
                yield topic, time, decode(data, self.topics[topic])
            except Exception as error:  # the package raises errors of many kinds
                raise self.problem(f"a message of {topic} is damaged: {_short(error)}") from None

    def problem(self, message: str) -> FileProblems:
        """The error that says `message` of the bag."""
        return FileProblems(self.paths[0], [Problem(message)])


def is_bag(file: Path) -> bool:
    """Whether a path looks like a bag: by its suffix, or as a folder with a metadata.yaml."""
    return file.suffix.lower() in SUFFIXES or (file / "metadata.yaml").is_file()


def open_bag(files: list[Path]) -> Bag:
    """The topics of a bag.

    Args:
        files: Of one recording, in any order.

    Raises:
        InputError: The package that reads bags is not installed.
        FileProblems: A file is no bag, or damaged.
    """
    paths = [file.parent if file.name == "metadata.yaml" else file for file in files]
    starts: dict[Path, int] = {}
    bag = Bag([])
    for path in paths:
        if not path.exists():
            raise FileProblems(path, [Problem("the file does not exist")])
        if not is_bag(path):
            raise FileProblems(
                path,
                [
                    Problem(
                        f"not a bag: none of {', '.join(SUFFIXES)}, no folder with metadata.yaml"
                    )
                ],
            )
        if (path.suffix.lower() == ".bag") != (paths[0].suffix.lower() == ".bag"):
            raise FileProblems(path, [Problem(f"is of another ROS than {paths[0].name}")])
        try:
            with _reader(path) as reader:
                starts[path] = int(reader.start_time)
                for connection in reader.connections:
                    form = getattr(connection.ext, "serialization_format", "cdr")
                    if form in {"cdr", ""}:
                        bag.topics.setdefault(str(connection.topic), str(connection.msgtype))
        except BenchError:
            raise
        except Exception as error:  # the readers raise errors of many kinds
            raise _damaged(path, error) from None
    bag.paths = sorted(starts, key=lambda path: starts[path])
    return bag


def _reader(path: Path) -> Any:
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError:
        raise InputError(missing_extra("reading bags of ROS needs", "ros")) from None
    return Reader1(path) if path.suffix.lower() == ".bag" else Reader2(path)


def _damaged(path: Path, error: Exception) -> FileProblems:
    if "Profile is not ros2" in str(error):
        return FileProblems(
            path,
            [
                Problem(
                    "is MCAP, but its messages are not those of ROS 2; convert it to ROS 2, or "
                    "export the topic to CSV for the format generic"
                )
            ],
        )
    mends = MENDS.get(path.suffix.lower())
    hint = f"; of one that was cut off, `{mends} {path.name}` makes a whole one" if mends else ""
    return FileProblems(path, [Problem(f"not a readable bag: {_short(error)}{hint}")])


def _short(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text[:200] or type(error).__name__


def _whole(data: bytes, tail: int, ros1: bool, order: str) -> bool:
    """Whether a message is as long as its header says; CDR aligns numbers to 8 bytes, or to 4."""
    if len(data) < 16 + tail:
        return False
    text = int.from_bytes(data[12:16], "little" if order == "<" else "big")
    end = len(data) - tail - 16 - text
    return end == 0 if ros1 else 0 <= end < 8
