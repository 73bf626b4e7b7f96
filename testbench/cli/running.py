"""The command `run`: simulated arms, and those that are not, with the dry run, the hazards, and the
motion.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.arm_choice import ArmChoice
from testbench.cli.calibrating import CalibrationOption
from testbench.cli.filtering import FiltersOption, JsonOption, parse_filters
from testbench.cli.options import RobotOption, complete_protocol, exit_code
from testbench.cli.output import (
    progress_bar,
    say,
    say_check,
    say_evaluation,
    say_json,
    say_note,
    say_table,
    say_warning,
    say_warnings,
)
from testbench.cli.tuning import TunedOption
from testbench.drivers.arms.catalogue import ARMS, SIM, refuse_other_maker

if TYPE_CHECKING:
    from testbench.arm_pipeline import ArmSetup
    from testbench.execution import RunOptions
    from testbench.pipeline import Result
    from testbench.records.plan import Plan, PlannedStep


class Speed(StrEnum):
    """How virtual time passes."""

    fast = "fast"
    realtime = "realtime"


if TYPE_CHECKING:
    ArmName = str
else:
    ArmName = StrEnum("ArmName", {name: name for name in ARMS})
ARM_HELP = "Which arm to drive: " + ", ".join(f"{arm.name} {arm.title}" for arm in ARMS.values())


def run(
    protocol: Annotated[
        str | None,
        typer.Argument(
            help="Protocol file, or the name of one that ships with the bench.",
            autocompletion=complete_protocol,
        ),
    ] = None,
    robot: RobotOption = None,
    arm: Annotated[ArmName, typer.Option("--arm", help=ARM_HELP)] = ArmName("sim"),
    host: Annotated[
        str | None, typer.Option("--host", help="Address of the arm's controller.")
    ] = None,
    confirm_motion: Annotated[
        bool, typer.Option("--confirm-motion", help="Move the real arm; without it, a dry run.")
    ] = False,
    hazards_checked: Annotated[
        bool,
        typer.Option(
            "--hazards-checked", help="The physical hazards were looked at; they are not asked for."
        ),
    ] = False,
    simulate_imus: Annotated[
        bool,
        typer.Option(
            "--simulate-imus", help="Simulated sensors on the real arm's reported motion."
        ),
    ] = False,
    serial: Annotated[
        list[str] | None,
        typer.Option("--serial", metavar="NAME=PORT:FORMAT", help="Live sensor, as for `record`."),
    ] = None,
    dot: Annotated[
        list[str] | None, typer.Option("--dot", metavar="NAME=ADDRESS", help="Live Xsens DOT.")
    ] = None,
    kinematics: Annotated[
        Path | None,
        typer.Option(
            "--kinematics", help="The arm's own DH corrections (YAML); without it, nominal values."
        ),
    ] = None,
    log: Annotated[
        Path | None, typer.Option("--log", help="Recorded motion for --arm replay.")
    ] = None,
    resume: Annotated[Path | None, typer.Option("--resume", help="Session to go on with.")] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulation.")] = 0,
    speed: Annotated[
        Speed,
        typer.Option("--speed", help="Virtual time: as fast as possible, or a second a second."),
    ] = Speed.fast,
    logs: Annotated[Path, typer.Option("--logs", help="Folder that sessions are made in.")] = Path(
        "logs"
    ),
    filters: FiltersOption = None,
    calibration: CalibrationOption = None,
    tuned: TunedOption = None,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Do not write report.html.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Run a protocol: plan, check, move, record, estimate, evaluate, report. Keys: p pauses, r
    resumes, q stops.
    """
    from testbench.exceptions import InputError
    from testbench.pipeline import run as run_protocol

    names = parse_filters(filters)
    choice = ArmChoice(
        str(arm),
        host,
        log,
        simulate_imus,
        serial or [],
        dot or [],
        kinematics,
        confirm_motion,
        hazards_checked,
        seed,
        speed.value,
        logs,
        names,
        calibration,
        tuned or [],
        not no_report,
        json,
    )
    if resume is not None:
        return _finish(resume_run(resume, protocol, robot, choice), json)
    choice.refuse_ignored()
    if protocol is None:
        raise InputError("name a protocol, or a session with --resume")
    if arm != SIM.name:
        return _finish(run_real(protocol, robot, choice), json)
    with (
        progress_bar(not json) as progress,
        _resumable(lambda path: shlex.join(["testbench", "run", "--resume", str(path)])),
    ):
        result = run_protocol(
            protocol,
            robot,
            seed,
            speed.value,
            logs,
            names,
            not no_report,
            progress=progress,
            planned=None if json else say_warnings,
            calibrations=calibration,
            tunings=tuned or (),
            keys=not json,
            say=(lambda line: None) if progress is None else progress.say,
        )
    return _finish(result, json)


def _finish(result: Result, json: bool) -> None:
    """Say what a run came to, and end with its exit code."""
    if json:
        say_json(result.to_dict())
    else:
        report = str(result.report) if result.report else None
        say_evaluation(
            result.evaluation, str(result.session.path), report, result.session.simulated
        )
    raise typer.Exit(exit_code(result.evaluation))


def run_real(protocol: str, robot: str | None, choice: ArmChoice) -> Result:
    """Run a protocol on a real arm, or show what it would do.

    Raises:
        InputError: The motion was not confirmed; nothing moved, nothing was connected.
    """
    from testbench.arm_pipeline import calibrated_robot, run_on_arm
    from testbench.pipeline import make_plan

    setup = choice.setup()
    own = (
        calibrated_robot(protocol, robot, choice.kinematics)
        if choice.kinematics is not None
        else robot
    )
    plan = make_plan(protocol, own, choice.filters, choice.tuned)
    refuse_other_maker(choice.arm, plan.robot.name)
    if not choice.json:
        say_warnings(plan)
    checklist = approve(plan, choice, setup) if choice.moves else None
    with _shown(choice, checklist) as options:
        return run_on_arm(
            plan,
            setup,
            options,
            choice.filters,
            choice.with_report,
            calibrations=choice.calibration,
            tunings=choice.tuned,
        )


@contextmanager
def _shown(choice: ArmChoice, checklist: dict[str, Any] | None) -> Iterator[RunOptions]:
    """The options of a run on a real arm, which show it."""
    from testbench.execution import RunOptions

    options = RunOptions(choice.logs, choice.seed, checklist=checklist)
    with progress_bar(not choice.json, "connecting") as display, _resumable(choice.resume_line):
        if display is not None:
            options = replace(
                options, keys=True, progress=display, say=display.say, notify=say_warning
            )
        yield options


@contextmanager
def _resumable(line: Callable[[Path], str]) -> Iterator[None]:
    """Give an error after a session was made the line that goes on with it."""
    from testbench.exceptions import BenchError
    from testbench.records.session import Session

    try:
        yield
    except BenchError as error:
        if isinstance(error.session, Session):
            error.add_note(f"go on: {line(error.session.path)}")
        raise


def resume_run(session: Path, protocol: str | None, robot: str | None, choice: ArmChoice) -> Result:
    """Go on with a session whose run broke off."""
    from testbench.arm_pipeline import prepare_resume, resume
    from testbench.exceptions import InputError
    from testbench.records.session import Session

    arm = Session(session).manifest.arm.record
    simulated = arm is None or arm.simulated  # one without an arm is refused below
    driver = SIM.name if arm is None or simulated else arm.driver
    if choice.arm == SIM.name and not simulated:
        raise InputError(
            f"{session} was run on a real arm; say --arm {driver} and its options again"
        )
    if choice.arm != driver:
        own = (
            "on a simulated arm; leave --arm away"
            if simulated
            else f"with --arm {driver}; say that"
        )
        raise InputError(f"{session} was run {own} to go on")
    choice.refuse_ignored(resumed=True)
    setup = None if simulated else choice.setup()
    prepared = prepare_resume(session, protocol, robot, choice.filters, choice.tuned)
    if not choice.json:
        say_note(prepared.note)
    checklist = None
    if setup is not None and choice.moves:
        checklist = approve(prepared.plan, choice, setup, prepared.steps)
    with ExitStack() as stack:
        progress = options = None
        if simulated:
            progress = stack.enter_context(progress_bar(not choice.json))
        else:
            options = stack.enter_context(_shown(choice, checklist))
        return resume(
            session,
            setup,
            options,
            filters=choice.filters,
            with_report=choice.with_report,
            progress=progress,
            calibrations=choice.calibration,
            tunings=choice.tuned,
            prepared=prepared,
        )


def approve(
    plan: Plan, choice: ArmChoice, setup: ArmSetup, steps: list[PlannedStep] | None = None
) -> dict[str, Any]:
    """Show the whole motion, and ask; without --confirm-motion that is all.

    A person is asked last, when arm and options are such that the run will not be refused
    afterwards.

    Args:
        plan: The motion.
        choice: As asked for.
        setup: As asked for.
        steps: Those of its steps to do; all if None.

    Raises:
        InputError: The arm was refused, or the motion or a hazard was not confirmed.
    """
    if not choice.json:
        say_motion(plan, steps)
    _refuse_unconfirmed(choice)
    if not choice.hazards_checked:
        from testbench.arm_pipeline import look_at_arm

        _refuse_without_terminal()
        look_at_arm(plan, setup, steps)
    return _hazards(choice)


def _refuse_unconfirmed(choice: ArmChoice) -> None:
    from testbench.exceptions import ArmRefused

    if not choice.confirmed:
        raise ArmRefused("nothing moved: this was a dry run; add --confirm-motion to move the arm")


def _refuse_without_terminal() -> None:
    from testbench.exceptions import ArmRefused

    if not sys.stdin.isatty():
        raise ArmRefused(
            "nothing moves: the hazards must be confirmed on a terminal, or with --hazards-checked"
        )


def _hazards(choice: ArmChoice) -> dict[str, Any]:
    from testbench.execution.checklist import confirm_hazards

    if choice.hazards_checked:
        return confirm_hazards(lambda sentence: True) | {"by": "--hazards-checked"}
    print("Before the arm moves:", file=sys.stderr)
    return confirm_hazards(_ask) | {"by": "asked on the terminal"}


def _ask(sentence: str) -> bool:
    """Ask on the terminal; what was typed before the question stands there is no answer to it."""
    import termios

    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
    print(f"  {sentence} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def say_motion(plan: Plan, steps: list[PlannedStep] | None = None) -> None:
    """Every motion with its pose, so that a person can walk through it before anything moves;
    `steps`: those to do.
    """
    import numpy as np

    from testbench.execution.motion_table import MotionRow, motion_rows

    def where(row: MotionRow) -> str:
        swings = [
            f"{joint.removesuffix('_joint')} {low:.1f}..{high:.1f}"
            for joint, (low, high) in row.swings_deg.items()
        ]
        return ", ".join(swings) or " ".join(f"{angle:.1f}" for angle in row.pose_deg)

    motions = motion_rows(plan, steps)
    say_check(plan)
    title = (
        f"Motion, from {' '.join(f'{angle:.1f}' for angle in np.degrees(plan.trajectory.q[0]))} deg"
    )
    say_table(
        title,
        [
            "step",
            "name",
            "kind",
            "pose, of a sweep its turns [deg]",
            "fastest joint [deg/s]",
            "duration [s]",
        ],
        [[m.index, m.name, m.kind, where(m), m.speed_deg_s, m.duration_s] for m in motions],
    )
    count = sum(row.index is not None for row in motions)
    of_all = "" if steps is None else f" of {len(plan.steps)}, reference and calibration once more,"
    say(f"{count} steps{of_all} about {sum(row.duration_s for row in motions):.0f} s")
