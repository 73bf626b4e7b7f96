"""How far instants usually lie apart."""

from __future__ import annotations

import numpy as np

PIECE = 100_000
"""Instants whose differences are taken at once: what is in between takes eight times their
memory.
"""


def median_interval(times: np.ndarray) -> float:
    """The median interval; the mean one where most samples share their stamp with the one before.

    Loggers that stamp a packet of several samples leave most intervals at zero.

    Args:
        times: Not falling, shape (n,).

    Returns:
        In the unit of the times; 0 for fewer than two, or if all are equal.
    """
    if len(times) < 2:
        return 0.0
    median = float(np.median(np.diff(times)))
    return median if median > 0 else float(times[-1] - times[0]) / (len(times) - 1)


def gradient(values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """How fast values change, by second-order differences as `numpy.gradient` takes them.

    Of samples that share a stamp, or whose stamp goes back, each has that of the first.

    Args:
        values: Shape (n,) or (n, k).
        times: Shape (n,).

    Returns:
        Of the shape of the values; 0 where there are fewer than two instants.
    """
    rises = np.ones(len(times), dtype=bool)
    rises[1:] = times[1:] > np.maximum.accumulate(times)[:-1]
    if rises.sum() < 2:
        return np.zeros_like(values, dtype=float)
    if not rises.all():
        return np.asarray(gradient(values[rises], times[rises])[np.cumsum(rises) - 1])
    found = np.empty(values.shape)
    for begin in range(0, len(times), PIECE):  # with the neighbours that differences are to
        around = slice(max(begin - 1, 0), begin + PIECE + 1)
        own = np.gradient(values[around], times[around], axis=0)[begin - around.start :]
        found[begin : begin + PIECE] = own[:PIECE]
    return found
