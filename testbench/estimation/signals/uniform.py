"""A regular time grid for filters: lost packets are filled in, and taken out again afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from testbench.consistency.traits import finite_rows
from testbench.estimation.filters.base import UniformSamples
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.results.estimate import ClockFit
from testbench.records.session.samples import ImuSamples

LEAST_JITTER, SHORTEST, LONGEST = 0.05, 0.2, 10.0
"""Standard deviation of the intervals above which they count as irregular, the shortest and the
longest, in median ones.

Below the first they are regular but for the resolution of the stamps. Intervals shorter than the
second are stamps of packets that came together: the sampling behind them is regular, and the stamps
say nothing of it. Over a pause longer than the third nobody knows the rate: the next sample's is
not held for all of it.
"""
BRIDGED_S = 0.25
"""Forces and fields that are missing for longer are not filled in [s]."""
MOST_FILLING = 10
"""Gaps that would make the grid this many times longer than the recording are not filled; the
counter is then not trusted.
"""


def fill_gaps(
    samples: ImuSamples, clock: ClockFit, bridges: Mapping[str, int] | None = None
) -> tuple[UniformSamples, np.ndarray]:
    """Samples on a regular grid.

    Args:
        samples: With their counter.
        clock: Gives the true interval.
        bridges: As for `fill_rows`; the usual ones if None.

    Returns:
        The regular samples, and the row of each original sample in them, shape (n,).
    """
    rows = samples.counter - samples.counter[0]
    if (np.diff(rows) <= 0).any() or rows[-1] + 1 > MOST_FILLING * len(rows):
        rows = np.arange(len(samples))
    count = int(rows[-1]) + 1
    span = (samples.device_time_ns[-1] - samples.device_time_ns[0]) / NANOSECONDS
    interval = span / max(count - 1, 1) / (1 + 1e-6 * clock.drift_ppm)
    intervals = _irregular(samples.device_time_ns, rows, clock)
    bridges = bridges_of(interval) if bridges is None else bridges
    uniform = fill_rows(samples, rows, np.arange(count), interval, bridges)
    return replace(uniform, intervals=intervals), rows


def bridges_of(interval: float, slower: Mapping[str, float] | None = None) -> Mapping[str, int]:
    """Rows in a row that are filled in of forces and fields; over longer holes filters go on
    without.

    Args:
        interval: Between rows [s].
        slower: Quantities whose readings come once in several rows, and in how many.
    """
    usual = max(round(BRIDGED_S / interval), 1) if interval > 0 else 1
    own = {} if slower is None else slower
    return {key: max(usual, int(np.ceil(2 * own.get(key, 0.0)))) for key in ("acc", "mag")}


def fill_rows(
    samples: ImuSamples,
    rows: np.ndarray,
    grid: np.ndarray,
    interval: float,
    bridges: Mapping[str, int],
    ends: tuple[bool, bool] = (True, True),
) -> UniformSamples:
    """Samples at rows of a regular grid; each quantity is interpolated where it was lost or is not
    finite.

    A rate is interpolated over any hole, for a filter needs one. Forces and fields over a long one
    are NaN: a straight line between them is nothing that was felt.

    Args:
        samples: All, or a chunk with its neighbouring rows.
        rows: Of each sample, increasing, shape (n,).
        grid: The rows that are wanted, consecutive, shape (m,).
        interval: Between rows [s].
        bridges: Longest hole of "acc" and "mag" that is filled [rows].
        ends: Whether the samples begin with the first, and end with the last of the recording.
    """
    dense = rows[-1] - rows[0] + 1 == len(rows) and rows[0] <= grid[0] and grid[-1] <= rows[-1]
    part = slice(grid[0] - rows[0], grid[-1] - rows[0] + 1)

    def filled(key: str) -> np.ndarray | None:
        array = getattr(samples, key)
        if array is None:
            return None
        known = finite_rows(array)
        if dense and known.all():
            return array if len(grid) == len(rows) else np.asarray(array[part])
        if not known.any():
            return np.full((len(grid), array.shape[1]), np.nan)
        return _filled(array[known], rows[known], grid, bridges.get(key), ends)

    gyr, acc = filled("gyr"), filled("acc")
    assert gyr is not None
    assert acc is not None
    return UniformSamples(interval, gyr, acc, filled("mag"), filled("device_q"))


def _filled(
    array: np.ndarray,
    sources: np.ndarray,
    grid: np.ndarray,
    bridge: int | None,
    ends: tuple[bool, bool],
) -> np.ndarray:
    """Readings at rows of a grid, shape (m, k).

    Args:
        array: Those that are known, shape (n, k).
        sources: Their rows, increasing, shape (n,).
        grid: The rows that are wanted, consecutive, shape (m,).
        bridge: Longest hole that is filled [rows]; None for any.
        ends: As for `fill_rows`.
    """
    result = np.empty((len(grid), array.shape[1]))
    inside = slice(*np.searchsorted(sources, [grid[0], grid[-1] + 1]))
    is_hole = np.ones(len(grid), dtype=bool)
    is_hole[sources[inside] - grid[0]] = False
    result[~is_hole] = array[inside]
    holes = grid[is_hole]
    if array.shape[1] == 4:
        result[is_hole] = rotation.interpolate(sources, array, holes)
        return result
    for axis in range(array.shape[1]):
        result[is_hole, axis] = np.interp(holes, sources, array[:, axis])
    if bridge is not None and len(holes):
        after = np.searchsorted(sources, holes)
        # at either end of the recording the hole begins, or ends, with it
        before_first = -1 if ends[0] else -np.inf
        after_last = 1 if ends[1] else np.inf
        edges = np.concatenate(
            [
                [min(sources[0], grid[0]) + before_first],
                sources.astype(float),
                [max(sources[-1], grid[-1]) + after_last],
            ]
        )
        result[np.flatnonzero(is_hole)[edges[after + 1] - edges[after] - 1 > bridge]] = np.nan
    return result


def _irregular(device_time_ns: np.ndarray, rows: np.ndarray, clock: ClockFit) -> np.ndarray | None:
    """Time before each row of the grid, shape (m,) [s]; None unless stamps tell irregular ones."""
    if len(rows) < 3:
        return None
    stamps = np.interp(
        np.arange(rows[-1] + 1), rows, (device_time_ns - device_time_ns[0]) / NANOSECONDS
    )
    steps = np.diff(stamps) / (1 + 1e-6 * clock.drift_ppm)
    median = float(np.median(steps))
    if steps.min() <= SHORTEST * median or steps.std() <= LEAST_JITTER * median:
        return None
    return np.minimum(np.concatenate([[median], steps]), LONGEST * median)
