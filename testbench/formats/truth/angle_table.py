"""Angles of joints over time as files hold them: OpenSim's coordinates, C3D, tables."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.stamps import Stamps
from testbench.formats.tables.binary_kinds import PARQUET, binary_kind
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.parquet_table import ParquetTable
from testbench.formats.tables.samples_stream import Quantities, SampleStream, stack
from testbench.formats.tables.source import Columns, Kind, Source
from testbench.formats.tables.text_table import TextTable, find_table, guess_separator, head_of
from testbench.formats.tables.timeline import RegularTime
from testbench.formats.truth.c3d import read_c3d_angles
from testbench.formats.truth.number_rows import number_rows, rows_apart
from testbench.formats.truth.reference import collect
from testbench.formats.truth.times import truth_stamps
from testbench.formats.truth.tracked import frame_times, tracked_times
from testbench.records.findings.finding import Finding

AngleUnit = Literal["deg", "rad"]
OPENSIM, END = "OpenSim", "endheader"
_UNIT = re.compile(r"[\s_]*[\[(]?(?P<unit>deg(?:rees?)?|rad(?:ians?)?)[\])]?$", re.IGNORECASE)
_QUATERNIONS = re.compile(r"datatype\s*=\s*quaternion", re.IGNORECASE)


@dataclass
class AngleTable:
    """Angles over time.

    Attributes:
        system: Kind of the file, for people.
        time_ns: From the first row, or host time of the samples; shape (n,), int64, increasing.
        columns: As in the file, by title, shape (n,) each; NaN where unknown.
        broken: Columns that cannot be read as numbers, and why.
        unit: Of all, where the file states one.
        unix_ns: Unix time of the first row, where its times are such [ns].
        model: Of OpenSim, whose coordinates they are, where the file says so.
        findings: What was noticed.
    """

    system: str
    time_ns: np.ndarray
    columns: dict[str, np.ndarray]
    broken: dict[str, FileProblems] = field(default_factory=dict)
    unit: AngleUnit | None = None
    unix_ns: int | None = None
    model: str = ""
    findings: list[Finding] = field(default_factory=list)

    @property
    def titles(self) -> list[str]:
        """Of all columns."""
        return [*self.columns, *self.broken]

    def values(self, title: str) -> np.ndarray:
        """A column, shape (n,).

        Raises:
            FileProblems: It cannot be read as numbers; names the line.
        """
        if title in self.broken:
            raise self.broken[title]
        return self.columns[title]

    def unit_of(self, title: str) -> AngleUnit | None:
        """The unit of a column by its title, else that of all."""
        found = _UNIT.search(title)
        if found is None or found.start() == 0:
            return self.unit
        return "deg" if found["unit"].lower().startswith("d") else "rad"


def plain_title(title: str) -> str:
    """What a column is called, in small letters, without its unit and the path to it.

    Args:
        title: Such as knee_angle_r_deg, /jointset/knee/knee_angle_r/value or Anna:LKneeAngles.x.
    """
    parts = title.strip().split("/")
    name = parts[-2] if len(parts) > 2 and parts[-1] == "value" else title.strip()
    name = name.rpartition(":")[2]
    unit = _UNIT.search(name)
    return (name[: unit.start()] if unit and unit.start() else name).lower()


def is_coordinates(file: Path) -> bool:
    """Whether a file is a table of OpenSim that holds no orientations."""
    if file.suffix.lower() not in (".mot", ".sto"):
        return False
    lines = head_of(file)
    return any(_is_end(line) for line in lines) and not any(map(_QUATERNIONS.match, lines))


def read_angles(
    file: Path, titles: Iterable[str], rate: float | None, time_unit: str | None
) -> AngleTable:
    """The angles in a file.

    Args:
        file: A motion or storage file of OpenSim, a C3D file, or a table.
        titles: Some of which stand in the line of titles of a table.
        rate: In place of its times [Hz], or None.
        time_unit: Of the times of a table, where a person stated it.

    Raises:
        InputError: The unit of its times is not known; says how to state it.
        FileProblems: It is malformed, or holds no angles; names the line.
    """
    has_column = file.suffix.lower() not in (".c3d", ".mot", ".sto")
    if time_unit is not None and (rate is not None or not has_column):
        raise InputError(f"--truth-time-unit has no effect: no times of {file} are in doubt")
    if file.suffix.lower() == ".c3d":
        found = read_c3d_angles(file)
        if not found.names:
            message = "holds no angles: none of its points is listed in POINT:ANGLES"
            raise FileProblems(file, [Problem(message)])
        times = frame_times(len(found.values), rate or found.rate)
        return AngleTable("C3D", times, found.columns(), unit=found.unit)
    if file.suffix.lower() in (".mot", ".sto"):
        return _coordinates(file, rate)
    return _of_table(file, titles, rate, time_unit)


def _coordinates(file: Path, rate: float | None) -> AngleTable:
    """A table of OpenSim (user guide, Motion (.mot) Files, Storage (.sto) Files)."""
    lines = head_of(file)

    def refuse(message: str, line: int | None = None) -> FileProblems:
        return FileProblems(file, [Problem(message, line=line)])

    end = next((i for i, line in enumerate(lines) if _is_end(line)), None)
    if end is None:
        raise refuse(f"not an OpenSim table: no line '{END}' in its beginning")
    header = {
        key.strip().lower(): value.strip()
        for key, equals, value in (line.partition("=") for line in lines[:end])
        if equals
    }
    at = next((i for i in range(end + 1, len(lines)) if lines[i].strip()), None)
    if at is None:
        raise refuse("there are no titles below the header")
    separator = guess_separator(lines[at])
    names = split_line(lines[at], separator)
    if names[0].strip().lower() != "time" or len(names) < 2 or len(set(names)) != len(names):
        raise refuse("the titles must be time and the coordinates, each once", at + 1)
    rows = number_rows(file, at + 2, separator, len(names))
    times = tracked_times(file, len(rows), rows[:, 0], rate, first_line=at + 2)
    stated = header.get("indegrees", "").lower()
    unit: AngleUnit | None = {"yes": "deg", "no": "rad"}.get(stated)  # type: ignore[assignment]
    columns = {name: rows[:, i] for i, name in enumerate(names) if i}
    model = header.get("coordinates", "")
    count = "nRows" if "nrows" in header else "datarows"
    findings = rows_apart(file, count, header.get(count.lower()), len(rows))
    return AngleTable(OPENSIM, times, columns, unit=unit, model=model, findings=findings)


def _is_end(line: str) -> bool:
    return line.strip().lower() == END


def _of_table(
    file: Path, titles: Iterable[str], rate: float | None, time_unit: str | None
) -> AngleTable:
    """A table of text or Parquet, with a column of times or a rate."""
    table = _open(file, titles)
    stamps = truth_stamps(table, rate, time_unit)
    if stamps is None and rate is None:
        raise table.problem("no column of times; state its rate with --truth-rate HZ")
    if stamps is None:
        known = float(rate or 0.0)
        stamps = Stamps(lambda: RegularTime(known), [])
    return angles_of(table, list(table.names), stamps, None)


def _open(file: Path, titles: Iterable[str]) -> TextTable | ParquetTable:
    if binary_kind(file) is PARQUET:
        return ParquetTable(file)
    wanted = "|".join(re.escape(title) for title in sorted(titles))
    what = "a table of joint angles, whose titles name them"
    return find_table(file, re.compile(wanted or r"[^\W\d]", re.IGNORECASE), what)[0]


def angles_of(
    table: Source, titles: list[str], stamps: Stamps, origin_ns: int | None
) -> AngleTable:
    """Columns of a table as angles; those that are not numbers are left out.

    Args:
        table: Of text, or whatever holds it.
        titles: Of the columns.
        stamps: How its times are read.
        origin_ns: Time at which host time is zero [ns]; None for that of the first row.
    """
    time_columns = set(stamps.timeline().kinds)
    broken = _broken(table, [title for title in titles if title not in time_columns])
    wanted = [own for own in titles if own not in time_columns and own not in broken]
    if not wanted:
        raise next(iter(broken.values()), table.problem("there is no column beside the times"))
    kinds: dict[str, Kind] = dict.fromkeys(wanted, "float")

    def convert(columns: Columns) -> Quantities:
        return Quantities(None, None, None, stack(columns, wanted))  # carried, whatever they are

    stream = SampleStream(table, kinds, convert, stamps.timeline, origin_ns=origin_ns)
    time, values = collect(stream)
    findings = [*stamps.findings, *stream.findings()]
    unix = stream.first_time_ns() if stamps.unix else None
    own = {title: values[:, i] for i, title in enumerate(wanted)}
    return AngleTable("table", time, own, broken, unix_ns=unix, findings=findings)


def _broken(table: Source, titles: list[str]) -> dict[str, FileProblems]:
    """Columns that cannot be read as numbers, and why."""
    if not titles or _problem(table, titles) is None:
        return {}
    found = {title: _problem(table, [title]) for title in dict.fromkeys(titles)}
    return {title: problem for title, problem in found.items() if problem is not None}


def _problem(table: Source, titles: list[str]) -> FileProblems | None:
    """Why columns cannot be read as numbers."""
    try:
        for _ in table.chunks(dict.fromkeys(titles, "float")):
            pass
    except FileProblems as error:
        return error
    return None
