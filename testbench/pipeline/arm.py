"""The arm and sensors that a request asks for, and what is refused before anything moves."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from testbench.clock import Clock
from testbench.drivers.arms import catalogue
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.entry import WantedArm
from testbench.exceptions import BenchError, DriverError, InputError
from testbench.execution.devices import open_devices
from testbench.execution.resume import refuse_differences
from testbench.execution.sensors import Sensors
from testbench.extras import is_missing, missing_extra
from testbench.pipeline.prepared import Prepared
from testbench.pipeline.request import RunRequest
from testbench.pipeline.watcher import Consent
from testbench.records.session.plan import Plan
from testbench.records.specs.arm_calibration import load_arm_calibration


def refuse_arm(asked: RunRequest, consent: Consent) -> None:
    """Refuse what the chosen arm would take no notice of, and what it cannot do without.

    Of the first, somebody meant another run than this one.

    Args:
        asked: A new run, or one that goes on: a simulated session keeps its seed, its rhythm and
            its folder.
        consent: Which only an arm that moves needs.

    Raises:
        InputError: Names each such option, and the arms that take it; or the option that is
            missing.
        DriverError: A library that the run needs is not installed.
    """
    driver, given = asked.arm.driver, _given(asked, consent)
    needed = [*catalogue.ignored_options(driver, given), *_kept(asked)]
    if needed:
        raise InputError("; ".join(f"{option} needs {what}" for option, what in needed))
    catalogue.refuse_missing(driver, given)
    entry = catalogue.find_arm(driver)
    if consent.motion and entry.extra and is_missing(entry.extra):
        raise DriverError(missing_extra(f"driving {entry.family} needs", entry.extra))
    refuse_missing_devices(asked.arm.serial, asked.arm.dots)


def refuse_missing_devices(serial: Collection[str], dots: Collection[str]) -> None:
    """Refuse live sensors whose library is not installed, before anything is connected.

    Args:
        serial: Boards that are asked for.
        dots: Xsens DOTs that are asked for.

    Raises:
        DriverError: Names the extra, and how to install it.
    """
    if serial and is_missing("serial"):
        raise DriverError(missing_extra("serial devices need", "serial"))
    if dots and is_missing("ble"):
        raise DriverError(missing_extra("Bluetooth devices need", "ble"))


def _given(asked: RunRequest, consent: Consent) -> set[str]:
    """The options that were given, of those that not every arm takes."""
    arm, default = asked.arm, RunRequest()
    given = {
        "--serial": arm.serial,
        "--dot": arm.dots,
        "--simulate-imus": arm.simulate_imus,
        "--kinematics": arm.kinematics,
        "--host": arm.host,
        "--confirm-motion": consent.motion,
        "--hazards-checked": consent.hazards_checked,
        "--log": arm.log,
        "--speed": asked.speed != default.speed,
        "--seed": asked.seed != default.seed,
    }
    return {option for option, value in given.items() if value}


def _kept(asked: RunRequest) -> Iterator[tuple[str, str]]:
    """Options that a simulated session which goes on has settled when it began."""
    if asked.resume is None or not catalogue.find_arm(asked.arm.driver).virtual:
        return
    default = RunRequest()
    settled = {
        "--seed": asked.seed != default.seed,
        "--speed": asked.speed != default.speed,
        "--logs": asked.logs != default.logs,
    }
    for option, given in settled.items():
        if given:
            yield option, "a new run: a simulated session goes on as it began"


def make_arm(
    plan: Plan, asked: RunRequest, clock: Clock, known_ns: int = 0
) -> tuple[SteppingArm, Sensors]:
    """The arm and the sensors of a run; nothing is connected yet.

    Args:
        plan: What the arm is to do.
        asked: Arm and sensors.
        clock: Of the session.
        known_ns: So much a session holds already that is completed in virtual time [ns].

    Raises:
        InputError: No sensors, or devices that are not the protocol's.
        DriverError: An extra is missing.
    """
    wanted = asked.arm
    time = catalogue.session_time(wanted.driver, clock, asked.speed, known_ns)
    number = (
        load_arm_calibration(Path(wanted.kinematics)).serial
        if wanted.kinematics is not None
        else None
    )
    log = None if wanted.log is None else Path(wanted.log)
    arm = catalogue.make_arm(
        wanted.driver, plan, WantedArm(wanted.host, log, number, asked.seed), time
    )
    if wanted.simulate_imus or arm.entry.virtual:
        return arm, Sensors.simulated(plan, asked.seed, arm.felt)
    if not wanted.serial and not wanted.dots:
        if not arm.entry.commanded:
            arm.connect()  # what is wrong with the log is said first
        raise InputError(
            "name the sensors on the arm with --serial or --dot, or simulate them with "
            "--simulate-imus"
        )
    devices = open_devices(list(wanted.serial), list(wanted.dots), time)
    return arm, Sensors.live(plan, devices)


def refuse_other_sensors(prepared: Prepared, sensors: Sensors) -> None:
    """Refuse to go on with other sensors than those that began.

    Args:
        prepared: What the arm would do.
        sensors: Of today; they are let go where they are refused.

    Raises:
        InputError: Lists what differs.
    """
    if prepared.resumed is None:
        return
    try:
        refuse_differences(prepared.resumed, prepared.plan, sensors.described())
    except BenchError:
        sensors.close()
        raise


def look_at_arm(prepared: Prepared, asked: RunRequest, clock: Clock) -> None:
    """Refuse what a run would refuse of its sensors and arm, before a person is asked anything.

    The controller is let go again: a person takes time to answer.

    Args:
        prepared: What the arm would do.
        asked: Arm and sensors.
        clock: Of the session.

    Raises:
        InputError: As for `make_arm` and `refuse_other_sensors`, or the arm must not be driven.
        DriverError: A live sensor delivers nothing, or there is no controller that answers.
    """
    arm, sensors = make_arm(prepared.plan, asked, clock)
    refuse_other_sensors(prepared, sensors)
    try:
        sensors.listen()
        arm.connect()
        arm.check_way(prepared.plan, prepared.steps)
    finally:
        arm.close()
        sensors.close()
