"""Technaid Tech-IMU / Tech-MCS: CSV converted from the vendor's captures.

There are blanks around the titles of the columns.

The vendor publishes no layout of a CSV; the titles are recognised by their usual spellings. Several
IMUs may stand in one file, each with its name before its columns (`IMU1 AccX`, `Shank_GyrZ`).
Physical data come at 60 Hz at most beside quaternions.
"""

from __future__ import annotations

import re
from pathlib import Path

from testbench.exceptions import InputError
from testbench.formats.names import sensor_name, stem_without_stamp, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import Recording
from testbench.formats.suitable import suitable_analysis
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.recognise import find_sensors, find_time
from testbench.formats.tables.text_table import find_table

_HEADER = re.compile(r"acc\w*[\s_.\-]*x|gyr\w*[\s_.\-]*x|(quat\w*|q)[\s_.\-]*[w0]\b", re.IGNORECASE)


def read(files: list[Path], options: Options) -> Recording:
    """Read files, each with one or more sensors.

    Args:
        files: CSV files.
        options: Rate, and units where the titles do not state them.

    Raises:
        InputError: No files, or a rate or unit is open.
        FileProblems: A file is not of this format.
    """
    if not files:
        raise InputError("a Technaid recording needs at least one file")
    notes: list[str] = []
    parts = []
    for file in files:
        table, _ = find_table(
            file,
            _HEADER,
            "a Technaid CSV (no titles such as AccX, GyrX or q0)",
            encoding=options.encoding_or(None),
        )
        sensors = find_sensors(table.names)
        if not sensors:
            raise table.problem(
                "no complete accelerometer, gyroscope or quaternion among its columns: "
                f"{', '.join(table.names)}"
            )
        parts += [(file, table, prefix, found) for prefix, found in sensors.items()]
    names = unique_names(prefix or stem_without_stamp(file.stem) for file, _, prefix, _ in parts)
    result = {}
    for name, (_, table, _, found) in zip(names, parts, strict=True):
        time = find_time(table.names)
        unit = time[1] or "s" if time else "s"
        column = time[0] if time else None
        layout = Layout("Technaid Tech-IMU", {}, column, unit)  # type: ignore[arg-type]
        if time and time[1] is None and options.rate is None:
            notes.append(
                f"{name}: the column {time[0]} is taken for seconds; state --rate if it is not"
            )
        result[name] = table_sensor(table, found, layout, name, options, notes)
    heads = [head for head in (sensor.head() for sensor in result.values()) if head is not None]
    label = sensor_name(stem_without_stamp(files[0].stem)) if len(files) == 1 else "technaid"
    return Recording(label, "Technaid recording", result, suitable_analysis(heads), notes)
