"""OpenSim's tables of orientations (.sto): a column a body, in it the four parts of a quaternion.

A header of keys ends with the line `endheader`; below it stand the titles, time first, and rows of
`w,x,y,z` between tabs (OpenSim user guide, Storage (.sto) Files; OpenSense).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem, one_line
from testbench.formats.tables.bytes_stream import LineStream, encoding_of
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.text_table import head_of

TIME = "time"
AXES = "wxyz"
LINES_PER_CHUNK = 20_000


@dataclass(frozen=True)
class StoTable:
    """The table of a file, its columns named as `pelvis_imu_w`.

    Attributes:
        file: Where it is.
        bodies: Titles of its columns, from left to right.
        header: Its keys.
        first_line: Of the data, from 1.
    """

    file: Path
    bodies: list[str]
    header: dict[str, str]
    first_line: int

    @property
    def names(self) -> list[str]:
        """The time, and four columns a body."""
        return [TIME, *(f"{body}_{axis}" for body in self.bodies for axis in AXES)]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        at = {name: self.names.index(name) for name in kinds}
        with LineStream(self.file, encoding_of(self.file), self.first_line - 1) as stream:
            numbered = enumerate(stream.lines(), self.first_line)
            while lines := list(itertools.islice(numbered, LINES_PER_CHUNK)):
                rows = [(number, line) for number, line in lines if line.strip()]
                if rows:
                    values = self._values(rows)
                    yield {name: values[:, column] for name, column in at.items()}

    def _values(self, rows: list[tuple[int, str]]) -> np.ndarray:
        """The numbers of numbered lines, shape (n, 1 + 4 bodies)."""
        width = len(self.names)
        fields = [line.replace(",", " ").split() for _, line in rows]
        for (number, _), row in zip(rows, fields, strict=True):
            if len(row) != width:
                raise self._at(
                    number,
                    f"has {len(row)} numbers where {width} are expected, the time and four for "
                    f"each of {len(self.bodies)} bodies",
                )
        try:
            return np.array(fields, dtype=float)
        except ValueError:
            for (number, _), row in zip(rows, fields, strict=True):
                for text in row:
                    if not _is_number(text):
                        shown = one_line(text[:40])
                        raise self._at(number, f"'{shown}' is not a number") from None
            raise self._at(rows[0][0], "cannot be read as numbers") from None

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the file, or of a row of it (from 0)."""
        if row is None:
            return FileProblems(self.file, [Problem(message)])
        with LineStream(self.file, encoding_of(self.file), self.first_line - 1) as stream:
            numbered = enumerate(stream.lines(), self.first_line)
            full = (number for number, line in numbered if line.strip())
            return self._at(next(itertools.islice(full, row, None), self.first_line), message)

    def _at(self, line: int, message: str) -> FileProblems:
        return FileProblems(self.file, [Problem(message, line=line)])


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def find_sto(file: Path) -> StoTable:
    """The table of orientations of a file.

    Raises:
        FileProblems: The file is no such table.
    """
    lines = head_of(file)

    def refuse(message: str, line: int | None = None) -> FileProblems:
        return FileProblems(file, [Problem(message, line=line)])

    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if end is None:
        raise refuse("not an OpenSim table: no line 'endheader' in its beginning")
    header = {
        key.strip(): value.strip()
        for key, equals, value in (line.partition("=") for line in lines[:end])
        if equals
    }
    if header.get("DataType", "").lower() != "quaternion":
        kind = header.get("DataType") or "another kind"
        raise refuse(
            f"a table of {kind}, where orientations are needed: the header of such a table says "
            "DataType=Quaternion"
        )
    titles = next((i for i in range(end + 1, len(lines)) if lines[i].strip()), None)
    if titles is None:
        raise refuse("there are no titles below the header")
    names = [name.strip() for name in lines[titles].strip().split("\t")]
    if names[0].lower() != TIME or len(names) < 2 or not all(names):
        raise refuse("the titles must be time and the bodies, between tabs", titles + 1)
    if len(set(names)) != len(names):
        raise refuse("a body stands twice among the titles", titles + 1)
    return StoTable(file, names[1:], header, titles + 2)
