"""Xsens DOT: CSV files that the vendor's app or its SDK writes, in any of the payload modes.

Source: Xsens DOT user manual XD0502P, section 4.2; column titles of the SDK's logger.
SampleTimeFine is a 32-bit counter of microseconds; Euler angles are the earth-fixed roll, pitch,
yaw (ZYX); free acceleration is in the earth frame without gravity; the magnetic field is in
arbitrary units of about 40 uT; dq and dv are increments over one output interval.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.assumed import assumed_units, derived_quantities
from testbench.formats.common_clock import common_clock
from testbench.formats.dates import Recorded, earliest, recorded
from testbench.formats.names import sensor_name, stem_without_stamp, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.stamps import Asking, Stamps, rate_differs, read_stamps
from testbench.formats.suitable import suited_recording
from testbench.formats.tables.samples_stream import (
    Quantities,
    SampleStream,
    increment_rate,
    measured_rate,
    specific_force,
    stack,
)
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.text_table import TextTable, find_table
from testbench.formats.tables.units import SECONDS, TimeUnit
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

TIME, COUNTER = "SampleTimeFine", "PacketCounter"
SETS = {
    "quat": ["Quat_W", "Quat_X", "Quat_Y", "Quat_Z"],
    "euler": ["Euler_X", "Euler_Y", "Euler_Z"],
    "free": ["FreeAcc_X", "FreeAcc_Y", "FreeAcc_Z"],
    "acc": ["Acc_X", "Acc_Y", "Acc_Z"],
    "gyr": ["Gyr_X", "Gyr_Y", "Gyr_Z"],
    "mag": ["Mag_X", "Mag_Y", "Mag_Z"],
    "dq": ["dq_W", "dq_X", "dq_Y", "dq_Z"],
    "dv": ["dv[1]", "dv[2]", "dv[3]"],
}
CLIPPED = 0x1FF
"""Bits of Status: an axis of the accelerometer (0 to 2), gyroscope (3 to 5) or magnetometer (6 to
8) was at full scale.
"""
WRAP = 1 << 32
LOOK = 12
"""Rows at the beginning among which a stale first one is looked for."""
RATE_WITHIN = 0.03
_UNITS = {"acc": "m/s^2", "gyr": "deg/s", "mag": "au"}


@dataclass
class DotFile:
    """One file, looked at but not yet read through."""

    table: TextTable
    header: dict[str, str]
    rate: float
    drop: int
    first_tick: int
    tick_ns: int
    findings: list[Finding]
    stamps: Stamps


def read(files: list[Path], options: Options) -> Recording:
    """Read one file for each sensor.

    Args:
        files: CSV files.
        options: Units, where the files were written in others.

    Raises:
        InputError: No files.
        FileProblems: A file is not of this format.
    """
    if not files:
        raise InputError("an Xsens DOT recording needs at least one file")
    dots = [_open(file, options) for file in files]
    stems = [stem_without_stamp(file.stem) for file in files]
    if len(set(map(str.lower, stems))) < len(stems):
        stems = [dot.header.get("DeviceTag") or stem for dot, stem in zip(dots, stems, strict=True)]
    names = unique_names(stems)
    synced = len(dots) > 1 and all(
        dot.header.get("SyncStatus", "").lower() == "synced" for dot in dots
    )
    findings: list[Finding] = []
    ahead = [(dot.first_tick - dots[0].first_tick + WRAP // 2) % WRAP - WRAP // 2 for dot in dots]
    sensors = {}
    for name, dot, lead in zip(names, dots, ahead, strict=True):
        begun = dot.first_tick - (lead - min(ahead) if synced else 0)
        sensors[name] = _sensor(dot, begun * dot.tick_ns, options)
        findings += [found.at(name) for found in dot.findings]
    tag = sensor_name(stem_without_stamp(files[0].stem)) if len(files) == 1 else "xsens_dot"
    return suited_recording(
        tag,
        "Xsens DOT recording exported by the vendor's app",
        sensors,
        [*_clock([lead * dots[0].tick_ns for lead in ahead], synced), *findings],
        recorded=_date(dots),
    )


def _clock(ahead_ns: list[int], synced: bool) -> list[Finding]:
    """What is said of the clock of several sensors."""
    if len(ahead_ns) < 2:
        return []
    if not synced:
        return [finding("clock.unsynced")]
    return [common_clock("that of their synchronisation (the files say Synced)", ahead_ns)]


def _date(dots: list[DotFile]) -> Recorded | None:
    return earliest(
        recorded(dot.header.get("StartTime"), f"StartTime in {dot.table.file.name}") for dot in dots
    )


# One piece: what the header says decides how the first rows are read.
def _open(file: Path, options: Options) -> DotFile:
    table, above = find_table(
        file,
        re.compile(rf"\b{TIME}\b"),
        f"an Xsens DOT export (its header has {TIME})",
        encoding=options.encoding_or(None),
    )
    table.require([TIME], "an Xsens DOT export")
    header = {}
    for line in above:
        key, _, value = line.partition(":")
        header[key.strip()] = value.strip(" ,;\t")
    kinds = _kinds(table)
    if not kinds:
        known = ", ".join(columns[0] for columns in SETS.values())
        raise table.problem(
            f"has no column of samples; looked for {known} and their like; it has "
            f"{', '.join(table.names)}"
        )
    counted: dict[str, Kind] = {COUNTER: "integer"} if COUNTER in table.names else {}
    head = next(iter(table.chunks(kinds | counted | {TIME: "integer"})), None)
    if head is None or not len(head[TIME]):
        raise table.problem("there are no samples after the header")
    ticks = head[TIME]
    bad = (ticks < 0) | (ticks >= WRAP)
    if bad.any():
        raise table.problem(
            f"{TIME} {ticks[np.argmax(bad)]} is not a 32-bit number of microseconds",
            int(np.argmax(bad)),
        )
    answer = options.unit("time", "us")
    unit: TimeUnit = "us" if answer is None else cast(TimeUnit, answer.name)
    answered = unit if options.answered("time") else None
    asking = Asking(f"{file}", answered, rate=options.rate_or(None))
    stamps = read_stamps(table, TIME, "us", asking, bits=32)
    stream = SampleStream(table, kinds, lambda columns: Quantities(None, None), stamps.timeline)
    findings: list[Finding] = []
    rate = options.rate_or(None) or _rate(header, measured_rate(stream.first()), stamps.findings)
    drop = _stale_rows(head, kinds, rate)
    if drop:
        findings.append(finding("structure.stale_rows", count=drop))
    if drop >= len(ticks):
        raise table.problem("every sample is zero")
    left = sorted(set(table.names) - set(kinds) - {TIME, COUNTER, ""})
    if left:
        findings.append(finding("structure.columns_left", columns=left))
    tick_ns = round(SECONDS[unit] * NANOSECONDS)
    return DotFile(table, header, rate, drop, int(ticks[drop]), tick_ns, findings, stamps)


def _rate(header: dict[str, str], measured: float | None, findings: list[Finding]) -> float:
    found = re.match(r"\s*([0-9.]+)\s*Hz", header.get("OutputRate", ""))
    stated = float(found.group(1)) if found else None
    if stated and measured and abs(measured / stated - 1) > RATE_WITHIN:
        findings += rate_differs(stated, measured, "time.header_rate_differs")
        return round(measured, 3)
    return stated or (round(measured, 3) if measured else 60.0)


def _kinds(table: TextTable) -> dict[str, Kind]:
    present = [
        column
        for columns in SETS.values()
        if set(columns) <= set(table.names)
        for column in columns
    ]
    present += [
        column
        for column in ("Status", "ClipCountAcc", "ClipCountGyr")
        if column in table.names and present
    ]
    return dict.fromkeys(present, "float")


def _stale_rows(head: Columns, kinds: dict[str, Kind], rate: float) -> int:
    """How many rows at the beginning are zero, or of another time or place than the next ones."""
    values = np.column_stack(
        [
            head[column]
            for column in kinds
            if column not in {"Status", "ClipCountAcc", "ClipCountGyr"}
        ]
    )
    zero = (values == 0).all(axis=1)
    dropped = len(zero) if zero.all() else int(np.argmin(zero))
    rest = slice(dropped, LOOK)
    ticks = head[TIME][rest]
    if dropped or len(ticks) < LOOK:
        return dropped
    steps = (np.diff(ticks) + WRAP // 2) % WRAP - WRAP // 2
    counts = np.diff(head[COUNTER][rest]) if COUNTER in head else np.ones(len(steps))
    elsewhen = steps[0] < 0 or (
        abs(steps[0] * 1e-6 * rate - counts[0]) > 0.5
        and np.all(np.abs(steps[1:] * 1e-6 * rate - counts[1:]) < 0.5)
    )
    return 1 if elsewhen or _jumps(head) else 0


def _jumps(head: Columns) -> bool:
    """Whether the first row lies farther from the second than a moving sensor can be.

    That is ten times any later step.
    """
    floors = {"quat": 0.035, "euler": 2.0, "acc": 0.5, "gyr": 5.0}
    for key, floor in floors.items():
        if not set(SETS[key]) <= set(head):
            continue
        values = stack(head, SETS[key])[:LOOK]
        if key == "quat":
            values = values * np.where(
                np.sum(values * values[1], axis=1, keepdims=True) < 0, -1.0, 1.0
            )
        steps = np.diff(values, axis=0)
        if key == "euler":
            steps = (steps + 180) % 360 - 180
        sizes = np.linalg.norm(steps, axis=1)
        if sizes[0] > max(10 * sizes[1:].max(), floor):
            return True
    return False


# One piece: each quantity has several sources in the file, and the first that is there is read.
def _sensor(dot: DotFile, origin_ns: int, options: Options) -> ImportedSensor:
    kinds = _kinds(dot.table)
    has = {key: set(columns) <= set(kinds) for key, columns in SETS.items()}
    units = {
        quantity: options.unit(quantity, stated)
        for quantity, stated in _UNITS.items()
        if has[quantity]
    }
    factors = {quantity: unit.factor for quantity, unit in units.items() if unit is not None}

    def convert(columns: Columns) -> Quantities:
        q = _orientation(columns, has)
        acc = gyr = mag = None
        if has["acc"]:
            acc = stack(columns, SETS["acc"], factors["acc"])
        elif has["dv"]:
            acc = stack(columns, SETS["dv"], dot.rate)
        elif q is not None and has["free"]:
            acc = specific_force(q, stack(columns, SETS["free"]))
        if has["gyr"]:
            gyr = stack(columns, SETS["gyr"], factors["gyr"])
        elif has["dq"]:
            gyr = increment_rate(stack(columns, SETS["dq"]), dot.rate)
        if has["mag"]:
            mag = stack(columns, SETS["mag"], factors["mag"])
        return Quantities(gyr, acc, mag, q, _saturated(columns))

    dot.findings += assumed_units("", {q: u for q, u in _UNITS.items() if has[q]}, options)
    free = has["free"] and (has["quat"] or has["euler"])
    dot.findings += derived_quantities("", has | {"free": free})
    counter = COUNTER if COUNTER in dot.table.names else None
    stream = SampleStream(
        dot.table,
        kinds,
        convert,
        dot.stamps.timeline,
        counter,
        drop=dot.drop,
        origin_ns=origin_ns,
    )
    mode = dot.header.get("Measurement Mode", "")
    kept = {
        "DeviceTag": "device_tag",
        "FirmwareVersion": "firmware",
        "FilterProfile": "filter_profile",
        "StartTime": "started",
    }
    details = {key: dot.header[title] for title, key in kept.items() if dot.header.get(title)}
    return ImportedSensor(
        stream,
        dot.rate,
        f"Xsens DOT{f', {mode}' if mode else ''}",
        details=details,
        findings=dot.stamps.findings,
        told=stream.findings,
    )


def _orientation(columns: Columns, has: dict[str, bool]) -> np.ndarray | None:
    if has["quat"]:
        return stack(columns, SETS["quat"])
    if has["euler"]:
        return rotation.from_euler("ZYX", np.radians(stack(columns, SETS["euler"])[:, ::-1]))
    return None


def _saturated(columns: Columns) -> np.ndarray | None:
    result = None
    if "Status" in columns:
        status = np.nan_to_num(columns["Status"]).astype(np.int64)
        result = (status & CLIPPED) != 0
    for column in ("ClipCountAcc", "ClipCountGyr"):
        if column in columns:
            clipped = np.nan_to_num(columns[column]) > 0
            result = clipped if result is None else result | clipped
    return result
