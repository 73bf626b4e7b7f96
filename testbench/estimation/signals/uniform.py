"""A regular time grid for filters: lost packets are filled in, and taken out again afterwards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

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
MOST_FILLING = 10
"""Gaps that would make the grid this many times longer than the recording are not filled; the
counter is then not trusted.
"""


def fill_gaps(samples: ImuSamples, clock: ClockFit) -> tuple[UniformSamples, np.ndarray]:
    """Samples on a regular grid.

    Args:
        samples: With their counter.
        clock: Gives the true interval.

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
    if count == len(samples) and whole_samples(samples).all():
        return UniformSamples(
            interval, samples.gyr, samples.acc, samples.mag, samples.device_q, intervals
        ), rows
    return replace(fill_rows(samples, rows, np.arange(count), interval), intervals=intervals), rows


def fill_rows(
    samples: ImuSamples,
    rows: np.ndarray,
    grid: np.ndarray,
    interval: float,
    whole: np.ndarray | None = None,
) -> UniformSamples:
    """Samples at rows of a regular grid, interpolated where they were lost or are not finite.

    Args:
        samples: All, or a chunk with its neighbouring rows.
        rows: Of each sample, increasing, shape (n,).
        grid: The rows that are wanted, shape (m,).
        interval: Between rows [s].
        whole: Samples of which every quantity is finite, shape (n,), if known.
    """
    whole = whole_samples(samples) if whole is None else whole
    sources = rows[whole]
    if (
        len(sources) == len(rows)
        and rows[-1] - rows[0] + 1 == len(rows)
        and rows[0] <= grid[0]
        and grid[-1] <= rows[-1]
    ):
        part = slice(grid[0] - rows[0], grid[-1] - rows[0] + 1)
        mag, q = samples.mag, samples.device_q
        return UniformSamples(
            interval,
            samples.gyr[part],
            samples.acc[part],
            None if mag is None else mag[part],
            None if q is None else q[part],
        )

    def fill(array: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(grid, sources, column) for column in array[whole].T])

    mag = None if samples.mag is None else fill(samples.mag)
    device_q = (
        None
        if samples.device_q is None
        else rotation.interpolate(sources, samples.device_q[whole], grid)
    )
    return UniformSamples(interval, fill(samples.gyr), fill(samples.acc), mag, device_q)


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


def whole_samples(samples: ImuSamples) -> np.ndarray:
    """Samples of which no recorded quantity is NaN, shape (n,), bool."""
    whole = np.ones(len(samples), dtype=bool)
    for array in (samples.gyr, samples.acc, samples.mag, samples.device_q):
        if array is not None and np.isfinite(array).any():
            whole &= np.isfinite(array).all(axis=1)
    return whole if whole.any() else np.ones(len(samples), dtype=bool)
