"""A truth cut where it turns by what the gyroscope does not, and which pieces fit each other."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from testbench.estimation.signals.segmentation import intervals_of
from testbench.estimation.signals.truth_turning import LEAST_STEP, Compared
from testbench.frames import NANOSECONDS

STEP_WITHIN_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Over so long it is asked whether the truth turns as far as the gyroscope does: steps may be
smoothed, or filled in [s].
"""
LEAST_GAP_S = 0.1
"""Over a longer gap of the truth it is asked whether both sides fit, and steps that are closer are
one [s].
"""
SCALE = 0.03
"""Part of its path by which a gyroscope's turn may be wrong [1]."""
DRIFT = np.radians(0.1)
"""Speed at which its turn goes wrong [rad/s]."""
LOOSEST = np.radians(25.0)
"""Pieces that cannot be compared better than this are not compared [rad]."""
LASTING_S, LEAST_LASTING = 3.0, 0.45
"""Where less of the motion lies in pieces that last so long, truth and gyroscope differ everywhere:
axes, range or scale of the one are wrong, and no smoothed step is the cause [s, 1].
"""
COMPARED_S, INSTANTS = 0.5, 5
"""Pieces are compared at so many instants of so long an end of each [s]."""
MOST_CLASSES = 8
"""A piece is compared with the latest of so many kinds, so that the time does not grow with the
square of their number.
"""
BESIDE = 2
"""Rows on either side of a step that are left out with it: whoever looks for jumps leaves one."""
LEAST_ROWS = 3
"""Pieces of fewer rows are single jumps, which the evaluation leaves out and counts."""


@dataclass(frozen=True)
class Cut:
    """A truth cut where it steps.

    Attributes:
        dropped: Rows of pieces that do not fit the rest, shape (m,), bool.
        angle: Of the largest step [rad].
        begins: Rows that steps come before.
        others: First row and the one after the last of the pieces that are dropped, those that fit
            one another together.
    """

    dropped: np.ndarray
    angle: float = 0.0
    begins: list[int] = field(default_factory=list)
    others: list[list[tuple[int, int]]] = field(default_factory=list)

    def turns_with_the_sensor(self) -> np.ndarray:
        """Rows of all pieces but those beside a step, shape (m,), bool."""
        inner = ~self.dropped
        for first, end in (piece for pieces in self.others for piece in pieces):
            inner[first:end] = True
        for first in self.begins:
            inner[max(first - BESIDE, 0) : first + BESIDE] = False
        return inner


def cut_truth(both: Compared) -> Cut:
    """Cut a truth where it steps, and drop the pieces that do not fit those that last longest."""
    rows = both.time_ns
    whole = Cut(np.zeros(len(rows), dtype=bool))
    if len(rows) < 10:
        return whole
    steps, within = _steps(both)
    usual = float(np.median(np.diff(rows)))
    gaps = np.diff(rows) > max(LEAST_GAP_S * NANOSECONDS, 2.5 * usual)
    borders = np.flatnonzero(steps | gaps) + 1
    if not len(borders):
        return whole
    edges = np.concatenate([[0], borders, [len(rows)]])
    pieces = [(int(a), int(b)) for a, b in pairwise(edges) if not within[a:b].all()]
    if within.any() and _lasting(within, both) < LEAST_LASTING:
        return whole
    classes = _classes(pieces, both)
    lengths: dict[int, float] = {}
    for (first, end), own in zip(pieces, classes, strict=True):
        lengths[own] = lengths.get(own, 0.0) + float(rows[end - 1] - rows[first]) + usual
    main = max(lengths, key=lengths.__getitem__)
    others: dict[int, list[tuple[int, int]]] = {}
    for piece, own in zip(pieces, classes, strict=True):
        if own != main:
            others.setdefault(own, []).append(piece)
    odd = [piece for own in others.values() for piece in own]
    if all(end - first < LEAST_ROWS for first, end in odd):
        return whole
    dropped = within.copy()
    for first, end in odd:
        dropped[first:end] = True
    size = max((_misfit(both, a, b)[0] for a, b in pairwise(pieces)), default=0.0)
    changes = [
        first
        for (first, _), own, before in zip(pieces[1:], classes[1:], classes, strict=False)
        if own != before
    ]
    return Cut(dropped, size, changes, list(others.values()))


def _steps(both: Compared) -> tuple[np.ndarray, np.ndarray]:
    """Where the truth steps: between which rows, shape (m - 1,), and rows within a smoothed step,
    shape (m,), bool.

    Both angles of a relative rotation are compared, and either may be the larger: a step against
    the motion leaves the truth turning less. How far the gyroscope turned on its way counts for
    nothing but its error.
    """
    rows = both.time_ns
    within = np.zeros(len(rows), dtype=bool)
    steps = np.zeros(len(rows) - 1, dtype=bool)
    usual = max(float(np.median(np.diff(rows))), 1.0)
    spans = {max(round(seconds * NANOSECONDS / usual), 1) for seconds in STEP_WITHIN_S}
    for apart in sorted({1} | {span for span in spans if span < len(rows)}):
        span = rows[apart:] - rows[:-apart]
        wrong = SCALE * (both.path[apart:] - both.path[:-apart]) + DRIFT * span / NANOSECONDS
        differ = both.differences(slice(None, -apart), slice(apart, None)).min(axis=0)
        far = (differ > LEAST_STEP + wrong) & (span <= 2.5 * apart * usual)
        if apart == 1:
            steps = far
            for a, b in pairwise(np.flatnonzero(steps) + 1):
                if rows[b - 1] - rows[a] < LEAST_GAP_S * NANOSECONDS:  # one step, in several
                    within[a:b] = True
            continue
        known = np.concatenate([[0], np.cumsum(steps | within[1:])])
        for i in np.flatnonzero(far):
            if known[i + apart] == known[i]:  # nothing shorter explains it
                within[i + 1 : i + apart] = True
    smooth = within[1:] != within[:-1]
    return steps | smooth, within


def _lasting(within: np.ndarray, both: Compared) -> float:
    """Part of the gyroscope's path that lies in pieces which last, [1].

    Args:
        within: Rows in which the two turn differently, shape (m,), bool.
        both: Truth and gyroscope.
    """
    path = np.concatenate([[0.0], np.cumsum(np.minimum(np.diff(both.path), np.pi))])
    first, last = intervals_of(~within, 1).T - [[0], [1]]
    seconds = (both.time_ns[last] - both.time_ns[first]) / NANOSECONDS
    lasts = seconds >= LASTING_S
    return float((path[last] - path[first])[lasts].sum()) / max(float(path[-1]), 1e-9)


def _classes(pieces: list[tuple[int, int]], both: Compared) -> list[int]:
    """Which pieces fit each other: a number for each."""
    classes: list[int] = []
    latest: dict[int, tuple[int, int]] = {}
    for piece in pieces:
        fitting = None
        recent = sorted(latest.items(), key=lambda item: -item[1][1])[:MOST_CLASSES]
        for own, other in recent:
            misfit, allowed = _misfit(both, other, piece)
            follows = bool(classes) and own == classes[-1]
            if allowed > LOOSEST:
                if follows:  # nothing tells them apart
                    fitting = own
                    break
            elif misfit <= allowed:
                fitting = own
                break
        chosen = len(latest) if fitting is None else fitting
        classes.append(chosen)
        latest[chosen] = piece
    return classes


def _misfit(both: Compared, before: tuple[int, int], after: tuple[int, int]) -> tuple[float, float]:
    """How differently truth and gyroscope turn from the end of one piece to the beginning of
    another, and what the gyroscope may be wrong by [rad].
    """
    near, rows = round(COMPARED_S * NANOSECONDS), both.time_ns
    first = max(before[0], int(np.searchsorted(rows, rows[before[1] - 1] - near)))
    end = min(after[1], int(np.searchsorted(rows, rows[after[0]] + near, side="right")))
    i = np.unique(np.linspace(first, before[1] - 1, INSTANTS).round().astype(int))
    j = np.unique(np.linspace(after[0], end - 1, INSTANTS).round().astype(int))
    i, j = (grid.ravel() for grid in np.meshgrid(i, j))
    span = float(rows[after[0]] - rows[before[1] - 1]) / NANOSECONDS
    whole = both.path[j] - both.path[i]
    allowed = LEAST_STEP + SCALE * float(whole.max()) + DRIFT * span
    return float(both.differences(i, j).max(axis=1).min()), allowed
