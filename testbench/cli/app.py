"""The commands; each loads what it needs when it is called, so that --help stays quick."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.designing import design
from testbench.cli.emulating import emulate
from testbench.cli.exporting import export
from testbench.cli.importing import formats, import_files
from testbench.cli.noise import noise
from testbench.cli.output import progress_bar, say, say_check, say_evaluation, say_json, say_table, say_warnings
from testbench.cli.recording import record

if TYPE_CHECKING:
    from testbench.pipeline import Result
    from testbench.records.session import Session

app = typer.Typer(
    help="A robot arm turned into a metrology bench for inertial sensors.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class Speed(StrEnum):
    """How virtual time passes."""

    fast = "fast"
    realtime = "realtime"


class ArmDriver(StrEnum):
    """Arms that can be driven."""

    sim = "sim"
    ur = "ur"
    replay = "replay"


def _complete_protocol(incomplete: str) -> list[str]:
    from testbench.records.shipped import shipped_folder

    return [path.stem for path in shipped_folder("protocols").glob("*.yaml") if path.stem.startswith(incomplete)]


def _complete_robot(incomplete: str) -> list[str]:
    from testbench.records.robot import list_robots

    return [name for name in list_robots() if name.startswith(incomplete)]


ProtocolArgument = Annotated[
    str, typer.Argument(help="Protocol file, or the name of one that ships with the bench.", autocompletion=_complete_protocol)
]
RobotOption = Annotated[
    str | None,
    typer.Option("--robot", help="Robot name, robot.yaml or URDF, in place of the protocol's.", autocompletion=_complete_robot),
]
FiltersOption = Annotated[str | None, typer.Option("--filters", help="Orientation filters, separated by commas.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")]
SessionArgument = Annotated[Path, typer.Argument(help="Folder of a session.")]


def _version(shown: bool) -> None:
    if shown:
        from importlib.metadata import version

        say(f"testbench {version('imu-testbench')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")] = False,
) -> None:
    """Options that stand before the command."""


@app.command()
def check(protocol: ProtocolArgument, robot: RobotOption = None, json: JsonOption = False) -> None:
    """Plan a protocol and show how near it comes to every limit; nothing moves."""
    from testbench.pipeline import make_plan

    plan = make_plan(protocol, robot)
    if json:
        say_json({"protocol": plan.protocol.spec.name, "robot": plan.robot.name, "hash": plan.hash, **plan.check.to_dict()})
    else:
        say_check(plan)


@app.command()
def plan(
    protocol: ProtocolArgument,
    robot: RobotOption = None,
    out: Annotated[Path | None, typer.Option("--out", help="Parquet file to write the plan to.")] = None,
    json: JsonOption = False,
) -> None:
    """Plan a protocol: its steps with their times, and the plan's hash."""
    from testbench.exceptions import InputError
    from testbench.frames import NANOSECONDS
    from testbench.pipeline import make_plan

    the_plan = make_plan(protocol, robot)
    if out is not None:
        try:
            the_plan.save(out)
        except OSError as error:
            raise InputError(f"{out} cannot be written: {error.strerror}") from None
    rows = [
        [s.index, s.section, s.name, s.kind, s.start_ns / NANOSECONDS, s.settled_ns / NANOSECONDS, s.end_ns / NANOSECONDS]
        for s in the_plan.steps
    ]
    columns = ["step", "section", "name", "kind", "start [s]", "settled [s]", "end [s]"]
    if json:
        keys = ["index", "section", "name", "kind", "start_s", "settled_s", "end_s"]
        steps = [dict(zip(keys, row, strict=True)) for row in rows]
        say_json({"hash": the_plan.hash, "duration_s": the_plan.duration, "steps": steps, "file": str(out) if out else None})
    else:
        say_table(f"{the_plan.protocol.spec.name} on {the_plan.robot.name}", columns, rows)
        say(f"duration: {the_plan.duration:.1f} s")
        say(f"hash: {the_plan.hash}")


@app.command()
def run(
    protocol: Annotated[
        str | None,
        typer.Argument(help="Protocol file, or the name of one that ships with the bench.", autocompletion=_complete_protocol),
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
    no_report: Annotated[bool, typer.Option("--no-report", help="Do not write report.html.")] = False,
    json: JsonOption = False,
) -> None:
    """Run a protocol: plan, check, move, record, estimate, evaluate, report. Keys: p pauses, r resumes, q stops."""
    from testbench.cli.running import ArmChoice, resume_run, run_real
    from testbench.exceptions import InputError
    from testbench.pipeline import run as run_protocol

    names = _filter_names(filters)
    choice = ArmChoice(
        arm.value, host, log, simulate_imus, serial or [], dot or [], kinematics, confirm_motion, hazards_checked,
        seed, logs, names, not no_report, json,
    )  # fmt: skip
    if resume is not None:
        return _finish(resume_run(resume, protocol, choice), json)
    if protocol is None:
        raise InputError("name a protocol, or a session with --resume")
    if arm is not ArmDriver.sim:
        return _finish(run_real(protocol, robot, choice), json)
    with progress_bar(not json) as progress:
        result = run_protocol(
            protocol, robot, seed, speed.value, logs, names, not no_report, progress=progress, planned=say_warnings,
            keys=not json,
        )  # fmt: skip
    return _finish(result, json)


def _finish(result: Result, json: bool) -> None:
    """Say what a run came to, and end with its exit code."""
    if json:
        say_json(result.to_dict())
    else:
        report = str(result.report) if result.report else None
        say_evaluation(result.evaluation, str(result.session.path), report)
    raise typer.Exit(_exit_code(result.evaluation))


app.command()(record)


app.command("import")(import_files)
app.command()(export)
app.command()(noise)
app.add_typer(emulate, name="emulate")
app.command()(design)


@app.command()
def estimate(session: SessionArgument, filters: FiltersOption = None, json: JsonOption = False) -> None:
    """Align clocks and frames, run the filters, compute joint angles."""
    from testbench.estimation import estimate as make_estimate

    opened = _open(session)
    result = make_estimate(opened, _filter_names(filters))
    result.save(opened.path)
    rows = [
        [name, s.clock.method, 1e3 * s.clock.offset_s, s.clock.drift_ppm, s.clock.residual_deg_s, s.calibration.poses]
        for name, s in result.sensors.items()
    ]
    if json:
        summary = {name: {"clock": vars(s.clock), "filters": list(s.orientation)} for name, s in result.sensors.items()}
        say_json({"session": str(opened.path), "sensors": summary})
    else:
        columns = ["sensor", "clock by", "offset [ms]", "drift [ppm]", "residual [deg/s]", "calibration poses"]
        say_table("Estimate", columns, rows)


@app.command()
def evaluate(session: SessionArgument, filters: FiltersOption = None, json: JsonOption = False) -> None:
    """Compare the estimates with the truth and judge them."""
    from testbench.pipeline import judge_again

    opened = _open(session)
    result = judge_again(opened, _filter_names(filters))
    if json:
        say_json(result.to_dict())
    else:
        say_evaluation(result, str(opened.path), None)
    raise typer.Exit(_exit_code(result))


@app.command()
def report(session: SessionArgument, filters: FiltersOption = None, json: JsonOption = False) -> None:
    """Estimate, evaluate and write report.html anew."""
    from testbench.pipeline import analyse

    result = analyse(_open(session), _filter_names(filters))
    if json:
        say_json(result.to_dict())
    else:
        say(f"report: {result.report}")


@app.command()
def view(
    session: SessionArgument,
    web: Annotated[bool, typer.Option("--web", help="Serve the viewer to a browser on this machine.")] = False,
    save: Annotated[Path | None, typer.Option("--save", help="Write a .rrd recording instead of opening the viewer.")] = None,
    screenshot: Annotated[Path | None, typer.Option("--screenshot", help="Write a .png instead, without a screen.")] = None,
    json: JsonOption = False,
) -> None:
    """Open a session in rerun: the arm, the sensors, their signals and errors."""
    from testbench.pipeline import show

    opened = _open(session)
    written = show(opened, web=web, save=save, screenshot=screenshot)
    if json:
        say_json({"session": str(opened.path), "files": [str(path) for path in written]})
    else:
        for path in written:
            say(f"written: {path}")


@app.command()
def robots(json: JsonOption = False) -> None:
    """List the arms that can be asked for by name."""
    from testbench.records.robot import list_robots

    _listing("robots", "Robots", list_robots(), json)


@app.command()
def protocols(
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of protocol files instead.")] = False,
    json: JsonOption = False,
) -> None:
    """List the protocols that ship with the bench."""
    if schema:
        from testbench.records.protocol_schema import schema_text

        return say(schema_text().rstrip())
    from testbench.records.protocol_file import list_protocols

    return _listing("protocols", "Protocols", list_protocols(), json)


app.command()(formats)


@app.command()
def filters(json: JsonOption = False) -> None:
    """List the orientation filters."""
    from testbench.estimation.filters import FILTERS

    entries: list[dict[str, Any]] = [
        {"name": name, "needs": list(kind.needs), "parameters": kind.parameters, "source": kind.source}
        for name, kind in FILTERS.items()
    ]
    if json:
        say_json({"filters": entries})
    else:
        rows = [[e["name"], ", ".join(e["needs"]), _settings(e["parameters"]), e["source"]] for e in entries]
        say_table("Filters", ["name", "needs", "parameters", "source"], rows)


@app.command()
def sessions(
    logs: Annotated[Path, typer.Option("--logs", help="Folder that holds the sessions.")] = Path("logs"),
    json: JsonOption = False,
) -> None:
    """List the recorded sessions with their status."""
    from testbench.records.evaluation import FILE
    from testbench.records.session import damaged_sessions, list_sessions
    from testbench.records.storage import read_json

    rows = []
    for session in list_sessions(logs):
        file = session.path / FILE
        outcome = read_json(file)["outcome"] if file.is_file() else "-"
        duration = session.manifest.get("duration_s")
        rows.append(
            [
                session.name,
                session.manifest.get("kind"),
                "cut off" if session.status == "running" and not session.is_being_recorded else str(session.status),
                outcome,
                duration,
                session.manifest.get("started_utc"),
            ]
        )
    rows += [[name, None, "damaged", "-", None, None] for name in damaged_sessions(logs)]
    if json:
        keys = ["session", "kind", "status", "outcome", "duration_s", "started_utc"]
        say_json({"sessions": [dict(zip(keys, row, strict=True)) for row in rows]})
    else:
        say_table(f"Sessions in {logs}", ["session", "kind", "status", "outcome", "duration [s]", "started (UTC)"], rows)


@app.command()
def recover(session: SessionArgument, json: JsonOption = False) -> None:
    """Make a session readable whose run was cut off by a kill or a power cut."""
    from testbench.execution.recovery import recover as make_readable

    recovered = make_readable(_open(session))
    message = recovered.manifest.get("message") or "nothing to recover"
    if json:
        say_json({"session": str(recovered.path), "status": recovered.status, "message": message})
    else:
        say(f"{recovered.path}: {message}")


def _open(path: Path) -> Session:
    from testbench.records.session import Session

    return Session(path)


def _filter_names(text: str | None) -> list[str] | None:
    """Names of a comma-separated list, checked before anything moves."""
    if text is None:
        return None
    from testbench.estimation.filters import get_filter
    from testbench.exceptions import InputError

    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise InputError("--filters names no filter")
    for name in names:
        get_filter(name)
    return names


def _exit_code(evaluation: Any) -> int:
    """0 pass or no limits, 1 when a limit was broken or what it limits could not be measured."""
    limited = any(metric.outcome is not None for metric in evaluation.metrics)
    return int(limited and evaluation.outcome in {"fail", "not_measured"})


def _listing(key: str, title: str, entries: dict[str, str], json: bool) -> None:
    if json:
        say_json({key: [{"name": name, "description": text} for name, text in entries.items()]})
    else:
        say_table(title, ["name", "description"], [[name, text] for name, text in entries.items()])


def _settings(parameters: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in parameters.items()) or "defaults"
