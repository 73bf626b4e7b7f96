"""Technaid Tech-IMU / Tech-MCS: CSV converted from the vendor's captures.

There are blanks around the titles of the columns.

The vendor publishes no layout of a CSV; the titles are recognised by their usual spellings. Several
IMUs may stand in one file, each with its name before its columns (`IMU1 AccX`, `Shank_GyrZ`).
Physical data come at 60 Hz at most beside quaternions.

The vendor's software keeps physical data and quaternions in captures of their own (.capp, .capq),
which are converted one by one: two files of one sensor are merged on their common clock.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, InputError
from testbench.formats.common_clock import share_clock
from testbench.formats.names import sensor_name, stem_without_stamp, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.joined_table import Joined, JoinedTable
from testbench.formats.tables.recognise import Found, find_sensors, find_time
from testbench.formats.tables.source import Columns, Kind, Source
from testbench.formats.tables.text_table import TextTable, find_table
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

_HEADER = re.compile(r"acc\w*[\s_.\-]*x|gyr\w*[\s_.\-]*x|(quat\w*|q)[\s_.\-]*[w0]\b", re.IGNORECASE)
_CAPTURE = re.compile(
    r"[\s_.\-]*(phys(ical)?|quat(ernions?)?|capp|capq|ori(entations?)?)[\s_.\-]*(data)?$",
    re.IGNORECASE,
)
ROW = "number of the row"


@dataclass(frozen=True)
class Part:
    """One sensor's columns in one file."""

    table: TextTable
    prefix: str
    found: Found

    @property
    def base(self) -> str:
        """The file's stem without what tells the kind of capture."""
        return _CAPTURE.sub("", stem_without_stamp(self.table.file.stem)) or self.table.file.stem

    @property
    def name(self) -> str:
        """Of the sensor."""
        return self.prefix or stem_without_stamp(self.table.file.stem)


def read(files: list[Path], options: Options) -> Recording:
    """Read files, each with one or more sensors.

    Args:
        files: CSV files; one with the physical data of a sensor and one with its quaternions, as
            the vendor's captures are converted, are one sensor.
        options: Rate, and units where the titles do not state them.

    Raises:
        InputError: No files, or a rate or unit is open.
        FileProblems: A file is not of this format.
    """
    if not files:
        raise InputError("a Technaid recording needs at least one file")
    findings: list[Finding] = []
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
        parts += [Part(table, prefix, found) for prefix, found in sensors.items()]
    pairs = _pairs(parts)
    names = unique_names(
        part.name if other is None else part.prefix or part.base for part, other in pairs
    )
    result = {}
    for name, (part, other) in zip(names, pairs, strict=True):
        source: Source = part.table
        time, found = find_time(part.table.names), part.found
        column, unit = time or (None, None)
        if other is not None:
            source, found = _joined(part, other, findings, name)
        layout = Layout("Technaid Tech-IMU", {}, column, unit)
        result[name] = table_sensor(source, found, layout, name, options, findings)
    label = sensor_name(stem_without_stamp(files[0].stem)) if len(files) == 1 else "technaid"
    if len({part.table.file for part, _ in pairs}) > 1:
        findings = [*share_clock(result), *findings]
    return suited_recording(label, "Technaid recording", result, findings)


def _pairs(parts: list[Part]) -> list[tuple[Part, Part | None]]:
    """Each part with physical data, and the part of another file that holds its quaternions.

    They belong together by the name of the sensor and the file's name without the kind of capture;
    of two files, by the name of the sensor alone.
    """
    quaternions = [part for part in parts if set(part.found.columns) == {"quaternion"}]
    files = {part.table.file for part in parts}
    pairs: list[tuple[Part, Part | None]] = []
    taken: list[Part] = []
    for part in parts:
        if part in quaternions:
            continue
        own = [
            other
            for other in quaternions
            if "quaternion" not in part.found.columns
            and other.prefix == part.prefix
            and other.table.file != part.table.file
            and (other.base == part.base or len(files) == 2)
        ]
        pairs.append((part, own[0] if len(own) == 1 else None))
        taken += own[:1] if len(own) == 1 else []
    return pairs + [(part, None) for part in quaternions if part not in taken]


def _joined(part: Part, other: Part, findings: list[Finding], name: str) -> tuple[Source, Found]:
    """The physical data with the quaternions of the other file, brought to their times."""
    titles = [f"quaternion_{axis}" for axis in "wxyz"]
    columns = dict(zip(titles, other.found.columns["quaternion"], strict=True))
    found = Found(part.found.columns | {"quaternion": titles}, part.found.units)
    first, second = part.table.file.name, other.table.file.name
    own, its = find_time(part.table.names), find_time(other.table.names)
    if own is None or its is None:
        findings.append(finding("structure.side_by_side", name, first=first, second=second))
        rows = Joined(Numbered(other.table), ROW, columns, turns=True)
        return JoinedTable(Numbered(part.table), ROW, [rows]), found
    if own[1] != its[1]:
        raise other.table.problem(
            f"its times are in another unit ({its[0]}) than those of {first} ({own[0]}); bring "
            "both to one"
        )
    begin, end = _span(part.table, own[0])
    its_begin, its_end = _span(other.table, its[0])
    if end < its_begin or its_end < begin:
        raise other.table.problem(
            f"from {its_begin:g} to {its_end:g} it has no time in common with {first}, which goes "
            f"from {begin:g} to {end:g}; the two are no pair of one recording"
        )
    findings.append(
        finding("structure.at_times_of", name, quantity="quaternion", file=second, main=first)
    )
    return JoinedTable(part.table, own[0], [Joined(other.table, its[0], columns, True)]), found


def _span(table: TextTable, time: str) -> tuple[float, float]:
    """First and last time of a table."""
    first, last = np.inf, -np.inf
    for chunk in table.chunks({time: "float"}):
        first = min(first, float(np.nanmin(chunk[time], initial=np.inf)))
        last = max(last, float(np.nanmax(chunk[time], initial=-np.inf)))
    return first, last


@dataclass(frozen=True)
class Numbered:
    """A table with the number of each row as a further column."""

    table: TextTable

    @property
    def names(self) -> list[str]:
        """Of the table, and the number."""
        return [*self.table.names, ROW]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        done = 0
        for chunk in self.table.chunks({n: kind for n, kind in kinds.items() if n != ROW}):
            count = len(next(iter(chunk.values())))
            yield chunk | {ROW: np.arange(done, done + count, dtype=float)}
            done += count

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the table."""
        return self.table.problem(message, row)
