"""Readings that ran over the end of a register and came back at the other end of the range.

A count beyond 32767 of 16 bits becomes -32768: a rate that goes on rising reads as the largest one
the other way round. It leaves by a jump over the whole range, and comes back by another; with the
range added where it was lost, the readings go on as they were before.
"""

from __future__ import annotations

import numpy as np

LEAST_JUMP = 0.8
"""Part of the range that a jump covers at least: just before it and after it the readings are near
the ends [1].
"""
MOST_BESIDE = 0.2
"""Steps beside a jump, and what the jump is once the range is added, are smaller parts of it [1]:
what swings from one end to the other by itself moves as far just before or after.
"""
UNEVEN = 0.1
"""Part of the range by which its ends may differ in size [1]: bias and the last count."""
LONGEST = 2048
"""Rows that a chunk must reach beyond its ends to see where a reading left."""


def largest_change(column: np.ndarray) -> float:
    """Largest change from a row to the next, 0 where there is none.

    Args:
        column: Shape (n,).
    """
    if len(column) < 2:
        return 0.0
    step = column[1:] - column[:-1]
    return float(np.fmax(step.max(), -step.min()))


def may_wrap(low: float, high: float, change: float, least: float) -> bool:
    """Whether an axis may hold readings that ran over its end.

    Args:
        low: Its smallest reading.
        high: Its largest.
        change: Largest from a row to the next.
        least: Smallest range that a sensor has.
    """
    span = high - low
    ends = low < -least and high > least and abs(high + low) < UNEVEN * span
    return ends and change > LEAST_JUMP * span


def wrapped_rows(column: np.ndarray, low: float, high: float) -> np.ndarray:
    """Rows of readings that ran over an end, increasing.

    Args:
        column: One axis, shape (n,); NaN where it is not known.
        low: Smallest reading of the whole recording.
        high: Largest.
    """
    span = high - low
    with np.errstate(invalid="ignore"):  # infinite readings, of which others tell
        step = np.diff(column)
        jumps = np.flatnonzero(np.abs(step) > LEAST_JUMP * span)
        turns = np.round(step / span)
        left = np.abs(step - span * turns) / span  # what is left of each step, the range added
    beside = np.concatenate([[0.0], left, [0.0]])
    near = np.fmax(np.fmax(beside[jumps], beside[jumps + 1]), beside[jumps + 2])
    jumps = jumps[near < MOST_BESIDE]
    if not len(jumps):
        return jumps
    # a jump down is one over the top, or back from beyond the bottom: as few rows as may be are
    # taken for wrapped ones
    passed = np.append(0, -np.cumsum(np.sign(step[jumps])))
    lengths = np.diff(np.concatenate([[0], jumps + 1, [len(column)]]))
    rows = [int(lengths[passed != begun].sum()) for begun in np.unique(passed)]
    begun = np.unique(passed)[int(np.argmin(rows))]
    return np.flatnonzero(np.repeat(passed != begun, lengths))
