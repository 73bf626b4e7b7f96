"""Where the stages meet: plan, execute, estimate, evaluate, report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Literal

from testbench.clock import Clock, SystemClock
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.replay import ReplayArm
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.imus.streamed import SessionTime
from testbench.estimation import estimate
from testbench.estimation.filters import get_filter
from testbench.evaluation import evaluate
from testbench.exceptions import InputError, SessionError
from testbench.execution import execute
from testbench.execution.arm_run import ArmRunOptions, Sensors, execute_on_arm
from testbench.execution.device_recorder import open_devices
from testbench.execution.executor import Progress, simulated_sensors
from testbench.execution.resume import missing_steps, open_for_resume, refuse_differences, stored_protocol, stored_robot
from testbench.formats.exporters import TRUTH, Exported, ExportSource, Frame, check_options, prepare_export, write_export
from testbench.model.dh_calibration import calibrated
from testbench.planning import plan
from testbench.planning.designed import DesignedProtocol, design_protocol
from testbench.planning.experiment_design import Wanted
from testbench.planning.planner import find_robot
from testbench.records.arm_calibration import load_arm_calibration
from testbench.records.estimate import FOLDER as ESTIMATE_FOLDER
from testbench.records.estimate import Estimate
from testbench.records.evaluation import Evaluation
from testbench.records.plan import Plan
from testbench.records.protocol import Protocol
from testbench.records.protocol_file import load_protocol
from testbench.records.robot import Robot
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


@dataclass(frozen=True)
class ArmSetup:
    """What moves and what is recorded in a run that is not simulated.

    Attributes:
        host: Address of the controller. log: A recorded motion to replay instead of an arm. simulate_imus: Sensors follow the
        reported motion. serial, dots: Live devices, as for `open_devices`. seed: Of simulated sensors. arm_serial: Serial
        number that the arm must have; any if None.
    """

    host: str = ""
    log: Path | None = None
    simulate_imus: bool = False
    serial: list[str] = field(default_factory=list)
    dots: list[str] = field(default_factory=list)
    seed: int = 0
    arm_serial: str | None = None


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
    keys: bool = False,
) -> Result:
    """Run a protocol from its file to its report.

    Args:
        protocol, robot: As for `plan`. seed, speed, logs, progress: As for `execute`. filters: As for `estimate`.
        with_report: Whether to write report.html. clock: The machine's if None. planned: Called with the plan before it is run.
        keys: Listen to the keyboard: p pauses, r resumes, q stops.
    """
    clock = clock or SystemClock()
    the_plan = make_plan(protocol, robot, filters)
    if planned is not None:
        planned(the_plan)
    session = execute(the_plan, logs, seed, speed, clock, progress, keys=keys)
    return analyse(session, filters, with_report, the_plan)


def calibrated_robot(protocol: str | Path, robot: str | Path | None, kinematics: Path) -> Robot:
    """The arm of a protocol with its own kinematics, from a calibration.yaml.

    Its corrected URDF lies beside the calibration's folder of the system's temporary files; the session keeps a copy.
    """
    calibration = load_arm_calibration(kinematics)
    folder = Path(mkdtemp(prefix="testbench-"))
    return calibrated(find_robot(load_protocol(protocol), robot), calibration, folder)


def make_arm(plan: Plan, setup: ArmSetup, clock: Clock) -> tuple[SteppingArm, Sensors, SessionTime]:
    """The arm and the sensors of a run that is not simulated; nothing is connected yet.

    Raises:
        InputError: No sensors, or devices that are not the protocol's.
        DriverError: An extra is missing.
    """
    time = SessionTime(clock)
    if setup.log is not None:
        arm: SteppingArm = ReplayArm(plan.robot, setup.log, time)
    else:
        arm = UrArm(plan.robot, ur_settings(plan, setup.host), time, setup.arm_serial)
    if setup.simulate_imus:
        return arm, Sensors.simulated(plan, setup.seed), time
    if not setup.serial and not setup.dots:
        raise InputError("name the sensors on the arm with --serial or --dot, or simulate them with --simulate-imus")
    devices = open_devices(setup.serial, setup.dots, clock, time=time)
    return arm, Sensors.live(plan, devices), time


def run_on_arm(
    plan: Plan,
    setup: ArmSetup,
    options: ArmRunOptions,
    filters: list[str] | None = None,
    with_report: bool = True,
    clock: Clock | None = None,
) -> Result:
    """Run a plan on an arm that keeps its own time, and judge it.

    Args:
        plan: As made by `make_plan`. setup: Arm and sensors. options: As for `execute_on_arm`. filters, with_report: As for
        `run`. clock: The machine's if None.
    """
    arm, sensors, time = make_arm(plan, setup, clock or SystemClock())
    session = execute_on_arm(plan, arm, sensors, time, options)
    return analyse(session, filters, with_report, plan)


def resume(
    path: Path,
    setup: ArmSetup | None = None,
    options: ArmRunOptions | None = None,
    protocol: str | Path | None = None,
    filters: list[str] | None = None,
    with_report: bool = True,
    clock: Clock | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Result:
    """Go on with a session whose run broke off.

    A simulated run is completed in its own folder. A real arm does what is missing in a session of its own, after the steps
    that give the sensors their references.

    Args:
        path: Of the session. setup, options: For a run that is not simulated. protocol: As it is today; the session's own copy
        if None. filters, with_report, clock, progress: As for `run`.

    Raises:
        SessionError: It was completed, or is no run.
        InputError: Protocol, robot, sensors or software are not what they were; lists what differs.
    """
    session = open_for_resume(path)
    with stored_protocol(session) as stored:
        the_plan = make_plan(protocol or stored, stored_robot(session), filters)
        if session.manifest["arm"]["driver"] == "simulated":
            refuse_differences(session, the_plan, simulated_sensors(the_plan))
            seed, speed = session.manifest["seed"], session.manifest["arm"]["speed"]
            resumed = execute(the_plan, seed=seed, speed=speed, clock=clock, progress=progress, resumed=session)
            return analyse(resumed, filters, with_report, the_plan)
        if setup is None or options is None:
            raise InputError(f"{path} was run on a real arm; say --arm, --host and --confirm-motion to go on")
        arm, sensors, time = make_arm(the_plan, setup, clock or SystemClock())
        refuse_differences(session, the_plan, {name: imu.describe() for name, imu in sensors.imus.items()})
        steps = missing_steps(session, the_plan)
        options = replace(options, steps=steps, resumes={"session": session.name, "steps": [step.index for step in steps]})
        return analyse(execute_on_arm(the_plan, arm, sensors, time, options), filters, with_report, the_plan)


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


def _has_filters(stored: Estimate, filters: list[str] | None) -> bool:
    if filters is None:
        return True
    return all(set(sensor.orientation) | set(sensor.skipped) == set(filters) for sensor in stored.sensors.values())


def judge_again(session: Session, filters: list[str] | None = None) -> Evaluation:
    """Evaluate what is estimated; a report that exists already is written anew, so that it never contradicts the session."""
    estimated = load_or_estimate(session, filters)
    evaluated = evaluate(session, estimated)
    evaluated.save(session.path)
    if (session.path / "report.html").is_file():
        from testbench.reporting.report import report

        report(session, estimated, evaluated)
    return evaluated


def make_plan(
    protocol: Protocol | str | Path, robot: Robot | str | Path | None = None, filters: list[str] | None = None
) -> Plan:
    """Plan a protocol, and refuse filters that this version lacks.

    Raises:
        NotFoundError: A filter is reserved but not there yet; lists those that are.
    """
    the_plan = plan(protocol, robot)
    for name in filters or the_plan.protocol.spec.estimate.filters:
        get_filter(name)
    return the_plan


def design_calibration(out: Path, robot: str, like: str, sensor: str | None, wanted: Wanted) -> DesignedProtocol:
    """Design a calibration, compare it with the static poses of a protocol, check it, and write it.

    Args:
        out: Protocol file to write. robot: Name or file. like: Protocol that describes the sensor and is compared with.
        sensor: Which of its sensors; may be None where there is one. wanted: How many poses and turns, and how.

    Raises:
        InputError: The file exists, or nothing can be designed.
    """
    return design_protocol(out, robot, like, sensor, wanted)


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
