"""Cycles of a recording that nobody planned: found in a joint's angle or in a sensor's own signal.

The period is where the autocorrelation of the signal peaks; a cycle goes from one peak of the
smoothed signal to the next. What is averaged are cycles of like length and like shape. Where a
signal does not repeat itself there are none, and that is said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.evaluation.cycles import LEAST_CYCLES, POINTS, WIDEST_GAP, widest_gap
from testbench.model.statistics.intervals import median_interval
from testbench.model.windows import moving_mean

SHORTEST_S = 0.25
"""Nothing that a person or an arm repeats is shorter [s]."""
LEAST_REPEATED = 0.5
"""Autocorrelation at the period from which a signal repeats itself [1]."""
AS_HIGH = 0.85
"""A peak of the autocorrelation that is as high as this part of the highest is the period if it is
the first: at twice the period a signal is as like itself [1].
"""
LEAST_PEAK = 0.3
"""A peak of the signal, as part of its usual ones; smaller ones are no cycles [1]."""
LONGEST, SHORTEST = 1.35, 0.65
"""Lengths of cycles, as parts of the period; others are left out [1]."""
LEAST_LIKENESS = 0.7
"""Correlation with the average cycle from which a cycle is one of them [1]."""
FINEST_S = 0.01
"""The period is looked for on a grid no finer than this [s]."""
MOST_PERIODS = 2**17
"""Points of that grid at the most: a quarter of an hour."""


@dataclass(frozen=True)
class Borders:
    """Where the cycles of a signal begin and end.

    Attributes:
        begin: Shape (m,) [s].
        end: Shape (m,) [s]; not always the next one's begin.
        others: Cycles between the first and the last that are not among them.
    """

    begin: np.ndarray
    end: np.ndarray
    others: int


@dataclass(frozen=True)
class AverageCycle:
    """What cycles come to, in the signal's unit.

    Attributes:
        mean: Shape (101,).
        sd: Standard deviation over the cycles, shape (101,).
        ranges: Largest less smallest value of each cycle, shape (m,).
        periods: Length of each cycle, shape (m,) [s].
        begin: When the first begins [s].
        end: When the last ends [s].
        left_out: Cycles between them that are not averaged.
        likeness: Median correlation of a cycle with the mean one [1].
    """

    mean: np.ndarray
    sd: np.ndarray
    ranges: np.ndarray
    periods: np.ndarray
    begin: float
    end: float
    left_out: int
    likeness: float


def period_of(time: np.ndarray, signal: np.ndarray) -> float | None:
    """The period of a signal that repeats itself [s]; None for one that does not.

    Args:
        time: Increasing, shape (n,) [s].
        signal: At those times, finite, shape (n,).
    """
    grid, values = _on_a_grid(time, signal)
    if grid is None:
        return None
    step = grid[1] - grid[0]
    count = len(values)
    longest = count // LEAST_CYCLES
    spectrum = np.fft.rfft(values, 2 * count)
    shared = np.fft.irfft(np.abs(spectrum) ** 2)[:longest]
    if shared[0] <= 0:
        return None
    like = shared / shared[0] * count / (count - np.arange(longest))
    apart = np.flatnonzero(like < 0)  # the first lag beyond the peak at none
    if not len(apart):
        return None
    inside = np.arange(max(apart[0], round(SHORTEST_S / step), 1), longest - 1)
    peaks = inside[(like[inside] >= like[inside - 1]) & (like[inside] > like[inside + 1])]
    if not len(peaks) or like[peaks].max() < LEAST_REPEATED:
        return None
    return float(step * peaks[like[peaks] >= AS_HIGH * like[peaks].max()][0])


def _on_a_grid(time: np.ndarray, signal: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """A signal on an even grid, without its mean and trend."""
    if len(time) < 4 * LEAST_CYCLES:
        return None, signal
    step = max(median_interval(time), FINEST_S)
    count = int((time[-1] - time[0]) / step) + 1
    if step <= 0 or count < 4 * LEAST_CYCLES:
        return None, signal
    grid = time[0] + step * np.arange(min(count, MOST_PERIODS))
    values = np.interp(grid, time, signal)
    about = grid - grid.mean()
    values = values - values.mean()
    return grid, values - about * (about @ values) / (about @ about)


def find_borders(time: np.ndarray, signal: np.ndarray) -> Borders | None:
    """Where the cycles of a signal lie: each from one of its largest values to the next.

    Args:
        time: Increasing, shape (n,) [s].
        signal: At those times, finite, shape (n,).

    Returns:
        None where it does not repeat itself, or has fewer than three cycles.
    """
    period = period_of(time, signal)
    if period is None:
        return None
    step = max(median_interval(time), FINEST_S)
    grid = np.arange(time[0], time[-1], step)
    values = np.interp(grid, time, signal)
    half = max(round(period / 2 / step), 1)  # a mean over it has no second harmonic
    smooth = moving_mean(moving_mean(values - values.mean(), half), half)
    smooth -= moving_mean(smooth, min(max(round(3 * period / step), 1), len(smooth)))
    peaks = _peaks(smooth, round(SHORTEST * period / step))
    lengths = np.diff(grid[peaks])
    fits = (lengths > SHORTEST * period) & (lengths < LONGEST * period)
    if fits.sum() < LEAST_CYCLES:
        return None
    first, last = np.flatnonzero(fits)[[0, -1]]
    others = int((~fits[first : last + 1]).sum())
    return Borders(grid[peaks[:-1]][fits], grid[peaks[1:]][fits], others)


def _peaks(signal: np.ndarray, apart: int) -> np.ndarray:
    """Rows of the highest values, none nearer to a higher one than so many rows."""
    rows = np.flatnonzero((signal[1:-1] >= signal[:-2]) & (signal[1:-1] > signal[2:])) + 1
    rows = rows[signal[rows] > 0]
    if not len(rows):
        return rows
    rows = rows[signal[rows] >= LEAST_PEAK * np.quantile(signal[rows], 0.75)]
    kept: list[int] = []
    for row in rows:
        if kept and row - kept[-1] < apart:
            if signal[row] > signal[kept[-1]]:
                kept[-1] = int(row)
        else:
            kept.append(int(row))
    return np.array(kept, dtype=np.int64)


def average_cycle(borders: Borders, time: np.ndarray, signal: np.ndarray) -> AverageCycle | None:
    """The average of a signal's cycles; None where fewer than three are alike.

    Args:
        borders: Of the cycles; those of another signal of the same motion will do.
        time: Increasing, shape (n,) [s].
        signal: At those times, finite, shape (n,).
    """
    period = borders.end - borders.begin
    usual = median_interval(time)
    whole = np.array(
        [
            time[0] <= begin
            and end <= time[-1]
            and widest_gap(time, begin, end) <= max(WIDEST_GAP * (end - begin), 1.5 * usual)
            for begin, end in zip(borders.begin, borders.end, strict=True)
        ]
    )
    if whole.sum() < LEAST_CYCLES:
        return None
    instants = borders.begin[whole, None] + period[whole, None] * np.linspace(0, 1, POINTS)
    cycles = np.interp(instants, time, signal)
    likeness = _likeness(cycles)
    alike = likeness >= LEAST_LIKENESS
    if alike.sum() < max(LEAST_CYCLES, len(alike) / 2):
        return None
    kept = np.flatnonzero(whole)[alike]
    chosen = cycles[alike]
    between = np.arange(kept[0], kept[-1] + 1)
    return AverageCycle(
        mean=chosen.mean(axis=0),
        sd=chosen.std(axis=0, ddof=1),
        ranges=np.ptp(chosen, axis=1),
        periods=period[kept],
        begin=float(borders.begin[kept[0]]),
        end=float(borders.end[kept[-1]]),
        left_out=borders.others + len(between) - len(kept),
        likeness=float(np.median(_likeness(chosen))),
    )


def _likeness(cycles: np.ndarray) -> np.ndarray:
    """Correlation of each cycle with the median one, shape (m, 101) to (m,)."""
    own = cycles - cycles.mean(axis=1, keepdims=True)
    usual = np.median(cycles, axis=0)
    usual = usual - usual.mean()
    sizes = np.linalg.norm(own, axis=1) * np.linalg.norm(usual)
    return np.divide(own @ usual, sizes, out=np.zeros(len(cycles)), where=sizes > 0)
