"""Vicon Nexus and Tracker: ASCII export (Vicon documentation, ASCII file format).

A file has sections such as Trajectories, Segments or Objects. Each has its title, the rate, the
names above the first of their columns, the row Frame, Sub Frame, X, Y, Z (or RX, RY, RZ, RW, TX,
TY, TZ), the row of units, and the data up to a blank line.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem, one_line
from testbench.formats.tables.bytes_stream import LineStream, encoding_of
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.text_table import guess_separator
from testbench.formats.truth.number_rows import number_rows
from testbench.formats.truth.tracked import (
    METRES,
    Tracked,
    frame_times,
    points,
    quaternions,
    stated_rate,
)


@dataclass(frozen=True)
class _Section:
    """The header of a section; lines are counted from 1."""

    title: str
    rate: float
    names: list[str]
    axes: list[str]
    units: list[str]
    separator: str
    first_line: int


def is_vicon(lines: list[str]) -> bool:
    """Whether there is the row of axes of such a file."""
    return any(_axes_row(line) for line in lines)


def _axes_row(line: str) -> bool:
    cells = split_line(line, guess_separator(line))
    return len(cells) > 2 and [cell.lower() for cell in cells[:2]] == ["frame", "sub frame"]


def read_vicon(file: Path, rate: float | None) -> Tracked:
    """Markers and bodies of a file.

    Args:
        file: To read.
        rate: In place of that of its sections [Hz], or None.

    Raises:
        FileProblems: It is malformed, or holds neither; names the line.
    """
    tracked = None
    for section in _sections(file):
        is_points = section.axes[2:5] == ["X", "Y", "Z"] and section.title.startswith("traj")
        is_bodies = "RX" in section.axes
        if not is_points and not is_bodies:
            continue
        rows = number_rows(file, section.first_line, section.separator, len(section.axes))
        times = frame_times(len(rows), rate or section.rate)
        if tracked is None:
            tracked = Tracked("Vicon", times)
        if len(times) != len(tracked.time_ns):
            raise FileProblems(
                file, [Problem("its sections differ in length", line=section.first_line)]
            )
        if is_points:
            _add_points(file, section, rows, tracked)
        else:
            _add_bodies(section, rows, tracked)
    if tracked is None:
        raise FileProblems(
            file, [Problem("has no section Trajectories, and none with rotations (RX, RY, RZ, RW)")]
        )
    return tracked


def _sections(file: Path) -> Iterator[_Section]:
    """The headers of the sections, wherever they begin."""
    before: list[str] = []
    with LineStream(file, encoding_of(file)) as stream:
        lines = enumerate(stream.lines(), 1)
        for number, line in lines:
            if line[:1] in 'Ff"' and _axes_row(line) and len(before) >= 3:
                separator = guess_separator(line)
                axes = [cell.upper() for cell in split_line(line, separator)]
                _, units = next(lines, (0, ""))
                title, rate, names = before[-3:]
                yield _Section(
                    title.strip(f' "{separator}').lower(),
                    _rate(file, rate.strip(f' "{separator}'), number - 2),
                    split_line(names, separator),
                    axes,
                    split_line(units, separator),
                    separator,
                    number + 2,
                )
            before = [*before[-2:], line]


def _rate(file: Path, text: str, line: int) -> float:
    rate = stated_rate(text)
    if rate is None:
        shown = one_line(text[:40])
        raise FileProblems(file, [Problem(f"'{shown}' is no sampling rate", line=line)])
    return rate


def _named(section: _Section) -> dict[str, int]:
    """The first column of each name."""
    return {name: i for i, name in enumerate(section.names) if name and i >= 2}


def _add_points(file: Path, section: _Section, rows: np.ndarray, tracked: Tracked) -> None:
    starts = {
        name: i for name, i in _named(section).items() if section.axes[i : i + 3] == ["X", "Y", "Z"]
    }
    unit = section.units[2].lower() if len(section.units) > 2 else "mm"
    if unit not in METRES:
        raise FileProblems(
            file,
            [Problem(f"the unit is '{unit}'; known: mm, cm, m", line=section.first_line - 1)],
        )
    flat = [rows[:, i : i + 3] for i in starts.values()]
    if flat:
        tracked.markers |= points(np.hstack(flat), list(starts), METRES[unit])


def _add_bodies(section: _Section, rows: np.ndarray, tracked: Tracked) -> None:
    starts = _named(section)
    ends = [*list(starts.values())[1:], len(section.axes)][: len(starts)]
    for (name, start), end in zip(starts.items(), ends, strict=True):
        own = section.axes[start:end]
        if {"RX", "RY", "RZ", "RW"} <= set(own):
            places = [start + own.index(axis) for axis in ("RW", "RX", "RY", "RZ")]
            tracked.bodies[name] = quaternions(rows[:, places])
        elif "RX" in own:
            tracked.left_out[name] = (
                "its rotation is three numbers, helical or Euler by a setting that the file does "
                "not tell; export it as quaternions (RX, RY, RZ, RW), or its markers"
            )
