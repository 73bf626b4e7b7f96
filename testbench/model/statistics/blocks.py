"""Errors as a series of blocks, and what may be inferred from them.

Neighbours resemble each other, so that single errors would say too much.

Sensor errors last: samples a hundredth of a second apart say nearly the same, and so may
neighbouring poses. The series is resampled in blocks long enough to hold that memory (Politis &
Romano 1992, circular block bootstrap), whose length follows from the series' own autocorrelation
(Politis & White 2004, as corrected by Patton, Politis & White 2009).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import ndtr, stdtrit

LONGEST_SERIES = 1024
"""A longer series is first summed over equal runs: errors are far smoother than their sampling
[1].
"""
FEWEST_STEPS = 4
"""Fewer poses than this say too little of other poses."""
FEWEST_SWEEPS = 5
"""Fewer sweeps are cut into runs of time, which are many: as blocks they would be too few to rank
filters by.
"""
FEWEST_BLOCKS = 3
"""Fewer independent blocks give no interval and no comparison."""
DRAWS = 1000
CONFIDENCE = 0.95


@dataclass(frozen=True)
class ErrorSeries:
    """Sums of errors over blocks in the order of time.

    Attributes:
        weight: How much each block counts, shape (m,).
        mean: Weight times the block's mean of e, shape (m,).
        absolute: Weight times the block's mean of |e|, shape (m,).
        square: Weight times the block's mean of e², shape (m,).
    """

    weight: np.ndarray
    mean: np.ndarray
    absolute: np.ndarray
    square: np.ndarray

    def __len__(self) -> int:
        return len(self.weight)


def step_series(
    errors: np.ndarray, steps: Sequence[np.ndarray], moving: bool, equally: bool
) -> ErrorSeries | None:
    """The series of a protocol's steps.

    Args:
        errors: Shape (n,), in any unit.
        steps: Rows of each step, in the order of time, shape (rows of the step,) each.
        moving: Whether all steps are sweeps.
        equally: Every step counts alike, else every sample.

    Returns:
        One block for each step; runs of equal time within the steps where they are few sweeps; None
        for few poses.
    """
    if len(steps) >= (FEWEST_SWEEPS if moving else FEWEST_STEPS):
        pieces = list(steps)
    elif moving and steps:
        runs = max(min(LONGEST_SERIES // len(steps), min(len(rows) for rows in steps)), 1)
        pieces = [piece for rows in steps for piece in np.array_split(rows, runs)]
    else:
        return None
    return _sums(
        errors[np.concatenate(pieces)], np.array([len(piece) for piece in pieces]), equally
    )


def sample_series(errors: np.ndarray) -> ErrorSeries:
    """The series of a recording without steps: equal runs of samples.

    Args:
        errors: Shape (n,), in any unit.
    """
    runs = min(LONGEST_SERIES, len(errors))
    longer = len(errors) % runs  # the first so many runs have a sample more
    return _sums(errors, len(errors) // runs + (np.arange(runs) < longer), False)


def _sums(errors: np.ndarray, sizes: np.ndarray, equally: bool) -> ErrorSeries:
    """Sums of errors, shape (n,), over consecutive pieces of these sizes, shape (m,)."""
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    weight = np.ones(len(sizes)) if equally else sizes.astype(float)
    scale = weight / sizes
    return ErrorSeries(
        weight,
        *(
            np.add.reduceat(values, starts) * scale
            for values in (errors, np.abs(errors), errors**2)
        ),
    )


def block_length(series: np.ndarray) -> int:
    """Length of the blocks that the circular bootstrap of a mean wants.

    Patton, Politis & White (2009), eqs 3 to 5.

    Args:
        series: Shape (n,).

    Returns:
        From 1 to a third of the series.
    """
    return int(_block_length(np.ascontiguousarray(series, dtype=np.float64)))


@njit(cache=True)
def _block_length(series: np.ndarray) -> int:
    n = len(series)
    longest = int(np.ceil(min(3 * np.sqrt(n), n / 3)))
    centred = series - series.mean()
    power = np.mean(centred**2)
    if n < 9 or not power > 1e-24 * max(np.mean(series**2), 1e-300):
        return 1
    looked = max(5, int(np.sqrt(np.log10(n))))  # K_n
    most = min(int(np.ceil(np.sqrt(n))) + looked, n - 1)
    covariance = np.zeros(most + 1)
    for lag in range(most + 1):
        for i in range(n - lag):
            covariance[lag] += centred[i + lag] * centred[i]
        covariance[lag] /= n
    # m: the lag after which K_n correlations in a row are no larger than chance
    memory, quiet = 0, 0
    for lag in range(1, most + 1):
        loud = abs(covariance[lag] / covariance[0]) > 2 * np.sqrt(np.log10(n) / n)
        quiet = 0 if loud else quiet + 1
        if quiet == looked:
            memory = lag - looked
            break
        if loud:
            memory = lag
    bandwidth = min(2 * max(memory, 1), most)  # M
    slope = level = 0.0  # G and g(0), by the flat-top window of Politis & Romano
    for lag in range(-bandwidth, bandwidth + 1):
        share = abs(lag) / bandwidth
        taper = 1.0 if share <= 0.5 else 2 * (1 - share)
        slope += taper * abs(lag) * covariance[abs(lag)]
        level += taper * covariance[abs(lag)]
    if not level**2 > 0:
        return longest
    # Politis & White 2004: the best length, with D = 4/3 g(0)² of the circular bootstrap
    wanted = (2 * slope**2 / (4 / 3 * level**2)) ** (1 / 3) * n ** (1 / 3)
    return min(max(round(wanted), 1), longest)


@dataclass(frozen=True)
class Intervals:
    """95 % confidence intervals, None where too few blocks are independent.

    Attributes:
        mean: Both ends for the signed mean.
        absolute: Both ends for the mean magnitude.
        rms: Both ends for the RMS.
        blocks: How many independent blocks they rest on.
        length: Of these blocks, in blocks of the series.
    """

    mean: list[float] | None
    absolute: list[float] | None
    rms: list[float] | None
    blocks: int
    length: int


def intervals(series: ErrorSeries, rng: np.random.Generator) -> Intervals:
    """Confidence intervals by the circular block bootstrap.

    Percentile intervals, widened for the few blocks there are as Student's t widens a normal one
    (Hesterberg 2015, section 4.3: expanded percentile intervals).
    """
    n = len(series)
    per_weight = [values / series.weight for values in (series.mean, series.absolute)]
    length = max(block_length(values) for values in per_weight)
    blocks = n // length
    if blocks < FEWEST_BLOCKS:
        return Intervals(None, None, None, blocks, length)
    columns = np.column_stack([series.weight, series.mean, series.absolute, series.square])
    starts = rng.integers(0, n, (DRAWS, -(-n // length)))
    weight, mean, absolute, square = resampled_sums(columns, starts, length).T
    # Hesterberg 2015, section 4.3: the tail of the normal at Student's t times sqrt(n / (n - 1))
    tail = ndtr(np.sqrt(blocks / (blocks - 1)) * stdtrit(blocks - 1, (1 - CONFIDENCE) / 2))
    found = np.stack([mean / weight, absolute / weight, np.sqrt(square / weight)])
    ends = np.quantile(found, [tail, 1 - tail], axis=1)
    of_mean, of_magnitude, of_rms = ends.T.tolist()
    return Intervals(of_mean, of_magnitude, of_rms, blocks, length)


@njit(cache=True)
def resampled_sums(columns: np.ndarray, starts: np.ndarray, length: int) -> np.ndarray:
    """Sums over n rows that are drawn in blocks.

    The series is closed to a circle, and the last block is cut to fit.

    Args:
        columns: Shape (n, k).
        starts: First row of each block, shape (draws, blocks).
        length: Of a block.

    Returns:
        Shape (draws, k).
    """
    n, k = columns.shape
    running = np.zeros((2 * n + 1, k))
    for i in range(2 * n):
        for j in range(k):
            running[i + 1, j] = running[i, j] + columns[i % n, j]
    result = np.zeros((starts.shape[0], k))
    for draw in range(starts.shape[0]):
        left = n
        for block in range(starts.shape[1]):
            size = min(length, left)
            begin = starts[draw, block]
            for j in range(k):
                result[draw, j] += running[begin + size, j] - running[begin, j]
            left -= size
    return result


def mean_and_error(
    values: np.ndarray, weight: np.ndarray, least: int = 1
) -> tuple[float, float, int]:
    """Weighted mean of a series, its standard error, and its number of independent blocks.

    The standard error is that which the circular block bootstrap would show after infinitely many
    draws (Politis & Romano 1992), with its bias for few blocks taken out.

    Args:
        values: Sums over the blocks, shape (n,).
        weight: Of the blocks, shape (n,).
        least: Length of the independent blocks where the series' own autocorrelation asks for less.
    """
    n = len(values)
    mean = float(values.sum() / weight.sum())
    deviation = values - mean * weight
    length = min(max(block_length(values / weight), least), n)
    blocks = n // length
    running = np.concatenate(
        [[0.0], np.cumsum(np.concatenate([deviation, deviation[: length - 1]]))]
    )
    sums = running[length:] - running[:-length]
    variance = (
        n / length * float(np.mean(sums**2)) * (blocks / (blocks - 1) if blocks > 1 else np.inf)
    )
    return mean, float(np.sqrt(variance) / weight.sum()), blocks
