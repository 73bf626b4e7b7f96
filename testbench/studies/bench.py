"""What a study is given to work with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from testbench.clock import Clock, utc_text
from testbench.pipeline import Result, run
from testbench.records.plan import Plan


def _nothing(text: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class StudyBench:
    """The simulated bench of a study.

    Attributes:
        logs: Folder that its sessions are kept in.
        clock: Source of dates and run times.
        seed: Of the first part; the others take the numbers that follow.
        parts: How many sensors of the same kind.
        say: Called with what is being done.
        protocol: Name or file of one in place of the study's own, for studies that take another.
    """

    logs: Path
    clock: Clock
    seed: int = 0
    parts: int = 5
    say: Callable[[str], None] = _nothing
    protocol: str | Path | None = None

    def run(
        self,
        protocol: str | Path,
        filters: Sequence[str] | None = None,
        planned: Callable[[Plan], None] | None = None,
    ) -> Result:
        """Run a protocol on the simulated bench and keep its session with its report.

        Args:
            protocol: Name of a shipped one, or a file.
            filters: The protocol's own if None.
            planned: Called with the plan before it is run; what it raises stops the run.
        """
        self.say(f"running {protocol}")
        return run(
            protocol,
            seed=self.seed,
            logs=self.logs,
            filters=filters,
            clock=self.clock,
            planned=planned,
        )

    def now(self) -> str:
        """As records keep it."""
        return utc_text(self.clock.utc())

    def settings(self, protocol: str, plan: Plan) -> dict[str, Any]:
        """What a study of several parts says of itself.

        Args:
            protocol: Its name.
            plan: Made of it.
        """
        parts = {"seed": self.seed, "parts": self.parts}
        return {"protocol": protocol, "plan_hash": plan.hash, **parts}
