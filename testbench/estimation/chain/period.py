"""The base frequency of a motion, by its angular rates: the first guess of the filter."""

from __future__ import annotations

import numpy as np

from testbench.estimation.chain.run import ChainSamples
from testbench.exceptions import InputError

GRID_S = 0.01
SHORTEST_PERIOD_S = 0.1
NEARLY = 0.9
"""The shortest lag with this part of the best correlation is the period [1]; its multiples
correlate as well.
"""
PERIODIC = 0.5
"""Correlation that the best lag must reach [1]."""


def base_frequency(samples: ChainSamples, begin: float) -> float:
    """Base frequency [Hz] by the autocorrelation of the rates of all sensors together.

    Args:
        samples: Rates and forces.
        begin: When the motion begins [s].

    Raises:
        InputError: The motion does not repeat.
    """
    grid = np.arange(begin, samples.time[-1], GRID_S)
    total = np.zeros(len(grid))
    for sensor in range(len(samples.counts)):
        own = samples.sensor == sensor
        for axis in range(3):
            rate = np.interp(grid, samples.time[own], samples.reading[own, axis])
            spectrum = np.fft.rfft(rate - rate.mean(), 2 * len(grid))
            total += np.fft.irfft(np.abs(spectrum) ** 2)[: len(grid)]
    overlap = np.arange(len(grid), 0, -1) / len(grid)
    half = len(grid) // 2  # a period must fit in twice
    correlation = total[:half] / overlap[:half] / max(total[0], 1e-300)
    peaks = (
        np.flatnonzero(
            (correlation[1:-1] > correlation[:-2]) & (correlation[1:-1] >= correlation[2:])
        )
        + 1
    )
    peaks = peaks[peaks * GRID_S >= SHORTEST_PERIOD_S]
    if not len(peaks) or correlation[peaks].max() < PERIODIC:
        raise InputError(
            "the motion does not repeat, so no Fourier series fits it; name frequency_hz if it does"
        )
    best = int(peaks[correlation[peaks] >= NEARLY * correlation[peaks].max()][0])
    # vertex of the parabola through three points
    left, middle, right = correlation[best - 1 : best + 2]
    shift = 0.5 * (left - right) / (left - 2 * middle + right)
    return float(1.0 / ((best + shift) * GRID_S))
