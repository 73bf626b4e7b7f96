"""When a body slips under its markers: rates go over from one map to another.

Before and after it a gyroscope's rates make those of the truth, by maps that differ by a rotation.
A recording is split where two maps leave least. What its motion does not show of a map is left as
it is on the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.model import rotation

LEAST = np.radians(5.0)
"""Both part who are so far from one another afterwards [rad]."""
LEAST_SWAP = np.radians(4.0)
"""Two bodies that are taken for one another lie so far apart [rad]."""
SOUGHT_S, SWAPPED_S, TURNED, PARTED = 5.0, 0.11, np.radians(40.0), 3.0
"""The moment is sought so near to where two maps leave least. While the body turns so far before it
and after it, but for so long beside it, the map of the other side leaves, squared, so many times
what that of its own does [s, s, rad, 1].
"""
LEAST_SIDE_S = 5.0
"""Maps are told on either side by so long at least [s]."""
LEAST_EVIDENCE = 15.0
"""By so much two maps must be more likely than one, in the log [1]: twelve numbers more, and any
time to split at (Schwarz, Annals of Statistics 6, 1978: half the log of the seconds for each of
thirteen, beyond a Bayes factor of some hundred).
"""
INDEPENDENT_S = 0.5
"""Rates so far apart count as independent [s]."""
LOOSE = 0.3
"""Standard deviation of what a side's map may differ by, in each entry [1]: a turn of 20 deg."""
ROUNDS, KEPT = 3, 0.8
"""A side's map is fitted so many times, again to the part that fitted best [1]."""
TRIED_S = 0.5
"""Splits are tried so far apart [s]."""


@dataclass(frozen=True)
class ChangedMap:
    """Two maps, and where one takes over from the other.

    Attributes:
        at: First interval of the second.
        before: Makes true rates of readings and 1, shape (4, 3).
        after: Likewise.
        angle: By which the second turns more than the first [rad].
    """

    at: int
    before: np.ndarray
    after: np.ndarray
    angle: float


@dataclass(frozen=True)
class _Sums:
    """Normal equations of the intervals up to each, from the first on.

    Attributes:
        designs: Shape (n + 1, 4, 4).
        products: Shape (n + 1, 4, 3).
        squares: Shape (n + 1,).
    """

    designs: np.ndarray
    products: np.ndarray
    squares: np.ndarray

    @staticmethod
    def of(design: np.ndarray, left: np.ndarray) -> _Sums:
        """Of readings and what one map leaves, shapes (n, 4) and (n, 3)."""

        def summed(values: np.ndarray) -> np.ndarray:
            return np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])

        return _Sums(
            summed(design[:, :, None] * design[:, None, :]),
            summed(design[:, :, None] * left[:, None, :]),
            summed(np.sum(left**2, axis=1)),
        )

    def side(
        self, first: np.ndarray | int, end: np.ndarray | int, ridge: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The change of the map by intervals from one to another, and what it leaves.

        Args:
            first: Of them, shape (k,) or one for all.
            end: The ones after the last.
            ridge: Added to the normal equations, shape (4, 4).
        """
        design = self.designs[end] - self.designs[first] + ridge
        product = self.products[end] - self.products[first]
        change = np.linalg.solve(design, product)
        explained = np.sum(change * product, axis=(1, 2))
        return change, self.squares[end] - self.squares[first] - explained


def find_changed_map(
    rate: np.ndarray,
    design: np.ndarray,
    fitted: np.ndarray,
    width: float,
    least: float = LEAST,
) -> ChangedMap | None:
    """Where the map of rates changes most, or None where it does not.

    Args:
        rate: True ones in the body, shape (n, 3) [rad/s].
        design: What the gyroscope reads, and 1, shape (n, 4) [rad/s].
        fitted: One map for all, shape (4, 3).
        width: Of an interval [s].
        least: Angle by which the maps differ [rad].
    """
    n, side = len(rate), round(LEAST_SIDE_S / width)
    splits = np.arange(side, n - side, max(round(TRIED_S / width), 1))
    if not len(splits):
        return None
    left = rate - design @ fitted
    sums = _Sums.of(design, left)
    noise = max(float(np.median(np.sum(left**2, axis=1))) / 3, 1e-12)
    ridge = np.diag([noise / LOOSE**2] * 3 + [noise / LEAST**2])
    before, left_before = sums.side(0, splits, ridge)
    after, left_after = sums.side(splits, n, ridge)
    both = np.maximum(left_before + left_after, 1e-12)
    best = int(np.argmin(both))
    _, left_whole = sums.side(0, np.array([n]), ridge)
    count = 3 * n * min(width / INDEPENDENT_S, 1.0)
    evidence = count / 2 * float(np.log(max(left_whole[0], 1e-12) / both[best]))
    if evidence < LEAST_EVIDENCE + 13 / 2 * np.log(max(n * width, 1.0)):
        return None
    at = int(splits[best])
    maps = [
        fitted + _robust(design[side], left[side], change, ridge)
        for side, change in ((slice(at), before[best]), (slice(at, None), after[best]))
    ]
    # true rate = map' reading: what takes the first's to the second's turns by the slip
    relative = maps[1][:3].T @ np.linalg.pinv(maps[0][:3].T)
    angle = rotation.angle(rotation.from_matrix(rotation.nearest_rotation(relative)))
    if float(angle) < least:
        return None
    return ChangedMap(at, maps[0], maps[1], float(angle))


def find_swap(
    rate: np.ndarray, design: np.ndarray, fitted: np.ndarray, width: float
) -> ChangedMap | None:
    """Where one map gives way to another at once, as where one body was taken for another; None
    where none does, or the body slips for a while, in which neither map fits.

    Args:
        rate: True ones in the body, shape (n, 3) [rad/s].
        design: What the gyroscope reads, and 1, shape (n, 4) [rad/s].
        fitted: One map for all, shape (4, 3).
        width: Of an interval [s].
    """
    slip = find_changed_map(rate, design, fitted, width, LEAST_SWAP)
    if slip is None:
        return None
    before, after = (
        np.sum((rate - design @ own) ** 2, axis=1) for own in (slip.before, slip.after)
    )
    reach = round(SOUGHT_S / width)
    first, end = max(slip.at - reach, 0), min(slip.at + reach, len(rate))
    leaves = np.cumsum(before[first:end]) + after[first:].sum() - np.cumsum(after[first:end])
    at = first + 1 + int(np.argmin(leaves))
    path = np.concatenate([[0.0], np.cumsum(rotation.lengths(rate)) * width])
    beside = round(SWAPPED_S / width)
    begin = int(np.searchsorted(path, path[max(at - beside, 0)] - TURNED))
    close = int(np.searchsorted(path, path[min(at + beside, len(rate))] + TURNED))
    early = slice(max(begin, at - reach, 0), max(at - beside, 0))
    late = slice(at + beside, min(close, at + reach))
    for side, own, other in ((early, before, after), (late, after, before)):
        if not float(other[side].sum()) > PARTED * float(own[side].sum()):
            return None
    return replace(slip, at=at)


def _robust(
    design: np.ndarray, left: np.ndarray, change: np.ndarray, ridge: np.ndarray
) -> np.ndarray:
    """The change of a side's map by those intervals that fit best, shape (4, 3): a slip that takes
    a while is of neither side.

    Args:
        design: What the gyroscope reads, and 1, shape (n, 4) [rad/s].
        left: What one map for all leaves, shape (n, 3) [rad/s].
        change: By all intervals, shape (4, 3).
        ridge: Added to the normal equations, shape (4, 4).
    """
    for _ in range(ROUNDS):
        size = rotation.lengths(left - design @ change)
        kept = size <= np.quantile(size, KEPT)
        own = design[kept]
        change = np.linalg.solve(own.T @ own + ridge, own.T @ left[kept])
    return change
