"""A table with its times in seconds since a common instant, so that tables of one clock can join.

Its columns bear a prefix, for the files of a phone call all of theirs x, y and z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from testbench.exceptions import FileProblems
from testbench.formats.tables.source import Columns, Kind, Source
from testbench.formats.tables.timeline import BadRowError, Timeline
from testbench.frames import NANOSECONDS

TIME = "time [s]"


@dataclass
class ClockedTable:
    """A table behind a prefix, with a further column `<prefix>time [s]`.

    Attributes:
        source: The table.
        timeline: Makes its clock; called for each pass.
        origin_ns: That instant on the clock [ns].
        prefix: Of every column.
    """

    source: Source
    timeline: Callable[[], Timeline]
    origin_ns: int
    prefix: str = ""

    @property
    def time(self) -> str:
        """The column of seconds."""
        return self.prefix + TIME

    @property
    def names(self) -> list[str]:
        """Of the table, and the seconds."""
        return [self.prefix + name for name in [*self.source.names, TIME]]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        timeline = self.timeline()
        cut = len(self.prefix)
        own = {name[cut:]: kind for name, kind in kinds.items() if name != self.time}
        row = 0
        for chunk in self.source.chunks(own | timeline.kinds):
            count = len(next(iter(chunk.values())))
            columns = {self.prefix + name: values for name, values in chunk.items() if name in own}
            if self.time in kinds and count:
                try:
                    times = timeline(chunk, count) - self.origin_ns
                except BadRowError as error:
                    raise self.source.problem(str(error), row + error.row) from None
                columns[self.time] = times / NANOSECONDS
            if count:
                yield columns
            row += count

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the table."""
        return self.source.problem(message, row)


@dataclass
class SparseColumns:
    """The rows of a main table, with columns of a slower one where that has a row, NaN elsewhere.

    A magnetometer of 10 Hz beside a gyroscope of 100 Hz says something in one row of ten.

    Attributes:
        main: Whose rows these are, with a column of seconds.
        time: That column.
        slow: The other table.
        columns: Of the slow table.
    """

    main: Source
    time: str
    slow: ClockedTable
    columns: list[str]

    @property
    def names(self) -> list[str]:
        """Of the main table, and the columns."""
        return [*self.main.names, *self.columns]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        own = {name: kind for name, kind in kinds.items() if name not in self.columns}
        wanted: dict[str, Kind] = dict.fromkeys([self.slow.time, *self.columns], "float")
        reader = self.slow.chunks(wanted)
        held, ended = np.empty((0, len(wanted))), False
        for chunk in self.main.chunks(own | {self.time: "float"}):
            times = chunk[self.time]
            while not ended and (not len(held) or held[-1, 0] <= times[-1]):
                following = next(reader, None)
                ended = following is None
                if following is not None:
                    held = np.vstack([held, np.column_stack([following[n] for n in wanted])])
            due = int(np.searchsorted(held[:, 0], times[-1], side="right"))
            placed = _placed(times, held[:due])
            held = held[due:]
            found = {name: placed[:, i] for i, name in enumerate(self.columns)}
            yield {name: values for name, values in (chunk | found).items() if name in kinds}

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the main table."""
        return self.main.problem(message, row)


def _placed(times: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Values at the nearest of the times, shape (n, k); NaN where none is near.

    Args:
        times: Increasing, shape (n,) [s].
        rows: Time, then k values, shape (m, 1 + k).
    """
    result = np.full((len(times), rows.shape[1] - 1), np.nan)
    if not len(rows) or len(times) < 2:
        return result
    after = np.clip(np.searchsorted(times, rows[:, 0]), 1, len(times) - 1)
    nearer = rows[:, 0] - times[after - 1] <= times[after] - rows[:, 0]
    at = after - nearer
    near = np.abs(times[at] - rows[:, 0]) <= np.median(np.diff(times))
    result[at[near]] = rows[near, 1:]
    return result
