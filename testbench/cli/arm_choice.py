"""Which arm and which sensors were asked for on the command line."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from testbench.drivers.arms.catalogue import find_arm, ignored_options, refuse_missing

if TYPE_CHECKING:
    from testbench.arm_pipeline import ArmSetup
    from testbench.estimation.filters import OrientationFilter


@dataclass
class ArmChoice:
    """What was asked for on the command line.

    Attributes:
        arm: Its name in the catalogue of arms.
        host: As the options.
        log: As the options.
        simulate_imus: As the options.
        serial: As the options.
        dots: As the options.
        confirmed: --confirm-motion.
        hazards_checked: --hazards-checked.
        seed: As for every run.
        speed: As for every run.
        logs: As for every run.
        filters: As for every run.
        calibration: As for every run.
        tuned: As for every run.
        with_report: As for every run.
        json: As for every run.
    """

    arm: str
    host: str | None = None
    log: Path | None = None
    simulate_imus: bool = False
    serial: list[str] = field(default_factory=list)
    dots: list[str] = field(default_factory=list)
    kinematics: Path | None = None
    confirmed: bool = False
    hazards_checked: bool = False
    seed: int = 0
    speed: str = "fast"
    logs: Path = Path("logs")
    filters: list[str | OrientationFilter] | None = None
    calibration: Path | None = None
    tuned: list[Path] = field(default_factory=list)
    with_report: bool = True
    json: bool = False

    def setup(self) -> ArmSetup:
        """Arm and sensors."""
        from testbench.arm_pipeline import ArmSetup
        from testbench.records.arm_calibration import load_arm_calibration

        refuse_missing(self.arm, self._given())
        number = (
            load_arm_calibration(self.kinematics).serial if self.kinematics is not None else None
        )
        return ArmSetup(
            self.arm,
            self.host or "",
            self.log,
            self.simulate_imus,
            self.serial,
            self.dots,
            self.seed,
            number,
        )

    def refuse_ignored(self, resumed: bool = False) -> None:
        """Refuse options that the chosen arm would not take notice of: somebody meant another run
        than this one.

        Args:
            resumed: Whether a session is gone on with; a simulated one keeps its seed, its rhythm
                and its folder.

        Raises:
            InputError: Names each such option, and the arms that take it.
        """
        from testbench.exceptions import InputError

        takers = list(ignored_options(self.arm, self._given()))
        if resumed and self.arm == "sim":
            kept = {
                "--seed": self.seed != 0,
                "--speed": self.speed != "fast",
                "--logs": self.logs != Path("logs"),
            }
            takers += [
                (option, "a new run: a simulated session goes on as it began")
                for option, given in kept.items()
                if given
            ]
        if takers:
            raise InputError("; ".join(f"{option} needs {needed}" for option, needed in takers))

    def _given(self) -> set[str]:
        """The options that were given, of those that not every arm takes."""
        given = {
            "--serial": self.serial,
            "--dot": self.dots,
            "--simulate-imus": self.simulate_imus,
            "--kinematics": self.kinematics,
            "--host": self.host,
            "--confirm-motion": self.confirmed,
            "--hazards-checked": self.hazards_checked,
            "--log": self.log,
            "--speed": self.speed != "fast",
            "--seed": self.seed != 0,
        }
        return {option for option, value in given.items() if value}

    @property
    def moves(self) -> bool:
        """Whether anything real moves."""
        return find_arm(self.arm).commanded

    def resume_line(self, session: Path) -> str:
        """The command that goes on with a session, with the same arm and sensors; the hazards will
        be asked for.
        """
        words = ["testbench", "run", "--resume", str(session), "--arm", self.arm]
        words += ["--host", self.host] if self.host else []
        words += ["--log", str(self.log)] if self.log is not None else []
        words += ["--confirm-motion"] if self.moves else []
        words += ["--simulate-imus"] if self.simulate_imus else []
        words += [word for text in self.serial for word in ("--serial", text)]
        words += [word for text in self.dots for word in ("--dot", text)]
        words += ["--kinematics", str(self.kinematics)] if self.kinematics is not None else []
        words += ["--logs", str(self.logs)] if self.logs != Path("logs") else []
        words += ["--seed", str(self.seed)] if self.seed else []
        return shlex.join(words)
