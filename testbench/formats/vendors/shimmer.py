"""Shimmer: CSV or TSV exported by Consensys.

`sep=`, a row of titles (`Shimmer_40AC_Gyro_X_CAL`), a row of units, the samples.

Calibrated columns (`_CAL`) are read, of the low-noise accelerometer if there is one, else of the
wide-range one. The magnetic field is in units of the local field; stamps are milliseconds (Unix or
since power-up) or a date with a time of day.
"""

from __future__ import annotations

import re
from pathlib import Path

from testbench.exceptions import InputError
from testbench.formats.common_clock import share_clock
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.recognise import Found
from testbench.formats.tables.text_table import TextTable, find_table, head_of
from testbench.formats.tables.units import TimeUnit, known_unit
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

_HEADER = re.compile(r"(Accel|Gyro)\w*_[XYZ]_(CAL|RAW)|Timestamp\w*_(CAL|RAW)")
_SIGNAL = re.compile(
    r"^(?P<device>.*?)_?(?P<kind>Accel_LN|Accel_WR|Accel|Gyro|Mag|Timestamp\w*?)"
    r"(?:_(?P<axis>[XYZ]))?_(?P<form>CAL|RAW)$"
)
_KINDS = [
    ("acc", "Accel_LN"),
    ("acc", "Accel"),
    ("acc", "Accel_WR"),
    ("gyr", "Gyro"),
    ("mag", "Mag"),
]


def read(files: list[Path], options: Options) -> Recording:
    """Read files, each with one or more devices.

    Args:
        files: As Consensys exports them.
        options: Units, where the file's row of units is missing.

    Raises:
        InputError: No files.
        FileProblems: A file is not of this format.
    """
    if not files:
        raise InputError("a Shimmer recording needs at least one file")
    findings: list[Finding] = []
    parts = []
    for file in files:
        parts += [(file, *part) for part in _devices(file, options.encoding_or(None), findings)]
    names = unique_names(device or file.stem for file, device, *_ in parts)
    sensors = {}
    for name, (_, _, table, found, layout) in zip(names, parts, strict=True):
        sensors[name] = table_sensor(table, found, layout, name, options, findings)
    label = sensor_name(files[0].stem) if len(files) == 1 else "shimmer"
    return suited_recording(
        label,
        "Shimmer recording exported by Consensys",
        sensors,
        [*share_clock(sensors, None, "clock.power_up"), *findings],
    )


# One piece: titles and units of one header are sorted by device.
def _devices(
    file: Path, encoding: str | None, findings: list[Finding]
) -> list[tuple[str, TextTable, Found, Layout]]:
    lines = head_of(file, encoding)
    at = next((i for i, line in enumerate(lines) if _HEADER.search(line)), None)
    following = lines[at + 1] if at is not None and at + 1 < len(lines) else ""
    has_units = bool(re.search(r"m/\(?s|deg/s|\bms\b|no_units|mSecs", following))
    table, _ = find_table(
        file,
        _HEADER,
        "a Consensys export (no titles such as Shimmer_40AC_Gyro_X_CAL)",
        int(has_units),
        encoding,
    )
    units = (
        dict(zip(table.names, split_line(following, table.separator), strict=False))
        if has_units
        else {}
    )
    seen: dict[str, dict[str, dict[str, str]]] = {}
    for title in table.names:
        match = _SIGNAL.match(title)
        if match and match.group("form") == "CAL":
            seen.setdefault(match.group("device"), {}).setdefault(match.group("kind"), {})[
                match.group("axis") or ""
            ] = title
    result = []
    for device, kinds in seen.items():
        found = Found()
        for quantity, kind in _KINDS:
            if quantity not in found.columns and set("XYZ") <= set(kinds.get(kind, {})):
                found.columns[quantity] = [kinds[kind][axis] for axis in "XYZ"]
                unit = units.get(found.columns[quantity][0], "")
                if known_unit(quantity, unit):
                    found.units[quantity] = unit
                elif unit:
                    raise table.problem(
                        f"the unit '{unit[:40]}' of {found.columns[quantity][0]} is unknown"
                    )
        if not found.columns.keys() & {"acc", "gyr"}:
            continue
        time, unit = _time(table, kinds, units)
        if "Accel_LN" in kinds and "Accel_WR" in kinds:
            findings.append(
                finding(
                    "structure.one_of_several",
                    device,
                    quantity="specific force",
                    taken="the low-noise accelerometer",
                    others="the wide-range one",
                )
            )
        result.append(
            (
                device,
                table,
                found,
                Layout("Shimmer", {"acc": "m/s^2", "gyr": "deg/s", "mag": "au"}, time, unit),
            )
        )
    if not result:
        raise table.problem(
            "no calibrated accelerometer or gyroscope (titles that end in _X_CAL); export "
            "calibrated data"
        )
    return result


def _time(
    table: TextTable, kinds: dict[str, dict[str, str]], units: dict[str, str]
) -> tuple[str | None, TimeUnit]:
    stamps = [
        columns[""]
        for kind, columns in kinds.items()
        if kind.startswith("Timestamp") and "" in columns
    ]
    stamps.sort(
        key=lambda title: ("Formatted" in title, "Unix" not in title, "Sync" not in title)
    )  # numbers before dates, those that other devices share before others
    if not stamps:
        return None, "ms"
    unit = units.get(stamps[0], "ms")
    if "Formatted" in stamps[0] or ":" in unit:
        return stamps[0], "clock"
    if unit in {"ms", "mSecs", "mSec"}:
        return stamps[0], "ms"
    if unit in {"s", "secs", "sec"}:
        return stamps[0], "s"
    raise table.problem(f"the unit '{unit[:40]}' of {stamps[0]} is unknown")
