"""OpenSim .sto: orientations of sensors, as OpenSense takes them, become device orientations.

Each column is a sensor, named after the body it is on (`pelvis_imu`), its quaternion (w, x, y, z)
turning the sensor into the world. The format does not say where up is: it is taken for z, as
the files that OpenSense converts from vendors' have it, unless the header of an export of this
bench says that the world was turned to OpenSim's ground, y up.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import asked_stamps
from testbench.formats.tables.samples_stream import (
    Quantities,
    SampleStream,
    measured_rate,
    stack,
)
from testbench.formats.tables.source import Columns
from testbench.formats.tables.sto_table import AXES, TIME, StoTable, find_sto
from testbench.model import rotation
from testbench.records.findings.catalogue import finding

Q_WORLD_FROM_GROUND = rotation.from_rotation_vector(np.array([np.pi / 2, 0.0, 0.0]))
"""From OpenSim's ground (y up) to the world (z up): x stays, ground y becomes world z."""


def read(files: list[Path], options: Options) -> Recording:
    """Read one file.

    Args:
        files: One .sto file of quaternions.
        options: Rate, in place of the file's times.

    Raises:
        InputError: Not one file.
        FileProblems: The file is no table of orientations.
    """
    if len(files) != 1:
        raise InputError(f"an OpenSim table is one file, {len(files)} were given")
    table = find_sto(files[0])
    ground = "y up" in table.header.get("frame", "")
    findings = [finding("orientation.y_up" if ground else "orientation.z_up", files[0].name)]
    sensors: dict[str, ImportedSensor] = {}
    for name, body in zip(unique_names(table.bodies), table.bodies, strict=True):
        sensors[name] = _sensor(table, body, ground, options)
    return suited_recording(
        sensor_name(files[0].stem),
        "orientations in an OpenSim table",
        sensors,
        findings,
    )


def _sensor(table: StoTable, body: str, ground: bool, options: Options) -> ImportedSensor:
    titles = [f"{body}_{axis}" for axis in AXES]

    def convert(columns: Columns) -> Quantities:
        q = stack(columns, titles)
        return Quantities(
            None, None, None, rotation.multiply(Q_WORLD_FROM_GROUND, q) if ground else q
        )

    stated = options.rate_or(None)
    stamps = asked_stamps(table, TIME, "s", body, options)
    stream = SampleStream(table, dict.fromkeys(titles, "float"), convert, stamps.timeline)
    rate = stated or measured_rate(stream.first())
    if rate is None:
        raise table.problem("its times tell no rate; state it with --rate HZ")
    return ImportedSensor(
        stream,
        round(rate, 3),
        f"orientation of {body} in an OpenSim table",
        findings=stamps.findings,
        told=stream.findings,
    )
