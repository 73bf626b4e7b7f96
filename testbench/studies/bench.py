"""What a study is given to work with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.clock import Clock, utc_text
from testbench.exceptions import InputError
from testbench.pipeline.analyse import Result, examine
from testbench.pipeline.request import AnalysisRequest, Request, RunRequest, StudyRequest
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Watcher, nothing
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import REPORT
from testbench.records.session.plan import Plan
from testbench.records.session.raw_files import open_for_analysis
from testbench.records.session.session import Session
from testbench.studies.parts import run_side_by_side


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
        session: Recording that is asked in place of anything run, for studies that take one.
        verify: Whether its raw files are compared with their hashes first.
        options: Of the study, by name, as typed.
    """

    logs: Path
    clock: Clock
    seed: int = 0
    parts: int = 5
    say: Callable[[str], None] = nothing
    protocol: str | Path | None = None
    session: str | Path | None = None
    verify: bool = True
    options: Mapping[str, str] = field(default_factory=dict)

    @staticmethod
    def of(asked: StudyRequest, clock: Clock, say: Callable[[str], None] = nothing) -> StudyBench:
        """The bench that a request asks for.

        Args:
            asked: Seed, parts, folder, protocol, session and options.
            clock: Source of dates and run times.
            say: Called with what is being done.
        """
        own = (asked.protocol, asked.session, asked.verify, asked.options)
        return StudyBench(Path(asked.logs), clock, asked.seed, asked.parts, say, *own)

    @property
    def own(self) -> bool:
        """Whether the data are the user's, of which the publication says nothing."""
        return self.protocol is not None or self.session is not None

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

    def results(self, protocol: str | Path, filters: Sequence[str] | None = None) -> list[Result]:
        """What the study is made of: the user's recording, or each part of a protocol.

        The first part has a report; that of another is made by `testbench report`.

        Args:
            protocol: The study's own; one that the user brings stands in for it.
            filters: Those of the recording or the protocol if None.

        Raises:
            InputError: The recording cannot be analysed.
            SessionError: It is none, or was changed.
        """
        named = None if filters is None else tuple(filters)
        if self.session is not None:
            self.say(f"asking {self.session}")
            return [examine(self.recording(), AnalysisRequest(filters=named, report=False))]
        wanted = str(self.protocol or protocol)
        return self.results_of({wanted: named})[wanted]

    def results_of(self, protocols: Mapping[str, Sequence[str] | None]) -> dict[str, list[Result]]:
        """Every part of several protocols, side by side.

        The first part of each has a report; that of another is made by `testbench report`.

        Args:
            protocols: By name or file, the filters to run; the protocol's own if None.
        """
        asked = []
        for protocol, filters in protocols.items():
            named = None if filters is None else tuple(filters)
            for seed in self.seeds:
                request = self.request(protocol, seed, report=seed == self.seed)
                analysis = request.analysis.model_copy(update={"filters": named})
                asked.append(request.model_copy(update={"analysis": analysis}))
        self.say(f"running {', '.join(protocols)}: {self.parts} parts")
        if len(asked) == 1:
            return {next(iter(protocols)): [run(asked[0], Watcher(self.clock))]}
        paths = run_side_by_side(
            asked, lambda done: self.say(f"{done} of {len(asked)} runs are done")
        )
        results = [kept_result(path) for path in paths]
        n = self.parts
        return {name: results[i * n : (i + 1) * n] for i, name in enumerate(protocols)}

    def recording(self) -> Session:
        """The recording that is asked, as it is.

        Raises:
            SessionError: It is none, or was changed.
        """
        assert self.session is not None
        return open_for_analysis(self.session, self.verify)

    def refuse_without(self, what: str, missing: Sequence[str]) -> None:
        """Refuse data of the user's that lack what a study asks for.

        Args:
            what: The study or its part, for people.
            missing: What there is not, each by its name; nothing is refused where all is there.

        Raises:
            InputError: Names the data and all that is missing.
        """
        if missing:
            raise InputError(
                f"{self.session or self.protocol}: {what} asks for {'; for '.join(missing)}"
            )

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

    def now(self) -> str:
        """As records keep it."""
        return utc_text(self.clock.utc())

    def settings(self, protocol: str, plan: Plan | None = None) -> dict[str, Any]:
        """What a study of several parts says of itself.

        Args:
            protocol: Its name.
            plan: Made of it; its hash is told where there is one.
        """
        if self.session is not None:
            return {"session": str(self.session)}
        hashed = {} if plan is None else {"plan_hash": plan.hash}
        named = {"protocol": str(self.protocol or protocol), **hashed}
        return {**named, "seed": self.seed, "parts": self.parts}


def kept_result(path: str | Path) -> Result:
    """What a run of another process left, or an earlier one.

    Args:
        path: Folder of its session, with estimate and evaluation.
    """
    session, report = Session(path), Path(path) / REPORT
    return Result(
        session,
        Estimate.load(session.path),
        Evaluation.load(session.path),
        report if report.is_file() else None,
    )
