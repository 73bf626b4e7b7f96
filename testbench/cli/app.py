"""The commands; each loads what it needs when it is called, so that --help stays quick."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.auditing import audit
from testbench.cli.calibrating import calibrate, calibrations
from testbench.cli.certifying import certificate
from testbench.cli.comparing import compare
from testbench.cli.describing import say_description, say_plateaus
from testbench.cli.designing import design
from testbench.cli.emulating import emulate
from testbench.cli.examples import example
from testbench.cli.exporting import export
from testbench.cli.filtering import filters
from testbench.cli.gait import gait
from testbench.cli.importing import formats, import_files
from testbench.cli.noise import noise
from testbench.cli.once import options_once
from testbench.cli.options import (
    CalibrationOption,
    CompareOption,
    FiltersOption,
    InjectOption,
    JsonOption,
    JunitOption,
    MarkdownOption,
    NoVerifyOption,
    PlateausOption,
    ProtocolArgument,
    RepeatsOption,
    ReturnedOption,
    RobotOption,
    SequenceOption,
    SessionArgument,
    SetOption,
    TunedOption,
    analysis_request,
    beside,
    described_by,
    exit_code,
    injected_errors,
    optional,
    session_of,
    summed_up,
    typed_plateaus,
)
from testbench.cli.output import (
    in_ranges,
    say,
    say_check,
    say_evaluation,
    say_findings,
    say_json,
    say_table,
    say_warnings,
)
from testbench.cli.recording import record
from testbench.cli.running import run
from testbench.cli.sessions import sessions
from testbench.cli.simulating import simulate
from testbench.cli.studying import study
from testbench.cli.tuning import tune
from testbench.cli.verifying import seal, verify
from testbench.cli.viewing import view

app = typer.Typer(
    help="A robot arm turned into a metrology bench for inertial sensors.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(shown: bool) -> None:
    if shown:
        from importlib.metadata import version

        say(f"testbench {version('imu-testbench')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options that stand before the command."""


@app.command()
def check(protocol: ProtocolArgument, robot: RobotOption = None, json: JsonOption = False) -> None:
    """Plan a protocol and show how near it comes to every limit; nothing moves."""
    from testbench.pipeline.prepared import make_plan
    from testbench.pipeline.request import Request, RunRequest

    plan = make_plan(Request(run=RunRequest(protocol=protocol, robot=robot)))
    if json:
        say_json(
            {
                "protocol": plan.protocol.spec.name,
                "robot": plan.robot.name,
                "hash": plan.hash,
                **plan.check.to_dict(),
            }
        )
    else:
        say_check(plan)


@app.command()
def plan(
    protocol: ProtocolArgument,
    robot: RobotOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Parquet file to write the plan to.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Plan a protocol: its steps with their times, and the plan's hash."""
    from testbench.exceptions import InputError
    from testbench.frames import NANOSECONDS
    from testbench.pipeline.prepared import make_plan
    from testbench.pipeline.request import Request, RunRequest
    from testbench.records.disk.replacing import stored_where_asked

    if out is not None and not out.parent.is_dir():
        raise InputError(f"{out} cannot be written: there is no folder {out.parent}")
    the_plan = make_plan(Request(run=RunRequest(protocol=protocol, robot=robot)))
    if not json:
        say_warnings(the_plan)
    if out is not None:
        with stored_where_asked(out):
            the_plan.save(out)
    rows = [
        [
            s.index,
            s.section,
            s.name,
            s.kind,
            s.start_ns / NANOSECONDS,
            s.settled_ns / NANOSECONDS,
            s.end_ns / NANOSECONDS,
        ]
        for s in the_plan.steps
    ]
    columns = ["step", "section", "name", "kind", "start [s]", "settled [s]", "end [s]"]
    if json:
        keys = ["index", "section", "name", "kind", "start_s", "settled_s", "end_s"]
        steps = [dict(zip(keys, row, strict=True)) for row in rows]
        told = {
            "hash": the_plan.hash,
            "duration_s": the_plan.duration,
            "warnings": the_plan.check.warnings,
        }
        say_json(told | {"steps": steps, "file": str(out) if out else None})
    else:
        say_table(f"{the_plan.protocol.spec.name} on {the_plan.robot.name}", columns, rows)
        say(f"duration: {the_plan.duration:.1f} s")
        say(f"hash: {the_plan.hash}")


app.command()(run)
app.command()(record)


app.command("import")(import_files)
app.command()(export)
app.command()(gait)
app.command()(noise)
app.command()(simulate)
app.command()(example)
app.command()(audit)
app.command()(calibrate)
app.command()(calibrations)
app.add_typer(certificate, name="certificate")
app.add_typer(emulate, name="emulate")
app.command()(design)
app.command()(study)
app.command()(tune)
app.command()(verify)
app.command()(seal)


@app.command()
def estimate(
    session: SessionArgument,
    filters: FiltersOption = None,
    parameters: SetOption = None,
    calibration: CalibrationOption = None,
    tuned: TunedOption = None,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Align clocks and frames, run the filters, compute joint angles."""
    from testbench.pipeline.kept_estimate import make_estimate

    opened = session_of(session, no_verify)
    result = make_estimate(opened, analysis_request(filters, parameters, calibration, tuned))
    rows = [
        [
            name,
            s.clock.method,
            1e3 * s.clock.offset_s,
            s.clock.drift_ppm,
            s.clock.residual_deg_s,
            s.calibration.poses,
        ]
        for name, s in result.sensors.items()
    ]
    if json:
        summary = {
            name: {"clock": vars(s.clock), "filters": list(s.orientation)}
            for name, s in result.sensors.items()
        }
        say_json({"session": str(opened.path), "sensors": summary})
    else:
        columns = [
            "sensor",
            "clock by",
            "offset [ms]",
            "drift [ppm]",
            "residual [deg/s]",
            "calibration poses",
        ]
        say_table("Estimate", columns, rows)


@app.command()
def evaluate(
    session: SessionArgument,
    filters: FiltersOption = None,
    parameters: SetOption = None,
    calibration: CalibrationOption = None,
    tuned: TunedOption = None,
    compare: CompareOption = None,
    sequence: SequenceOption = None,
    returned: ReturnedOption = False,
    repeats: RepeatsOption = None,
    inject: InjectOption = None,
    plateaus: PlateausOption = None,
    markdown: MarkdownOption = None,
    junit: JunitOption = None,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Compare the estimates with the truth and judge them."""
    from testbench.pipeline.analyse import examine, judge_again, judge_plateaus

    opened = session_of(session, no_verify)
    asked = analysis_request(filters, parameters, calibration, tuned)
    wanted = beside(described_by(asked, compare, sequence, returned), repeats, no_verify)
    errors = injected_errors(inject or [])
    typed = typed_plateaus(plateaus or [])
    wanted = summed_up(wanted, markdown, junit)
    result = examine(opened, wanted, errors).evaluation if errors else judge_again(opened, wanted)
    rows = judge_plateaus(opened, wanted, errors, typed)  # of the estimate that is kept by now
    if json:
        say_json(result.to_dict() | ({"plateaus": [vars(row) for row in rows]} if typed else {}))
    else:
        say_plateaus(rows)
        say_description(result)
        say_evaluation(result, str(opened.path), None, opened.simulated)
        for error in errors:
            off = ", ".join(f"{value:g}" for value in error.yaw_pitch_roll_deg)
            say(f"put in, and kept nowhere: {error.of} of {error.sensor} off by {off} deg")
    raise typer.Exit(exit_code(result))


app.command()(compare)


@app.command()
def report(
    session: SessionArgument,
    filters: FiltersOption = None,
    parameters: SetOption = None,
    calibration: CalibrationOption = None,
    tuned: TunedOption = None,
    compare: CompareOption = None,
    sequence: SequenceOption = None,
    returned: ReturnedOption = False,
    repeats: RepeatsOption = None,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Print it to report.pdf as well, by a browser.")
    ] = False,
    band: Annotated[
        Path | None,
        typer.Option(
            "--band",
            help="Normal band behind average cycles: a YAML file (docs/joint_angles.md), or "
            "`gait_boys`.",
        ),
    ] = None,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Estimate, evaluate and write report.html anew."""
    from testbench.pipeline.analyse import analyse

    opened = session_of(session, no_verify)
    asked = analysis_request(filters, parameters, calibration, tuned)
    wanted = beside(described_by(asked, compare, sequence, returned), repeats, no_verify)
    wanted = wanted.model_copy(update={"printed": pdf, "band": optional(band)})
    result = analyse(opened, wanted)
    if json:
        say_json(result.to_dict())
    else:
        say_findings(result.evaluation.findings)
        say(f"report: {result.report}")
        if result.printed:
            say(f"printed: {result.printed}")


app.command()(view)


@app.command()
def robots(json: JsonOption = False) -> None:
    """List the arms that can be asked for by name."""
    from testbench.records.specs.robot import list_robots

    _listing("robots", "Robots", list_robots(), json)


@app.command()
def protocols(
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of protocol files instead.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """List the protocols that ship with the bench."""
    if schema:
        from testbench.records.specs.protocol_schema import schema_text

        return say(schema_text().rstrip())
    from testbench.records.specs.protocol_file import list_protocols

    return _listing("protocols", "Protocols", list_protocols(), json)


app.command()(formats)


app.command()(filters)


app.command()(sessions)


@app.command()
def recover(session: SessionArgument, json: JsonOption = False) -> None:
    """Make a session readable whose run was cut off by a kill or a power cut."""
    from testbench.execution.recovery import recover as make_readable
    from testbench.records.session.earlier_steps import unfinished_steps
    from testbench.records.session.session import Session

    opened = Session(session)
    recovered = make_readable(opened)
    message = recovered.manifest.message or "nothing to recover"
    if opened.status != "running":
        before = opened.manifest.message
        message = f"nothing to recover; it was closed as {opened.status}" + (
            f" before: {before}" if before else ""
        )
    missing = unfinished_steps(recovered)
    if json:
        told = {
            "session": str(recovered.path),
            "status": recovered.status,
            "message": message,
            "missing_steps": missing,
        }
        say_json(told)
        return
    say(f"{recovered.path}: {message}")
    if missing:
        say(
            f"missing: {len(missing)} of {recovered.manifest.plan.check.steps} steps: "
            f"{in_ranges(missing)}"
        )
        say(
            f"go on: testbench run --resume {recovered.path}, on a real arm with --arm and its "
            "options"
        )


options_once(app)


def _listing(key: str, title: str, entries: dict[str, str], json: bool) -> None:
    if json:
        say_json({key: [{"name": name, "description": text} for name, text in entries.items()]})
    else:
        say_table(title, ["name", "description"], [[name, text] for name, text in entries.items()])
