"""x-io x-IMU3: the CSV files of the maker's software, one a message type, a folder a device.

Inertial.csv holds gyroscope and accelerometer; Magnetometer.csv, Quaternion.csv and the others come
at rates of their own, on the same clock of microseconds, and are brought to its times. Titles carry
units; their words changed with the software (`X (a.u.)`, `X Axis (a.u.)`, `Magnetometer X (a.u.)`).

By the maker's own examples (github xioTechnologies/x-IMU3-CSV, Examples/Logged Data): quaternion
and matrix turn vectors of the sensor into the earth's (x magnetic north, y west, z up), as only so
the measured gravity becomes vertical and the measured field points north; quaternions are longer
than one by 1e-4; the magnetometer's arbitrary unit is the earth's field in one recording (norm 1.2)
and about a microtesla in another (norm 66).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.common_clock import share_clock
from testbench.formats.dates import Recorded, earliest, recorded
from testbench.formats.device_folders import by_folder
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.joined_table import Joined, JoinedTable
from testbench.formats.tables.recognise import Found
from testbench.formats.tables.source import Columns, Kind, Source, first_rows
from testbench.formats.tables.text_table import TextTable, find_table
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

_HEADER = re.compile(r"^\W*Timestamp\b.*\(us\)", re.IGNORECASE)
TIME = re.compile(r"^timestamp \(us\)$", re.IGNORECASE)
MESSAGES = {
    "inertial": "Inertial",
    "magnetometer": "Magnetometer",
    "quaternion": "Quaternion",
    "linear": "LinearAcceleration",
    "earth": "EarthAcceleration",
    "matrix": "RotationMatrix",
    "euler": "EulerAngles",
}
"""Files that are read, by kind; of those that hold an orientation the first is taken."""
LEFT_OUT = (
    *("Temperature", "HighGAccelerometer", "AhrsStatus", "Battery", "Rssi"),
    *("SerialAccessory", "Notification", "Error"),
)
_TITLES = {
    "gyr": (r"gyroscope {}", "xyz"),
    "acc": (r"accelerometer {}", "xyz"),
    "mag": (r"(magnetometer )?{}", "xyz"),
    "quaternion": (r"(quaternion )?{}", "wxyz"),
    "matrix": (r"(rotation matrix )?{}", ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz")),
    "euler": (r"{}( angle)?", ("roll", "pitch", "yaw")),
}
_FIRST_SOLD = 2021
"""A date before it is that of a clock that was never set."""
LARGEST_NORMALISED = 5.0
"""A field of more arbitrary units than this is not normalised to the earth's: microtesla then."""
Q = ("q_w", "q_x", "q_y", "q_z")


@dataclass(frozen=True)
class Orientations:
    """A table of orientations in any of the maker's forms, as unit quaternions.

    Attributes:
        table: Of the file.
        time: Its column of times.
        titles: Of the form's columns.
        convert: From these, shape (n, k), to q_earth_from_sensor, shape (n, 4).
    """

    table: TextTable
    time: str
    titles: list[str]
    convert: Callable[[np.ndarray], np.ndarray]

    @property
    def names(self) -> list[str]:
        """The time and the parts of the quaternion."""
        return [self.time, *Q]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        wanted: dict[str, Kind] = dict.fromkeys([self.time, *self.titles], "float")
        for chunk in self.table.chunks(wanted):
            values = np.column_stack([chunk[title] for title in self.titles])
            q = np.full((len(values), 4), np.nan)
            known = np.isfinite(values).all(axis=1) & np.any(values != 0, axis=1)
            if known.any():
                q[known] = self.convert(values[known])
            columns = {self.time: chunk[self.time], **dict(zip(Q, q.T, strict=True))}
            yield {name: columns[name] for name in kinds}

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the file."""
        return self.table.problem(message, row)


def read(files: list[Path], options: Options) -> Recording:
    """Read one or more devices.

    Args:
        files: Inertial.csv, Magnetometer.csv, Quaternion.csv and others, or folders of them; files
            in one folder belong together.
        options: Units, where they are not those of the titles.

    Raises:
        InputError: No files, or two of a kind for one device.
        FileProblems: A file is not of this format.
    """
    findings: list[Finding] = []
    what = "an x-IMU3 CSV (its header begins with Timestamp (us))"
    encoding = options.encoding_or(None)
    paths = _expanded(files, findings)
    opened = (find_table(path, _HEADER, what, encoding=encoding)[0] for path in paths)
    called = {kind: f"{name}.csv" for kind, name in MESSAGES.items()}
    devices = by_folder(opened, _kind, called)
    if not devices:
        raise InputError("an x-IMU3 recording needs Inertial.csv, or the folder that holds it")
    names = unique_names(_device_name(tables, folder) for folder, tables in devices.items())
    sensors = {
        name: _device(name, tables, options, findings)
        for name, tables in zip(names, devices.values(), strict=True)
    }
    return suited_recording(
        sensor_name(names[0] if len(names) == 1 else "ximu3"),
        "x-IMU3 recording",
        sensors,
        [*share_clock(sensors, None, "clock.power_up"), *findings],
        recorded=earliest(_command_date(folder) for folder in devices),
    )


def _expanded(files: list[Path], findings: list[Finding]) -> list[Path]:
    """Files for folders, and without those that hold no motion."""
    result: list[Path] = []
    passed_over: list[str] = []
    for file in files:
        if file.is_dir():
            names = [f"{name}.csv" for name in MESSAGES.values()]
            found = [path for name in names for path in sorted(file.rglob(name))]
            if not found:
                raise FileProblems(
                    file, [Problem(f"a folder without any of {', '.join(names)} in it")]
                )
            result += found
        elif file.stem in LEFT_OUT or file.name == "Command.json":
            passed_over.append(file.name)
        else:
            result.append(file)
    if passed_over:
        findings.append(finding("structure.files_left", files=passed_over))
    return result


def _kind(table: TextTable) -> str:
    """Which message's file it is, by its titles, or by its name where those are not enough."""
    if not any(TIME.match(name) for name in table.names):
        raise table.problem(f"has no column Timestamp (us); it has {', '.join(table.names)}")
    fits = {kind: _columns(table, kind) for kind in _TITLES}
    if fits["gyr"] or fits["acc"]:
        return "inertial"
    if fits["quaternion"]:
        linear = any("acceleration" in name.lower() for name in table.names)
        if not linear:
            return "quaternion"
        return "earth" if table.file.stem == MESSAGES["earth"] else "linear"
    for quantity, kind in (("matrix", "matrix"), ("euler", "euler"), ("mag", "magnetometer")):
        if fits[quantity]:
            return kind
    raise table.problem(
        f"not one of {', '.join(f'{name}.csv' for name in MESSAGES.values())} of an x-IMU3: its "
        f"columns are {', '.join(table.names)}"
    )


def _columns(table: TextTable, quantity: str) -> list[str] | None:
    """Titles of a quantity in order, None if any is missing."""
    pattern, parts = _TITLES[quantity]
    found = []
    for part in parts:
        title = re.compile(pattern.format(part) + r"( axis| element)?( \(.*\))?", re.IGNORECASE)
        match = next((name for name in table.names if title.fullmatch(name)), None)
        if match is None:
            return None
        found.append(match)
    return found


def _device_name(tables: dict[str, TextTable], folder: Path) -> str:
    stem = next(iter(tables.values())).file.stem
    return folder.name if stem in MESSAGES.values() else stem


def _command_date(folder: Path) -> Recorded | None:
    """The date that the device was set to, by the answer to the command `time`."""
    file = folder / "Command.json"
    try:
        text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
    except OSError:
        return None
    found = re.search(r'"time"\s*:\s*"([\d: -]{1,30})"', text)
    date = recorded(found.group(1), "Command.json") if found else None
    return date if date is not None and date.at.year >= _FIRST_SOLD else None


def _device(
    name: str, tables: dict[str, TextTable], options: Options, findings: list[Finding]
) -> ImportedSensor:
    times = {
        kind: next(title for title in table.names if TIME.match(title))
        for kind, table in tables.items()
    }
    others: list[Joined] = []
    interpolated: dict[str, TextTable] = {}
    found = Found()
    orientations = _orientations(name, tables, times, findings)
    if orientations is not None:
        found.columns["quaternion"] = list(Q)
        interpolated["quaternion"] = orientations.table
        others.append(Joined(orientations, orientations.time, {q: q for q in Q}, turns=True))
    if "magnetometer" in tables:
        table = tables["magnetometer"]
        titles = _columns(table, "mag") or []
        found.columns["mag"] = ["mag_x", "mag_y", "mag_z"]
        interpolated["mag"] = table
        found.units["mag"] = _field_unit(table, titles, name, options, findings)
        others.append(
            Joined(
                table, times["magnetometer"], dict(zip(found.columns["mag"], titles, strict=True))
            )
        )
    source: Source
    if "inertial" in tables:
        source = JoinedTable(tables["inertial"], times["inertial"], others)
        found = _inertial(tables["inertial"], found)
        time = times["inertial"]
    elif orientations is not None:
        source, time = orientations, orientations.time
        found = Found({"quaternion": list(Q)})
        findings.append(finding("derived.missing_file", name, file="Inertial.csv"))
    else:
        raise tables["magnetometer"].problem(
            "a magnetometer alone tells no motion; give Inertial.csv of the same folder, too"
        )
    if "inertial" in tables:
        main = tables["inertial"].file.name
        for quantity, other in interpolated.items():
            file = other.file.name
            findings.append(
                finding("structure.at_times_of", name, quantity=quantity, file=file, main=main)
            )
    layout = Layout("x-io x-IMU3", {"acc": "g", "gyr": "deg/s"}, time, "us", earth="NWU")
    return table_sensor(source, found, layout, name, options, findings)


def _inertial(table: TextTable, found: Found) -> Found:
    for quantity in ("acc", "gyr"):
        titles = _columns(table, quantity)
        if titles:
            found.columns[quantity] = titles
            unit = re.search(r"\((.*)\)", titles[0])
            if unit:
                found.units[quantity] = unit.group(1)
    return found


def _field_unit(
    table: TextTable, titles: list[str], name: str, options: Options, findings: list[Finding]
) -> str:
    """The unit of the magnetometer; the maker's arbitrary one by the size of the field."""
    stated = re.search(r"\((.*)\)", titles[0])
    unit = stated.group(1) if stated else "a.u."
    if unit.lower() != "a.u.":
        return unit
    rows = first_rows(table, dict.fromkeys(titles, "float"))
    norms = rotation.lengths(np.column_stack([rows[title] for title in titles]))
    known = norms[np.isfinite(norms)]
    strength = float(np.median(known)) if len(known) else 0.0
    if strength <= LARGEST_NORMALISED:
        return "au"
    if not options.answered("mag"):
        findings.append(finding("unit.field_size", name, strength=strength))
    return "uT"


def _orientations(
    name: str, tables: dict[str, TextTable], times: dict[str, str], findings: list[Finding]
) -> Orientations | None:
    """The orientation by the best of the files that hold one."""
    forms = {
        "quaternion": ("quaternion", rotation.normalise),
        "linear": ("quaternion", rotation.normalise),
        "earth": ("quaternion", rotation.normalise),
        "matrix": ("matrix", _from_matrix),
        "euler": ("euler", _from_angles),
    }
    own = [kind for kind in forms if kind in tables]
    if not own:
        return None
    if own[1:]:
        taken, *others = (tables[kind].file.name for kind in own)
        findings.append(
            finding(
                "structure.one_of_several",
                name,
                quantity="orientation",
                taken=taken,
                others=others,
            )
        )
    quantity, convert = forms[own[0]]
    table = tables[own[0]]
    return Orientations(table, times[own[0]], _columns(table, quantity) or [], convert)


def _from_matrix(rows: np.ndarray) -> np.ndarray:
    """From R_earth_from_sensor row by row, shape (n, 9); its rows are longer than one by 1e-4."""
    return rotation.from_matrix(rotation.nearest_rotation(rows.reshape(-1, 3, 3)))


def _from_angles(degrees: np.ndarray) -> np.ndarray:
    """From roll, pitch, yaw, shape (n, 3) [deg]: about z, then the turned y, then the turned x."""
    return rotation.from_euler("ZYX", np.radians(degrees[:, ::-1]))
