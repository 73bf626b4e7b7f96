"""The timeline of a recording, and columns on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr

from testbench.model.statistics.intervals import median_interval

TIMELINE = "host_time"


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


def every(time_ns: np.ndarray, rate: float) -> slice:
    """The stride that brings regular samples down to a rate; never up.

    Args:
        time_ns: Of the samples, increasing, shape (n,) [ns].
        rate: About that of what is left [Hz].
    """
    if len(time_ns) < 2:
        return slice(None)
    interval = median_interval(time_ns) * 1e-9
    return slice(None, None, max(1, round(1 / (rate * interval)))) if interval > 0 else slice(None)


def changing(values: np.ndarray, tolerance: float) -> np.ndarray:
    """Rows that differ from the one before or after, and the ends.

    Args:
        values: Shape (n, k), in any unit.
        tolerance: Least change of any column that counts, in the same unit.

    Returns:
        Their indices, increasing.
    """
    moved = np.abs(np.diff(values, axis=0)).max(axis=1) > tolerance
    keep = np.zeros(len(values), dtype=bool)
    keep[[0, -1]] = True
    keep[1:] |= moved
    keep[:-1] |= moved
    return np.flatnonzero(keep)
