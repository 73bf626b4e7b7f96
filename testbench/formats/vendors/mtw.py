"""Xsens MTw and MTi: text files exported by MT Manager.

They have `//` lines, titles, and columns apart by tabs (or commas).

Source: MTw Awinda user manual, table of the ASCII export; MTi documentation. Acceleration m/s^2,
angular rate rad/s, magnetic field in arbitrary units; PacketCounter wraps at 65535; SampleTimeFine
counts 10 kHz ticks of 32 bits; Mat[row][column] and Quat_q0..q3 turn the sensor into the earth;
Roll, Pitch, Yaw are earth-fixed (ZYX) in degrees. Earth is ENU unless the header says otherwise.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.assumed import assumed_units, derived_quantities
from testbench.formats.common_clock import share_clock
from testbench.formats.dates import earliest, recorded
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.stamps import Asking, Stamps, rate_differs, read_stamps
from testbench.formats.suitable import suited_recording
from testbench.formats.tables.samples_stream import (
    Quantities,
    SampleStream,
    increment_rate,
    specific_force,
    stack,
)
from testbench.formats.tables.source import Columns, Kind, first_rows
from testbench.formats.tables.text_table import TextTable, find_table
from testbench.formats.tables.timeline import RegularTime
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

SETS = {
    "acc": ["Acc_X", "Acc_Y", "Acc_Z"],
    "gyr": ["Gyr_X", "Gyr_Y", "Gyr_Z"],
    "mag": ["Mag_X", "Mag_Y", "Mag_Z"],
    "quat": ["Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3"],
    "mat": [f"Mat[{row}][{column}]" for row in "123" for column in "123"],
    "euler": ["Yaw", "Pitch", "Roll"],
    "free": ["FreeAcc_E", "FreeAcc_N", "FreeAcc_U"],
    "free_xyz": ["FreeAcc_X", "FreeAcc_Y", "FreeAcc_Z"],
    "dq": ["OriInc_q0", "OriInc_q1", "OriInc_q2", "OriInc_q3"],
    "dv": ["VelInc_X", "VelInc_Y", "VelInc_Z"],
}
COUNTER, TICKS = "PacketCounter", "SampleTimeFine"
_UNITS = {"acc": "m/s^2", "gyr": "rad/s", "mag": "au"}
TICK_NS = NANOSECONDS // 10_000
LOWEST_HZ = 10.0
"""An MTw Awinda puts out 40 to 120 Hz, by the number of sensors (user manual), an MTi 400 Hz if
nothing else is set: less is a rate of microseconds that were taken for ticks."""


def read(files: list[Path], options: Options) -> Recording:
    """Read one file for each sensor.

    Args:
        files: Text files.
        options: Rate, where neither the header nor the time stamps tell it; units, where they are
            others.

    Raises:
        InputError: No files, or the rate is open.
        FileProblems: A file is not of this format.
    """
    if not files:
        raise InputError("an MT Manager recording needs at least one file")
    opened = []
    for file in files:
        table, above = find_table(
            file,
            re.compile(r"^(?!\s*//).*\b(PacketCounter|SampleTimeFine|Acc_X|Gyr_X|Quat_q0)\b"),
            "an MT Manager export",
            encoding=options.encoding_or(None),
        )
        opened.append(
            (
                table,
                {
                    key.strip(" /"): value.strip()
                    for key, _, value in (line.partition(":") for line in above)
                },
            )
        )
    names = unique_names(_name(table, header) for table, header in opened)
    findings: list[Finding] = []
    sensors = {}
    for name, (table, header) in zip(names, opened, strict=True):
        sensors[name] = _sensor(name, table, header, options, findings)
    tables = {name: table for name, (table, _) in zip(names, opened, strict=True)}
    label = sensor_name(files[0].stem) if len(files) == 1 else "mtw"
    date = earliest(
        recorded(header.get("Start Time"), f"Start Time in {table.file.name}")
        for table, header in opened
    )
    return suited_recording(
        label,
        "Xsens recording exported by MT Manager",
        sensors,
        [*_clock(sensors, tables), *findings],
        recorded=date,
    )


def _name(table: TextTable, header: dict[str, str]) -> str:
    """Device number from the header or the end of the file's name, else the whole name.

    It is 00B432CC of MT_0120000B-000_00B432CC.
    """
    found = re.search(r"_([0-9A-F]{8})$", table.file.stem, re.IGNORECASE)
    return header.get("DeviceId") or (found.group(1) if found else table.file.stem)


# One piece: each quantity has several spellings in the file, and the first that is there is read.
def _sensor(
    name: str, table: TextTable, header: dict[str, str], options: Options, findings: list[Finding]
) -> ImportedSensor:
    titles = {title.strip().lower(): title for title in table.names}
    columns_of = {
        key: [titles.get(column.lower(), column) for column in columns]
        for key, columns in SETS.items()
    }
    has = {key: set(columns) <= set(table.names) for key, columns in columns_of.items()}
    used = [column for key, columns in columns_of.items() if has[key] for column in columns]
    if not used:
        raise table.problem(
            f"not an MT Manager export with samples; it has {', '.join(table.names)}"
        )
    kinds: dict[str, Kind] = dict.fromkeys(used, "float")
    counter = titles.get(COUNTER.lower())
    rate, stamps, how = _time(name, table, header, titles, options)
    findings.append(how)
    taken = {q: unit for q, unit in _UNITS.items() if has[q]}
    units = {q: options.unit(q, stated) for q, stated in taken.items()}
    factors = {quantity: unit.factor for quantity, unit in units.items() if unit is not None}
    earth = next(
        (key for key in Q_ENU_FROM if key in header.get("Coordinate system", "ENU").upper()), "ENU"
    )
    if earth != "ENU":
        findings.append(finding("orientation.other_earth", name, earth=earth))
    q_enu_from_earth = np.array(Q_ENU_FROM[earth])

    def pick(columns: Columns, key: str, factor: float = 1.0) -> np.ndarray:
        return stack(columns, columns_of[key], factor)

    def convert(columns: Columns) -> Quantities:
        q = None
        if has["quat"]:
            q = pick(columns, "quat")
        elif has["mat"]:
            matrices = pick(columns, "mat").reshape(-1, 3, 3)
            q = np.full((len(matrices), 4), np.nan)
            known = np.isfinite(matrices).all(axis=(1, 2))
            q[known] = rotation.from_matrix(matrices[known])
        elif has["euler"]:
            q = rotation.from_euler("ZYX", np.radians(pick(columns, "euler")))
        free = "free" if has["free"] else "free_xyz" if has["free_xyz"] else None
        acc = gyr = None
        if has["acc"]:
            acc = pick(columns, "acc", factors["acc"])
        elif has["dv"]:
            acc = pick(columns, "dv", rate)
        elif q is not None and free is not None and earth != "NED":
            acc = specific_force(q, pick(columns, free))
        if has["gyr"]:
            gyr = pick(columns, "gyr", factors["gyr"])
        elif has["dq"]:
            gyr = increment_rate(pick(columns, "dq"), rate)
        mag = pick(columns, "mag", factors["mag"]) if has["mag"] else None
        return Quantities(
            gyr,
            acc,
            mag,
            q if q is None or earth == "ENU" else rotation.multiply(q_enu_from_earth, q),
        )

    findings += assumed_units(name, taken, options)
    turns = has["quat"] or has["mat"] or has["euler"]
    free = turns and (has["free"] or has["free_xyz"]) and earth != "NED"
    findings += derived_quantities(name, has | {"free": free})
    kept = {
        "DeviceId": "device_id",
        "Firmware Version": "firmware",
        "Filter Profile": "filter_profile",
        "ProductCode": "product",
    }
    details = {key: header[title] for title, key in kept.items() if header.get(title)}
    stream = SampleStream(table, kinds, convert, stamps.timeline, counter)
    return ImportedSensor(
        stream,
        rate,
        "Xsens MTw or MTi, exported by MT Manager",
        details=details,
        findings=stamps.findings,
        told=stream.findings,
        unix=stamps.unix,
    )


def _time(
    name: str,
    table: TextTable,
    header: dict[str, str],
    titles: dict[str, str],
    options: Options,
) -> tuple[float, Stamps, Finding]:
    """Rate [Hz], what makes the times, and where they come from."""
    found = re.match(r"([0-9.]+)\s*Hz", header.get("Update Rate", ""))
    stated = float(found.group(1)) if found else None
    counter, ticks = titles.get(COUNTER.lower()), titles.get(TICKS.lower())
    rate = options.rate_or(stated)
    stamps = _by_ticks(name, table, ticks, stated, options)
    if stamps is not None and (options.rate is None or counter is None):
        measured = round(stamps.rate or 0.0, 3)
        denied = options.rate is None and bool(rate_differs(rate or measured, measured))
        return (
            measured if denied else rate or measured,
            stamps,
            finding("time.by_column", name, column=TICKS),
        )
    if rate is None:
        raise InputError(
            f"{table.file}: neither an update rate in the header nor {TICKS}; state the sampling "
            "rate with --rate HZ"
        )
    who = "the header" if options.rate is None else "--rate"
    how = finding("time.by_rows", name, rate_hz=rate, who=who)
    if counter is not None:
        how = finding("time.by_counter", name, column=counter, rate_hz=rate, who=who)
    findings = [] if stamps is None else stamps.findings
    return rate, Stamps(lambda: RegularTime(rate, counter), findings), how


def _by_ticks(
    name: str, table: TextTable, ticks: str | None, stated: float | None, options: Options
) -> Stamps | None:
    """Times by SampleTimeFine, None where the file has none."""
    if ticks is None or not np.isfinite(first_rows(table, {ticks: "float"})[ticks]).all():
        return None
    answer = options.unit("time", None)
    asking = Asking(
        f"{table.file}: sensor '{name}'",
        None if answer is None else answer.name,
        lowest_hz=LOWEST_HZ,
        rate=options.rate_or(None),
    )
    stamps = read_stamps(table, ticks, None, asking, bits=32, tick_ns=TICK_NS)
    if stamps.rate is None and options.rate is None:
        raise table.problem(f"{TICKS} stands still; state the sampling rate with --rate HZ")
    if options.rate is not None:
        stamps.findings.extend(rate_differs(options.rate, stamps.rate))
    elif stated is not None:
        more = rate_differs(stated, stamps.rate, "time.header_rate_differs")
        stamps.findings.extend(more)
    return stamps


def _clock(sensors: dict[str, ImportedSensor], tables: dict[str, TextTable]) -> list[Finding]:
    """Sensors of one Awinda station share its PacketCounter; its recordings have one name."""
    if len(sensors) < 2:
        return []
    stems = {
        re.sub(r"_[0-9A-F]{8}$", "", t.file.stem, flags=re.IGNORECASE) for t in tables.values()
    }
    counters = {
        key: next((title for title in table.names if title.lower() == COUNTER.lower()), None)
        for key, table in tables.items()
    }
    rates = [sensor.rate for sensor in sensors.values()]
    if len(stems) > 1 or None in counters.values() or max(rates) > 1.01 * min(rates):
        return share_clock(sensors, None, "clock.stations")
    first = {
        key: int(first_rows(tables[key], {title: "integer"})[title][0])
        for key, title in counters.items()
        if title is not None
    }
    zero, span = next(iter(first.values())), 1 << 16
    leads = {key: (count - zero + span // 2) % span - span // 2 for key, count in first.items()}
    times = {key: round(lead * NANOSECONDS / rates[0]) for key, lead in leads.items()}
    return share_clock(sensors, f"the {COUNTER} of one station", leads_ns=times)
