"""The command `run`: simulated arms, and those that are not, with the dry run, the hazards, and the motion."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.calibrating import CalibrationOption
from testbench.cli.filtering import FiltersOption, JsonOption, parse_filters
from testbench.cli.options import RobotOption, complete_protocol, exit_code
from testbench.cli.output import progress_bar, say, say_check, say_evaluation, say_json, say_table, say_warning, say_warnings
from testbench.cli.tuning import TunedOption

if TYPE_CHECKING:
    from testbench.arm_pipeline import ArmSetup
    from testbench.estimation.filters import OrientationFilter
    from testbench.pipeline import Result
    from testbench.records.plan import Plan


class Speed(StrEnum):
    """How virtual time passes."""

    fast = "fast"
    realtime = "realtime"


class ArmDriver(StrEnum):
    """Arms that can be driven."""

    sim = "sim"
    ur = "ur"
    xarm = "xarm"
    replay = "replay"


def run(
    protocol: Annotated[
        str | None,
        typer.Argument(help="Protocol file, or the name of one that ships with the bench.", autocompletion=complete_protocol),
    ] = None,
    robot: RobotOption = None,
    arm: Annotated[ArmDriver, typer.Option("--arm", help="Which arm to drive.")] = ArmDriver.sim,
    host: Annotated[str | None, typer.Option("--host", help="Address of the arm's controller.")] = None,
    confirm_motion: Annotated[bool, typer.Option("--confirm-motion", help="Move the real arm; without it, a dry run.")] = False,
    hazards_checked: Annotated[
        bool, typer.Option("--hazards-checked", help="The physical hazards were looked at; they are not asked for.")
    ] = False,
    simulate_imus: Annotated[
        bool, typer.Option("--simulate-imus", help="Simulated sensors on the real arm's reported motion.")
    ] = False,
    serial: Annotated[
        list[str] | None, typer.Option("--serial", metavar="NAME=PORT:FORMAT", help="Live sensor, as for `record`.")
    ] = None,
    dot: Annotated[list[str] | None, typer.Option("--dot", metavar="NAME=ADDRESS", help="Live Xsens DOT.")] = None,
    kinematics: Annotated[
        Path | None, typer.Option("--kinematics", help="The arm's own DH corrections (YAML); without it, nominal values.")
    ] = None,
    log: Annotated[Path | None, typer.Option("--log", help="Recorded motion for --arm replay.")] = None,
    resume: Annotated[Path | None, typer.Option("--resume", help="Session to go on with.")] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulation.")] = 0,
    speed: Annotated[
        Speed, typer.Option("--speed", help="Virtual time: as fast as possible, or a second a second.")
    ] = Speed.fast,
    logs: Annotated[Path, typer.Option("--logs", help="Folder that sessions are made in.")] = Path("logs"),
    filters: FiltersOption = None,
    calibration: CalibrationOption = None,
    tuned: TunedOption = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Do not write report.html.")] = False,
    json: JsonOption = False,
) -> None:
    """Run a protocol: plan, check, move, record, estimate, evaluate, report. Keys: p pauses, r resumes, q stops."""
    from testbench.exceptions import InputError
    from testbench.pipeline import run as run_protocol

    names = parse_filters(filters)
    choice = ArmChoice(
        arm.value, host, log, simulate_imus, serial or [], dot or [], kinematics, confirm_motion, hazards_checked,
        seed, logs, names, calibration, tuned or [], not no_report, json,
    )  # fmt: skip
    if resume is not None:
        return _finish(resume_run(resume, protocol, choice), json)
    if protocol is None:
        raise InputError("name a protocol, or a session with --resume")
    if arm is not ArmDriver.sim:
        return _finish(run_real(protocol, robot, choice), json)
    with progress_bar(not json) as progress:
        result = run_protocol(
            protocol, robot, seed, speed.value, logs, names, not no_report, progress=progress,
            planned=None if json else say_warnings, calibrations=calibration, tunings=tuned or (), keys=not json,
        )  # fmt: skip
    return _finish(result, json)


def _finish(result: Result, json: bool) -> None:
    """Say what a run came to, and end with its exit code."""
    if json:
        say_json(result.to_dict())
    else:
        report = str(result.report) if result.report else None
        say_evaluation(result.evaluation, str(result.session.path), report)
    raise typer.Exit(exit_code(result.evaluation))


@dataclass
class ArmChoice:
    """What was asked for on the command line.

    Attributes:
        arm: ur, xarm or replay. host, log, simulate_imus, serial, dots: As the options. confirmed: --confirm-motion.
        hazards_checked: --hazards-checked. seed, logs, filters, calibration, tuned, with_report, json: As for every
        run.
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
    logs: Path = Path("logs")
    filters: list[str | OrientationFilter] | None = None
    calibration: Path | None = None
    tuned: list[Path] = field(default_factory=list)
    with_report: bool = True
    json: bool = False

    def setup(self) -> ArmSetup:
        """Arm and sensors."""
        from testbench.arm_pipeline import ArmSetup
        from testbench.exceptions import InputError
        from testbench.records.arm_calibration import load_arm_calibration

        if self.moves and not self.host:
            raise InputError(f"--arm {self.arm} needs --host, the address of the controller")
        if self.arm == "replay" and self.log is None:
            raise InputError("--arm replay needs --log, a session, a Parquet or a CSV file")
        log = self.log if self.arm == "replay" else None
        number = load_arm_calibration(self.kinematics).serial if self.kinematics is not None else None
        return ArmSetup(self.host or "", log, self.simulate_imus, self.serial, self.dots, self.seed, number, self.arm)

    @property
    def moves(self) -> bool:
        """Whether anything real moves."""
        return self.arm != "replay"


def run_real(protocol: str, robot: str | None, choice: ArmChoice) -> Result:
    """Run a protocol on a real arm, or show what it would do.

    Raises:
        InputError: The motion was not confirmed; nothing moved, nothing was connected.
    """
    from testbench.arm_pipeline import calibrated_robot, run_on_arm
    from testbench.pipeline import make_plan

    setup = choice.setup()
    own = calibrated_robot(protocol, robot, choice.kinematics) if choice.kinematics is not None else robot
    plan = make_plan(protocol, own, choice.filters, choice.tuned)
    if not choice.json:
        say_warnings(plan)
    options = _options(choice)
    if choice.moves:
        options.checklist = approve(plan, choice)
    with progress_bar(not choice.json) as progress:
        options.progress = progress
        return run_on_arm(
            plan, setup, options, choice.filters, choice.with_report, calibrations=choice.calibration, tunings=choice.tuned
        )


def resume_run(session: Path, protocol: str | None, choice: ArmChoice) -> Result:
    """Go on with a session whose run broke off."""
    from testbench.arm_pipeline import resume
    from testbench.exceptions import InputError
    from testbench.records.session import Session

    arm = Session(session).manifest.get("arm", {})
    if arm.get("driver") == "simulated":
        with progress_bar(not choice.json) as progress:
            return resume(
                session, None, None, protocol, choice.filters, choice.with_report, progress=progress,
                calibrations=choice.calibration, tunings=choice.tuned,
            )  # fmt: skip
    if choice.arm == "sim":
        raise InputError(f"{session} was run on a real arm; say --arm {arm.get('driver', 'ur')} and its options again")
    setup, options = choice.setup(), _options(choice)
    if choice.moves:
        _refuse_unconfirmed(choice)
        options.checklist = _hazards(choice)
    with progress_bar(not choice.json) as progress:
        options.progress = progress
        return resume(
            session, setup, options, protocol, choice.filters, choice.with_report, calibrations=choice.calibration,
            tunings=choice.tuned,
        )  # fmt: skip


def _options(choice: ArmChoice) -> Any:
    from testbench.execution.arm_run import ArmRunOptions

    return ArmRunOptions(choice.logs, choice.seed, keys=not choice.json, notify=None if choice.json else say_warning)


def approve(plan: Plan, choice: ArmChoice) -> dict[str, Any]:
    """Show the whole motion, and ask; without --confirm-motion that is all.

    Raises:
        InputError: The motion or a hazard was not confirmed.
    """
    if not choice.json:
        say_motion(plan)
    _refuse_unconfirmed(choice)
    return _hazards(choice)


def _refuse_unconfirmed(choice: ArmChoice) -> None:
    from testbench.exceptions import ArmRefused

    if not choice.confirmed:
        raise ArmRefused("nothing moved: this was a dry run; add --confirm-motion to move the arm")


def _hazards(choice: ArmChoice) -> dict[str, Any]:
    from testbench.exceptions import ArmRefused
    from testbench.execution.checklist import confirm_hazards

    if choice.hazards_checked:
        return confirm_hazards(lambda sentence: True) | {"by": "--hazards-checked"}
    if not sys.stdin.isatty():
        raise ArmRefused("nothing moves: the hazards must be confirmed on a terminal, or with --hazards-checked")
    print("Before the arm moves:", file=sys.stderr)
    return confirm_hazards(_ask) | {"by": "asked on the terminal"}


def _ask(sentence: str) -> bool:
    print(f"  {sentence} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def say_motion(plan: Plan) -> None:
    """Every step with its pose, so that a person can walk through it before anything moves."""
    import numpy as np

    from testbench.frames import NANOSECONDS

    rows = []
    for step in plan.steps:
        q = np.degrees(plan.trajectory.at(np.array([step.settled_ns]))[0][0])
        inside = (plan.trajectory.time_ns >= step.start_ns) & (plan.trajectory.time_ns <= step.settled_ns)
        fastest = float(np.degrees(np.abs(plan.trajectory.v[inside]).max())) if inside.any() else 0.0
        duration = (step.end_ns - step.start_ns) / NANOSECONDS
        rows.append([step.index, step.name, step.kind, " ".join(f"{angle:.1f}" for angle in q), fastest, duration])
    say_check(plan)
    title = f"Motion, from {' '.join(f'{angle:.1f}' for angle in np.degrees(plan.trajectory.q[0]))} deg"
    say_table(title, ["step", "name", "kind", "pose [deg]", "fastest joint [deg/s]", "duration [s]"], rows)
    say(f"{len(rows)} steps, about {plan.duration:.0f} s")
