"""Vectors of a sensor, seen from a frame that does not turn.

Over a window of seconds the rates are integrated from its beginning; what the accelerometer reads,
turned back by that, must be gravity and little else: the mean of a linear acceleration over a
second is the change of the velocity in it, whatever the shocks. It is, if the axes, signs and scale
of both triads agree; else it smears.

For any reading of axes the same sums serve. If the gyroscope's rate is P w with a rotation P, its
integral is P R P^T, and the means of R a, taken as sums of R_ij a_k, give that of P R P^T a. One
that mirrors is minus a rotation, and needs the integral of -w: two passes for 48 readings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from numba import njit

from testbench.consistency.excerpt import Excerpt
from testbench.records.session.samples import AXES

BIN_S = 0.5
"""Windows begin at a bin."""
BINS = (2, 4)
"""Bins of a block. In 1 s, what a person's stride takes, linear accelerations mostly average out;
slow ones, of something carried about, need longer, and a gyroscope that drifts shorter. Recordings
of a few seconds make do with one bin.
"""
BLOCKS = 5
"""Blocks of a window."""
MOST_WINDOWS = 200
SHORTEST_STEPS = 2
"""Steps that a bin must have, for a turn to be followed."""


def signed_permutations() -> np.ndarray:
    """All 48, the identity first, shape (48, 3, 3)."""
    maps = [
        np.diag(signs)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return np.array(maps)


MAPS = signed_permutations()
PROPER = np.linalg.det(MAPS) > 0
IDENTITY = 0


def names_of(matrix: np.ndarray) -> str:
    """A map of axes as a mapping states it, such as "x: -z, y: +y, z: +x".

    Args:
        matrix: Signed permutation, shape (3, 3).
    """
    parts = []
    for target, row in zip(AXES, matrix, strict=True):
        source = int(np.argmax(np.abs(row)))
        parts.append(f"{target}: {'-' if row[source] < 0 else '+'}{AXES[source]}")
    return ", ".join(parts)


@dataclass(frozen=True)
class Windows:
    """Windows of an excerpt that can be integrated over.

    Attributes:
        starts: Their first bins, shape (w,).
        size: Steps of a bin.
        seconds: Of a step.
        together: Bins of a block.
        independent: How many windows that do not overlap would say as much.
    """

    starts: np.ndarray
    size: int
    seconds: float
    together: int
    independent: float

    @property
    def bins(self) -> np.ndarray:
        """The bins of each window, shape (w, BLOCKS * together)."""
        return self.starts[:, None] + np.arange(BLOCKS * self.together)

    @property
    def steps(self) -> np.ndarray:
        """Rows of the steps of each window, shape (w, BLOCKS * together * size)."""
        steps = np.arange(BLOCKS * self.together * self.size)
        return self.starts[:, None] * self.size + steps

    def some(self, most: int) -> Windows:
        """At most so many of them, evenly spread."""
        every = max(-(-len(self.starts) // most), 1)
        starts = self.starts[::every]
        return replace(self, starts=starts, independent=min(self.independent, len(starts)))


def find_windows(excerpt: Excerpt, vectors: np.ndarray, seconds: float, together: int) -> Windows:
    """Windows without a gap, in which rates and vectors are known.

    Args:
        excerpt: Of the recording.
        vectors: Of the accelerometer or magnetometer, shape (n, 3).
        seconds: Of a step.
        together: Bins of a block.
    """
    size = round(BIN_S / seconds)
    length = size * BLOCKS * together
    known = np.isfinite(excerpt.gyr).all(axis=1) & np.isfinite(vectors).all(axis=1)
    n = len(known)
    if size < SHORTEST_STEPS or n < length:
        return Windows(np.zeros(0, dtype=int), size, seconds, together, 0.0)
    bins = n // size - BLOCKS * together + 1
    hop = max(-(-bins // MOST_WINDOWS), 1)
    first = np.arange(0, bins, hop)
    starts = first * size
    lost = np.concatenate([[0], np.cumsum(~known)])
    broken = np.concatenate([[0], np.cumsum(~excerpt.follows)])
    whole = (lost[starts + length] == lost[starts]) & (
        broken[starts + length] == broken[starts + 1]
    )
    lasted = (excerpt.time_ns[starts + length - 1] - excerpt.time_ns[starts]) * 1.0
    usual = excerpt.interval_ns * excerpt.samples * (length - 1)
    whole &= np.abs(lasted / usual - 1) < 0.1 if usual > 0 else False
    apart = min(hop / (BLOCKS * together), 1.0)
    independent = whole.sum() * apart + 1 - apart
    return Windows(first[whole], size, seconds, together, independent)


def sums(
    rates: np.ndarray,
    vectors: np.ndarray,
    windows: Windows,
    scale: float = 1.0,
    bias: np.ndarray | None = None,
) -> np.ndarray:
    """Means over each block of R_ij v_k, R turning from the sensor to where it was at the beginning
    of the window.

    Args:
        rates: Shape (n, 3) [rad/s].
        vectors: Shape (n, 3).
        windows: To go over.
        scale: Rates are taken so many times, negative for a gyroscope that mirrors.
        bias: Taken off the rates first, shape (3,) [rad/s].

    Returns:
        Shape (w, BLOCKS, 3, 3, 3).
    """
    bins = windows.bins
    used, rows = np.unique(bins, return_inverse=True)
    mixed, turned = _bins(
        np.ascontiguousarray(rates),
        np.ascontiguousarray(vectors),
        used * windows.size,
        windows.size,
        windows.seconds * scale,
        np.zeros(3) if bias is None else np.asarray(bias, dtype=float),
    )
    return np.asarray(_joined(mixed, turned, rows.reshape(bins.shape), windows.together))


@njit(cache=True)
def _bins(rates, vectors, starts, size, seconds, bias):  # type: ignore[no-untyped-def]
    """Means of R_ij v_k over each bin, R from its first step, and R of the first step after it; the
    bias is taken off the rates, and a step is so many seconds, times the scale of the rates.
    """
    mixed = np.zeros((len(starts), 3, 3, 3))
    turned = np.zeros((len(starts), 3, 3))
    r = np.eye(3)
    for number in range(len(starts)):
        a, b, c, d = 1.0, 0.0, 0.0, 0.0
        own = mixed[number]
        r[:] = np.eye(3)
        for row in range(starts[number], starts[number] + size):
            for k in range(3):
                v = vectors[row, k] / size
                for i in range(3):
                    for j in range(3):
                        own[i, j, k] += r[i, j] * v
            after = min(row + 1, len(rates) - 1)
            x = seconds * (0.5 * (rates[row, 0] + rates[after, 0]) - bias[0])
            y = seconds * (0.5 * (rates[row, 1] + rates[after, 1]) - bias[1])
            z = seconds * (0.5 * (rates[row, 2] + rates[after, 2]) - bias[2])
            angle = np.sqrt(x * x + y * y + z * z)
            f = 0.5 if angle < 1e-9 else np.sin(0.5 * angle) / angle
            e, x, y, z = np.cos(0.5 * angle), f * x, f * y, f * z
            a, b, c, d = (
                a * e - b * x - c * y - d * z,
                a * x + b * e + c * z - d * y,
                a * y - b * z + c * e + d * x,
                a * z + b * y - c * x + d * e,
            )
            r[0, 0] = 1 - 2 * (c * c + d * d)
            r[0, 1] = 2 * (b * c - a * d)
            r[0, 2] = 2 * (b * d + a * c)
            r[1, 0] = 2 * (b * c + a * d)
            r[1, 1] = 1 - 2 * (b * b + d * d)
            r[1, 2] = 2 * (c * d - a * b)
            r[2, 0] = 2 * (b * d - a * c)
            r[2, 1] = 2 * (c * d + a * b)
            r[2, 2] = 1 - 2 * (b * b + c * c)
        turned[number] = r
    return mixed, turned


@njit(cache=True)
def _joined(mixed, turned, rows, together):  # type: ignore[no-untyped-def]
    """Bins one after the other, seen from the beginning of their window."""
    count, bins = rows.shape
    whole = np.zeros((count, bins // together, 3, 3, 3))
    for w in range(count):
        r = np.eye(3)
        for number in range(bins):
            row = rows[w, number]
            own = whole[w, number // together]
            for i in range(3):
                for j in range(3):
                    for m in range(3):
                        part = r[i, m] / together
                        for k in range(3):
                            own[i, j, k] += part * mixed[row, m, j, k]
            r = r @ turned[row]
    return whole


def read_as(mixed: np.ndarray, mirrored: np.ndarray, maps: np.ndarray) -> np.ndarray:
    """Mean vectors of each block for gyroscopes whose true rates are P times what they read.

    Args:
        mixed: Sums for the rates as read, shape (w, b, 3, 3, 3).
        mirrored: Those for the negative rates, shape (w, b, 3, 3, 3).
        maps: Each P, shape (p, 3, 3).

    Returns:
        In a frame that does not turn in a window, shape (p, w, b, 3).
    """
    proper = np.linalg.det(maps) > 0
    result = np.empty((len(maps), *mixed.shape[:2], 3))
    # P R P^T a up to a constant turn: R P^T a, that is the sum over j, k of (R_ij a_k) P_kj
    for i, (one, is_proper) in enumerate(zip(maps, proper, strict=True)):
        source, turn = (mixed, one) if is_proper else (mirrored, -one)
        result[i] = np.einsum("wbijk,kj->wbi", source, turn)
    return result
