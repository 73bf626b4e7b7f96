"""What the bench knows of a way to move an arm before its driver is loaded."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from testbench.exceptions import InputError
from testbench.records.session.arm_record import REPORTED_MOTION, ArmRecord

LIVE_SENSORS = ("--serial", "--dot")
SIMULATED_SENSORS = "--simulate-imus"
REAL_ARM = frozenset({"--host", "--confirm-motion", "--hazards-checked"})
"""Options of `run` that every arm at the other end of a network takes."""
SENSORS = frozenset({*LIVE_SENSORS, SIMULATED_SENSORS})
"""Options of `run` that every arm takes which is no model."""


@dataclass(frozen=True)
class WantedArm:
    """Which arm a person asked for.

    Attributes:
        host: Address of the controller.
        log: A recorded motion.
        serial: Number that the arm must have; any if None.
        seed: Of a simulated one.
    """

    host: str = ""
    log: Path | None = None
    serial: str | None = None
    seed: int = 0


@dataclass(frozen=True)
class ArmEntry:
    """A way to move an arm.

    Attributes:
        name: After `--arm`.
        title: What it is, for the help of `--arm`.
        made_by: `module:function`, called with a plan, a `WantedArm` and the session's time; loaded
            when it is needed, for drivers load client libraries.
        options: Options of `run` that it takes notice of, beside those of every run.
        needs: The option that it cannot do without, and what that is.
        commanded: Whether something real moves, which a person must have confirmed.
        provenance: Where its motion comes from, in words that go on after "followed".
        virtual: Whether it moves in virtual time: a session that broke off is completed in its own
            folder, as it began; any other arm does what is missing in a session of its own.
        recorded_as: Its name in the manifest; `name` if empty.
        extra: What must be installed beside the bench, as in `pip install 'imu-testbench[extra]'`.
        robots: A regular expression of the names of the robots that it drives.
        family: What people call these.
        notice: What a person must know before it moves; nothing if empty.
        remedies: What a person does after it has stopped, by the word for the cause.
        former_faults: Words for causes that earlier sessions hold, and those of today.
    """

    name: str
    title: str
    made_by: str
    options: frozenset[str] = frozenset()
    needs: tuple[str, str] | None = None
    commanded: bool = True
    provenance: str = REPORTED_MOTION
    virtual: bool = False
    recorded_as: str = ""
    extra: str = ""
    robots: str = ".*"
    family: str = "every arm"
    notice: str = ""
    remedies: Mapping[str, str] = field(default_factory=dict)
    former_faults: Mapping[str, str] = field(default_factory=dict)

    @property
    def record(self) -> ArmRecord:
        """What a session keeps of it."""
        return ArmRecord(self.recorded_as or self.name, self.provenance, self.commanded)

    def make(self, *arguments: Any) -> Any:
        """The arm; nothing is connected."""
        module, _, function = self.made_by.partition(":")
        return getattr(import_module(module), function)(*arguments)

    def drives(self, robot: str) -> bool:
        """Whether it is for arms of that name."""
        return re.fullmatch(self.robots, robot) is not None

    def refuse_other(self, robot: str) -> None:
        """Refuse an arm of another maker, by its name.

        Raises:
            InputError: The driver is for others.
        """
        if not self.drives(robot):
            raise InputError(f"--arm {self.name} drives {self.family}; the plan is for {robot}")

    def remedy(self, fault: str) -> str | None:
        """What a person does after a stop, by the word for its cause; None where the fault's own
        sentence says all.
        """
        return self.remedies.get(self.former_faults.get(fault, fault))
