"""Bags of ROS 1 and ROS 2, and MCAP: sensor_msgs/Imu, and sensor_msgs/MagneticField beside it.

Each topic of inertial messages is a sensor. Angular rate and specific force are in SI, the
orientation turns the sensor into the world, z up (REP 103, REP 145); the first element of a
covariance is -1 where the message does not hold the quantity (definition of sensor_msgs/Imu). The
field is in tesla. Times are the stamps of the headers, which all topics of a bag have in common.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, InputError
from testbench.formats.common_clock import share_origin
from testbench.formats.dates import Recorded
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.joined_table import Joined, JoinedTable
from testbench.formats.tables.recognise import Found
from testbench.formats.tables.ros_bag import IMU, MAGNETIC_FIELD, Bag, open_bag
from testbench.formats.tables.source import Columns, Kind, Source
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

TIME = "stamp"
ABSENT = -1.0
MICROTESLA = 1e6
_COMMON = {"imu", "data", "data_raw", "raw", "imu_raw", "mag", "magnetic_field", "imu_data"}
"""Last parts of topics that name no sensor."""
_EARLIEST_NS = 946_684_800 * NANOSECONDS
"""The year 2000: earlier stamps are those of a clock that was never set [ns since 1970]."""
_PARTS = {
    "quaternion": (slice(0, 4), 4, "xyzw"),
    "gyr": (slice(13, 16), 16, "xyz"),
    "acc": (slice(25, 28), 28, "xyz"),
}
"""Where an inertial message has its numbers: the quantity's, and the first of its covariance."""
_WORDS = {"quaternion": "orientation", "gyr": "angular rate", "acc": "acceleration"}


@dataclass(frozen=True)
class Topic:
    """The messages of one topic as a table.

    Attributes:
        bag: Where they are.
        topic: Its name.
        logged: Whether times are those of the recording, as the headers have none.
    """

    bag: Bag
    topic: str
    logged: bool

    @property
    def names(self) -> list[str]:
        """Of the columns."""
        if self.bag.topics[self.topic] == MAGNETIC_FIELD:
            return [TIME, "mag_x", "mag_y", "mag_z"]
        own = [f"{part}_{axis}" for part, (_, _, axes) in _PARTS.items() for axis in axes]
        return [TIME, *own]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        for stamps, logged, values in self.bag.numbers(self.topic):
            columns = {TIME: logged if self.logged else stamps}
            if self.bag.topics[self.topic] == MAGNETIC_FIELD:
                field = MICROTESLA * values[:, :3]
                columns |= dict(zip(self.names[1:], field.T, strict=True))
            else:
                columns |= _inertial(values)
            yield {name: columns[name] for name in kinds}

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the topic, or of one of its messages (from 1)."""
        place = self.topic + ("" if row is None else f", message {row + 1}")
        return self.bag.problem(f"{place}: {message}")


def _inertial(values: np.ndarray) -> Columns:
    """Columns of inertial messages; NaN where they do not hold a quantity."""
    columns: Columns = {}
    for part, (place, covariance, axes) in _PARTS.items():
        array = values[:, place].copy()
        array[values[:, covariance] == ABSENT] = np.nan
        if part == "quaternion":
            array[~np.any(array != 0, axis=1)] = np.nan
        columns |= {f"{part}_{axis}": array[:, i] for i, axis in enumerate(axes)}
    return columns


def read(files: list[Path], options: Options) -> Recording:
    """Read one bag.

    Args:
        files: One file or folder, or the files of a bag that was split.
        options: Rate, in place of the stamps.

    Raises:
        InputError: No files, or the package that reads bags is not installed.
        FileProblems: A file is no bag, is damaged, or holds no inertial messages.
    """
    if not files:
        raise InputError("a recording of ROS needs a bag")
    bag = open_bag(files)
    topics = bag.of(IMU)
    if not topics:
        listing = ", ".join(f"{topic} ({kind})" for topic, kind in bag.topics.items()) or "nothing"
        raise bag.problem(f"no topic of {IMU}; the bag has {listing}")
    findings: list[Finding] = []
    fields = _fields(topics, bag.of(MAGNETIC_FIELD))
    sensors: dict[str, ImportedSensor] = {}
    for name, topic in zip(unique_names(map(_plain, topics)), topics, strict=True):
        sensor = _sensor(bag, topic, fields.get(topic), name, options, findings)
        if sensor is not None:
            sensors[name] = sensor
    if not sensors:
        raise bag.problem("its topics of inertial messages are empty")
    origin = None if options.rate is not None else share_origin(sensors.values())
    return suited_recording(
        sensor_name(files[0].stem),
        "recording in a bag of ROS",
        sensors,
        findings,
        recorded=_date(origin),
        origin_ns=origin,
    )


def _date(origin: int | None) -> Recorded | None:
    if origin is None or origin < _EARLIEST_NS:
        return None
    return Recorded(
        datetime.fromtimestamp(origin // NANOSECONDS, UTC), "the first stamp of the bag"
    )


def _plain(topic: str) -> str:
    """A topic without the parts that name no sensor."""
    parts = [part for part in topic.split("/") if part]
    own = list(parts)
    while own and own[-1].lower() in _COMMON:
        own.pop()
    return "_".join(own or parts[:1])


def _fields(topics: list[str], fields: list[str]) -> dict[str, str]:
    """The topic of the magnetic field that belongs to each of inertial messages.

    It is the one below the same name, or the only one beside a single sensor.
    """
    if len(topics) == 1 and len(fields) == 1:
        return {topics[0]: fields[0]}
    found = {}
    for topic in topics:
        near = [f for f in fields if f.rpartition("/")[0] == topic.rpartition("/")[0]]
        near = near or [f for f in fields if _plain(f) == _plain(topic)]
        if len(near) == 1:
            found[topic] = near[0]
    return found


def _sensor(
    bag: Bag, topic: str, field: str | None, name: str, options: Options, findings: list[Finding]
) -> ImportedSensor | None:
    """The sensor of a topic, None where it has no messages."""
    first = next(bag.numbers(topic), None)
    if first is None:
        findings.append(finding("structure.empty_topic", name, topic=topic))
        return None
    stamps, _, values = first
    logged = not stamps.any()
    if logged:
        findings.append(finding("time.of_recorder", name))
    findings.append(finding("structure.topic", name, topic=topic))
    if field is not None:
        findings.append(finding("structure.field_topic", name, topic=field))
    columns = _inertial(values)
    found = Found()
    for part, (_, _, axes) in _PARTS.items():
        titles = [f"{part}_{axis}" for axis in ("wxyz" if part == "quaternion" else axes)]
        if np.isfinite(columns[titles[0]]).any():
            found.columns[part] = titles
        else:
            findings.append(
                finding("derived.missing", name, source="its topic", quantity=_WORDS[part])
            )
    source: Source = Topic(bag, topic, logged)
    if field is not None and next(bag.numbers(field), None) is not None:
        found.columns["mag"] = ["mag_x", "mag_y", "mag_z"]
        joined = Topic(bag, field, logged)
        source = JoinedTable(
            source, TIME, [Joined(joined, TIME, {m: m for m in found.columns["mag"]})]
        )
    layout = Layout(
        "inertial sensor in ROS", {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}, TIME, "ns"
    )
    return table_sensor(source, found, layout, name, options, findings)
