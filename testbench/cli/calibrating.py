"""The commands `calibrate` and `calibrations`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import JsonOption, NoVerifyOption, SensorOption, session_of
from testbench.cli.output import say, say_json, say_table
from testbench.clock import utc_text

if TYPE_CHECKING:
    from testbench.pipeline.calibrate import MadeCalibration


class Witness(StrEnum):
    """Who says where the rests are."""

    arm = "arm"
    gyroscope = "gyroscope"
    peaks = "peaks"
    variance = "variance"


class Middle(StrEnum):
    """Where the rates inside a step of an integrator come from."""

    measured = "measured"
    interpolated = "interpolated"
    constant = "constant"


def _complete_method(incomplete: str) -> list[str]:
    from testbench.estimation.calibration.methods import METHODS

    return [name for name in METHODS if name.startswith(incomplete)]


def _list(asked: bool) -> None:
    if not asked:
        return
    from testbench.estimation.calibration.methods import METHODS

    rows = [[m.calibrates, m.name, m.needs, m.source] for m in METHODS.values()]
    say_table("Calibration methods", ["triad", "method", "needs", "source"], rows)
    raise typer.Exit


# Long by its options, one parameter each.
def calibrate(
    session: Annotated[Path, typer.Argument(help="Folder of a session with static poses.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", help="Calibration file to write (.yaml), or a folder that keeps many."
        ),
    ],
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            help="Method, at most one a triad; without it the best that the recording allows.",
            autocompletion=_complete_method,
        ),
    ] = None,
    sensor: SensorOption = None,
    segmentation: Annotated[
        Witness | None,
        typer.Option(
            "--segmentation", help="Who says where the rests are; the arm if it was there."
        ),
    ] = None,
    held_out: Annotated[
        list[Path] | None,
        typer.Option(
            "--held-out", help="Session whose poses validate, in place of cross-validation."
        ),
    ] = None,
    field: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            "--field-ut",
            metavar="X Y Z",
            help="Field of the earth in the world in uT, where it is known.",
        ),
    ] = None,
    turn: Annotated[
        float | None,
        typer.Option(
            "--turn-deg",
            metavar="DEG",
            help="Of ferraris_gyroscope: angle of the largest turn about each axis; negative: "
            "clockwise, against the axis.",
        ),
    ] = None,
    integrator: Annotated[
        str | None,
        typer.Option(
            "--integrator", help="Of the turns (gravity_turns, attitude): rk4, cg4, tustin, ..."
        ),
    ] = None,
    stages: Annotated[
        Middle | None,
        typer.Option(
            "--stages",
            help="Where its rates inside a step come from; measured where it gains by it.",
        ),
    ] = None,
    g_sensitivity: Annotated[
        bool | None,
        typer.Option(
            "--g-sensitivity/--no-g-sensitivity",
            help="Whether the gyroscope's response to gravity is fitted too; by attitude alone "
            "unless said.",
        ),
    ] = None,
    every: Annotated[
        int, typer.Option("--every", min=1, help="Take only one sample of so many of each turn.")
    ] = 1,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Do not write the report beside the file.")
    ] = False,
    listed: Annotated[
        bool, typer.Option("--list", callback=_list, is_eager=True, help="List the methods.")
    ] = False,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Calibrate a sensor from a session: corrections with their uncertainty, judged on poses held
    out.
    """
    from testbench.pipeline.calibrate import calibrate as make_calibration
    from testbench.pipeline.request import CalibrationRequest

    witness: Any = None if segmentation is None else segmentation.value
    between: Any = None if stages is None else stages.value
    asked = CalibrationRequest(
        out=str(out),
        sensor=sensor,
        methods=tuple(method or ()),
        segmentation=witness,
        held_out=tuple(map(str, held_out or ())),
        field_ut=field,
        turn_deg=turn,
        integrator=integrator,
        stages=between,
        g_sensitivity=g_sensitivity,
        every=every,
        report=not no_report,
        verify=not no_verify,
    )
    made = make_calibration(session_of(session, no_verify), asked)
    if json:
        _say_calibration_json(made)
    else:
        _say_calibration(made)


def _say_calibration_json(made: MadeCalibration) -> None:
    """What was written, which methods made it, and how far it holds on poses held out."""
    from dataclasses import asdict

    result = made.result
    triads = {
        triad: {
            "method": found.method,
            "validation": found.validation,
            "remarks": list(found.remarks),
        }
        for triad, found in result.calibration.triads.items()
    }
    files = {"file": str(made.file), "report": str(made.report) if made.report else None}
    say_json(
        {
            **files,
            "sensor": result.calibration.sensor,
            "simulated": result.calibration.simulated,
            "triads": triads,
            "remarks": result.remarks,
            "findings": [
                asdict(own) | {"severity": own.severity.value}
                for own in result.calibration.findings
            ],
        }
    )


def _say_calibration(made: MadeCalibration) -> None:
    """Parameters with their uncertainty, figures of the poses held out, remarks, files."""
    import numpy as np

    result = made.result
    rows: list[list[Any]] = []
    for triad, found in result.calibration.triads.items():
        for fit in found.fits:
            half = fit.half_width()
            rows += [
                [triad, name, float(value), float(sd), float(width), unit]
                for name, value, sd, width, unit in zip(
                    fit.names, fit.values, fit.sd, half, fit.units, strict=True
                )
            ]
    mounting = result.calibration.mounting
    if mounting is not None:
        turned, sd = np.degrees(mounting.fit.values), np.degrees(mounting.fit.sd)
        half_deg = np.degrees(mounting.fit.half_width())
        rows += [
            ["mounting", n, float(v), float(s), float(h), "deg"]
            for n, v, s, h in zip(mounting.fit.names, turned, sd, half_deg, strict=True)
        ]
    shown = [
        [*row[:2], *(_to_its_uncertainty(number, row[3]) for number in row[2:5]), row[5]]
        for row in rows
    ]
    say_table("Parameters", ["triad", "parameter", "value", "sd", "95 % ±", "unit"], shown)
    figures = [
        [triad, name, f"{value:.4g}"]
        for triad, found in result.calibration.triads.items()
        for name, value in found.validation.items()
    ]
    say_table(f"Held out, by {result.held_out}", ["triad", "figure", "value"], figures)
    for triad, found in result.calibration.triads.items():
        for remark in found.remarks:
            say(f"note: {triad} by {found.method}: {remark}")
    for remark in result.remarks:
        say(f"note: {remark}")
    for own in result.calibration.findings:
        say(f"{own.severity.value}: {own}")
    if result.calibration.simulated:
        say("simulated: the sensor is a model, and so is what was calibrated")
    say(f"calibration: {made.file}")
    if made.report:
        say(f"report:      {made.report}")


def _to_its_uncertainty(value: float, sd: float) -> str:
    from testbench.records.results.numbers import decimals_by

    decimals = decimals_by(sd)
    return f"{value:.6g}" if decimals is None else f"{value:.{decimals}f}"


def calibrations(
    path: Annotated[Path, typer.Argument(help="Folder of calibrations, or one file.")],
    json: JsonOption = False,
) -> None:
    """List stored calibrations by date."""
    from testbench.records.results.calibration_file import load_calibrations

    found = sorted(load_calibrations(path), key=lambda calibration: calibration.calibrated)
    entries: list[dict[str, Any]] = [
        {
            "file": str(c.file),
            "sensor": c.sensor,
            "device": c.device,
            "calibrated_utc": utc_text(c.calibrated),
            "methods": {triad: calibration.method for triad, calibration in c.triads.items()},
            "temperature_deg_c": c.temperature,
        }
        for c in found
    ]
    if json:
        say_json({"calibrations": entries})
        return
    rows = [
        [
            e["calibrated_utc"],
            e["sensor"],
            e["device"] or "-",
            ", ".join(f"{t}: {m}" for t, m in e["methods"].items()),
            e["file"],
        ]
        for e in entries
    ]
    say_table(
        f"Calibrations in {path}", ["calibrated (UTC)", "sensor", "device", "methods", "file"], rows
    )
