"""Straight lines: readings that a logger or an exporter put in for lost ones, each on the line
between its neighbours in every axis.

Noise does not lie on lines: the second difference of white noise of standard deviation s has
sqrt(6) s.
"""

from __future__ import annotations

import numpy as np

ROUNDED = 1.01
"""Second differences of a line are no larger than so many counts: rounded to multiples of q, those
of a line are -q, 0 or q, for its first differences take but two neighbouring values.
"""
COMPUTED = 1e-4
"""Part of the noise within which a line that was not rounded is one: numbers in 32 bits differ from
it by 1e-7 of the reading.
"""
DENSITY = 1 / np.sqrt(2 * np.pi)
"""Largest density of a normal of standard deviation 1."""


def tolerance_of(noise: np.ndarray, quantum: np.ndarray) -> np.ndarray:
    """Largest second difference of a straight line, by axis, shape (k,).

    Args:
        noise: Standard deviation of each axis, 0 where none is seen, shape (k,).
        quantum: Smallest change of each axis, infinite where none was seen, shape (k,).
    """
    counts = np.where(np.isfinite(quantum), quantum, 0.0)
    return np.asarray(np.maximum(ROUNDED * counts, COMPUTED * noise))


def chance_of(noise: np.ndarray, quantum: np.ndarray) -> float:
    """Largest part of the rows that noise sets on straight lines in all axes [1].

    m second differences of white noise in a row have the covariance s^2 D, D the five-banded matrix
    of 1, -4, 6, -4, 1, whose determinant is at least 1: all of them lie within +-t with a
    probability of at most (2 t / (s sqrt(2 pi)))^m. Of multiples of q one more than 2 t / q lie
    there.

    Args:
        noise: As for `tolerance_of`, shape (k,).
        quantum: Likewise, shape (k,).
    """
    tolerance = tolerance_of(noise, quantum)
    width = 2 * tolerance + np.where(np.isfinite(quantum), quantum, 0.0)
    seen = noise > 0
    chances = DENSITY * width[seen] / noise[seen]
    return float(np.prod(np.minimum(chances, 1.0)))


def straight_rows(array: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
    """Rows on the line between the ones before and after them that is not level, increasing.

    Args:
        array: Shape (n, k).
        tolerance: Largest second difference of each axis, shape (k,).
    """
    if len(array) < 3:
        return np.zeros(0, dtype=np.int64)
    with np.errstate(invalid="ignore", over="ignore"):
        # one axis leaves few rows to the others; its columns side by side: twice as fast
        step = np.diff(np.ascontiguousarray(array[:, 0]))
        bend = np.subtract(step[1:], step[:-1])
        rows = np.flatnonzero(np.abs(bend, out=bend) <= tolerance[0])
        for axis in range(1, array.shape[1]):
            column = array[:, axis]
            bend = column[rows + 2] - 2 * column[rows + 1] + column[rows]
            rows = rows[np.abs(bend) <= tolerance[axis]]
    rows += 1
    return np.asarray(rows[(array[rows] != array[rows - 1]).any(axis=1)])
