"""Where samples come from: a table with named columns, handed over in chunks.

It knows where each row stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal, Protocol

import numpy as np

from testbench.exceptions import FileProblems

Kind = Literal["float", "integer", "clock"]
"""float: NaN where a value is missing; integer: exact to 64 bits, none may be missing; clock: a
time of day, as seconds.
"""
Columns = dict[str, np.ndarray]
ROWS_PER_CHUNK = 100_000


class Source(Protocol):
    """A table that is read from its beginning each time it is asked for chunks."""

    @property
    def names(self) -> list[str]:
        """Its columns."""
        ...

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """The wanted columns in pieces that fit in memory, each an array of shape (n,).

        Raises:
            FileProblems: Names the line of what cannot be read.
        """
        ...

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """The error that says `message` of the table, or of one of its rows (from 0)."""
        ...


def first_rows(source: Source, kinds: Mapping[str, Kind]) -> Columns:
    """The first chunk.

    Raises:
        FileProblems: The table has no rows.
    """
    for chunk in source.chunks(kinds):
        if len(next(iter(chunk.values()), ())):
            return chunk
    raise source.problem("there are no samples in the file")
