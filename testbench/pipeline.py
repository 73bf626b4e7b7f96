"""Where the stages meet: plan, execute, estimate, evaluate, report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from testbench.clock import Clock, SystemClock
from testbench.estimation import estimate
from testbench.estimation.filters import get_filter
from testbench.evaluation import evaluate
from testbench.exceptions import SessionError
from testbench.execution import execute
from testbench.execution.executor import Progress
from testbench.planning import plan
from testbench.records.estimate import FOLDER as ESTIMATE_FOLDER
from testbench.records.estimate import Estimate
from testbench.records.evaluation import Evaluation
from testbench.records.plan import Plan
from testbench.records.protocol import Protocol
from testbench.records.session import Session


@dataclass(frozen=True)
class Result:
    """What a run came to; `report` is None where none was asked for."""

    plan: Plan | None
    session: Session
    estimate: Estimate
    evaluation: Evaluation
    report: Path | None

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "session": str(self.session.path),
            "outcome": self.evaluation.outcome,
            "report": str(self.report) if self.report else None,
        }


def run(
    protocol: Protocol | str | Path,
    robot: str | Path | None = None,
    seed: int = 0,
    speed: Literal["fast", "realtime"] = "fast",
    logs: str | Path = "logs",
    filters: list[str] | None = None,
    with_report: bool = True,
    clock: Clock | None = None,
    progress: Callable[[Progress], None] | None = None,
    planned: Callable[[Plan], None] | None = None,
) -> Result:
    """Run a protocol from its file to its report.

    Args:
        protocol, robot: As for `plan`. seed, speed, logs, progress: As for `execute`. filters: As for `estimate`.
        with_report: Whether to write report.html. clock: The machine's if None. planned: Called with the plan before it is run.
    """
    clock = clock or SystemClock()
    the_plan = plan(protocol, robot)
    for name in filters or the_plan.protocol.spec.estimate.filters:
        get_filter(name)  # a filter that this version lacks is refused before anything moves
    if planned is not None:
        planned(the_plan)
    session = execute(the_plan, logs, seed, speed, clock, progress)
    return analyse(session, filters, with_report, the_plan)


def analyse(
    session: Session, filters: list[str] | None = None, with_report: bool = True, the_plan: Plan | None = None
) -> Result:
    """Everything that follows a recording; may be repeated at will."""
    estimated = estimate(session, filters)
    estimated.save(session.path)
    evaluated = evaluate(session, estimated)
    evaluated.save(session.path)
    path = None
    if with_report:
        from testbench.reporting.report import report

        path = report(session, estimated, evaluated)
    return Result(the_plan, session, estimated, evaluated, path)


def load_or_estimate(session: Session, filters: list[str] | None = None) -> Estimate:
    """The estimate on disk if it was made from this very recording with these filters, else a new one."""
    if (session.path / ESTIMATE_FOLDER / "estimate.json").is_file():
        try:
            stored = Estimate.load(session.path)
        except SessionError:
            stored = None
        if stored is not None and stored.fingerprint == session.fingerprint and _same_filters(session, stored, filters):
            return stored
    estimated = estimate(session, filters)
    estimated.save(session.path)
    return estimated


def _same_filters(session: Session, stored: Estimate, filters: list[str] | None) -> bool:
    wanted = set(filters or session.analysis.estimate.filters)
    return all(set(sensor.orientation) | set(sensor.skipped) == wanted for sensor in stored.sensors.values())


def show(session: Session, web: bool = False, save: Path | None = None, screenshot: Path | None = None) -> list[Path]:
    """Open a session in the viewer, or write what it would show.

    Args:
        session: The recording. web: Serve to a browser instead of a window. save: A .rrd file to write instead.
        screenshot: A .png file to write instead.

    Returns:
        The files that were written.
    """
    import testbench.reporting.viewer as viewer

    estimated = load_or_estimate(session)
    evaluated = evaluate(session, estimated)
    if save is not None:
        viewer.save_recording(session, save, estimated, evaluated)
    if screenshot is not None:
        viewer.screenshot(session, screenshot, estimated, evaluated)
    written = [path for path in (save, screenshot) if path is not None]
    if not written:
        viewer.view(session, web=web, estimate=estimated, evaluation=evaluated)
    return written
