"""Every way to move an arm: who adds one adds an entry here.

The command line lists these and refuses options by them, so that nothing heavy is imported here:
entries say by name where their drivers are.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING

from testbench.drivers.arms.entry import (
    LIVE_SENSORS,
    REAL_ARM,
    SENSORS,
    SIMULATED_SENSORS,
    ArmEntry,
    WantedArm,
)
from testbench.drivers.arms.remedies import UR_REMEDIES, XARM_REMEDIES
from testbench.exceptions import InputError, NotFoundError
from testbench.records.session.arm_record import MODEL, RECORDED_MOTION, SIMULATED

if TYPE_CHECKING:
    from testbench.clock import Clock
    from testbench.drivers.arms.base import SteppingArm
    from testbench.drivers.session_time import SessionTime, Speed
    from testbench.records.session.plan import Plan

SIM = ArmEntry(
    name="sim",
    title="a simulated arm",
    made_by="testbench.drivers.arms.simulated:simulated_arm",
    options=frozenset({"--speed"}),
    commanded=False,
    provenance=MODEL,
    virtual=True,
    recorded_as=SIMULATED,
)
UR = ArmEntry(
    name="ur",
    title="a Universal Robots e-series",
    made_by="testbench.drivers.arms.ur:ur_arm",
    options=REAL_ARM | SENSORS | {"--kinematics"},
    needs=("--host", "the address of the controller"),
    extra="ur",
    robots=r"ur\d+e",
    family="e-series arms such as ur3e",
    remedies=UR_REMEDIES,
    former_faults={"rtde_silence": "report_silence"},
)
XARM = ArmEntry(
    name="xarm",
    title="a UFACTORY xArm",
    made_by="testbench.drivers.arms.xarm:xarm_arm",
    options=REAL_ARM | SENSORS,
    needs=("--host", "the address of the controller"),
    extra="xarm",
    robots="xarm6",
    family="xarm6",
    notice="the xArm driver is UNVERIFIED ON HARDWARE: it was tested against an emulated "
    "controller only, and this controller has no watchdog that stops the arm when the bench is cut "
    "off; keep a hand on the emergency stop",
    remedies=XARM_REMEDIES,
    former_faults={"rtde_silence": "report_silence"},
)
REPLAY = ArmEntry(
    name="replay",
    title="a recorded motion",
    made_by="testbench.drivers.arms.replay:replay_arm",
    options=SENSORS | {"--kinematics", "--log"},
    needs=("--log", "a session, a Parquet or a CSV file"),
    commanded=False,
    provenance=RECORDED_MOTION,
)
ARMS = {entry.name: entry for entry in (SIM, UR, XARM, REPLAY)}
"""By name, in the order in which people are told of them."""
CHECKED = (
    *LIVE_SENSORS,
    SIMULATED_SENSORS,
    "--kinematics",
    "--host",
    "--confirm-motion",
    "--hazards-checked",
    "--log",
    "--speed",
)
"""Options that not every arm takes, in the order in which they are told of."""


def find_arm(name: str) -> ArmEntry:
    """An entry by its name on the command line, or by that in a manifest.

    Raises:
        NotFoundError: There is none; lists those that there are.
    """
    for entry in ARMS.values():
        if name in {entry.name, entry.record.driver}:
            return entry
    raise NotFoundError("arm", name, list(ARMS))


def make_arm(name: str, plan: Plan, wanted: WantedArm, time: SessionTime) -> SteppingArm:
    """An arm; nothing is connected.

    Args:
        name: Of the driver.
        plan: What it is to do.
        wanted: What is known of it.
        time: Of the session, as `session_time` makes it.

    Raises:
        NotFoundError: There is no such driver.
        InputError: The plan is for an arm of another maker, or the address is none.
    """
    arm: SteppingArm = find_arm(name).make(plan, wanted, time)
    return arm


def session_time(name: str, clock: Clock, speed: Speed, known_ns: int = 0) -> SessionTime:
    """The time that an arm moves in.

    Args:
        name: Of the driver.
        clock: Gives the monotonic time.
        speed: How virtual time passes; real time does as it does.
        known_ns: So much a session that is gone on with in virtual time holds already [ns].

    Raises:
        NotFoundError: There is no such driver.
    """
    from testbench.drivers.session_time import SessionTime, VirtualTime

    return VirtualTime(clock, speed, known_ns) if find_arm(name).virtual else SessionTime(clock)


def refuse_other_maker(name: str, robot: str) -> None:
    """Refuse an arm that a driver is not for, by its name; nothing is connected.

    Args:
        name: Of the driver.
        robot: Name of the robot that the plan is for.

    Raises:
        InputError: It is another maker's; says which driver it needs.
    """
    try:
        find_arm(name).refuse_other(robot)
    except InputError as error:
        right = next(
            (entry.name for entry in ARMS.values() if entry.commanded and entry.drives(robot)), None
        )
        raise InputError(
            f"{error}: say --arm {right}" if right else f"{error}, which no driver is for"
        ) from None


def refuse_missing(name: str, given: Collection[str]) -> None:
    """Refuse a run that lacks the option which the arm cannot do without.

    Args:
        name: Of the arm.
        given: The options that were given, such as `--host`.

    Raises:
        InputError: Names the option, and what it is.
    """
    needs = find_arm(name).needs
    if needs is not None and needs[0] not in given:
        raise InputError(f"--arm {name} needs {needs[0]}, {needs[1]}")


def ignored_options(name: str, given: Collection[str]) -> Iterator[tuple[str, str]]:
    """Options that the arm would take no notice of: somebody meant another run than this one.

    Args:
        name: Of the arm.
        given: The options that were given with a value of their own.

    Returns:
        Each such option with what it needs.
    """
    arm = find_arm(name)
    for option in CHECKED:
        if option in given and option not in arm.options:
            *others, last = (entry.name for entry in ARMS.values() if option in entry.options)
            yield option, f"--arm {', '.join(others)} or {last}" if others else f"--arm {last}"
    if SIMULATED_SENSORS not in arm.options:
        return
    if SIMULATED_SENSORS in given:
        for option in LIVE_SENSORS:
            if option in given:
                yield option, f"a run without {SIMULATED_SENSORS}"
    elif "--seed" in given:
        yield "--seed", f"simulated sensors: {SIMULATED_SENSORS}"
