"""What the bench is meant to reach, beside what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tests.benchmarks.timing import Text, show


@dataclass(frozen=True)
class Bar:
    """A limit on something that was measured.

    Attributes:
        what: Was measured.
        measured: Value.
        limit: That it is held against.
        unit: Of both.
        at_least: Whether more is better; else the value must stay below.
    """

    what: str
    measured: float
    limit: float
    unit: str
    at_least: bool = False

    @property
    def kept(self) -> bool:
        """Whether it is; a value that is not known keeps none."""
        if self.at_least:
            return self.measured >= self.limit
        return self.measured < self.limit


def show_bars(bars: Sequence[Bar]) -> bool:
    """Print each beside its value; whether all are kept."""
    rows: list[list[str | Text]] = [
        [
            Text(bar.what),
            f"{bar.measured:.3g} {bar.unit}",
            f"{'at least' if bar.at_least else 'below'} {bar.limit:.3g} {bar.unit}",
            Text("kept" if bar.kept else "MISSED"),
        ]
        for bar in bars
    ]
    missed = sum(not bar.kept for bar in bars)
    show(
        "Bars",
        ["what", "measured", "bar", "which is"],
        rows,
        f"{missed} of {len(bars)} missed" if missed else f"all {len(bars)} kept",
    )
    return not missed
