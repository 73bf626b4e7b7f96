"""MATRIX (ICM-40607): CSV at 100 Hz, with stamps of whole seconds.

Its columns are dateTime, acc_x..z [g], gyr_x..z [deg/s] and temperatures.

Source: Castellanos Alonso, Universidad de Oviedo, 2023.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.assumed import assumed_units
from testbench.formats.dates import earliest, recorded
from testbench.formats.names import sensor_name, stem_without_stamp, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.samples_stream import Quantities, SampleStream, stack
from testbench.formats.tables.source import Columns, Kind, first_rows
from testbench.formats.tables.text_table import find_table, head_of
from testbench.formats.tables.timeline import SpreadTime, StampedTime, rate_of_stamps
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

NOMINAL_RATE = 100.0
TEMPERATURE = "ambient_temp"
ACC, GYR = ["acc_x", "acc_y", "acc_z"], ["gyr_x", "gyr_y", "gyr_z"]


def read(files: list[Path], options: Options) -> Recording:
    """Read one file for each sensor.

    Args:
        files: CSV files.
        options: Rate and units, where they are not the usual ones.

    Raises:
        InputError: No files.
        FileProblems: A file is not of this format.
    """
    if not files:
        raise InputError("a MATRIX recording needs at least one file")
    names = unique_names(stem_without_stamp(file.stem) for file in files)
    sensors: dict[str, ImportedSensor] = {}
    findings: list[Finding] = []
    dates = []
    for name, file in zip(names, files, strict=True):
        sensors[name], first = _sensor(name, file, options)
        dates.append(recorded(first, f"dateTime in {file.name}"))
    if len(files) > 1:
        findings.append(finding("clock.seconds"))
    label = sensor_name(files[0].stem) if len(files) == 1 else "matrix"
    purpose = "MATRIX recording (accelerometer and gyroscope)"
    return suited_recording(
        label,
        purpose,
        sensors,
        findings,
        recorded=earliest(dates),
    )


# One piece: the titles that are found decide what is checked, converted and noted.
def _sensor(name: str, file: Path, options: Options) -> tuple[ImportedSensor, str]:
    """The sensor, and its first stamp as it is written."""
    header = re.compile(r"^(?=.*\bdateTime\b)(?=.*\bacc_x\b)", re.IGNORECASE)
    table, _ = find_table(
        file,
        header,
        "a MATRIX export (its header has dateTime, acc_x..z, gyr_x..z)",
        encoding=options.encoding_or(None),
    )
    titles = {name.lower(): name for name in table.names}
    wanted = ["datetime", *ACC, *GYR]
    missing = [name for name in wanted if name not in titles]
    if missing:
        raise table.problem(
            f"not a MATRIX export: it lacks the column {', '.join(missing)}; it has "
            f"{', '.join(table.names)}"
        )
    stamp = titles["datetime"]
    acc_unit, gyr_unit = options.unit("acc", "g"), options.unit("gyr", "deg/s")
    assert acc_unit is not None
    assert gyr_unit is not None
    findings = assumed_units(name, {"acc": "g", "gyr": "deg/s"}, options)
    rate = options.rate_or(None)
    first_stamps = first_rows(table, {stamp: "clock"})[stamp]
    whole_s = 60.0 if np.all(first_stamps % 60 == 0) and len(first_stamps) > 1 else 1.0
    if rate is None:
        seconds = StampedTime(stamp, "clock")
        stamps = [seconds(columns, len(columns[stamp])) for columns in table.chunks(seconds.kinds)]
        all_stamps = np.concatenate(stamps) // NANOSECONDS
        rate, doubt = rate_of_stamps(all_stamps, NOMINAL_RATE, whole_s)
        if whole_s > 1 and np.isinf(doubt):
            raise table.problem(
                f"{stamp} has whole minutes, and none of them is whole in the file: state the "
                "sampling rate with --rate HZ"
            )
        unit = "minutes" if whole_s > 1 else "seconds"
        findings.append(
            finding("time.nominal", name, unit=unit, rate_hz=rate)
            if np.isinf(doubt)
            else finding("time.spread", name, unit=unit, rate_hz=rate, within_hz=doubt)
        )
    kinds: dict[str, Kind] = dict.fromkeys(
        [titles[name] for name in [*ACC, *GYR, TEMPERATURE] if name in titles], "float"
    )

    def convert(columns: Columns) -> Quantities:
        gyr = stack(columns, [titles[name] for name in GYR], gyr_unit.factor)
        degrees = columns[titles[TEMPERATURE]] if TEMPERATURE in titles else None
        return Quantities(
            gyr,
            stack(columns, [titles[name] for name in ACC], acc_unit.factor),
            temperature=degrees,
        )

    known = {*wanted, TEMPERATURE}
    left = [title for title in table.names if title and title.lower() not in known]
    if left:
        findings.append(finding("structure.columns_left", name, columns=left))
    stream = SampleStream(table, kinds, convert, lambda: SpreadTime(stamp, rate, whole_s))
    below = head_of(file, options.encoding)[table.first_line - 1 :]
    first = next((line for line in below if line.strip()), "")
    stamps_text = dict(zip(table.names, split_line(first, table.separator), strict=False)).get(
        stamp, ""
    )
    return (
        ImportedSensor(
            stream,
            rate,
            "MATRIX (ICM-40607), accelerometer and gyroscope",
            findings=findings,
        ),
        stamps_text,
    )
