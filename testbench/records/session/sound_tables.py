"""What a raw table must hold for anything to be computed of it, whoever wrote it.

A session may come from anybody, with hashes that are right: what stands in its tables is looked at
when they are read, so that a damaged one is one sentence and no fault somewhere behind.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from testbench.exceptions import SessionError
from testbench.frames import NANOSECONDS
from testbench.records.disk.tables import FLAG, INTEGER, NUMBER, parquet_kinds

LONGEST_S = 100 * 86_400
"""Of a recording [s]: more is no time of one, and grids of time would fill the memory."""
LATEST_NS = 4_000_000_000 * NANOSECONDS
"""Farthest from the zero of a clock, be it 1970: the year 2096. Differences keep within 64 bits."""
PIECE = 100_000
"""Rows that are looked at at once."""
UNIT_WITHIN = 0.01
"""By which the length of a quaternion may differ from 1: two decimals of a text file."""
RESTARTED_NS = NANOSECONDS
"""By which the clock of a device may go back: once it restarted it goes on by the host's clock, as
exactly as its samples arrive. So may that of an arm, where the clocks of host and controller part.
"""


def refuse_other_kinds(path: Path, wanted: Iterable[str]) -> None:
    """Refuse a table in which columns hold something else than they are named for.

    Times and counters are int64, marks are bool, everything else is double.

    Args:
        path: Of the table.
        wanted: Names of the columns that are read; one that is missing is for the reader to tell.

    Raises:
        SessionError: Names the first of them.
    """
    kinds = parquet_kinds(path)
    for name in wanted:
        if name in kinds and kinds[name] != _kind(name):
            raise SessionError(
                f"{path} is damaged: its column {name} holds {kinds[name]}, not {_kind(name)}"
            )


def _kind(name: str) -> str:
    if name.endswith("_ns") or name == "counter":
        return INTEGER
    return FLAG if name in {"saturated", "judged"} else NUMBER


class Times:
    """Refuses times that go back, or are none of a recording, in pieces as they are read.

    Args:
        path: Of the table.
        name: Of the column.
        back_ns: By which they may go back.

    Attributes:
        stood: Whether more than one was seen, and all are the same.
    """

    def __init__(self, path: Path, name: str, back_ns: int = 0):
        self._path, self._name, self._back_ns = path, name, back_ns
        self._rows = 0
        self._first = self._latest = 0

    @property
    def stood(self) -> bool:
        return self._rows > 1 and self._first == self._latest

    def look(self, times: np.ndarray) -> None:
        """Look at the next rows.

        Args:
            times: Shape (n,), int64 [ns].

        Raises:
            SessionError: Names the row, from 0.
        """
        if not len(times):
            return
        far = (times > LATEST_NS) | (times < -LATEST_NS)
        if far.any():
            at = int(np.argmax(far))
            raise self._damaged(f"is {int(times[at])} in row {self._rows + at}, which is no time")
        if not self._rows:
            self._first = self._latest = int(times[0])
        latest = np.maximum(np.maximum.accumulate(times), self._latest)
        back = times < latest - self._back_ns
        if back.any():
            at = int(np.argmax(back))
            before, now = int(latest[at]), int(times[at])
            raise self._damaged(f"goes back in row {self._rows + at}, from {before} to {now}")
        self._rows, self._latest = self._rows + len(times), int(latest[-1])
        if self._latest - self._first > LONGEST_S * NANOSECONDS:
            days = (self._latest - self._first) / (86_400 * NANOSECONDS)
            raise self._damaged(
                f"spans {days:.0f} days; a recording lasts {LONGEST_S // 86_400} at most"
            )

    def _damaged(self, what: str) -> SessionError:
        return SessionError(f"{self._path} is damaged: {self._name} {what}")


def refuse_times(path: Path, name: str, times: np.ndarray, back_ns: int = 0) -> None:
    """Refuse times that go back, or are none of a recording.

    Args:
        path: Of the table.
        name: Of the column.
        times: Shape (n,), int64 [ns].
        back_ns: By which they may go back.

    Raises:
        SessionError: Names the row, from 0.
    """
    Times(path, name, back_ns).look(times)


def refuse_no_numbers(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Refuse numbers that are not known where something is always known.

    Args:
        path: Of the table.
        columns: By name, each of shape (n,) or (n, k).

    Raises:
        SessionError: Names the column and the row, from 0.
    """
    for name, values in columns.items():
        lost = ~np.isfinite(values).reshape(len(values), int(np.prod(values.shape[1:]))).all(axis=1)
        if lost.any():
            row = int(np.argmax(lost))
            raise SessionError(f"{path} is damaged: {name} is no number in row {row}")


def refuse_no_rotations(path: Path, name: str, q: np.ndarray) -> None:
    """Refuse quaternions that are neither unit nor marked as unknown.

    Args:
        path: Of the table.
        name: Of the columns.
        q: Shape (n, 4); NaN where unknown.

    Raises:
        SessionError: Names the row, from 0.
    """
    for begin in range(0, len(q), PIECE):
        piece = q[begin : begin + PIECE]
        with np.errstate(over="ignore"):  # squares of what is no part of a unit quaternion
            length = np.sqrt((piece * piece).sum(axis=1))
        known = ~np.isnan(piece).any(axis=1)
        wrong = known & ~(np.abs(length - 1.0) <= UNIT_WITHIN)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise SessionError(
                f"{path} is damaged: {name} has length {length[row]:.3g} in row {begin + row}, and "
                "a rotation has 1"
            )
