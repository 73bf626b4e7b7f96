"""The timeline of a recording, and columns on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr
from numba import njit

from testbench.model.statistics.intervals import median_interval
from testbench.reporting.page.decimation import Envelope

TIMELINE = "host_time"
MOST_ROWS = 30_000
"""Of a plot: ten times what a screen has columns."""


def send(
    recording: rr.RecordingStream, path: str, time_ns: np.ndarray, columns: Iterable[Any]
) -> None:
    """Log columns at host times, as durations since the start of the session.

    Args:
        recording: To log to.
        path: Of the entity.
        time_ns: Host times, shape (n,) [ns].
        columns: Of n rows each.
    """
    durations = np.asarray(time_ns, dtype=np.int64).astype("timedelta64[ns]")
    rr.send_columns(
        path, [rr.TimeColumn(TIMELINE, duration=durations)], columns, recording=recording
    )


def every(time_ns: np.ndarray, rate: float, most: int | None = None) -> slice:
    """The stride that brings regular samples down to a rate; never up.

    Args:
        time_ns: Of the samples, increasing, shape (n,) [ns].
        rate: About that of what is left [Hz].
        most: About so many may be left; any number if None.
    """
    if len(time_ns) < 2:
        return slice(None)
    interval = median_interval(time_ns) * 1e-9
    stride = round(1 / (rate * interval)) if interval > 0 else 1
    return slice(None, None, max(1, stride, 0 if most is None else -(-len(time_ns) // most)))


def extremes(time_ns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lines of a plot without more rows than anybody sees, each with its extremes.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        values: One column a line, shape (n, k).

    Returns:
        Times and values; of more than `MOST_ROWS` rows the lowest and the highest of each line in
        each of equally long spans.
    """
    if len(time_ns) <= MOST_ROWS:
        return time_ns, values
    envelope = Envelope(time_ns, points=MOST_ROWS)
    fewer = np.column_stack([envelope(line) for line in values.T])
    return envelope.time.astype(np.int64), fewer


@njit(cache=True)
def departing(values: np.ndarray, tolerance: float) -> np.ndarray:
    """Rows of what is held until the next one: no value is off by more than the tolerance.

    Args:
        values: Shape (n, k), in any unit.
        tolerance: Of any column, in the same unit.

    Returns:
        Their indices, increasing, with the first and the last.
    """
    kept = np.empty(len(values), dtype=np.int64)
    count = 0
    for row in range(len(values)):
        # the viewer holds what it was last given, so that the last kept row is the one to compare
        wanted = count == 0 or row == len(values) - 1
        for column in range(values.shape[1]):
            if wanted:
                break
            wanted = not abs(values[row, column] - values[kept[count - 1], column]) <= tolerance
        if wanted:
            kept[count] = row
            count += 1
    return kept[:count]
