"""Joint states of ROS as a table whose cells hold the joints' names.

Converters of bags write a message of sensor_msgs/JointState as `name_0`, `name_1`, ... and
`position_0`, `position_1`, ..., or as two lists in one cell each. The order may differ from row to
row, and other publishers' rows have other joints.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem, one_line
from testbench.formats.tables.bytes_stream import LineStream, encoding_of
from testbench.formats.tables.fields import MISSING
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.text_table import guess_separator, head_of

_PLACED = r"(?P<before>.*?)(?P<key>name|position)s?[\s_./\[(]*(?P<place>\d+)[\])]*"
_LISTED = r"(?P<before>.*?)(?P<key>name|position)s?"
_NAME = re.compile(r"[A-Za-z_][\w./-]*")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan", re.I)


@dataclass(frozen=True)
class _Layout:
    """Where the cells of names and of positions stand, pair by pair; `listed`: many in a cell."""

    names: list[int]
    positions: list[int]
    listed: bool

    def of(self, row: list[str]) -> dict[str, str]:
        """Position of each joint of a row, as text."""
        names, positions = ([row[i] for i in places] for places in (self.names, self.positions))
        if self.listed:
            names, positions = _NAME.findall(names[0]), _NUMBER.findall(positions[0])
        return dict(zip((name.strip().lstrip("/") for name in names), positions, strict=False))


class JointCells:
    """A table of the joints' angles and of the other columns, as a source of samples.

    Args:
        file: Where it is.
        joints: Names of the arm.
        titles: Of the file's columns.
        rows: Cells, with the line of each.
        layout: Where names and positions stand.

    Raises:
        FileProblems: No row has all joints, or a position is no number.
    """

    def __init__(
        self,
        file: Path,
        joints: list[str],
        titles: list[str],
        rows: list[tuple[int, list[str]]],
        layout: _Layout,
    ):
        self.file = file
        self._lines: list[int] = []
        kept, angles, seen = [], [], set()
        for line, row in rows:
            position = layout.of(row)
            seen |= set(position)
            if set(joints) <= set(position):
                self._lines.append(line)
                kept.append(row)
                angles.append([self._angle(position[joint], joint, line) for joint in joints])
        if not kept:
            raise self.problem(
                f"no row names all the joints {', '.join(joints)}; the cells name "
                f"{', '.join(sorted(seen)) or 'none'}"
            )
        used = {*layout.names, *layout.positions}
        self._texts = {
            title: [row[i] for row in kept] for i, title in enumerate(titles) if i not in used
        }
        self._angles = dict(zip(joints, np.array(angles).T, strict=True))

    @property
    def names(self) -> list[str]:
        """The other columns, and the joints."""
        return [*self._texts, *self._angles]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        yield {name: self._column(name, kind) for name, kind in kinds.items()}

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the file, or of one of the rows that have all joints."""
        line = None if row is None else self._lines[row]
        return FileProblems(self.file, [Problem(message, line=line)])

    def _column(self, name: str, kind: Kind) -> np.ndarray:
        if name in self._angles:
            return self._angles[name]
        if kind == "clock":
            raise self.problem(f"the column {name} holds no numbers")
        for row, text in enumerate(self._texts[name]):
            if not _NUMBER.fullmatch(text) or (kind == "integer" and not text.isdigit()):
                raise self.problem(f"'{one_line(text[:40])}' in {name} is no number", row)
        return np.array(self._texts[name], dtype=np.int64 if kind == "integer" else np.float64)

    def _angle(self, text: str, joint: str, line: int) -> float:
        if text in MISSING or not _NUMBER.fullmatch(text.strip()):
            message = f"the position of {joint}, '{one_line(text[:40])}', is no number"
            raise FileProblems(self.file, [Problem(message, line=line)])
        return float(text)


def joint_cells(file: Path, joints: list[str]) -> JointCells | None:
    """The joint states of a file; None where its cells hold no joints' names.

    Args:
        file: Text.
        joints: Names of the arm.

    Raises:
        FileProblems: A row is cut off, or holds no numbers.
    """
    header = next((line for line in head_of(file) if line.strip()), "")
    separator = guess_separator(header)
    titles = _split(header, separator)
    layout = _layout(titles)
    if layout is None:
        return None
    rows = []
    with LineStream(file, encoding_of(file)) as stream:
        for number, line in enumerate(stream.lines(), 1):
            row = _split(line, separator)
            if not line.strip() or row == titles:
                continue
            if len(row) < len(titles):
                message = f"has {len(row)} cells, where the titles are {len(titles)}"
                raise FileProblems(file, [Problem(message, line=number)])
            rows.append((number, row))
    return JointCells(file, joints, titles, rows, layout)


def _split(line: str, separator: str) -> list[str]:
    return [
        cell.strip() for cell in next(csv.reader([line.strip("\r\n")], delimiter=separator), [])
    ]


def _layout(titles: list[str]) -> _Layout | None:
    for pattern, listed in ((_PLACED, False), (_LISTED, True)):
        found: dict[tuple[str, ...], dict[int, int]] = {}
        for column, title in enumerate(titles):
            match = re.fullmatch(pattern, title, re.I)
            if match:
                place = 0 if listed else int(match["place"])
                key = (match["before"].lower(), match["key"].lower())
                found.setdefault(key, {})[place] = column
        for (prefix, kind), names in found.items():
            positions = found.get((prefix, "position"), {})
            if kind == "name" and positions.keys() == names.keys():
                places = sorted(positions)
                return _Layout([names[i] for i in places], [positions[i] for i in places], listed)
    return None
