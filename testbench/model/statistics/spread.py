"""Whether one error is larger than another, over simulated parts.

That is the change, its spread, and what may be said of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import stdtrit

LEVEL = 0.95
"""Of the interval that decides."""
MOST_PERCENT = 100.0
"""A change of more is told as a multiple."""

Verdict = Literal["more", "less", "not shown"]


@dataclass(frozen=True)
class Change:
    """How much larger one error is than another, both of the same parts.

    Attributes:
        ratios: First to second, part by part, shape (parts,).
    """

    ratios: np.ndarray

    @staticmethod
    def of(first: Sequence[float], second: Sequence[float]) -> Change:
        """Of positive errors, part by part."""
        return Change(np.asarray(first, float) / np.asarray(second, float))

    @property
    def percent(self) -> float:
        """By the geometric mean of the ratios."""
        return 100 * float(np.expm1(np.log(self.ratios).mean()))

    @property
    def interval(self) -> tuple[float, float] | None:
        """Of the mean [%], by Student's t of the logarithms.

        None of a single part, which has no spread.
        """
        n = len(self.ratios)
        if n < 2:
            return None
        logarithms = np.log(self.ratios)
        half = float(stdtrit(n - 1, 0.5 + LEVEL / 2) * logarithms.std(ddof=1) / np.sqrt(n))
        low, high = (100 * float(np.expm1(logarithms.mean() + sign * half)) for sign in (-1, 1))
        return low, high

    @property
    def verdict(self) -> Verdict:
        """More or less where the interval leaves zero out."""
        interval = self.interval
        if interval is None or interval[0] <= 0 <= interval[1]:
            return "not shown"
        return "more" if interval[0] > 0 else "less"


def by_verdict(changes: Mapping[str, Change]) -> dict[Verdict, list[str]]:
    """Names under what may be said of each; a verdict that none has is left out."""
    found: dict[Verdict, list[str]] = {"more": [], "less": [], "not shown": []}
    for name, change in changes.items():
        found[change.verdict].append(name)
    return {verdict: names for verdict, names in found.items() if names}


def in_percent(value: float) -> str:
    """A change in words: 9 % less, 31 % more, 2.5 times as much, 1/200 as much."""
    ratio = 1 + value / 100
    if value > MOST_PERCENT:
        return f"{ratio:.1f} times as much" if ratio < 10 else f"{ratio:.0f} times as much"
    if value <= -99:
        return f"1/{1 / ratio:.0f} as much" if ratio > 0 else "next to nothing"
    shown = f"{abs(value):.0f}" if abs(value) >= 0.95 else f"{abs(value):.1f}"
    return "as much" if shown == "0.0" else f"{shown} % {'more' if value > 0 else 'less'}"


def told(change: Change) -> str:
    """What the parts show of one error against another, with the interval."""
    interval = change.interval
    if interval is None:
        return "one part does not show which has less"
    n = len(change.ratios)
    span = (
        f"{in_percent(interval[0])} to {in_percent(interval[1])}, {100 * LEVEL:g} % interval over "
        f"{n} parts"
    )
    if change.verdict == "not shown":
        return f"neither more nor less is shown ({span})"
    return f"{in_percent(change.percent)} ({span})"
