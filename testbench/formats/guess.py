"""What files seem to be: the formats that read them, and a mapping to begin with.

Titles and names tell quantities and units; where they do not, gravity at rest, the turns, the
strength of the field and the rates that sensors have do.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbench.consistency.evidence import Evidence
from testbench.exceptions import BenchError, FileProblems, InputError
from testbench.formats import FORMATS
from testbench.formats.any_table import Table, kind_of, open_table
from testbench.formats.mapping import TextLayout
from testbench.formats.names import sensor_name, stem_without_stamp, unique_names
from testbench.formats.options import Options
from testbench.formats.plausibility import gather, unit_that_fits
from testbench.formats.signatures import likely_format
from testbench.formats.tables.array_table import ArrayTable
from testbench.formats.tables.parquet_table import ParquetTable
from testbench.formats.tables.source import first_rows
from testbench.formats.tables.text_table import TextTable
from testbench.formats.text_layout import find_layout, numeric_columns
from testbench.formats.titles import in_order, read_title, unit_of
from testbench.formats.units import SECONDS
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.session.samples import ImuSamples

SLOWEST, FASTEST = 4.0, 4000.0
"""Rates of inertial sensors [Hz]: just three decades, so that one unit of time fits at most."""
STAMP_UNITS = ("s", "ms", "us", "ns")
FIELDS = {"uT": (15.0, 120.0), "mG": (150.0, 1200.0), "nT": (15e3, 120e3), "G": (0.15, 0.65)}
"""Strengths of magnetic fields that sensors meet; the earth's is 25 to 65 uT (IGRF-13)."""
MOST_TRIADS = 10
ROWS_LOOKED_AT = 100_000
LEAST_ROWS = 4
_RATE = re.compile(r"^(fs|f_s|rate|freq\w*)(_?hz)?$|sampl\w*_?(rate|freq\w*)", re.IGNORECASE)


@dataclass
class Quantity:
    """Columns of one quantity.

    Attributes:
        columns: Titles, or places from 1 where there are none.
        array: Or the array that holds them all.
        names: As the table calls them.
        unit: As their titles write it.
        order: Of a quaternion.
    """

    columns: list[str | int]
    names: list[str]
    unit: str = ""
    array: str | None = None


@dataclass
class Seen:
    """A file that was looked into.

    Attributes:
        table: Of it.
        layout: Of its text.
        values: First rows of its columns of numbers.
        clocks: Columns of times of day.
        sensors: Quantities by sensor.
    """

    table: Table
    layout: TextLayout
    values: dict[str, np.ndarray]
    clocks: list[str]
    sensors: dict[str, dict[str, Quantity]] = field(default_factory=dict)


@dataclass(frozen=True)
class Time:
    """Where the times of a table stand.

    Attributes:
        column: Title or place.
        unit: Of it.
        rate: That comes of it [Hz].
    """

    column: str | int
    unit: str
    rate: float


@dataclass
class Guess:
    """What files seem to be.

    Attributes:
        formats: Those that read the files, each with what it found or asks.
        mapping: Of the generic format; None where no columns were recognised.
        seen: What the mapping rests on, a sentence each.
    """

    formats: dict[str, str]
    mapping: dict[str, Any] | None
    seen: list[str]


def guess(files: Sequence[Path]) -> Guess:
    """Look into files.

    Args:
        files: Of one recording.

    Raises:
        InputError: Nothing fits; says what was seen.
    """
    for file in files:
        kind_of(file)  # refuses what is not there
    formats = {
        name: found
        for name in FORMATS
        if name != "generic" and (found := _tried(name, list(files))) is not None
    }
    likely = likely_format(files[0])
    if likely in formats:
        formats = {likely: formats[likely]} | formats
    said: list[str] = []
    try:
        mapping, why = _mapping(files, said), None
    except BenchError as error:
        mapping, why = None, str(error)
    if mapping is None and not formats:
        listing = ", ".join(file.name for file in files)
        raise InputError(f"{why}; no format reads {listing} (`testbench formats` lists them)")
    if mapping is None and why:
        said.append(f"no mapping: {why}")
    return Guess(formats, mapping, said)


def _tried(name: str, files: list[Path]) -> str | None:
    """What a format finds in the files, or asks; None where they are none of its own."""
    try:
        recording = FORMATS[name].read(files, Options())
        counts = [f"{key} at {sensor.rate:g} Hz" for key, sensor in recording.sensors.items()]
        if any(sensor.head() is None for sensor in recording.sensors.values()):
            return None
    except FileProblems:
        return None
    except BenchError as error:
        asks = "--unit" in str(error) or "--rate" in str(error)
        return f"it asks: {error}" if asks else None
    return ", ".join(counts)


def _mapping(files: Sequence[Path], said: list[str]) -> dict[str, Any]:
    """A mapping of the files.

    Raises:
        BenchError: No quantity of a sensor is recognised.
    """
    looked = [_look(file) for file in files]
    first = looked[0]
    whole = [seen for seen in looked if _is_whole(seen)]
    if len(files) > 1 and not whole:
        return _of_one_file_each(looked, said)
    if not first.sensors:
        raise first.table.problem(
            "no accelerometer, gyroscope or quaternion is recognised among its columns: "
            f"{', '.join(first.table.names[:40]) or 'none'}; name them in a mapping"
        )
    for other in looked[1:]:
        if other.table.names != first.table.names:
            raise other.table.problem(
                f"has other columns than {first.table.file.name}; guess file by file"
            )
    return _of_one_file(first, said)


def _is_whole(seen: Seen) -> bool:
    """Whether a file has a sensor that can be used by itself."""
    return any({"acc", "gyr"} <= set(q) or "quaternion" in q for q in seen.sensors.values())


def _look(file: Path) -> Seen:
    """Look into a file."""
    layout = TextLayout()
    clocks: list[str] = []
    if kind_of(file) is None:
        layout, rows = find_layout(file)
        table = open_table(file, layout)
        numbers, clocks = numeric_columns(table.names, rows)
    else:
        table = open_table(file, layout)
        numbers = [name for name in table.names if _is_number(table, name)]
    values: dict[str, np.ndarray] = {}
    for group in _together(table, numbers):
        rows_read = first_rows(table, dict.fromkeys(group, "float"))
        values |= {name: column[:ROWS_LOOKED_AT] for name, column in rows_read.items()}
    seen = Seen(table, layout, values, clocks)
    seen.sensors = _by_title(seen) if layout.header else {}
    if not seen.sensors:
        seen.sensors = _by_values(seen)
    return seen


def _is_number(table: Table, name: str) -> bool:
    if not isinstance(table, ParquetTable):
        return True
    try:
        first_rows(table, {name: "float"})
    except FileProblems:
        return False
    return True


def _together(table: Table, names: list[str]) -> list[list[str]]:
    """Columns that can be read together: of arrays, those of one."""
    if isinstance(table, TextTable):
        return [names] if names else []
    inside = {column: array for array, columns in table.arrays.items() for column in columns}
    return [list(group) for _, group in itertools.groupby(names, lambda n: inside.get(n, n))]


def _path(table: Table, name: str) -> tuple[str, str]:
    """Group and own name of an array; a column of another table is in no group."""
    if not isinstance(table, ArrayTable):
        return "", name
    folder, _, last = name.rpartition("/")
    return folder, last


def _by_title(seen: Seen) -> dict[str, dict[str, Quantity]]:
    """Quantities by sensor, as titles and names of arrays tell them."""
    sensors: dict[str, dict[str, Quantity]] = {}
    parts: dict[tuple[str, str], dict[str, str]] = {}
    units: dict[tuple[str, str], str] = {}
    inside = {column for columns in seen.table.arrays.values() for column in columns}
    stem = read_title(seen.table.file.stem).kind
    for name in seen.values:
        if name in inside:
            continue
        folder, last = _path(seen.table, name)
        title = read_title(last)
        kind = title.kind or (stem if title.part else None)
        if kind in ("acc", "gyr", "mag", "quaternion") and title.part:
            key = (folder or title.owner, kind)
            parts.setdefault(key, {}).setdefault(title.part, name)
            units.setdefault(key, title.unit)
    for (owner, kind), of in parts.items():
        ordered = in_order(of, kind)
        if ordered is not None:
            columns: list[str | int] = [*ordered]
            sensors.setdefault(owner, {})[kind] = Quantity(columns, ordered, units[owner, kind])
    for array, columns_of in seen.table.arrays.items():
        folder, last = _path(seen.table, array)
        title = read_title(last)
        kind = title.kind
        width = {"acc": 3, "gyr": 3, "mag": 3, "quaternion": 4}.get(kind or "")
        if kind is not None and len(columns_of) == width:
            found = Quantity([*columns_of], columns_of, title.unit, array)
            sensors.setdefault(folder, {}).setdefault(kind, found)
    return _of_one_owner(sensors)


def _of_one_owner(sensors: dict[str, dict[str, Quantity]]) -> dict[str, dict[str, Quantity]]:
    """The same, with quantities put together that stand under different names but once each.

    `device_q_w` beside `acc_x` and `gyr_x` is of the same sensor; two accelerometers are two.
    """
    kinds = [kind for of in sensors.values() for kind in of]
    if len(sensors) > 1 and len(set(kinds)) == len(kinds):
        return {"": {kind: q for of in sensors.values() for kind, q in of.items()}}
    return {owner: of for owner, of in sensors.items() if of.keys() - {"mag"}} or sensors


def _by_values(seen: Seen) -> dict[str, dict[str, Quantity]]:
    """The accelerometer and gyroscope whose numbers fit gravity and one another, without titles."""
    names = list(seen.values)
    time = _time_of(seen, names)
    free = [n for n in names if time is None or n != _name(seen, time.column)]
    triads = [free[i : i + 3] for i in range(len(free) - 2)][: 3 * MOST_TRIADS]
    rate = time.rate if time is not None else 100.0
    for acc, gyr in itertools.permutations(triads, 2):
        if set(acc) & set(gyr):
            continue
        evidence = _evidence(seen, acc, gyr, rate)
        if unit_that_fits("acc", evidence) and unit_that_fits("gyr", evidence):
            return {
                "": {
                    kind: Quantity([_column(seen, name) for name in triad], triad)
                    for kind, triad in (("acc", acc), ("gyr", gyr))
                }
            }
    return {}


def _column(seen: Seen, name: str) -> str | int:
    """A column as a mapping names it."""
    return name if seen.layout.header else int(name)


def _name(seen: Seen, column: str | int) -> str:
    return column if isinstance(column, str) else seen.table.names[column - 1]


def _evidence(seen: Seen, acc: list[str], gyr: list[str] | None, rate: float) -> Evidence:
    """What the numbers say of their units."""
    a = np.column_stack([seen.values[name] for name in acc])
    w = np.full_like(a, np.nan)
    if gyr is not None and len(seen.values[gyr[0]]) == len(a):
        w = np.column_stack([seen.values[name] for name in gyr])
    count = np.arange(len(a))
    time_ns = np.round(count * (NANOSECONDS / rate)).astype(np.int64)
    still = np.zeros(len(a), dtype=bool)
    with np.errstate(all="ignore"):
        return gather([ImuSamples(time_ns, time_ns, w, a, None, None, count, still)])


def _time_of(seen: Seen, among: Sequence[str]) -> Time | None:
    """The column of times among some, its unit, and the rate that comes of both."""
    inside = {column for columns in seen.table.arrays.values() for column in columns}
    candidates = [name for name in among if name not in inside]
    titled = [n for n in candidates if read_title(_path(seen.table, n)[1]).kind == "time"]
    if not titled and not seen.layout.header:
        titled = candidates
    # the finest of several clocks, and stamps before whole seconds
    for name in titled:
        values = seen.values[name]
        steps = np.diff(values)
        if len(values) < LEAST_ROWS or not np.isfinite(values).all() or (steps < 0).any():
            continue
        mean = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
        mean = float(steps[steps <= 5 * mean].mean()) if mean else 0.0
        if mean <= 0:
            continue
        stated = unit_of("time", read_title(_path(seen.table, name)[1]).unit)
        for unit in [stated] if stated else STAMP_UNITS:
            rate = 1 / (mean * SECONDS[unit])
            if SLOWEST <= rate <= FASTEST:
                return Time(_column(seen, name), unit, rate)
    for name in seen.clocks:
        return Time(_column(seen, name), "clock", 0.0)
    return None


def _stated_rate(table: Table) -> tuple[str, float] | None:
    """The sampling rate that a file of arrays states beside them, and its name there."""
    for name, value in getattr(table, "numbers", {}).items():
        if _RATE.search(name.rpartition("/")[2]) and SLOWEST <= value <= FASTEST:
            return name, float(value)
    return None


def _near(seen: Seen, owner: str, length: int) -> list[str]:
    """Columns as long as a sensor's, those of its own group first."""
    fitting = [name for name, values in seen.values.items() if len(values) == length]
    return sorted(fitting, key=lambda name: _path(seen.table, name)[0] != owner)


def _of_one_file(seen: Seen, said: list[str]) -> dict[str, Any]:
    """A mapping of a file with one or more sensors."""
    sensors: dict[str, Any] = {}
    owners = list(seen.sensors)
    labels = unique_names(owner.rpartition("/")[2] or "imu" for owner in owners)
    times: dict[tuple[str, str], Time | None] = {}
    for label, (owner, quantities) in zip(labels, seen.sensors.items(), strict=True):
        for kind, quantity in quantities.items():
            length = len(seen.values[quantity.names[0]])
            times[label, kind] = _time_of(seen, _near(seen, owner, length))
        sensors[label] = _sensor(
            seen, quantities, times[label, next(iter(quantities))], label, said
        )
    result: dict[str, Any] = {"description": f"guessed from {seen.table.file.name}"}
    text = seen.layout.model_dump(exclude_defaults=True)
    result |= {"text": text} if text else {}
    common = next(iter(times.values()))
    if common is not None:
        result["time"] = {"column": common.column, "unit": common.unit}
        _say_time(common, seen.table.file.name, said)
    elif (rate := _stated_rate(seen.table)) is not None:
        result["rate_hz"] = rate[1]
        said.append(f"{seen.table.file.name}: no times; {rate[0]} states {rate[1]:g} Hz")
    else:
        said.append(f"{seen.table.file.name}: no times are recognised; state --rate HZ")
    for (label, kind), own in times.items():
        if own is not None and common is not None and own.column != common.column:
            sensors[label][kind]["time"] = {"column": own.column, "unit": own.unit}
    return result | {"sensors": sensors}


def _of_one_file_each(looked: list[Seen], said: list[str]) -> dict[str, Any]:
    """A mapping of files with one quantity each.

    Raises:
        BenchError: Two files have the same one, or a file has none, or no times.
    """
    parts: dict[str, Any] = {}
    times = []
    acc = next((seen for seen in looked if "acc" in next(iter(seen.sensors.values()), {})), None)
    for seen in looked:
        quantities = next(iter(seen.sensors.values()), {})
        time = _time_of(seen, list(seen.values))
        if len(quantities) != 1 or next(iter(quantities)) in parts or time is None:
            raise seen.table.problem(
                "is neither a sensor nor one quantity, with times, of a sensor whose others stand "
                f"in the other files; its columns are {', '.join(seen.table.names[:40])}"
            )
        ((kind, found),) = quantities.items()
        evidence = _of_pair(seen, found, time, acc) if kind == "gyr" and acc is not None else None
        own = _sensor(seen, quantities, time, "imu", said, evidence)
        parts[kind] = {"file": seen.table.file.name, **own[kind]}
        times.append(time)
        _say_time(time, seen.table.file.name, said)
    if acc is None and "quaternion" not in parts and "gyr" not in parts:
        raise looked[0].table.problem("none of the files holds an accelerometer or gyroscope")
    first = {"column": times[0].column, "unit": times[0].unit}
    for part, time in zip(parts.values(), times, strict=True):
        if (own_time := {"column": time.column, "unit": time.unit}) != first:
            part["time"] = own_time
    text = looked[0].layout.model_dump(exclude_defaults=True)
    names = ", ".join(seen.table.file.name for seen in looked)
    result: dict[str, Any] = {"description": f"guessed from {names}"}
    result |= {"text": text} if text else {}
    return result | {"time": first, "sensors": {"imu": parts}}


def _of_pair(seen: Seen, gyr: Quantity, time: Time, other: Seen) -> Evidence | None:
    """What an accelerometer of another file says of a gyroscope."""
    own_time = _time_of(other, list(other.values))
    acc = next(iter(other.sensors.values()))["acc"]
    if own_time is None or own_time.unit != time.unit or time.unit == "clock":
        return None
    at = other.values[_name(other, own_time.column)]
    stamps = seen.values[_name(seen, time.column)]
    rates = {name: np.interp(at - at[0], stamps - at[0], seen.values[name]) for name in gyr.names}
    both = Seen(
        other.table, other.layout, {**other.values, **{f"w {n}": v for n, v in rates.items()}}, []
    )
    return _evidence(both, acc.names, [f"w {name}" for name in gyr.names], own_time.rate)


def _say_time(time: Time, file: str, said: list[str]) -> None:
    rate = f", {time.rate:.4g} Hz" if time.rate else ""
    said.append(f"{file}: times in column {time.column}, in {time.unit}{rate}")


def _sensor(
    seen: Seen,
    quantities: dict[str, Quantity],
    time: Time | None,
    label: str,
    said: list[str],
    evidence: Evidence | None = None,
) -> dict[str, Any]:
    """The part of a mapping for one sensor."""
    rate = time.rate if time is not None and time.rate else 100.0
    acc, gyr = quantities.get("acc"), quantities.get("gyr")
    if evidence is None and acc is not None:
        evidence = _evidence(seen, acc.names, gyr.names if gyr else None, rate)
    parts: dict[str, Any] = {}
    for kind in ("acc", "gyr", "mag", "quaternion"):
        if kind not in quantities:
            continue
        found = quantities[kind]
        where: dict[str, Any] = {"columns": found.columns}
        if found.array is not None:
            where = {"array": found.array}
        shown = found.array or ", ".join(map(str, found.columns))
        if kind == "quaternion":
            parts[kind] = where | _orientation(seen, found, acc)
            said.append(f"{label}: quaternion in {shown}")
            continue
        unit, why = _unit(kind, found, seen, evidence)
        parts[kind] = where | ({"unit": unit} if unit else {})
        said.append(f"{label}: {kind} in {shown}, {f'in {unit} ({why})' if unit else why}")
    return parts


def _unit(
    kind: str, found: Quantity, seen: Seen, evidence: Evidence | None
) -> tuple[str | None, str]:
    """The unit of a quantity, and how it is known."""
    written = unit_of(kind, found.unit)
    if kind == "mag":
        if written is not None:
            return written, "by its titles"
        with np.errstate(all="ignore"):
            norm = float(
                np.nanmedian(
                    np.linalg.norm(np.column_stack([seen.values[n] for n in found.names]), axis=1)
                )
            )
        for unit, (low, high) in FIELDS.items():
            if low <= norm <= high:
                return unit, f"a strength of {norm:.4g} fits it"
        return "au", f"a strength of {norm:.4g} fits no unit: only its direction is used"
    by_numbers = None if evidence is None else unit_that_fits(kind, evidence)
    fitting = [] if by_numbers is None else [by_numbers.name]
    if written is not None and (not fitting or written in fitting):
        return written, "by its titles"
    if len(fitting) == 1:
        told = "gravity at rest" if kind == "acc" else "turns as the accelerometer sees them"
        return fitting[0], f"by {told}"
    return None, "of which the unit is not told: the import asks for it"


def _orientation(seen: Seen, found: Quantity, acc: Quantity | None) -> dict[str, str]:
    """Order, direction and earth of a quaternion: the ones by which gravity points up."""
    q = np.column_stack([seen.values[name] for name in found.names])
    best = {"order": "wxyz"}
    if acc is None or len(seen.values[acc.names[0]]) != len(q):
        return best
    a = np.column_stack([seen.values[name] for name in acc.names])
    norm = np.linalg.norm(a, axis=1, keepdims=True)
    with np.errstate(all="ignore"):
        known = np.isfinite(q).all(axis=1) & np.isfinite(a).all(axis=1) & (norm[:, 0] > 0)
    q, up = q[known], (a / np.where(norm > 0, norm, 1))[known]
    if not len(q):
        return best
    highest = 0.0
    for order in ("wxyz", "xyzw") if found.array is not None else ("wxyz",):
        own = q if order == "wxyz" else np.roll(q, 1, axis=1)
        for direction in ("earth_from_sensor", "sensor_from_earth"):
            turned = own if direction == "earth_from_sensor" else rotation.conjugate(own)
            z = float(np.mean(rotation.rotate(turned, up)[:, 2]))
            if abs(z) > abs(highest) + 1e-6:
                highest = z
                best = {"order": order, "direction": direction}
    if highest < 0:
        best["earth"] = "NED"
    return best


def default_name(files: Sequence[Path]) -> str:
    """Name of a file for the mapping."""
    return f"{sensor_name(stem_without_stamp(files[0].stem))}_mapping.yaml"
