"""What a study is given to work with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from testbench.clock import Clock
from testbench.pipeline import Result, run


def _nothing(text: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class StudyBench:
    """The simulated bench of a study.

    Attributes:
        logs: Folder that its sessions are kept in. clock: Source of dates and run times. seed: Of the first part; the others
        take the numbers that follow. parts: How many sensors of the same kind. say: Called with what is being done.
    """

    logs: Path
    clock: Clock
    seed: int = 0
    parts: int = 5
    say: Callable[[str], None] = _nothing

    def run(self, protocol: str, filters: Sequence[str] | None = None) -> Result:
        """Run a shipped protocol on the simulated bench and keep its session; the protocol's own filters if None."""
        self.say(f"running {protocol}")
        return run(protocol, seed=self.seed, logs=self.logs, filters=filters, with_report=False, clock=self.clock)

    def now(self) -> str:
        """ISO 8601, UTC, to the second."""
        return f"{self.clock.utc():%Y-%m-%dT%H:%M:%SZ}"
