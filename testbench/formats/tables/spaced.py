"""Times by a rate that a person states, for rows that have stamps of their own.

The stamps then only tell where samples are missing: a step of more than `HOLE` usual ones is a hole
of so many of them, whatever the unit of the stamps.
"""

from __future__ import annotations

import numpy as np

from testbench.formats.tables.order import Habit
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

HOLE = 2.5
LONGEST_S = 10 * 86_400
"""A hole is at most so long, whatever stamps of an unknown unit seem to say [s]."""


class Spaced:
    """Times of samples one after another at a rate, with the holes of their stamps.

    Args:
        rate: [Hz].
        column: Of the stamps, for what is said of them.
    """

    def __init__(self, rate: float, column: str):
        self._rate, self._column = rate, column
        self._index, self._begun = -1, 0
        self._last: int | None = None
        self._holes = self._longest = 0

    def __call__(self, stamps: np.ndarray, habit: Habit | None) -> np.ndarray:
        """Times of the next samples, shape (n,), int64 [ns].

        Args:
            stamps: Mended, shape (n,) [ns].
            habit: What is usual; None where the stamps stand still.
        """
        if self._last is None:
            self._begun = int(stamps[0])
        advance = np.ones(len(stamps), dtype=np.int64)
        if habit is not None:
            steps = np.diff(stamps, prepend=stamps[0] if self._last is None else self._last)
            hole = steps > HOLE * habit.step_ns
            samples = np.minimum(steps[hole] / habit.step_ns, LONGEST_S * self._rate)
            advance[hole] = np.round(samples).astype(np.int64)
            self._holes += int(hole.sum())
            self._longest = max(self._longest, int(advance.max()) - 1)
        index = self._index + np.cumsum(advance)
        self._index, self._last = int(index[-1]), int(stamps[-1])
        return self._begun + np.round(index * (NANOSECONDS / self._rate)).astype(np.int64)

    def findings(self) -> list[Finding]:
        """What is to be said of the pass, once it is over."""
        result = [finding("time.by_rate", column=self._column)]
        if self._holes:
            result.append(
                finding(
                    "time.holes_by_rate",
                    column=self._column,
                    holes=self._holes,
                    longest=self._longest,
                )
            )
        return result
