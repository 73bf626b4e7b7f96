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
UNIT_WITHIN = 0.01
"""By which the length of a quaternion may differ from 1: two decimals of a text file."""
RESTARTED_NS = NANOSECONDS
"""By which the clock of a device may go back: once it restarted it goes on by the host's clock, as
exactly as its samples arrive.
"""


def refuse_other_kinds(path: Path, wanted: Iterable[str]) -> None:
    """Refuse a table in which columns hold something else than they are named for.

    Times and counters are whole numbers, marks are truth values, everything else is numbers.

    Args:
        path: Of the table.
        wanted: Names of the columns that are read; one that is missing is for the reader to tell.

    Raises:
        SessionError: Names the first of them.
    """
    kinds = parquet_kinds(path)
    for name in wanted:
        if name in kinds and kinds[name] not in _allowed(name):
            raise SessionError(
                f"{path} is damaged: its column {name} holds {kinds[name]}, not {_allowed(name)[0]}"
            )


def _allowed(name: str) -> tuple[str, ...]:
    if name.endswith("_ns") or name == "counter":
        return (INTEGER,)
    return (FLAG,) if name in {"saturated", "judged"} else (NUMBER, INTEGER)


def refuse_times(path: Path, name: str, times: np.ndarray, back_ns: int = 0) -> None:
    """Refuse times that go back, or are none of a recording.

    Args:
        path: Of the table.
        name: Of the column.
        times: Shape (n,), int64 [ns].
        back_ns: By which they may.

    Raises:
        SessionError: Names the row, from 0.
    """
    if not len(times):
        return
    far = (times > LATEST_NS) | (times < -LATEST_NS)
    if far.any():
        row = int(np.argmax(far))
        raise SessionError(
            f"{path} is damaged: {name} is {int(times[row])} in row {row}, which is no time"
        )
    back = times[1:] < times[:-1] - back_ns
    if back.any():
        row = int(np.argmax(back)) + 1
        raise SessionError(
            f"{path} is damaged: {name} goes back in row {row}, from {int(times[row - 1])} to "
            f"{int(times[row])}"
        )
    if times[-1] - times[0] > LONGEST_S * NANOSECONDS:
        days = int(times[-1] - times[0]) / (86_400 * NANOSECONDS)
        raise SessionError(
            f"{path} is damaged: {name} spans {days:.0f} days; a recording lasts "
            f"{LONGEST_S // 86_400} at most"
        )


def refuse_no_numbers(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Refuse numbers that are not known where something is always known.

    Args:
        path: Of the table.
        columns: By name, each of shape (n,) or (n, k).

    Raises:
        SessionError: Names the column and the row, from 0.
    """
    for name, values in columns.items():
        lost = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
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
    with np.errstate(over="ignore"):  # squares of what is no part of a unit quaternion
        length = np.sqrt((q * q).sum(axis=1))
    known = ~np.isnan(q).any(axis=1)
    wrong = known & ~(np.abs(length - 1.0) <= UNIT_WITHIN)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise SessionError(
            f"{path} is damaged: {name} has length {length[row]:.3g} in row {row}, and a rotation "
            "has 1"
        )
