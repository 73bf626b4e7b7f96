"""Where the stages meet: plan, execute, estimate, evaluate, report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from testbench.clock import Clock, SystemClock
from testbench.estimation import estimate
from testbench.estimation.filters import OrientationFilter, choose_filters, get_filter
from testbench.evaluation import evaluate
from testbench.exceptions import InputError, SessionError
from testbench.execution import execute
from testbench.execution.executor import Progress
from testbench.formats.exporters import TRUTH, Exported, ExportSource, Frame, check_options, prepare_export, write_export
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
    filters: Sequence[str | OrientationFilter] | None = None,
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
    the_plan = make_plan(protocol, robot, filters)
    if planned is not None:
        planned(the_plan)
    session = execute(the_plan, logs, seed, speed, clock, progress)
    return analyse(session, filters, with_report, the_plan)


def analyse(
    session: Session,
    filters: Sequence[str | OrientationFilter] | None = None,
    with_report: bool = True,
    the_plan: Plan | None = None,
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


def load_or_estimate(session: Session, filters: Sequence[str | OrientationFilter] | None = None) -> Estimate:
    """The estimate on disk if it was made from this very recording, with these filters where some are named; else a new one."""
    if (session.path / ESTIMATE_FOLDER / "estimate.json").is_file():
        try:
            stored = Estimate.load(session.path)
        except SessionError:
            stored = None
        if stored is not None and stored.fingerprint == session.fingerprint and _has_filters(stored, filters):
            return stored
    estimated = estimate(session, filters)
    estimated.save(session.path)
    return estimated


def _has_filters(stored: Estimate, filters: Sequence[str | OrientationFilter] | None) -> bool:
    """Whether an estimate was made with these filters; one that is given as it is may have changed since."""
    if filters is None:
        return True
    names = {entry for entry in filters if isinstance(entry, str)}
    if len(names) < len(filters):
        return False
    return all(set(sensor.orientation) | set(sensor.skipped) == names for sensor in stored.sensors.values())


def judge_again(session: Session, filters: Sequence[str | OrientationFilter] | None = None) -> Evaluation:
    """Evaluate what is estimated; a report that exists already is written anew, so that it never contradicts the session."""
    estimated = load_or_estimate(session, filters)
    evaluated = evaluate(session, estimated)
    evaluated.save(session.path)
    if (session.path / "report.html").is_file():
        from testbench.reporting.report import report

        report(session, estimated, evaluated)
    return evaluated


def make_plan(
    protocol: Protocol | str | Path, robot: str | Path | None = None, filters: Sequence[str | OrientationFilter] | None = None
) -> Plan:
    """Plan a protocol, and refuse filters that this version lacks.

    Raises:
        NotFoundError: An unknown filter. FileProblems: The protocol gives a filter parameters that it does not take.
    """
    the_plan = plan(protocol, robot)
    document = the_plan.protocol.document
    for name, parameters in document.value.estimate.filter_parameters.items():
        try:
            get_filter(name, parameters)
        except InputError as error:
            raise document.problem(str(error), "estimate", "filter_parameters", name) from None
    choose_filters(filters or document.value.estimate.filters)
    return the_plan


def show(session: Session, web: bool = False, save: Path | None = None, screenshot: Path | None = None) -> list[Path]:
    """Open a session in the viewer, or write what it would show.

    Args:
        session: The recording. web: Serve to a browser instead of a window. save: A .rrd file to write instead.
        screenshot: A .png file to write instead.

    Returns:
        The files that were written.
    """
    import testbench.reporting.viewer as viewer

    for target in (save, screenshot):
        if target is not None and not target.parent.is_dir():
            raise InputError(f"{target} cannot be written: there is no folder {target.parent}")
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


def export(
    session: Session,
    name: str,
    out: str | Path | None = None,
    filter_name: str | None = None,
    frame: Frame = "opensim",
    force: bool = False,
) -> Exported:
    """Write a session in a format that other programs read.

    Args:
        session: The recording. name: Of the format; `testbench.formats.exporters.EXPORTS` has them all. out: File or folder to
            write; one in the session's folder `export` if None. filter_name: Whose orientation; "truth" for the true one.
        frame: Of orientations for OpenSim. force: Replace an earlier export.

    Raises:
        InputError: The place is taken, or the session lacks what the format needs; nothing is written then.
    """
    check_options(name, filter_name, frame)
    path = prepare_export(name, session, Path(out) if out is not None else None, force)
    if filter_name is not None and filter_name != TRUTH:
        get_filter(filter_name)
    estimated = load_or_estimate(session)
    ran = {key for sensor in estimated.sensors.values() for key in (*sensor.orientation, *sensor.skipped)}
    if filter_name is not None and filter_name not in {TRUTH, *ran}:
        estimated = estimate(session, [filter_name])  # beside what the session keeps, which stays as it is
    source = ExportSource(session, estimated, filter_name, frame)
    return write_export(name, source, path, _write_recording if name == "rrd" else None)


def _write_recording(source: ExportSource, path: Path) -> list[str]:
    import testbench.reporting.viewer as viewer

    viewer.save_recording(source.session, path, source.estimate, evaluate(source.session, source.estimate))
    return []
