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

BLOCK_S = 1.0
"""What a person's stride takes: over it, linear accelerations average out."""
BLOCKS = 5
"""Blocks of a window."""
HOP_S = 1.25
"""From window to window; in short recordings less."""
FEWEST_WINDOWS = 12
MOST_WINDOWS = 200
SHORTEST_STEPS = 3
"""Steps that a block must have, for a turn to be followed."""


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
        starts: Their first steps, shape (w,).
        size: Steps of a block.
        seconds: Of a step.
        independent: How many windows that do not overlap would say as much.
    """

    starts: np.ndarray
    size: int
    seconds: float
    independent: float

    @property
    def steps(self) -> np.ndarray:
        """Rows of the steps of each window, shape (w, BLOCKS * size)."""
        return self.starts[:, None] + np.arange(BLOCKS * self.size)

    def some(self, most: int) -> Windows:
        """At most so many of them, evenly spread."""
        every = max(-(-len(self.starts) // most), 1)
        starts = self.starts[::every]
        return replace(self, starts=starts, independent=min(self.independent, len(starts)))


def find_windows(excerpt: Excerpt, vectors: np.ndarray, seconds: float) -> Windows:
    """Windows without a gap, in which rates and vectors are known.

    Args:
        excerpt: Of the recording.
        vectors: Of the accelerometer or magnetometer, shape (n, 3).
        seconds: Of a step.
    """
    size = round(BLOCK_S / seconds)
    length = size * BLOCKS
    known = np.isfinite(excerpt.gyr).all(axis=1) & np.isfinite(vectors).all(axis=1)
    n = len(known)
    if n < length or size < SHORTEST_STEPS:
        return Windows(np.zeros(0, dtype=int), size, seconds, 0.0)
    hop = min(round(HOP_S / seconds), (n - length) // FEWEST_WINDOWS)
    hop = max(hop, -(-(n - length) // MOST_WINDOWS), 1)
    starts = np.arange(0, n - length + 1, hop)
    lost = np.concatenate([[0], np.cumsum(~known)])
    broken = np.concatenate([[0], np.cumsum(~excerpt.follows)])
    whole = (lost[starts + length] == lost[starts]) & (
        broken[starts + length] == broken[starts + 1]
    )
    lasted = (excerpt.time_ns[starts + length - 1] - excerpt.time_ns[starts]) * 1.0
    usual = excerpt.interval_ns * excerpt.samples * (length - 1)
    whole &= np.abs(lasted / usual - 1) < 0.1 if usual > 0 else False
    covered = whole.sum() * min(hop, length) + length - min(hop, length)
    return Windows(starts[whole], size, seconds, covered / length)


def sums(
    excerpt_gyr: np.ndarray, vectors: np.ndarray, windows: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """Means over each block of R_ij v_k and of R_ij, R from the beginning of the window.

    Args:
        excerpt_gyr: Rates, shape (n, 3) [rad/s].
        vectors: Shape (n, 3).
        windows: To go over.

    Returns:
        Shape (w, BLOCKS, 3, 3, 3) and (w, BLOCKS, 3, 3).
    """
    return _sums(
        np.ascontiguousarray(excerpt_gyr),
        np.ascontiguousarray(vectors),
        windows.starts,
        windows.size,
        BLOCKS,
        windows.seconds,
    )


@njit(cache=True)
def _sums(gyr, vectors, starts, size, blocks, seconds):  # type: ignore[no-untyped-def]
    mixed = np.zeros((len(starts), blocks, 3, 3, 3))
    turned = np.zeros((len(starts), blocks, 3, 3))
    r = np.zeros((3, 3))
    for w in range(len(starts)):
        a, b, c, d = 1.0, 0.0, 0.0, 0.0
        row = starts[w]
        for k in range(blocks):
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
    """Mean vectors of each block for gyroscopes whose true rates are P times what they read.

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
