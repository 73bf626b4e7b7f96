"""Recordings whose accelerations were kept at rest alone and whose rates in motion alone.

So Botina & Vergara (Universidad del Cauca, 2018) recorded: a hundred accelerations, two hundred
rates while the gimbal turned, a hundred accelerations; the memory of the board held no more. What
was recorded tells the rests and the turns, and no other witness does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.signals.segmentation import intervals_of
from testbench.records.session.samples import ImuSamples

MOST_TOGETHER = 0.05
"""Share of rows with both triads up to which a recording is parted: border rows may have both."""
FEWEST_ROWS = 2


@dataclass(frozen=True)
class Parted:
    """Rests and turns by what was recorded.

    Attributes:
        rests: Begin and end (exclusive) of each still interval, in rows, shape (k, 2).
        turns: Begin and end (exclusive) of each turn, in rows, shape (m, 2).
        between: Rests before and after each turn, shape (m, 2).
    """

    rests: np.ndarray
    turns: np.ndarray
    between: np.ndarray


def parted(raw: ImuSamples) -> Parted | None:
    """The rests and turns of a recording whose triads were recorded by turns; None of any other.

    Accelerations between two turns are those of two rests, after the one and before the next: each
    gets half of the rows, whether the sensor was laid otherwise meanwhile or not.

    Args:
        raw: Samples, NaN where a triad was not recorded.
    """
    acc, gyr = (np.isfinite(getattr(raw, key)).all(axis=1) for key in ("acc", "gyr"))
    if not acc.any() or not gyr.any() or np.sum(acc & gyr) > MOST_TOGETHER * len(acc):
        return None
    turns = [run for run in intervals_of(gyr) if run[1] - run[0] >= FEWEST_ROWS]
    still = acc & ~gyr
    rests: list[tuple[int, int]] = []
    kept, between = [], []
    for i, (begin, end) in enumerate(turns):
        first = turns[i - 1][1] if i else 0
        last = turns[i + 1][0] if i + 1 < len(turns) else len(acc)
        before = _half(still, first, begin, later=i > 0)
        after = _half(still, end, last, later=False, whole=i + 1 == len(turns))
        if before is None or after is None:
            continue
        rests += [before, after]
        kept.append((begin, end))
        between.append((len(rests) - 2, len(rests) - 1))
    if not kept:
        return None
    return Parted(np.array(rests), np.array(kept), np.array(between))


def _half(
    still: np.ndarray, begin: int, end: int, later: bool, whole: bool = False
) -> tuple[int, int] | None:
    """The still rows of a stretch, or its later or earlier half; None where there are too few."""
    rows = begin + np.flatnonzero(still[begin:end])
    if begin and not whole:
        middle = len(rows) // 2
        rows = rows[middle:] if later else rows[:middle]
    if len(rows) < FEWEST_ROWS:
        return None
    return int(rows[0]), int(rows[-1]) + 1
