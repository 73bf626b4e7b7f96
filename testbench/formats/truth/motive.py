"""OptiTrack Motive: CSV of markers, rigid bodies and bones (docs.optitrack.com, Data Export: CSV).

The first line has keys and values in turn (Format Version, Export Frame Rate, Rotation Type, Length
Units, Coordinate Space). Below it each column is told by its type, its name and what it is, one row
for each, above the row Frame, Time (Seconds), X, Y, Z, W. Quaternions stand as X, Y, Z, W. The
world of Motive has y up.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.text_table import head_of
from testbench.formats.truth.number_rows import number_rows, rows_apart
from testbench.formats.truth.tracked import (
    METRES,
    Tracked,
    points,
    quaternions,
    stated_rate,
    tracked_times,
)

MARKERS = ("marker", "rigid body marker", "bone marker")
BODIES = ("rigid body", "bone")
COUNT = "Total Exported Frames"
"""Key of the number of frames."""


@dataclass(frozen=True)
class _Column:
    kind: str
    name: str
    what: str
    axis: str


def is_motive(lines: list[str]) -> bool:
    """Whether the first line is that of such a file."""
    return lines[0].lstrip('"\ufeff').startswith("Format Version")


def read_motive(file: Path, rate: float | None) -> Tracked:
    """Markers and bodies of a file.

    Args:
        file: To read.
        rate: In place of its times [Hz], or None.

    Raises:
        FileProblems: It is malformed, or in coordinates of parents; names the line.
    """
    lines = head_of(file)
    cells = split_line(lines[0], ",")
    header = dict(zip(cells[::2], cells[1::2], strict=False))

    def refuse(message: str, line: int | None = None) -> FileProblems:
        return FileProblems(file, [Problem(message, line=line)])

    if header.get("Coordinate Space", "Global").lower() != "global":
        raise refuse("is in the coordinates of parents; export it with Coordinate Space: Global", 1)
    unit = header.get("Length Units", "Meters").lower()
    if unit not in METRES:
        raise refuse(f"its Length Units are '{unit}'; known: Meters, Centimeters, Millimeters", 1)
    columns, at = _columns(lines, refuse)
    rows = number_rows(file, at + 2, ",", len(columns))
    timed = next((i for i, c in enumerate(columns) if c.axis.lower().startswith("time")), None)
    seconds = None if timed is None else rows[:, timed]
    stated = stated_rate(header.get("Export Frame Rate"))
    times = tracked_times(file, len(rows), seconds, rate, stated, at + 2)
    tracked = Tracked("Motive (y up)", times)
    tracked.findings += rows_apart(file, COUNT, header.get(COUNT), len(rows))
    for kind in MARKERS:
        places = _places(columns, (kind,), "position", "XYZ")
        if places:
            flat = np.column_stack([rows[:, place] for place in places.values()])
            found = points(flat, list(places), METRES[unit])
            tracked.markers = found | tracked.markers
    for name, place in _places(columns, BODIES, "rotation", "WXYZ").items():
        tracked.bodies[name] = quaternions(rows[:, place])
    form = header.get("Rotation Type", "Euler angles")
    for name in _places(columns, BODIES, "rotation", "XYZ"):
        if name not in tracked.bodies:
            tracked.left_out[name] = (
                f"its rotation was exported as {form}; export it with Rotation Type: Quaternion"
            )
    return tracked


def _columns(lines: list[str], refuse) -> tuple[list[_Column], int]:  # type: ignore[no-untyped-def]
    """What each column is, and the index of the line of axes."""
    at = next((i for i, line in enumerate(lines) if line.lstrip('"').startswith("Frame")), None)
    if at is None or at < 3:
        raise refuse("has no row Frame, Time (Seconds), X, Y, Z below its header")
    rows = [split_line(line, ",") for line in lines[:at]]
    by_title = {row[1].lower(): row for row in rows if len(row) > 2 and row[1]}
    if "type" not in by_title or "name" not in by_title:
        raise refuse("lacks the rows Type and Name; export it with Header Information")
    axes = split_line(lines[at], ",")
    width = len(axes)
    kinds, names, whats = (
        (row + [""] * width)[:width]
        for row in (by_title["type"], by_title["name"], split_line(lines[at - 1], ","))
    )
    return [
        _Column(kind.lower(), name, what.lower(), axis)
        for kind, name, what, axis in zip(kinds, names, whats, axes, strict=True)
    ], at


def _places(
    columns: list[_Column], kinds: tuple[str, ...], what: str, axes: str
) -> dict[str, list[int]]:
    """Indices of the columns of each name that has all axes, in their order."""
    found: dict[str, dict[str, int]] = {}
    for i, column in enumerate(columns):
        if column.kind in kinds and column.what == what:
            found.setdefault(column.name, {}).setdefault(column.axis, i)
    return {
        name: [own[axis] for axis in axes] for name, own in found.items() if set(axes) <= set(own)
    }
