"""What a moving window makes of evenly spaced samples: their mean, and the polynomial through them.

SciPy has both (`uniform_filter1d`, `savgol_filter`), in packages that take longer to load than a
short recording to evaluate; the tests hold these against it.
"""

from __future__ import annotations

from math import factorial
from typing import Literal

import numpy as np
from numba import njit
from scipy.linalg import lstsq

EPSILON = float(np.finfo(float).eps)


def moving_mean(
    signal: np.ndarray, size: int, ends: Literal["mirrored", "held"] = "mirrored"
) -> np.ndarray:
    """Mean over a window about each sample.

    Args:
        signal: Shape (n,) or (n, k).
        size: Of the window [samples]; an even one reaches a sample further back than ahead.
        ends: What follows beyond the ends: the samples in reverse, or the last one for ever.

    Returns:
        Of the signal's shape.
    """
    signal = np.asarray(signal, float)
    if not len(signal):
        return signal.copy()
    columns = signal.reshape(len(signal), -1)
    mode: Literal["symmetric", "edge"] = "symmetric" if ends == "mirrored" else "edge"
    longer = np.pad(columns, ((size // 2, size - size // 2 - 1), (0, 0)), mode=mode)
    return _running_mean(longer, size).reshape(signal.shape)


@njit(cache=True)
def _running_mean(longer: np.ndarray, size: int) -> np.ndarray:
    """Means of `size` rows that follow one another, shape (n + size - 1, k) to (n, k)."""
    n, k = longer.shape[0] - size + 1, longer.shape[1]
    means = np.empty((n, k))
    total = np.zeros(k)
    for row in range(size):
        for column in range(k):
            total[column] += longer[row, column]
    for row in range(n):
        for column in range(k):
            if row > 0:
                # one row comes in, one goes out
                total[column] += longer[row + size - 1, column] - longer[row - 1, column]
            means[row, column] = total[column] / size
    return means


def savitzky_golay(
    signal: np.ndarray, window: int, order: int, derivative: int = 0, interval: float = 1.0
) -> np.ndarray:
    """Value or derivative of the polynomial that fits the window about each sample best.

    Savitzky & Golay, Analytical Chemistry 36, 1964, 1627-1639; near the ends, of the polynomial of
    the outermost window.

    Args:
        signal: Shape (n, k).
        window: Odd [samples], at most n.
        order: Of the polynomial.
        derivative: Which; 0 for the value.
        interval: Between samples, in the unit that the derivative is by.

    Returns:
        Shape (n, k).
    """
    half = window // 2
    powers = np.arange(half, -half - 1.0, -1.0) ** np.arange(order + 1.0)[:, None]
    wanted = np.zeros(order + 1)
    wanted[derivative] = factorial(derivative) / interval**derivative
    weights = lstsq(powers, wanted)[0][::-1]  # shortest that give each power's derivative
    signal = np.ascontiguousarray(signal, float)
    smooth = _weighed(signal, np.ascontiguousarray(weights))
    for first, rows in ((0, slice(half)), (len(signal) - window, slice(-half, None))):
        fitted = np.polyfit(np.arange(0.0, window), signal[first : first + window], order)
        for _ in range(derivative):  # highest power first
            fitted = fitted[:-1] * np.arange(len(fitted) - 1.0, 0.0, -1.0)[:, None]
        places = np.arange(float(window))[rows][:, None]
        smooth[rows] = np.polyval(fitted, places) / interval**derivative
    return smooth


@njit(cache=True)
def _weighed(signal: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted sums of the rows about each, shape (n, k), where the window lies within.

    Where the weights of either side are the same, or opposite, the rows are added first, as SciPy
    does: truths are the same to the last bit whoever filtered them.
    """
    n, half = signal.shape[0], len(weights) // 2
    same = opposite = True
    for i in range(1, half + 1):
        same = same and abs(weights[half + i] - weights[half - i]) <= EPSILON
        opposite = opposite and abs(weights[half + i] + weights[half - i]) <= EPSILON
    result = np.zeros(signal.shape)
    for row in range(half, n - half):
        for column in range(signal.shape[1]):
            if same or opposite:
                sign = 1.0 if same else -1.0
                total = signal[row, column] * weights[half]
                for i in range(half, 0, -1):
                    # weights that are the same or opposite on both sides: one product for two rows
                    both = signal[row - i, column] + sign * signal[row + i, column]
                    total += both * weights[half - i]
            else:
                total = signal[row + half, column] * weights[2 * half]
                for i in range(-half, half):
                    total += signal[row + i, column] * weights[half + i]
            result[row, column] = total
    return result
