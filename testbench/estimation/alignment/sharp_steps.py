"""Steps of a truth that are smaller than what the angles of single turns show.

A reference that takes one body for another of nearly the same shape steps by a few degrees. Turned
into one frame by a map of the rates, truth and gyroscope differ by what both do wrong, which
wanders: a step stands out of how far they part over the same time just before it and after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation

LEAST = np.radians(3.5)
"""Smaller steps are not told from what filters of a reference do [rad]."""
OVER_S = 0.1
"""A step lasts so long at most, or two rows of a truth [s]."""
LEVEL_S = 0.25
"""Both sides are means over so long [s]."""
STAYS_S, STAYS = 1.0, 0.6
"""So much of a step is left between the means over so long on either side [s, 1]."""
WIDER_S, GROWS = 0.2, 1.25
"""With so much longer between both sides a step is hardly larger; what parts slowly is [s, 1]."""
LONGEST_LAG_S, ROUNDS, KEPT = 0.05, 3, 0.8
"""One of both may come so much later [s]; that is fitted so many times, again to the part that
fitted best [1]: filters of a reference delay by milliseconds, in which a body turns by degrees.
"""
BESIDE_S = 4.0
"""What the two part by is usual if they do so within this on either side [s]."""
BEYOND, OF_BESIDE = 2.0, 0.95
"""A step exceeds so many times what this part of the changes beside it stays below, for as far a
turn [1].
"""
USUAL, OF_ALL = 1.5, 0.98
"""And so many times what this part of all changes of the recording stays below, likewise [1]."""
LEAST_PATH = np.radians(5.0)
"""Shorter turns are all alike: what is left is noise [rad]."""


@dataclass(frozen=True)
class Differences:
    """How far truth and gyroscope are from one another, at intervals of one width.

    Attributes:
        apart: In the world of the truth, shape (n, 3) [rad].
        rate: True, in the world, shape (n, 3) [rad/s].
        path: That the gyroscope has turned since the beginning, shape (n,) [rad].
        wrong: Part of it by which its turn may be wrong [1].
        time_ns: Middle of each interval, increasing, shape (n,) [ns].
        width: Of an interval [s].
        truth_s: Between two rows of the truth [s].
    """

    apart: np.ndarray
    rate: np.ndarray
    path: np.ndarray
    wrong: float
    time_ns: np.ndarray
    width: float
    truth_s: float


@dataclass(frozen=True)
class Step:
    """A step.

    Attributes:
        angle: Its size [rad].
        before: Last interval before it.
        after: First after it.
    """

    angle: float
    before: int
    after: int


def find_step(own: Differences) -> Step | None:
    """The step that stands out most, or None."""
    level = max(round(LEVEL_S / own.width), 1)
    across = max(round(max(OVER_S, 2 * own.truth_s) / own.width), 1)
    firsts = np.arange(level, len(own.apart) - across - level + 1)
    if not len(firsts):
        return None
    own = _without_lag(own, firsts, level, across)
    change = rotation.lengths(_changes(own.apart, firsts, level, across))
    change[_has_gap(own, firsts, level, across)] = 0.0
    path = own.path[firsts + across + level - 1] - own.path[firsts - level]
    size = np.maximum(change - own.wrong * path, 0.0)
    # what either does wrong grows with the turn, or does not
    scales = np.maximum(path, LEAST_PATH), np.ones(len(size))
    least = [USUAL * float(np.quantile(size / scale, OF_ALL)) for scale in scales]
    beside, reach = level + across, round(BESIDE_S / own.width)
    taken = np.zeros(len(size), dtype=bool)
    for at in np.argsort(-size):
        if size[at] <= LEAST:
            break
        around = np.arange(max(at - reach, 0), min(at + reach + 1, len(size)))
        near = around[np.abs(around - at) <= beside]
        others = np.setdiff1d(around, near, assume_unique=True)
        if not taken[at] and len(others):
            beyond = min(
                scale[at] * max(usual, _usual(size, scale, others))
                for usual, scale in zip(least, scales, strict=True)
            )
            first = int(firsts[at])
            if size[at] > beyond and _is_sharp(own, first, level, across, float(change[at])):
                return Step(float(change[at]), first - 1, first + across)
        taken[near] = True
    return None


def _usual(size: np.ndarray, scale: np.ndarray, others: np.ndarray) -> float:
    """What a step must exceed beside some changes, in parts of a scale.

    Args:
        size: Of all changes, shape (m,) [rad].
        scale: That they may grow with, shape (m,).
        others: Those beside it, shape (k,).
    """
    return BEYOND * float(np.quantile(size[others] / scale[others], OF_BESIDE))


def _without_lag(own: Differences, firsts: np.ndarray, level: int, across: int) -> Differences:
    """The same without what one of both is late by, all in all: it turns by its rate meanwhile."""
    sound = ~_has_gap(own, firsts, level, across)
    change = _changes(own.apart, firsts, level, across)[sound]
    faster = _changes(own.rate, firsts, level, across)[sound]
    kept, lag = np.ones(len(change), dtype=bool), 0.0
    for _ in range(ROUNDS if len(change) else 0):
        power = float(np.sum(faster[kept] ** 2))
        lag = float(np.sum(faster[kept] * change[kept])) / max(power, 1e-12)
        left = rotation.lengths(change - lag * faster)
        kept = left <= np.quantile(left, KEPT)
    lag = float(np.clip(lag, -LONGEST_LAG_S, LONGEST_LAG_S))
    return replace(own, apart=own.apart - lag * own.rate)


def _changes(series: np.ndarray, firsts: np.ndarray, level: int, across: int) -> np.ndarray:
    """By how much means of a series change, shape (m, 3).

    Args:
        series: Shape (n, 3).
        firsts: First interval between both means, shape (m,).
        level: Intervals of a mean.
        across: Intervals between the two.
    """
    summed = np.concatenate([np.zeros((1, 3)), np.cumsum(series, axis=0)])
    before = summed[firsts] - summed[firsts - level]
    return np.asarray((summed[firsts + across + level] - summed[firsts + across] - before) / level)


def _has_gap(own: Differences, firsts: np.ndarray, level: int, across: int) -> np.ndarray:
    """Whether a gap lies between the first and the last interval, shape (m,), bool."""
    last = firsts + across + level - 1
    lasted = (own.time_ns[last] - own.time_ns[firsts - level]) / NANOSECONDS
    return np.asarray(lasted > (2 * level + across) * own.width)


def _is_sharp(own: Differences, first: int, level: int, across: int, size: float) -> bool:
    """Whether a change lasts, and is all there within the time of a step.

    Args:
        own: Differences.
        first: First interval between both sides.
        level: Intervals of a mean.
        across: Intervals between the two.
        size: Of the change [rad].
    """
    lasting = max(round(STAYS_S / own.width), level)
    wider = round(WIDER_S / 2 / own.width)
    stays = _between(own, first, first + across, lasting)
    return stays > STAYS * size and (
        _between(own, first - wider, first + across + wider, level) < GROWS * size
    )


def _between(own: Differences, first: int, end: int, count: int) -> float:
    """How far the means of so many intervals before one, and from another on, are apart [rad]."""
    before, after = own.apart[max(first - count, 0) : first], own.apart[end : end + count]
    if not len(before) or not len(after):
        return 0.0
    return float(np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)))
