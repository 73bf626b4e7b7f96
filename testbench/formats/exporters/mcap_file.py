"""MCAP with ROS 2 messages, stamped with the date of the session.

It holds IMUs, magnetic fields, joint states and frames.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from testbench.exceptions import InputError
from testbench.formats.exporters.frame_tree import Transforms, frame_tree, sensor_frame
from testbench.formats.exporters.ros_messages import (
    IMU,
    JOINT_STATE,
    MAGNETIC_FIELD,
    SCHEMAS,
    TF_MESSAGE,
    imu_layout,
    joint_state_layout,
    magnetic_field_layout,
    transforms_layout,
)
from testbench.formats.exporters.settings import settings_of
from testbench.formats.exporters.source import ExportSource, software
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ArmSamples

WINDOW_NS = 20 * NANOSECONDS
"""Messages are built and put in order for this long at a time, so that a long session needs little
memory [ns].
"""
LATEST_NS = 2**31 * NANOSECONDS
"""The stamp of a ROS 2 message ends here, in 2038 [ns]."""
TESLA_PER_MICROTESLA = 1e-6
NOT_ESTIMATED = -1.0
"""First element of a covariance that stands for: this message holds no orientation (definition of
sensor_msgs/msg/Imu).
"""

FOREVER = "{sec: 9223372036, nsec: 854775807}"
LATCHED = (
    "- history: 3\n  depth: 0\n  reliability: 1\n  durability: 1\n"
    f"  deadline: {FOREVER}\n  lifespan: {FOREVER}\n  liveliness: 1\n  liveliness_lease_duration: "
    f"{FOREVER}\n"
    "  avoid_ros_namespace_conventions: false\n"
)
"""What rosbag2 writes of a topic that late subscribers shall receive too: reliable, transient
local.
"""


@dataclass(frozen=True)
class Stream:
    """Messages of one channel.

    Attributes:
        topic: Name of the channel.
        kind: Type of its messages.
        time_ns: Host times, increasing, shape (n,).
        rows: Bytes of the messages of a slice, given their stamps [ns]: shape (n, length), uint8.
        latched: Whether late subscribers shall receive the last one.
    """

    topic: str
    kind: str
    time_ns: np.ndarray
    rows: Callable[[slice, np.ndarray], np.ndarray]
    latched: bool = False


def write(source: ExportSource, path: Path) -> list[str]:
    """Write the file.

    Raises:
        InputError: The date of the session is not known, or later than stamps can say.
    """
    start_ns = _start_ns(source)
    streams = [stream for stream in _streams(source) if len(stream.time_ns)]
    if (
        max((start_ns + int(stream.time_ns[-1]) for stream in streams), default=0) >= LATEST_NS
        or start_ns < 0
    ):
        raise InputError(
            f"{source.session.path}: the stamp of a ROS 2 message cannot hold its date"
        )
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library=software())
        writer.add_metadata("testbench", _metadata(source))
        schemas = {
            kind: writer.register_schema(kind, "ros2msg", SCHEMAS[kind].encode())
            for kind in _kinds(streams)
        }
        channels: dict[str, int] = {}
        for stream in streams:
            if stream.topic not in channels:
                quality = {"offered_qos_profiles": LATCHED} if stream.latched else {}
                channels[stream.topic] = writer.register_channel(
                    stream.topic, "cdr", schemas[stream.kind], quality
                )
        _write_in_order(writer, streams, channels, start_ns)
        writer.finish()
    return []


def _kinds(streams: list[Stream]) -> list[str]:
    return list(dict.fromkeys(stream.kind for stream in streams))


def _start_ns(source: ExportSource) -> int:
    """Start of the session since 1970 [ns]."""
    started = source.session.recorded_at or source.session.started
    return round(started.timestamp() * 1e6) * 1000


def _metadata(source: ExportSource) -> dict[str, str]:
    return {
        "session": source.session.name,
        "orientation": f"q_world_from_sensor by {source.filter}",
        "parameters": settings_of(source, [source.filter]).get(source.filter, ""),
        "world": "z up",
        "stamps": "start of the session (UTC) and the host's clock; sensors by their fitted clocks",
        "units": "SI",
    }


def _streams(source: ExportSource) -> list[Stream]:
    fixed, moving = frame_tree(source)
    result = [] if fixed is None else [_transform_stream("/tf_static", fixed, latched=True)]
    for name in source.sensor_names:
        result += _sensor_streams(source, name)
    if source.arm is not None:
        result.append(_joint_stream(source.arm))
    return result + [_transform_stream("/tf", group) for group in moving]


def _sensor_streams(source: ExportSource, name: str) -> list[Stream]:
    samples, estimated = source.imus[name], source.estimate.sensors[name]
    order = np.argsort(estimated.host_time_ns, kind="stable")
    time = estimated.host_time_ns[order]
    q_xyzw, covariance = _orientation_at(source, name, time)
    layout = imu_layout(sensor_frame(name))

    def imu_rows(part: slice, stamps: np.ndarray) -> np.ndarray:
        own = order[part]
        return layout.fill(
            len(own),
            **_stamp(stamps),
            q_xyzw=q_xyzw[part],
            q_covariance=covariance[part],
            rate=samples.gyr[own],
            force=samples.acc[own],
        )

    streams = [Stream(f"/{name}/imu/data", IMU, time, imu_rows)]
    if samples.mag is not None:
        field, field_layout = (
            TESLA_PER_MICROTESLA * samples.mag,
            magnetic_field_layout(sensor_frame(name)),
        )

        def mag_rows(part: slice, stamps: np.ndarray) -> np.ndarray:
            own = order[part]
            return field_layout.fill(len(own), **_stamp(stamps), field=field[own])

        streams.append(Stream(f"/{name}/imu/mag", MAGNETIC_FIELD, time, mag_rows))
    return streams


def _orientation_at(
    source: ExportSource, name: str, time_ns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Orientation x, y, z, w and its covariance (9) at the samples.

    -1 and no rotation where it is not known.
    """
    q = source.orientation_at(name, time_ns)
    known = np.isfinite(q).all(axis=1)
    q[~known] = (1.0, 0.0, 0.0, 0.0)
    covariance = np.zeros((len(q), 9))
    covariance[~known, 0] = NOT_ESTIMATED
    return np.roll(q, -1, axis=1), covariance


def _joint_stream(arm: ArmSamples) -> Stream:
    layout = joint_state_layout("", arm.joint_names)

    def rows(part: slice, stamps: np.ndarray) -> np.ndarray:
        return layout.fill(
            len(stamps),
            **_stamp(stamps),
            position=arm.q_measured[part],
            velocity=arm.v_measured[part],
        )

    return Stream("/joint_states", JOINT_STATE, arm.host_time_ns, rows)


def _transform_stream(topic: str, transforms: Transforms, latched: bool = False) -> Stream:
    layout = transforms_layout(transforms.frames)
    q_xyzw = [np.roll(q, -1, axis=1) for q in transforms.q_parent_from_child]

    def rows(part: slice, stamps: np.ndarray) -> np.ndarray:
        values: dict[str, np.ndarray] = {}
        for i, translation in enumerate(transforms.translation):
            values |= _stamp(stamps, f"_{i}") | {
                f"translation_{i}": translation[part],
                f"q_xyzw_{i}": q_xyzw[i][part],
            }
        return layout.fill(len(stamps), **values)

    return Stream(topic, TF_MESSAGE, transforms.time_ns, rows, latched)


def _stamp(stamps: np.ndarray, mark: str = "") -> dict[str, np.ndarray]:
    return {f"sec{mark}": stamps // NANOSECONDS, f"nanosec{mark}": stamps % NANOSECONDS}


def _write_in_order(
    writer: Writer, streams: list[Stream], channels: dict[str, int], start_ns: int
) -> None:
    """Every message in the order of its stamp, a window of time after the other."""
    begin = min((int(stream.time_ns[0]) for stream in streams), default=0)
    end = max((int(stream.time_ns[-1]) for stream in streams), default=-1)
    sequence = dict.fromkeys(channels, 0)
    while begin <= end:
        messages: list[tuple[str, memoryview]] = []
        stamps: list[np.ndarray] = []
        for stream in streams:
            part = slice(*np.searchsorted(stream.time_ns, [begin, begin + WINDOW_NS]).tolist())
            own = start_ns + stream.time_ns[part]
            if len(own):
                rows = stream.rows(part, own)
                content, length = memoryview(rows.tobytes()), rows.shape[1]
                messages += [
                    (stream.topic, content[i * length : (i + 1) * length]) for i in range(len(own))
                ]
                stamps.append(own)
        times = np.concatenate(stamps) if stamps else np.zeros(0, dtype=np.int64)
        ordered = np.argsort(times, kind="stable")
        for row, stamp in zip(ordered.tolist(), times[ordered].tolist(), strict=True):
            topic, data = messages[row]
            sequence[topic] += 1
            writer.add_message(channels[topic], stamp, data, stamp, sequence[topic])
        begin += WINDOW_NS
