"""The timeline of a recording, and columns on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr

TIMELINE = "host_time"


def send(
    recording: rr.RecordingStream, path: str, time_ns: np.ndarray, columns: Iterable[Any]
) -> None:
    """Log columns at host times, shape (n,), as durations since the start of the session."""
    durations = np.asarray(time_ns, dtype=np.int64).astype("timedelta64[ns]")
    rr.send_columns(
        path, [rr.TimeColumn(TIMELINE, duration=durations)], columns, recording=recording
    )


def every(time_ns: np.ndarray, rate: float) -> slice:
    """The stride that brings regular samples down to about `rate` [Hz]; never up."""
    if len(time_ns) < 2:
        return slice(None)
    interval = float(np.median(np.diff(time_ns))) * 1e-9
    return slice(None, None, max(1, round(1 / (rate * interval)))) if interval > 0 else slice(None)


def changing(values: np.ndarray, tolerance: float) -> np.ndarray:
    """Rows that differ from the one before or after by more than a tolerance, and the ends; shape
    (n, k) to indices.
    """
    moved = np.abs(np.diff(values, axis=0)).max(axis=1) > tolerance
    keep = np.zeros(len(values), dtype=bool)
    keep[[0, -1]] = True
    keep[1:] |= moved
    keep[:-1] |= moved
    return np.flatnonzero(keep)
