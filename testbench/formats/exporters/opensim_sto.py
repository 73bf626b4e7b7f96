"""Sensor orientations for OpenSense (OpenSim): a table of quaternions, one column a sensor."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.exporters.opensim_text import data_rate, gap_notes, overlap, write_text
from testbench.formats.exporters.settings import settings_lines
from testbench.formats.exporters.source import ExportSource
from testbench.formats.opensim_names import body_name
from testbench.model import rotation

GROUND = "opensim ground, y up: world turned by -90 deg about x"
WORLD = "world, z up"
OPENSIM_VERSION = "4.5"
"""Of the format; OpenSim asks for some version and reads all of them alike."""

Q_GROUND_FROM_WORLD = rotation.from_rotation_vector(np.array([-np.pi / 2, 0.0, 0.0]))
"""From z up to OpenSim's y up: x stays, world z becomes ground y, world y becomes ground -z."""


def write(source: ExportSource, path: Path) -> list[str]:
    """Write the file.

    Raises:
        InputError: The sensors were never recorded at the same time.
    """
    series = {name: source.orientation(name) for name in source.sensor_names}
    times = {f"sensor '{name}'": time for name, (time, _) in series.items()}
    if not times:
        raise InputError(f"{source.session.path} has no sensors")
    first = next(iter(times.values()))
    time_ns = first[overlap(times)]
    columns = [
        _continuous(_turned(rotation.interpolate(time, q, time_ns), source))
        for time, q in series.values()
    ]
    ground = source.frame == "opensim"
    header = [
        f"DataRate={data_rate(time_ns):.6f}",
        "DataType=Quaternion",
        "version=3",
        f"OpenSimVersion={OPENSIM_VERSION}",
        f"session={source.session.name}",
        f"filter={source.filter}",
        *settings_lines(source),
        f"frame={GROUND if ground else WORLD}",
    ]
    texts = "\t".join(["%.9f,%.9f,%.9f,%.9f"] * len(series))
    write_text(path, header, column_names(source), time_ns, texts, np.column_stack(columns))
    rotations = "0 0 0" if ground else "-1.5707963267948966 0 0"
    return [
        f"in OpenSense set sensor_to_opensim_rotations to {rotations}",
        *gap_notes(times, int(time_ns[0]), int(time_ns[-1])),
    ]


def column_names(source: ExportSource) -> list[str]:
    """<segment>_imu for each sensor.

    Without a segment it is the body of OpenSim's models that the sensor is called after, else
    <sensor>_imu; so is one of several sensors on one segment.
    """
    placed, body = source.session.analysis.sensors, source.session.analysis.body
    stated = {} if body is None else dict(body.segments)
    stated |= {name: own.segment for name, own in placed.items() if own.segment is not None}
    segments = {
        name: stated[name].name if name in stated else body_name(name)
        for name in source.sensor_names
    }
    counts = Counter(segments.values())
    return [
        f"{segment if counts[segment] == 1 else name}_imu" for name, segment in segments.items()
    ]


def _turned(q_world_from_sensor: np.ndarray, source: ExportSource) -> np.ndarray:
    """In the frame that was asked for, shape (n, 4)."""
    if source.frame == "world":
        return q_world_from_sensor
    return rotation.multiply(Q_GROUND_FROM_WORLD, q_world_from_sensor)


def _continuous(q: np.ndarray) -> np.ndarray:
    """The same rotations with signs that do not jump, the first with w >= 0, shape (n, 4)."""
    jumps = np.sum(q[1:] * q[:-1], axis=1) < 0
    signs = np.cumprod(
        np.concatenate([[1.0 if q[0, 0] >= 0 else -1.0], np.where(jumps, -1.0, 1.0)])
    )
    return q * signs[:, None]
