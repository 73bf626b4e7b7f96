"""Which arm and which sensors were asked for on the command line."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbench.estimation.filters import OrientationFilter
    from testbench.pipeline.run import ArmSetup

TAKEN_BY = {
    "--serial": ("ur", "xarm", "replay"),
    "--dot": ("ur", "xarm", "replay"),
    "--simulate-imus": ("ur", "xarm", "replay"),
    "--kinematics": ("ur", "replay"),
    "--host": ("ur", "xarm"),
    "--confirm-motion": ("ur", "xarm"),
    "--hazards-checked": ("ur", "xarm"),
    "--log": ("replay",),
    "--speed": ("sim",),
}
"""The arms that take notice of an option."""


@dataclass
class ArmChoice:
    """What was asked for on the command line.

    Attributes:
        arm: sim, ur, xarm or replay.
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
        from testbench.exceptions import InputError
        from testbench.pipeline.run import ArmSetup
        from testbench.records.arm_calibration import load_arm_calibration

        if self.moves and not self.host:
            raise InputError(f"--arm {self.arm} needs --host, the address of the controller")
        if self.arm == "replay" and self.log is None:
            raise InputError("--arm replay needs --log, a session, a Parquet or a CSV file")
        log = self.log if self.arm == "replay" else None
        number = (
            load_arm_calibration(self.kinematics).serial if self.kinematics is not None else None
        )
        return ArmSetup(
            self.host or "",
            log,
            self.simulate_imus,
            self.serial,
            self.dots,
            self.seed,
            number,
            self.arm,
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

        takers = list(self._ignored())
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

    def _ignored(self) -> Iterator[tuple[str, str]]:
        """Options that were given and that the chosen arm ignores, each with what it needs."""
        given = {
            "--serial": bool(self.serial),
            "--dot": bool(self.dots),
            "--simulate-imus": self.simulate_imus,
            "--kinematics": self.kinematics is not None,
            "--host": self.host is not None,
            "--confirm-motion": self.confirmed,
            "--hazards-checked": self.hazards_checked,
            "--log": self.log is not None,
            "--speed": self.speed != "fast",
        }
        for option, arms in TAKEN_BY.items():
            if given[option] and self.arm not in arms:
                *others, last = arms
                yield option, f"--arm {', '.join(others)} or {last}" if others else f"--arm {last}"
        if self.arm != "sim" and self.simulate_imus:
            for option in ("--serial", "--dot"):
                if given[option]:
                    yield option, "a run without --simulate-imus"
        if self.arm != "sim" and self.seed != 0 and not self.simulate_imus:
            yield "--seed", "simulated sensors: --simulate-imus"

    @property
    def moves(self) -> bool:
        """Whether anything real moves."""
        return self.arm != "replay"

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
