"""The command `run`: what was typed becomes a request, and a person sees and is asked."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.auditing import say_axes, say_timing
from testbench.cli.describing import say_description
from testbench.cli.options import (
    PROTOCOL,
    CalibrationOption,
    FiltersOption,
    JsonOption,
    JunitOption,
    LogsOption,
    MarkdownOption,
    RobotOption,
    SetOption,
    TunedOption,
    analysis_request,
    analysis_words,
    exit_code,
    optional,
    summed_up,
)
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
from testbench.cli.viewing import Viewing, ViewOption, shown_beside
from testbench.drivers.arms.catalogue import ARMS, SIM, find_arm

if TYPE_CHECKING:
    from testbench.cli.output import RunDisplay
    from testbench.pipeline.analyse import Result
    from testbench.pipeline.prepared import Prepared
    from testbench.pipeline.request import Request
    from testbench.pipeline.watcher import Consent, Watcher
    from testbench.records.session.plan import Plan, PlannedStep


class Speed(StrEnum):
    """How virtual time passes."""

    fast = "fast"
    realtime = "realtime"


if TYPE_CHECKING:
    ArmName = str
else:
    ArmName = StrEnum("ArmName", {name: name for name in ARMS})
ARM_HELP = "Which arm to drive: " + ", ".join(f"{arm.name} {arm.title}" for arm in ARMS.values())


# Long by its options, one parameter each, and the request that holds them.
def run(
    protocol: Annotated[str | None, PROTOCOL] = None,
    robot: RobotOption = None,
    arm: Annotated[ArmName, typer.Option("--arm", help=ARM_HELP)] = ArmName(SIM.name),
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
    logs: LogsOption = Path("logs"),
    filters: FiltersOption = None,
    parameters: SetOption = None,
    calibration: CalibrationOption = None,
    tuned: TunedOption = None,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Do not write report.html.")
    ] = False,
    view: ViewOption = None,
    table: Annotated[
        bool, typer.Option("--table", help="Show the tables of all numbers, too.")
    ] = False,
    markdown: MarkdownOption = None,
    junit: JunitOption = None,
    json: JsonOption = False,
) -> None:
    """Run a protocol: plan, check, move, record, estimate, evaluate, report. Keys: p pauses, r
    resumes, q stops.
    """
    from testbench.pipeline.request import ArmRequest, Request, RunRequest
    from testbench.pipeline.run import run as carry_out

    pace: Any = speed.value
    asked = Request(
        run=RunRequest(
            protocol=protocol,
            robot=robot,
            arm=ArmRequest(
                driver=str(arm),
                host=host or "",
                log=optional(log),
                kinematics=optional(kinematics),
                serial=tuple(serial or ()),
                dots=tuple(dot or ()),
                simulate_imus=simulate_imus,
            ),
            seed=seed,
            speed=pace,
            logs=str(logs),
            resume=optional(resume),
        ),
        analysis=summed_up(
            analysis_request(filters, parameters, calibration, tuned, not no_report),
            markdown,
            junit,
        ),
    )
    with _resumable(asked), progress_bar(not json) as display:
        consent = consent_of(confirm_motion, hazards_checked)
        result = carry_out(asked, _watcher(display, consent, view))
    _finish(result, json, table)


def _finish(result: Result, json: bool, table: bool) -> None:
    """Say what a run came to, and end with its exit code."""
    if json:
        say_json(result.to_dict())
    else:
        report = str(result.report) if result.report else None
        say_description(result.evaluation)
        if not result.estimate.joints and not result.estimate.chain:
            # a protocol that asks of sensors alone: which axis is which, and when it was read
            say_timing(result.estimate.sensors)
            say_axes(result.estimate.sensors)
        say_evaluation(
            result.evaluation, str(result.session.path), report, result.session.simulated, table
        )
    raise typer.Exit(exit_code(result.evaluation))


@contextmanager
def _resumable(asked: Request) -> Iterator[None]:
    """Give an error after a session was made the line that goes on with it."""
    from testbench.exceptions import BenchError
    from testbench.records.session.session import Session

    try:
        yield
    except BenchError as error:
        if isinstance(error.session, Session):
            error.add_note(f"go on: {resume_line(asked, error.session.path)}")
        raise


def _watcher(display: RunDisplay | None, consent: Consent, view: Viewing | None) -> Watcher:
    """Shows a run on the terminal, and in a viewer; without a display it is allowed what the person
    allows, and no more.
    """
    from testbench.pipeline.watcher import Watcher, nothing

    if display is None:
        return Watcher(consent=consent, opened=shown_beside(view, say_note) or nothing)
    return Watcher(
        prepared=_say_prepared,
        motion=lambda prepared: say_motion(prepared.plan, prepared.steps),
        progress=display,
        say=display.say,
        notify=say_warning,
        keys=True,
        consent=consent,
        opened=shown_beside(view, display.say) or nothing,
    )


def _say_prepared(prepared: Prepared) -> None:
    """By which protocol a session goes on, or what a plan warns of."""
    if prepared.resumed is not None:
        say_note(prepared.note)
        words = analysis_words(prepared.analysis.asked)
        if words:
            say_note(f"analysed with {shlex.join(words)}")
    else:
        say_warnings(prepared.plan)


def consent_of(confirm_motion: bool, hazards_checked: bool) -> Consent:
    """What a person allows by the options of `run`, and at this terminal."""
    from testbench.pipeline.watcher import Consent

    return Consent(confirm_motion, hazards_checked, _Asker() if sys.stdin.isatty() else None)


class _Asker:
    """Asks on the terminal; what was typed before a question stands there is no answer to it."""

    def __init__(self) -> None:
        self._introduced = False

    def __call__(self, sentence: str) -> bool:
        """Whether a person confirms a sentence."""
        import termios

        if not self._introduced:
            print("Before the arm moves:", file=sys.stderr)
            self._introduced = True
        if sys.stdin.isatty():
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
        print(f"  {sentence} [y/N] ", end="", file=sys.stderr, flush=True)
        return sys.stdin.readline().strip().lower() in {"y", "yes"}


def resume_line(asked: Request, session: Path) -> str:
    """The command that goes on with a session, with the same arm, sensors and analysis.

    The hazards will be asked for.
    """
    words, arm = ["testbench", "run", "--resume", str(session)], asked.run.arm
    if asked.run.resume is not None and asked.run.protocol is not None:
        words.append(asked.run.protocol)
    words += ["--arm", arm.driver] if arm.driver != SIM.name else []
    if find_arm(arm.driver).virtual:  # as it began, in its own folder
        return shlex.join([*words, *analysis_words(asked.analysis)])
    words += ["--host", arm.host] if arm.host else []
    words += ["--log", arm.log] if arm.log is not None else []
    words += ["--confirm-motion"] if find_arm(arm.driver).commanded else []
    words += ["--simulate-imus"] if arm.simulate_imus else []
    words += [word for text in arm.serial for word in ("--serial", text)]
    words += [word for text in arm.dots for word in ("--dot", text)]
    words += ["--kinematics", arm.kinematics] if arm.kinematics is not None else []
    words += ["--logs", asked.run.logs] if asked.run.logs != "logs" else []
    words += ["--seed", str(asked.run.seed)] if asked.run.seed else []
    return shlex.join([*words, *analysis_words(asked.analysis)])


def say_motion(plan: Plan, steps: list[PlannedStep] | None = None) -> None:
    """Every motion with its pose, so that a person can walk through it before anything moves.

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
