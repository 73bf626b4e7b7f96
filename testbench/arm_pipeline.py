"""Where the stages meet on an arm that keeps its own time, and where a run that broke off is gone
on with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import mkdtemp

from testbench.clock import Clock, SystemClock
from testbench.drivers.arms import catalogue
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.entry import WantedArm
from testbench.drivers.session_time import SessionTime
from testbench.estimation.filters import OrientationFilter
from testbench.exceptions import BenchError, InputError, SessionError
from testbench.execution import RunOptions, execute
from testbench.execution.devices import open_devices
from testbench.execution.executor import execute_on_arm, simulated_sensors
from testbench.execution.resume import (
    is_own_copy,
    missing_steps,
    open_for_resume,
    refuse_differences,
    refuse_edited_protocol,
    refuse_other_robot,
    stored_protocol,
    stored_robot,
)
from testbench.execution.run_progress import Progress
from testbench.execution.sensors import Sensors
from testbench.model.dh_calibration import calibrated
from testbench.model.dh_plausibility import judge_corrections
from testbench.pipeline import Result, analyse, make_plan
from testbench.planning.planner import find_robot
from testbench.records.arm_calibration import load_arm_calibration
from testbench.records.calibration_file import load_calibrations
from testbench.records.plan import Plan, PlannedStep
from testbench.records.protocol_file import load_protocol
from testbench.records.robot import Robot
from testbench.records.session import Session
from testbench.records.session_lock import session_lock


@dataclass(frozen=True)
class ArmSetup:
    """What moves and what is recorded in a run that is not simulated.

    Attributes:
        driver: Of the catalogue of arms, by its name.
        host: Address of the controller.
        log: A recorded motion.
        simulate_imus: Sensors follow the reported motion.
        serial: Live devices, as for `open_devices`.
        dots: Live devices, as for `open_devices`.
        seed: Of simulated sensors.
        arm_serial: Serial number that the arm must have; any if None.
    """

    driver: str
    host: str = ""
    log: Path | None = None
    simulate_imus: bool = False
    serial: list[str] = field(default_factory=list)
    dots: list[str] = field(default_factory=list)
    seed: int = 0
    arm_serial: str | None = None


def calibrated_robot(protocol: str | Path, robot: str | Path | None, kinematics: Path) -> Robot:
    """The arm of a protocol with its own kinematics, from a calibration.yaml.

    Its corrected URDF lies beside the calibration's folder of the system's temporary files; the
    session keeps a copy. What is doubtful about the corrections is among the warnings of every plan
    for it.

    Raises:
        InputError: The calibration is another arm's, or can be no factory calibration.
    """
    calibration = load_arm_calibration(kinematics)
    nominal = find_robot(load_protocol(protocol), robot)
    own = calibrated(nominal, calibration, Path(mkdtemp(prefix="testbench-")))
    try:
        doubt = judge_corrections(nominal, own)
    except InputError as error:
        raise InputError(f"{kinematics}: {error}") from None
    if doubt is None:
        return own
    spec = own.spec.model_copy(
        update={"assumptions": [*own.spec.assumptions, f"{kinematics}: {doubt}"]}
    )
    return Robot(spec, own.urdf, own.text, own.file)


def make_arm(plan: Plan, setup: ArmSetup, clock: Clock) -> tuple[SteppingArm, Sensors]:
    """The arm and the sensors of a run that is not simulated; nothing is connected yet.

    Raises:
        InputError: No sensors, or devices that are not the protocol's.
        DriverError: An extra is missing.
    """
    time = SessionTime(clock)
    wanted = WantedArm(setup.host, setup.log, setup.arm_serial, setup.seed)
    arm = catalogue.make_arm(setup.driver, plan, wanted, time)
    if setup.simulate_imus:
        return arm, Sensors.simulated(plan, setup.seed)
    if not setup.serial and not setup.dots:
        if not arm.entry.commanded:
            arm.connect()  # what is wrong with the log is said first
        raise InputError(
            "name the sensors on the arm with --serial or --dot, or simulate them with "
            "--simulate-imus"
        )
    devices = open_devices(setup.serial, setup.dots, time)
    return arm, Sensors.live(plan, devices)


def run_on_arm(
    plan: Plan,
    setup: ArmSetup,
    options: RunOptions,
    filters: Sequence[str | OrientationFilter] | None = None,
    with_report: bool = True,
    clock: Clock | None = None,
    calibrations: Path | None = None,
    tunings: Sequence[Path] = (),
) -> Result:
    """Run a plan on an arm that keeps its own time, and judge it.

    Args:
        plan: As made by `make_plan`.
        setup: Arm and sensors.
        options: As for `execute_on_arm`.
        filters: As for `run`.
        with_report: As for `run`.
        calibrations: As for `run`.
        tunings: As for `run`.
        clock: The machine's if None.
    """
    if calibrations is not None:
        load_calibrations(calibrations)  # a bad file is refused before anything moves
    arm, sensors = make_arm(plan, setup, clock or SystemClock())
    session = execute_on_arm(plan, arm, sensors, options)
    return _judge(session, plan, options, filters, with_report, calibrations, tunings)


def _judge(
    session: Session,
    plan: Plan,
    options: RunOptions,
    filters: Sequence[str | OrientationFilter] | None,
    with_report: bool,
    calibrations: Path | None,
    tunings: Sequence[Path],
) -> Result:
    """Analyse what was recorded whole; a failure says that it was."""
    if options.progress is not None:
        options.progress(Progress("", 0, 0, 1.0, 1.0, "the arm is done: estimating, evaluating"))
    try:
        return analyse(session, filters, with_report, plan, calibrations, tunings)
    except BenchError as error:
        error.add_note(f"the recording is whole; judge it again: testbench report {session.path}")
        raise


def look_at_arm(
    plan: Plan, setup: ArmSetup, steps: list[PlannedStep] | None = None, clock: Clock | None = None
) -> None:
    """Refuse what a run would refuse of its sensors and of its arm, before a person is asked
    anything.

    The controller is let go again: a person takes time to answer.

    Args:
        plan: As made by `make_plan`.
        setup: Arm and sensors.
        steps: Those of its steps to do; all if None.
        clock: The machine's if None.

    Raises:
        InputError: As for `make_arm`, or the arm must not be driven.
        DriverError: A live sensor delivers nothing, or there is no controller that answers.
    """
    arm, sensors = make_arm(plan, setup, clock or SystemClock())
    try:
        sensors.listen()
        arm.connect()
        arm.check_way(plan, steps)
    finally:
        arm.close()
        sensors.close()


@dataclass(frozen=True)
class Resumption:
    """How a session goes on.

    Attributes:
        session: That broke off.
        plan: Of the whole run.
        steps: That a real arm does.
        note: By which protocol, for people.
    """

    session: Session
    plan: Plan
    steps: list[PlannedStep]
    note: str


def prepare_resume(
    path: Path,
    protocol: str | Path | None = None,
    robot: str | Path | None = None,
    filters: Sequence[str | OrientationFilter] | None = None,
    tunings: Sequence[Path] = (),
) -> Resumption:
    """Look at what is missing of a session, and whether its files are still what they were; nothing
    is connected.

    Args:
        path: Of the session.
        protocol: As it is today; the session's own copy if None, unless its file was edited since.
        robot: As it is today; the session's own copy if None.
        filters: As for `run`.
        tunings: As for `run`.

    Raises:
        SessionError: It was completed, or is no run.
        InputError: Protocol, robot or software are not what they were; lists what differs.
    """
    session = open_for_resume(path)
    refuse_other_robot(session, robot)
    named = None if protocol is None or is_own_copy(session, protocol) else protocol
    with stored_protocol(session) as stored:
        plan = make_plan(named or stored, stored_robot(session), filters, tunings)
    note = (
        f"resuming by {protocol}" if protocol is not None else refuse_edited_protocol(session, plan)
    )
    refuse_differences(session, plan, session.manifest.content["sensors"])
    return Resumption(session, plan, missing_steps(session, plan), note)


def resume(
    path: Path,
    setup: ArmSetup | None = None,
    options: RunOptions | None = None,
    protocol: str | Path | None = None,
    filters: Sequence[str | OrientationFilter] | None = None,
    with_report: bool = True,
    clock: Clock | None = None,
    progress: Callable[[Progress], None] | None = None,
    calibrations: Path | None = None,
    tunings: Sequence[Path] = (),
    prepared: Resumption | None = None,
) -> Result:
    """Go on with a session whose run broke off.

    A simulated run is completed in its own folder. A real arm does what is missing in a session of
    its own, after the steps that give the sensors their references.

    Args:
        path: Of the session.
        setup: For a run that is not simulated.
        options: For a run that is not simulated.
        protocol: As for `prepare_resume`.
        filters: As for `run`.
        with_report: As for `run`.
        clock: As for `run`.
        progress: As for `run`.
        calibrations: As for `run`.
        tunings: As for `run`.
        prepared: As made by `prepare_resume`, where a person has seen it.

    Raises:
        SessionError: It was completed, or is no run.
        InputError: Protocol, robot, sensors or software are not what they were; lists what differs.
    """
    if calibrations is not None:
        load_calibrations(calibrations)
    prepared = prepared or prepare_resume(path, protocol, None, filters, tunings)
    session, the_plan, steps = prepared.session, prepared.plan, prepared.steps
    recorded = session.manifest.arm.record
    if recorded is not None and recorded.simulated:
        refuse_differences(session, the_plan, simulated_sensors(the_plan))
        seed, speed = session.manifest.seed, session.manifest.arm.speed
        if seed is None:
            raise SessionError(f"{path} does not say by which seed it was begun")
        again = RunOptions(seed=seed, speed=speed, clock=clock, progress=progress, resumed=session)
        with session_lock(session.path):
            resumed = execute(the_plan, options=again)
        return analyse(resumed, filters, with_report, the_plan, calibrations, tunings)
    if setup is None or options is None:
        raise InputError(
            f"{path} was run on a real arm; say --arm, --host and --confirm-motion to go on"
        )
    arm, sensors = make_arm(the_plan, setup, clock or SystemClock())
    refuse_differences(
        session, the_plan, {name: imu.describe() for name, imu in sensors.imus.items()}
    )
    options = replace(
        options,
        steps=steps,
        resumes={"session": session.name, "steps": [step.index for step in steps]},
    )
    session = execute_on_arm(the_plan, arm, sensors, options)
    return _judge(session, the_plan, options, filters, with_report, calibrations, tunings)
