"""Rows of a long table about given instants: all that interpolating there needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.records.disk.tables import (
    Stack,
    parquet_shape,
    read_parquet_batches,
    read_stacked,
)

MOST_ROWS = 500_000
"""Rows of the arm or of a truth that are read as a whole; of more, those are read that are
needed.
"""
MOST_THINNED = 2_000_000
"""Rows of a truth that is thinned out for what looks at the whole of it: four hours at 125 Hz stay
as they are.
"""
TIME = "host_time_ns"


@dataclass(frozen=True)
class Instants:
    """Host times at which a session is looked at [ns], increasing: by sensor, and for the arm."""

    sensors: Mapping[str, np.ndarray]
    arm: np.ndarray


def united(times: Iterable[np.ndarray]) -> np.ndarray:
    """All of several columns of times, increasing, each time once.

    Args:
        times: Columns, each of shape (k,) and increasing [ns].

    Returns:
        Shape (n,), int64.
    """
    columns = list(times)
    if len(columns) == 1:
        return columns[0]
    every = np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *columns]))
    return every[np.diff(every, prepend=every[:1] - 1) > 0]


def is_long(rows: int) -> bool:
    """Whether a table of the arm or of a truth is too long to be read as a whole."""
    return rows > MOST_ROWS


def read_near(
    path: Path, groups: Mapping[str, str | Sequence[str]], instants: np.ndarray
) -> dict[str, np.ndarray]:
    """The rows of a table before and after each instant, its first and its last one, in order.

    Between two neighbouring rows of the table that hold an instant between them none is left out,
    so that interpolation at the instants gives what it would give with the whole table. The table
    is gone through in pieces.

    Args:
        path: A table whose column `host_time_ns` increases.
        groups: By the name of the result, a column, or several that stand side by side in an array
            (n, k), straight at their places.
        instants: Increasing, shape (n,) [ns].

    Raises:
        SessionError: The file is missing or damaged, or lacks a column.
    """
    wanted = _rows_near(path, instants)
    if not len(wanted):
        return read_stacked(path, groups)
    stack, done, place = Stack(groups, int(wanted.sum())), 0, 0
    for batch in read_parquet_batches(path, stack.columns):
        here = wanted[done : done + len(batch[stack.columns[0]])]
        place = stack.put(place, batch, here)
        done += len(here)
    return stack.arrays


def _rows_near(path: Path, instants: np.ndarray) -> np.ndarray:
    """Which rows of a table are those before and after each instant, shape (rows,), bool.

    Args:
        path: The table.
        instants: Increasing, shape (n,) [ns].
    """
    wanted = np.zeros(parquet_shape(path)[0], dtype=bool)
    wanted[:1] = wanted[-1:] = True
    done, before = 0, np.zeros(0, dtype=np.int64)
    for columns in read_parquet_batches(path, [TIME]):
        times = np.concatenate([before, columns[TIME]])
        if not len(times):
            break
        begin, last = np.searchsorted(instants, times[0]), len(times) - 1
        own = instants[begin : np.searchsorted(instants, times[-1], side="right")]
        following = np.searchsorted(times, own, side="right")
        for rows in (following, following - 1, np.searchsorted(times, own)):
            wanted[done - len(before) + np.minimum(rows, last)] = True
        done, before = done + len(columns[TIME]), times[-1:]
    return wanted
