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
from functools import cached_property
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
        begins: First row of each bin of each window, shape (w, k); a bin begins where the one
            before it ends.
        ends: Row after the last of each, shape (w, k).
        weights: Of each bin in the mean of each block, shape (w, b, k).
        seconds: Of a step.
        independent: How many windows that do not overlap would say as much.
    """

    begins: np.ndarray
    ends: np.ndarray
    weights: np.ndarray
    seconds: float
    independent: float

    @staticmethod
    def none(seconds: float) -> Windows:
        """No windows at all."""
        nothing = np.zeros((0, 1), dtype=int)
        return Windows(nothing, nothing, np.zeros((0, 1, 1)), seconds, 0.0)

    def __len__(self) -> int:
        return len(self.begins)

    @cached_property
    def bins(self) -> tuple[np.ndarray, np.ndarray]:
        """First row of each bin and the one after its last, each once, shape (u, 2), and which of
        them are those of each window, shape (w, k).
        """
        count = int(self.ends.max(initial=0)) + 1
        keys, rows = np.unique(self.begins * count + self.ends, return_inverse=True)
        return np.stack([keys // count, keys % count], axis=1), rows.reshape(self.begins.shape)

    def covered(self, count: int) -> np.ndarray:
        """Which of so many rows are in any window, shape (count,), bool."""
        edges = np.zeros(count + 1, dtype=int)
        np.add.at(edges, self.begins[:, 0], 1)
        np.add.at(edges, self.ends[:, -1], -1)
        return np.asarray(np.cumsum(edges[:-1]) > 0)

    def some(self, most: int) -> Windows:
        """At most so many of them, evenly spread."""
        every = slice(None, None, max(-(-len(self) // most), 1))
        begins = self.begins[every]
        return replace(
            self,
            begins=begins,
            ends=self.ends[every],
            weights=np.ascontiguousarray(self.weights[every]),
            independent=min(self.independent, len(begins)),
        )


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
        return Windows.none(seconds)
    bins = n // size - BLOCKS * together + 1
    hop = max(-(-bins // MOST_WINDOWS), 1)
    first = np.arange(0, bins, hop)
    starts = first * size
    whole = are_whole(excerpt, known, starts, starts + length)
    apart = min(hop / (BLOCKS * together), 1.0)
    independent = whole.sum() * apart + 1 - apart
    begins = starts[whole][:, None] + size * np.arange(BLOCKS * together)
    weights = np.kron(np.eye(BLOCKS), np.full(together, 1 / together))
    weights = np.repeat(weights[None], len(begins), axis=0)
    return Windows(begins, begins + size, weights, seconds, independent)


def are_whole(
    excerpt: Excerpt, known: np.ndarray, begins: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Which stretches have no gap, shape (m,), bool.

    Args:
        excerpt: Of the recording.
        known: Rows where both triads are known, shape (n,), bool.
        begins: First row of each stretch, shape (m,).
        ends: Row after its last, shape (m,).
    """
    lost = np.concatenate([[0], np.cumsum(~known)])
    broken = np.concatenate([[0], np.cumsum(~excerpt.follows)])
    whole = (lost[ends] == lost[begins]) & (broken[ends] == broken[begins + 1])
    lasted = (excerpt.time_ns[ends - 1] - excerpt.time_ns[begins]) * 1.0
    usual = excerpt.interval_ns * excerpt.samples * (ends - 1 - begins)
    if not excerpt.interval_ns > 0:
        return np.zeros(len(begins), dtype=bool)
    return np.asarray(whole & (np.abs(lasted - usual) < 0.1 * usual))


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
        Shape (w, b, 3, 3, 3).
    """
    used, rows = windows.bins
    mixed, turned = _bins(
        np.ascontiguousarray(rates),
        np.ascontiguousarray(vectors),
        used,
        windows.seconds * scale,
        np.zeros(3) if bias is None else np.asarray(bias, dtype=float),
    )
    return np.asarray(_joined(mixed, turned, rows, windows.weights))


@njit(cache=True)
def _bins(rates, vectors, bins, seconds, bias):  # type: ignore[no-untyped-def]
    """Means of R_ij v_k over each bin, R from its first step, and R of the first step after it; the
    bias is taken off the rates, and a step is so many seconds, times the scale of the rates.
    """
    mixed = np.zeros((len(bins), 3, 3, 3))
    turned = np.zeros((len(bins), 3, 3))
    r = np.eye(3)
    for number in range(len(bins)):
        begin, end = bins[number, 0], bins[number, 1]
        a, b, c, d = 1.0, 0.0, 0.0, 0.0
        own, share = mixed[number], 1 / (end - begin)
        r[:] = np.eye(3)
        for row in range(begin, end):
            for k in range(3):
                v = vectors[row, k] * share
                for i in range(3):
                    for j in range(3):
                        own[i, j, k] += r[i, j] * v
            after = min(row + 1, len(rates) - 1)
            # rotation vector of the step, w dt by the trapezium rule; R <- R exp([w dt x])
            x = seconds * (0.5 * (rates[row, 0] + rates[after, 0]) - bias[0])
            y = seconds * (0.5 * (rates[row, 1] + rates[after, 1]) - bias[1])
            z = seconds * (0.5 * (rates[row, 2] + rates[after, 2]) - bias[2])
            # half the sine of half the angle over that half, and its cosine, by the square of it;
            # of small ones by Maclaurin's series, which is exact there and takes half the time
            q = 0.25 * (x * x + y * y + z * z)
            if q < 0.04:
                f = 0.5 - q * (1 / 12 - q * (1 / 240 - q * (1 / 10080 - q / 725760)))
                e = 1 - q * (1 / 2 - q * (1 / 24 - q * (1 / 720 - q * (1 / 40320 - q / 3628800))))
            else:
                half = np.sqrt(q)
                f, e = 0.5 * np.sin(half) / half, np.cos(half)
            x, y, z = f * x, f * y, f * z
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
def _joined(mixed, turned, rows, weights):  # type: ignore[no-untyped-def]
    """Means over blocks of bins that follow one another, seen from the beginning of a window."""
    # Many loops: products of matrices this small cost more by BLAS than all the rest, and a
    # function of its own for each would hand over as many arrays.
    count, bins = rows.shape
    blocks = weights.shape[1]
    whole = np.zeros((count, blocks, 3, 3, 3))
    seen, r, after = np.empty((3, 3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for w in range(count):
        r[:] = np.eye(3)
        for number in range(bins):
            row = rows[w, number]
            own, turn = mixed[row], turned[row]
            for i in range(3):
                for j in range(3):
                    for k in range(3):
                        seen[i, j, k] = (
                            r[i, 0] * own[0, j, k] + r[i, 1] * own[1, j, k] + r[i, 2] * own[2, j, k]
                        )
            for block in range(blocks):
                weight = weights[w, block, number]
                if weight > 0:
                    for i in range(3):
                        for j in range(3):
                            for k in range(3):
                                whole[w, block, i, j, k] += weight * seen[i, j, k]
            for i in range(3):
                for j in range(3):
                    after[i, j] = r[i, 0] * turn[0, j] + r[i, 1] * turn[1, j] + r[i, 2] * turn[2, j]
            r[:] = after
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
    for source, own, sign in ((mixed, proper, 1.0), (mirrored, ~proper, -1.0)):
        if own.any():
            turns = sign * maps[own].transpose(0, 2, 1).reshape(-1, 9)
            result[own] = (turns @ source.reshape(-1, 9).T).reshape(-1, *result.shape[1:])
    return result
