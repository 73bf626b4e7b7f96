"""Gait cycles in the swing of a limb (Cabezuelo 2019, section 2.4.1, after E. Muñoz 2016)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.estimation.gait.parameters import PedestrianParameters
from testbench.frames import NANOSECONDS


@dataclass(frozen=True)
class Cycles:
    """Gait cycles of one leg, in order.

    Attributes:
        begin: Row of the first sample of each, shape (k,).
        end: Row of the last sample of each, shape (k,).
        peak: Row of the largest step signal in each, shape (k,).
        swing: Largest less smallest step signal [rad], shape (k,) (eq. 2.27).
    """

    begin: np.ndarray
    end: np.ndarray
    peak: np.ndarray
    swing: np.ndarray

    def __len__(self) -> int:
        return len(self.begin)

    @property
    def steps(self) -> int:
        """Steps of both legs: two for each cycle (eq. 2.26)."""
        return 2 * len(self)


def find_cycles(
    time_ns: np.ndarray, step_signal: np.ndarray, parameters: PedestrianParameters
) -> Cycles:
    """Two half swings to opposite sides that together exceed the amplitude are a cycle.

    As published, the mean over the window before each sample is taken off, and each half swing must
    exceed the false zero. Here a half swing begins where the signal passes the false zero, not zero
    itself, so that noise at rest begins none; and one that fails is dropped alone, so that the next
    pair starts afresh.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        step_signal: Angle of the limb, without jumps of a turn, shape (n,) [rad]; samples that are
            not finite are passed over.
        parameters: Thresholds.
    """
    rows = np.flatnonzero(np.isfinite(step_signal))
    x, t = step_signal[rows], time_ns[rows]
    centred, first = without_offset(t, x, parameters.offset_window_s)
    halves = _half_swings(centred, first, np.radians(parameters.false_zero_deg))
    begin, end, peak, swing = [], [], [], []
    k = 0
    while k + 1 < len(halves):
        one, two = halves[k], halves[k + 1]
        if abs(one[2] - two[2]) <= np.radians(parameters.amplitude_deg):
            k += 1
            continue
        a, b = int(one[0]), int(two[1])
        largest = a + int(np.argmax(x[a : b + 1]))
        begin.append(rows[a])
        end.append(rows[b])
        peak.append(rows[largest])
        # eq. 2.27
        swing.append(float(np.ptp(x[a : b + 1])))
        k += 2
    return Cycles(
        np.array(begin, int), np.array(end, int), np.array(peak, int), np.array(swing, float)
    )


def without_offset(time_ns: np.ndarray, x: np.ndarray, window_s: float) -> tuple[np.ndarray, int]:
    """The mean over the window before each sample less the sample, with the published sign.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        x: The signal, finite, shape (n,) [rad].
        window_s: Length of the window.

    Returns:
        The difference, shape (n,) [rad], and the first row with a whole window before it.
    """
    if not len(x):
        return x, 0
    start = np.searchsorted(time_ns, time_ns - round(window_s * NANOSECONDS))
    total = np.concatenate([[0.0], np.cumsum(x)])
    own = np.arange(len(x))
    count = np.maximum(own - start, 1)
    mean = np.where(own > start, (total[own] - total[start]) / count, x)
    first = int(np.searchsorted(time_ns, time_ns[0] + round(window_s * NANOSECONDS)))
    return mean - x, first


@njit(cache=True)
def _half_swings(s: np.ndarray, first: int, threshold: float) -> np.ndarray:
    """First row, last row and extreme value of each half swing, sides alternating, shape (k, 3)."""
    found = np.empty((len(s), 3))
    count, side = 0, 0
    for i in range(first, len(s)):
        now = 1 if s[i] > threshold else (-1 if s[i] < -threshold else 0)
        # a half swing begins where the signal leaves the band about zero on the other side
        if now != 0 and now != side:
            found[count, 0], found[count, 2] = i, s[i]
            count, side = count + 1, now
        if side != 0:
            if now == side:
                found[count - 1, 1] = i
            if side * s[i] > side * found[count - 1, 2]:
                found[count - 1, 2] = s[i]
    return found[:count]
