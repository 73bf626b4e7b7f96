"""The command `gait`: strides, events and the path of a walk."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import (
    CalibrationOption,
    JsonOption,
    NoVerifyOption,
    SessionArgument,
    SetOption,
    complete_filter,
    filter_parameters,
    session_of,
)
from testbench.cli.output import say, say_findings, say_json, say_table

if TYPE_CHECKING:
    from testbench.records.results.gait import Gait, SensorGait


class Floor(StrEnum):
    """Whether all stands of a foot are equally high."""

    found = "found"
    level = "level"
    any = "any"


def _corners(text: str | None) -> tuple[tuple[float, float], ...]:
    """Corners of a path, written as "0,0 10,0 10,5"."""
    from testbench.exceptions import InputError

    found = []
    for corner in (text or "").split():
        try:
            x, y = (float(part) for part in corner.split(","))
        except ValueError:
            raise InputError(
                f"--corners: '{corner}' is no corner; write x,y in metres, corners apart by "
                "blanks: '0,0 10,0 10,5'"
            ) from None
        found.append((x, y))
    return tuple(found)


def _complete_parameters(incomplete: str) -> list[str]:
    from testbench.pipeline.gait import published_parameters

    return [name for name in published_parameters() if name.startswith(incomplete)]


# Long by its options, one parameter each.
def gait(
    session: SessionArgument,
    on: Annotated[
        list[str] | None,
        typer.Option(
            "--on",
            metavar="[SENSOR=]PLACE",
            help="Where a sensor sits: foot, shank, wrist or chest; else found. May be repeated.",
        ),
    ] = None,
    mounting: Annotated[
        list[str] | None,
        typer.Option(
            "--mounting",
            metavar="[SENSOR=]MOUNTING",
            help="How a sensor on shank, wrist or chest is worn: level, frontal or lateral; else "
            "found.",
        ),
    ] = None,
    parameters: Annotated[
        str,
        typer.Option(
            "--parameters",
            help="Published parameters of the step-length regression, such as ngimu_shin; a sensor "
            "on a foot goes by the regression, too.",
            autocompletion=_complete_parameters,
        ),
    ] = "",
    filter_name: Annotated[
        str,
        typer.Option(
            "--filter",
            help="Whose orientation the regression takes.",
            autocompletion=complete_filter,
        ),
    ] = "euler_ekf",
    parameters_set: SetOption = None,
    floor: Annotated[
        Floor,
        typer.Option("--floor", help="Whether all stands of a foot are equally high; else found."),
    ] = Floor.found,
    calibration: CalibrationOption = None,
    cycles: Annotated[
        int | None, typer.Option("--cycles", help="Strides of one leg, as counted: judges.")
    ] = None,
    distance: Annotated[
        float | None,
        typer.Option("--distance", metavar="M", help="Length of the way, as measured: judges."),
    ] = None,
    corners: Annotated[
        str | None,
        typer.Option(
            "--corners",
            metavar="'X,Y X,Y ...'",
            help="Corners of the path walked, in metres, from its start to its end: judges.",
        ),
    ] = None,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Do not write report.html anew.")
    ] = False,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Strides, gait events, step lengths and the path of somebody who walked. Exit code 2: none."""
    from testbench.exceptions import InputError
    from testbench.pipeline.gait import make_gait
    from testbench.pipeline.request import GaitRequest

    chosen: Any = floor.value
    asked = GaitRequest(
        on=tuple(on or ()),
        mounting=tuple(mounting or ()),
        parameters=parameters,
        filter=filter_name,
        filter_parameters=filter_parameters(parameters_set),
        floor=chosen,
        calibrations=None if calibration is None else str(calibration),
        cycles=cycles,
        distance_m=distance,
        corners_m=_corners(corners),
        report=not no_report,
    )
    made = make_gait(session_of(session, no_verify), asked)
    if json:
        say_json(_told(made.result) | {"report": str(made.report) if made.report else None})
    else:
        _say(made.result)
        if made.report:
            say(f"report: {made.report}")
    if not any(own.strides for own in made.result.sensors.values()):
        raise typer.Exit(InputError.exit_code)


def _told(found: Gait) -> dict[str, Any]:
    """For JSON: what gait.json holds, and the closure at the top where one sensor has one."""
    known = [own.closure_mm for own in found.sensors.values() if own.method]
    return {"closure_mm": known[0] if len(known) == 1 else None} | found.summary()


def _say(found: Gait) -> None:
    rows: list[list[Any]] = [
        [
            own.sensor,
            own.on or "unknown",
            own.method or "-",
            len(own.strides),
            *map(
                _known,
                (
                    own.distance_m,
                    own.cadence_steps_min,
                    own.stance_percent,
                    _mean(own, "length_m"),
                    own.closure_mm,
                ),
            ),
        ]
        for own in found.sensors.values()
    ]
    columns = ["sensor", "on", "by", "strides", "distance [m]", "cadence [steps/min]"]
    say_table("Gait", [*columns, "stance [%]", "stride [m]", "closure [mm]"], rows)
    if found.symmetry:
        rows = [
            [row.quantity, row.left, row.right, row.difference_percent] for row in found.symmetry
        ]
        say_table("Left and right", ["mean of", "left", "right", "difference [%]"], rows)
    if found.checks:
        rows = [
            [row.sensor, row.quantity, row.value, row.truth, row.error, _known(row.error_percent)]
            for row in found.checks
        ]
        columns = ["sensor", "quantity", "estimated", "true", "error", "error [%]"]
        say_table("Against what was typed", columns, rows)
    say_findings(found.all_findings())


def _known(value: float) -> float | None:
    """A number for a table; None where it is not known."""
    return None if value != value else value


def _mean(own: SensorGait, quantity: str) -> float:
    return next((row.mean for row in own.rows if row.quantity == quantity), float("nan"))
