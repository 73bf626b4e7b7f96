"""x-io NGIMU: sensors.csv and quaternion.csv of a device.

The vendor's software writes them in one folder a device.

Titles carry their units: Time (s), Gyroscope X (deg/s), Accelerometer X (g), Magnetometer X (uT);
quaternion.csv has W, X, Y, Z. The device's quaternion turns vectors of the earth (x magnetic north,
y west, z up) into the sensor; a session keeps its conjugate, from east, north, up. (Direction and
earth were found from the vendor's own example: only so does it turn the vertical into the measured
gravity, its steps are the measured rates, and the measured field points north.)
"""

from __future__ import annotations

import re
from pathlib import Path

from testbench.exceptions import InputError
from testbench.formats.common_clock import share_clock
from testbench.formats.device_folders import by_folder
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.joined_table import Joined, JoinedTable
from testbench.formats.tables.recognise import Found, find_sensors, find_time
from testbench.formats.tables.text_table import TextTable, find_table
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

_HEADER = re.compile(r"^\W*Time\b.*(Gyroscope|Accelerometer|\bW\b|Quaternion)", re.IGNORECASE)
Q = ["W", "X", "Y", "Z"]
_FILES = {"sensors": "sensors.csv", "quaternion": "quaternion.csv"}


def read(files: list[Path], options: Options) -> Recording:
    """Read one or more devices.

    Args:
        files: For each device sensors.csv, quaternion.csv or both; files in one folder belong
            together.
        options: Units, where they are not those of the titles.

    Raises:
        InputError: No files, or two of a kind for one device.
        FileProblems: A file is not of this format.
    """
    if not files:
        raise InputError("an NGIMU recording needs sensors.csv, quaternion.csv or both")
    what = "an NGIMU CSV (its header has Time (s) and Gyroscope X (deg/s), or W, X, Y, Z)"
    encoding = options.encoding_or(None)
    tables = (find_table(file, _HEADER, what, encoding=encoding)[0] for file in files)
    devices = by_folder(tables, _kind, _FILES)
    names = unique_names(_device_name(tables, folder) for folder, tables in devices.items())
    findings: list[Finding] = []
    sensors = {}
    for name, own in zip(names, devices.values(), strict=True):
        sensors[name] = _device(name, own, options, findings)
    label = names[0] if len(names) == 1 else "ngimu"
    return suited_recording(
        sensor_name(label),
        "NGIMU recording",
        sensors,
        [*share_clock(sensors, "the time that NGIMUs of one session write"), *findings],
    )


def _kind(table: TextTable) -> str:
    return "quaternion" if set(Q) <= set(table.names) else "sensors"


def _device_name(tables: dict[str, TextTable], folder: Path) -> str:
    stem = next(iter(tables.values())).file.stem
    return folder.name if stem.lower() in {"sensors", "quaternion"} else stem


def _device(
    name: str, tables: dict[str, TextTable], options: Options, findings: list[Finding]
) -> ImportedSensor:
    times = {kind: _time(table) for kind, table in tables.items()}
    source: TextTable | JoinedTable
    found = Found()
    if "sensors" in tables:
        source = tables["sensors"]
        found = find_sensors(source.names).get("", Found())
        if not {"acc", "gyr"} & found.columns.keys():
            raise source.problem(
                f"has no accelerometer and no gyroscope; it has {', '.join(source.names)}"
            )
    if "quaternion" in tables:
        q_table = tables["quaternion"]
        source = q_table
        if "sensors" in tables:
            orientation = Joined(q_table, times["quaternion"], {q: q for q in Q}, turns=True)
            source = JoinedTable(tables["sensors"], times["sensors"], [orientation])
        found.columns["quaternion"] = list(Q)
        if "sensors" in tables:
            file, main = q_table.file.name, tables["sensors"].file.name
            findings.append(
                finding("structure.at_times_of", name, quantity="quaternion", file=file, main=main)
            )
        else:
            findings.append(finding("derived.missing_file", name, file="sensors.csv"))
    first = "sensors" if "sensors" in tables else "quaternion"
    layout = Layout(
        "x-io NGIMU",
        {"acc": "g", "gyr": "deg/s", "mag": "uT"},
        times[first],
        "s",
        conjugate=True,
        earth="NWU",
    )
    return table_sensor(source, found, layout, name, options, findings)


def _time(table: TextTable) -> str:
    found = find_time(table.names)
    if found is None:
        raise table.problem(f"has no column Time (s); it has {', '.join(table.names)}")
    return found[0]
