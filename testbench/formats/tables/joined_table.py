"""A table with columns of other tables, of other rates but the same clock, brought to its times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from testbench.exceptions import FileProblems
from testbench.formats.tables.source import Columns, Kind, Source
from testbench.model import rotation

REACH = 1.5
"""Before its first and after its last row a table is held for so many of its intervals."""
WIDEST = 5.0
"""Across a pause longer than so many of its intervals a table is not interpolated."""


@dataclass(frozen=True)
class Joined:
    """Columns of another table.

    Attributes:
        source: The other table.
        time: Its column of times, on the clock and in the unit of the main table's.
        columns: Titles there by titles here.
        turns: Whether they are the four parts of a quaternion, w first.
    """

    source: Source
    time: str
    columns: dict[str, str]
    turns: bool = False


@dataclass
class JoinedTable:
    """The rows of a main table, with the columns of others interpolated to their times.

    Vectors are interpolated linearly, quaternions spherically; NaN where the other table has no
    rows near.

    Attributes:
        main: Whose rows these are.
        time: Its column of times.
        others: What joins it.
    """

    main: Source
    time: str
    others: list[Joined]

    @property
    def names(self) -> list[str]:
        """Of the main table, and those that joined."""
        return [*self.main.names, *(name for other in self.others for name in other.columns)]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        wanted = [other for other in self.others if set(other.columns) & set(kinds)]
        foreign = {name for other in wanted for name in other.columns}
        own = {name: kind for name, kind in kinds.items() if name not in foreign}
        windows = [_Window(other) for other in wanted]
        for chunk in self.main.chunks({self.time: "float", **own}):
            times = np.asarray(chunk[self.time], dtype=float)
            columns = {name: values for name, values in chunk.items() if name in own}
            for window in windows:
                columns |= {
                    name: values for name, values in window.at(times).items() if name in kinds
                }
            yield columns

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the main table."""
        return self.main.problem(message, row)


class _Window:
    """The rows of a joined table around the times that are asked for, which only grow."""

    def __init__(self, other: Joined):
        self._other = other
        kinds: dict[str, Kind] = {other.time: "float"}
        kinds |= dict.fromkeys(other.columns.values(), "float")
        self._reader = other.source.chunks(kinds)
        self._titles = [other.time, *other.columns.values()]
        self._held = np.empty((0, len(self._titles)))
        self._rows, self._interval, self._ended = 0, 0.0, False

    def at(self, times: np.ndarray) -> Columns:
        """The columns at the given times, shape (n,) each."""
        latest = float(np.nanmax(times, initial=-np.inf))
        while not self._ended and (not len(self._held) or self._held[-1, 0] < latest):
            self._read()
        values = self._values(times)
        first = int(np.searchsorted(self._held[:, 0], latest, side="right")) - 2
        self._held = self._held[max(first, 0) :]
        return dict(zip(self._other.columns, values.T, strict=True))

    def _read(self) -> None:
        """Take the next chunk in, without rows that are not whole."""
        chunk = next(self._reader, None)
        if chunk is None:
            self._ended = True
            return
        rows = np.column_stack([chunk[title] for title in self._titles])
        kept = np.flatnonzero(np.isfinite(rows).all(axis=1))
        whole = rows[kept]
        steps = np.diff(whole[:, 0], prepend=self._held[-1:, 0])
        if np.any(steps < 0):
            at = int(np.argmax(steps < 0)) + len(whole) - len(steps)
            raise self._other.source.problem("time goes back here", self._rows + int(kept[at]))
        self._rows += len(rows)
        if not self._interval and np.any(steps > 0):
            self._interval = float(np.median(steps[steps > 0]))
        self._held = np.vstack([self._held, whole])

    def _values(self, times: np.ndarray) -> np.ndarray:
        own, values = self._held[:, 0], self._held[:, 1:]
        if len(own) < 2:
            return np.full((len(times), values.shape[1]), np.nan)
        before = np.clip(np.searchsorted(own, times, side="right") - 1, 0, len(own) - 2)
        reach = REACH * self._interval
        near = own[before + 1] - own[before] <= WIDEST * self._interval
        near |= (times == own[before]) | (times == own[before + 1])
        near &= (times >= own[0] - reach) & (times <= own[-1] + reach)
        if self._other.turns:
            result = rotation.interpolate(own, values, times)
        else:
            result = np.column_stack([np.interp(times, own, column) for column in values.T])
        result[~near] = np.nan
        return result
