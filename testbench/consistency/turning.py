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

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numba import njit

from testbench.consistency.excerpt import Excerpt

BIN_S = 0.25
BINS = 20
HOP_BINS = 5
MOST_WINDOWS = 400


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


@dataclass(frozen=True)
class Windows:
    """Windows of an excerpt that can be integrated over.

    Attributes:
        starts: Their first steps, shape (w,).
        size: Steps of a bin.
        seconds: Of a step.
    """

    starts: np.ndarray
    size: int
    seconds: float

    @property
    def steps(self) -> np.ndarray:
        """Rows of the steps of each window, shape (w, BINS * size)."""
        return self.starts[:, None] + np.arange(BINS * self.size)


def find_windows(excerpt: Excerpt, vectors: np.ndarray, seconds: float) -> Windows:
    """Windows without a gap, in which rates and vectors are known.

    Args:
        excerpt: Of the recording.
        vectors: Of the accelerometer or magnetometer, shape (n, 3).
        seconds: Of a step.
    """
    size = max(round(BIN_S / seconds), 1)
    length = size * BINS
    known = np.isfinite(excerpt.gyr).all(axis=1) & np.isfinite(vectors).all(axis=1)
    n = len(known)
    if n < length or BIN_S / seconds < 0.9:
        return Windows(np.zeros(0, dtype=int), size, seconds)
    hop = max(size * HOP_BINS, (n - length) // MOST_WINDOWS)
    starts = np.arange(0, n - length + 1, hop)
    lost = np.concatenate([[0], np.cumsum(~known)])
    broken = np.concatenate([[0], np.cumsum(~excerpt.follows)])
    whole = (lost[starts + length] == lost[starts]) & (
        broken[starts + length] == broken[starts + 1]
    )
    lasted = (excerpt.time_ns[starts + length - 1] - excerpt.time_ns[starts]) * 1.0
    usual = excerpt.interval_ns * excerpt.samples * (length - 1)
    whole &= np.abs(lasted / usual - 1) < 0.1 if usual > 0 else False
    return Windows(starts[whole], size, seconds)


def sums(
    excerpt_gyr: np.ndarray, vectors: np.ndarray, windows: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """Means over each bin of R_ij v_k and of R_ij, R from the beginning of the window.

    Args:
        excerpt_gyr: Rates, shape (n, 3) [rad/s].
        vectors: Shape (n, 3).
        windows: To go over.

    Returns:
        Shape (w, BINS, 3, 3, 3) and (w, BINS, 3, 3).
    """
    return _sums(
        np.ascontiguousarray(excerpt_gyr),
        np.ascontiguousarray(vectors),
        windows.starts,
        windows.size,
        BINS,
        windows.seconds,
    )


@njit(cache=True)
def _sums(gyr, vectors, starts, size, bins, seconds):  # type: ignore[no-untyped-def]
    mixed = np.zeros((len(starts), bins, 3, 3, 3))
    turned = np.zeros((len(starts), bins, 3, 3))
    r = np.zeros((3, 3))
    for w in range(len(starts)):
        a, b, c, d = 1.0, 0.0, 0.0, 0.0
        row = starts[w]
        for k in range(bins):
            for _ in range(size):
                if row > starts[w]:
                    x = 0.5 * seconds * (gyr[row, 0] + gyr[row - 1, 0])
                    y = 0.5 * seconds * (gyr[row, 1] + gyr[row - 1, 1])
                    z = 0.5 * seconds * (gyr[row, 2] + gyr[row - 1, 2])
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
                for i in range(3):
                    for j in range(3):
                        turned[w, k, i, j] += r[i, j] / size
                        for m in range(3):
                            mixed[w, k, i, j, m] += r[i, j] * vectors[row, m] / size
                row += 1
    return mixed, turned


def read_as(mixed: np.ndarray, mirrored: np.ndarray, maps: np.ndarray) -> np.ndarray:
    """Mean vectors of each bin for gyroscopes whose true rates are P times what they read.

    Args:
        mixed: Sums for the rates as read, shape (w, b, 3, 3, 3).
        mirrored: Those for the negative rates.
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
