"""Where the stages meet: plan, execute, estimate, evaluate, report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from testbench.clock import Clock, SystemClock, utc_name
from testbench.estimation import estimate
from testbench.estimation.calibration.prepared import Segmentation
from testbench.estimation.calibration.session_calibration import calibrate as calibrate_sensor
from testbench.estimation.filters import FILTERS, OrientationFilter, get_filter
from testbench.estimation.filters.tuned import choose_tuned
from testbench.evaluation import evaluate
from testbench.exceptions import InputError, NotFoundError, SessionError
from testbench.execution import execute
from testbench.execution.executor import Progress
from testbench.formats.exporters import (
    TRUTH,
    Exported,
    ExportSource,
    Frame,
    check_options,
    prepare_export,
    write_export,
)
from testbench.planning import plan
from testbench.planning.designed import DesignedProtocol, design_protocol
from testbench.planning.experiment_design import Wanted
from testbench.records.calibration_file import SUFFIXES, load_calibrations, save_calibration
from testbench.records.calibration_result import CalibrationResult
from testbench.records.estimate import Estimate
from testbench.records.evaluation import Evaluation
from testbench.records.plan import Plan
from testbench.records.protocol import Protocol
from testbench.records.robot import Robot
from testbench.records.session import Session
from testbench.records.session_lock import session_locked
from testbench.records.tuning import load_tunings


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
            "simulated": self.session.simulated,
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
    calibrations: Path | None = None,
    tunings: Sequence[Path] = (),
    keys: bool = False,
    say: Callable[[str], None] = lambda line: None,
) -> Result:
    """Run a protocol from its file to its report.

    Args:
        protocol: As for `plan`.
        robot: As for `plan`.
        seed: As for `execute`.
        speed: As for `execute`.
        logs: As for `execute`.
        progress: As for `execute`.
        filters: As for `estimate`.
        with_report: Whether to write report.html.
        clock: The machine's if None.
        planned: Called with the plan before it is run.
        calibrations: As for `analyse`.
        tunings: As for `analyse`.
        keys: Listen to the keyboard: p pauses, r resumes, q stops.
        say: As for `execute`.
    """
    clock = clock or SystemClock()
    if calibrations is not None:
        load_calibrations(calibrations)  # a bad file is refused before anything moves
    the_plan = make_plan(protocol, robot, filters, tunings)
    if planned is not None:
        planned(the_plan)
    session = execute(the_plan, logs, seed, speed, clock, progress, keys=keys, say=say)
    return analyse(session, filters, with_report, the_plan, calibrations, tunings)


@session_locked
def analyse(
    session: Session,
    filters: Sequence[str | OrientationFilter] | None = None,
    with_report: bool = True,
    the_plan: Plan | None = None,
    calibrations: Path | None = None,
    tunings: Sequence[Path] = (),
) -> Result:
    """Everything that follows a recording; may be repeated at will.

    Args:
        session: The recording.
        filters: As for `estimate`.
        with_report: Whether to write report.html.
        the_plan: For the result.
        calibrations: Stored calibration, or a folder of them, that corrects the raw samples first.
        tunings: Files of tuned parameters, at most one a filter.
    """
    stored = None if calibrations is None else load_calibrations(calibrations)
    estimated = estimate(session, filters, stored, load_tunings(tunings))
    estimated.save(session.path)
    evaluated = evaluate(session, estimated)
    evaluated.save(session.path)
    path = None
    if with_report:
        from testbench.reporting.report import report

        path = report(session, estimated, evaluated)
    return Result(the_plan, session, estimated, evaluated, path)


@session_locked
def load_or_estimate(
    session: Session,
    filters: Sequence[str | OrientationFilter] | None = None,
    calibrations: Path | None = None,
    tunings: Sequence[Path] = (),
) -> Estimate:
    """The estimate on disk if it was made from this very recording, with these filters where some
    are named; else a new one.

    With calibrations or tuned parameters it is always made anew, and one with tuned parameters is
    not taken for one without where filters are named.
    """
    if calibrations is None and not tunings:
        stored = _stored_estimate(session)
        if stored is not None and _has_filters(stored, filters):
            return stored
    known = None if calibrations is None else load_calibrations(calibrations)
    estimated = estimate(session, filters, known, load_tunings(tunings))
    estimated.save(session.path)
    return estimated


def _stored_estimate(session: Session) -> Estimate | None:
    """The estimate on disk if it can be read and was made from this very recording."""
    if not Estimate.lies_in(session.path):
        return None
    try:
        stored = Estimate.load(session.path)
    except SessionError:
        return None
    return stored if stored.fingerprint == session.fingerprint else None


def _filters_of(estimated: Estimate | None) -> list[str]:
    """Names of the filters that ran, or were skipped, for any sensor."""
    sensors = [] if estimated is None else estimated.sensors.values()
    return list(
        dict.fromkeys(key for sensor in sensors for key in (*sensor.orientation, *sensor.skipped))
    )


def _has_filters(stored: Estimate, filters: Sequence[str | OrientationFilter] | None) -> bool:
    """Whether an estimate was made with these filters; one that is given as it is may have changed
    since.
    """
    if filters is None:
        return True
    names = {entry for entry in filters if isinstance(entry, str)}
    if len(names) < len(filters) or stored.tuned:
        return False
    return all(
        set(sensor.orientation) | set(sensor.skipped) == names for sensor in stored.sensors.values()
    )


@session_locked
def judge_again(
    session: Session,
    filters: Sequence[str | OrientationFilter] | None = None,
    calibrations: Path | None = None,
    tunings: Sequence[Path] = (),
) -> Evaluation:
    """Evaluate what is estimated; a report that exists already is written anew, so that it never
    contradicts the session.
    """
    estimated = load_or_estimate(session, filters, calibrations, tunings)
    evaluated = evaluate(session, estimated)
    evaluated.save(session.path)
    if (session.path / "report.html").is_file():
        from testbench.reporting.report import report

        report(session, estimated, evaluated)
    return evaluated


def make_plan(
    protocol: Protocol | str | Path,
    robot: Robot | str | Path | None = None,
    filters: Sequence[str | OrientationFilter] | None = None,
    tunings: Sequence[Path] = (),
) -> Plan:
    """Plan a protocol, and refuse filters that this version lacks.

    Raises:
        NotFoundError: An unknown filter.
        FileProblems: The protocol gives a filter parameters that it does not take, or a tuning is
            malformed.
    """
    the_plan = plan(protocol, robot)
    document = the_plan.protocol.document
    for name, parameters in document.value.estimate.filter_parameters.items():
        try:
            get_filter(name, parameters)
        except InputError as error:
            raise document.problem(str(error), "estimate", "filter_parameters", name) from None
    wanted = document.value.estimate
    choose_tuned(filters, wanted.filters, wanted.filter_parameters, load_tunings(tunings))
    return the_plan


@dataclass(frozen=True)
class MadeCalibration:
    """A calibration, the file that keeps it, and its report, or None where none was asked for."""

    result: CalibrationResult
    file: Path
    report: Path | None


def calibrate(
    session: Session,
    sensor: str | None,
    methods: Sequence[str],
    out: Path,
    segmentation: Segmentation | None = None,
    held_out: Sequence[Session] = (),
    with_report: bool = True,
    field: np.ndarray | None = None,
    turn_angle: float | None = None,
) -> MadeCalibration:
    """Calibrate a sensor and keep the result.

    Args:
        session: As for `calibrate_sensor`.
        methods: As for `calibrate_sensor`.
        segmentation: As for `calibrate_sensor`.
        held_out: As for `calibrate_sensor`.
        field: As for `calibrate_sensor`.
        turn_angle: As for `calibrate_sensor`.
        sensor: May be None where the session has one.
        out: A .yaml file, or a folder, in which the file is called after the date and the sensor.
        with_report: Whether to write an HTML report beside it.

    Raises:
        InputError: The file exists, or nothing can be calibrated; nothing is written then.
    """
    names = session.sensor_names
    if sensor is None and len(names) != 1:
        raise InputError(
            f"the session has several sensors ({', '.join(names)}); say which with --sensor"
        )
    name = sensor or names[0]
    file = out
    if out.suffix not in SUFFIXES:
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is neither a .yaml file nor a folder")
        moment = session.recorded_at or session.started
        file = out / f"{utc_name(moment)}_{name}.yaml"
    page = file.with_suffix(".html")
    for target in (file, page) if with_report else (file,):
        if target.exists():
            raise InputError(f"{target} exists already; calibrations are kept, not replaced")
    software = f"testbench {version('imu-testbench')}"
    result = calibrate_sensor(
        session, name, methods, segmentation, held_out, software, field, turn_angle
    )
    if out.suffix not in SUFFIXES:
        out.mkdir(parents=True, exist_ok=True)
    save_calibration(file, result.calibration)
    if with_report:
        from testbench.reporting.calibration_report import calibration_report

        calibration_report(result, page)
    return MadeCalibration(result, file, page if with_report else None)


def design_calibration(
    out: Path, robot: str, like: str, sensor: str | None, wanted: Wanted, link: str | None = None
) -> DesignedProtocol:
    """Design a calibration, compare it with the static poses of a protocol, check it, and write it.

    Args:
        out: Protocol file to write.
        robot: Name or file.
        like: Protocol that describes the sensor and is compared with.
        sensor: Which of its sensors; may be None where there is one.
        wanted: How many poses and turns, and how.
        link: That carries the sensor on this arm, in the mounting that `like` states; the link that
            `like` names if None.

    Raises:
        InputError: The file exists, or nothing can be designed.
    """
    return design_protocol(out, robot, like, sensor, link, wanted)


def show(
    session: Session, web: bool = False, save: Path | None = None, screenshot: Path | None = None
) -> list[Path]:
    """Open a session in the viewer, or write what it would show.

    Args:
        session: The recording.
        web: Serve to a browser instead of a window.
        save: A .rrd file to write instead.
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


@session_locked
def export(
    session: Session,
    name: str,
    out: str | Path | None = None,
    filter_name: str | OrientationFilter | None = None,
    frame: Frame = "opensim",
    force: bool = False,
) -> Exported:
    """Write a session in a format that other programs read.

    Args:
        session: The recording.
        name: Of the format; `testbench.formats.exporters.EXPORTS` has them all.
        out: File or folder to write; one in the session's folder `export` if None.
        filter_name: Whose orientation: "truth" for the true one, one that the estimate holds, one
            of the bench, or a filter of your own, which is run anew.
        frame: Of orientations for OpenSim.
        force: Replace an earlier export.

    Raises:
        NotFoundError: No such filter.
        InputError: The place is taken, or the session lacks what the format needs; nothing is
            written then.
    """
    key = filter_name.name if isinstance(filter_name, OrientationFilter) else filter_name
    check_options(name, key, frame)
    path = prepare_export(name, session, Path(out) if out is not None else None, force)
    stored = _stored_estimate(session)
    if isinstance(filter_name, str) and filter_name not in {TRUTH, *FILTERS, *_filters_of(stored)}:
        raise NotFoundError(
            "filter", filter_name, list(dict.fromkeys([TRUTH, *FILTERS, *_filters_of(stored)]))
        )
    if isinstance(filter_name, OrientationFilter):
        estimated = estimate(
            session, [filter_name]
        )  # beside what the session keeps, which stays as it is
    else:
        estimated = stored or load_or_estimate(session)
        if filter_name is not None and filter_name not in {TRUTH, *_filters_of(estimated)}:
            estimated = estimate(session, [filter_name])
    source = ExportSource(session, estimated, key, frame)
    return write_export(name, source, path, _write_recording if name == "rrd" else None)


def _write_recording(source: ExportSource, path: Path) -> list[str]:
    import testbench.reporting.viewer as viewer

    viewer.save_recording(
        source.session, path, source.estimate, evaluate(source.session, source.estimate)
    )
    return []
