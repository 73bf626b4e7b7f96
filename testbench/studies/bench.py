"""What a study is given to work with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from testbench.clock import Clock, utc_text
from testbench.pipeline.analyse import Result
from testbench.pipeline.prepared import Prepared
from testbench.pipeline.request import AnalysisRequest, Request, RunRequest, StudyRequest
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Watcher, nothing
from testbench.records.session.plan import Plan


def _go_on(plan: Plan) -> None:
    """Let a run go on."""


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
    say: Callable[[str], None] = nothing
    protocol: str | Path | None = None

    @staticmethod
    def of(asked: StudyRequest, clock: Clock, say: Callable[[str], None] = nothing) -> StudyBench:
        """The bench that a request asks for.

        Args:
            asked: Seed, parts, folder and protocol.
            clock: Source of dates and run times.
            say: Called with what is being done.
        """
        return StudyBench(Path(asked.logs), clock, asked.seed, asked.parts, say, asked.protocol)

    @property
    def seeds(self) -> range:
        """One for each part."""
        return range(self.seed, self.seed + self.parts)

    def run(
        self,
        protocol: str | Path,
        filters: Sequence[str] | None = None,
        planned: Callable[[Plan], None] = _go_on,
    ) -> Result:
        """Run a protocol on the simulated bench and keep its session with its report.

        Args:
            protocol: Name of a shipped one, or a file.
            filters: The protocol's own if None.
            planned: Called with the plan before it is run; what it raises stops the run.
        """
        self.say(f"running {protocol}")
        asked = self.request(protocol, self.seed)
        if filters is not None:
            asked = Request(run=asked.run, analysis=AnalysisRequest(filters=tuple(filters)))
        return run(asked, Watcher(self.clock, lambda prepared: planned(prepared.plan)))

    def request(self, protocol: str | Path, seed: int, report: bool = True) -> Request:
        """A run of a protocol with one part, analysed as the protocol says.

        Args:
            protocol: Name of a shipped one, or a file.
            seed: Of the part.
            report: Whether its session gets a report.
        """
        return Request(
            run=RunRequest(protocol=str(protocol), seed=seed, logs=str(self.logs)),
            analysis=AnalysisRequest(report=report),
        )

    def run_part(self, asked: Request, prepared: Prepared) -> Result:
        """Run one part of a protocol that was planned for all of them.

        Args:
            asked: As `request` makes it.
            prepared: Of a request for the same protocol.
        """
        return run(asked, Watcher(self.clock), prepared)

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
