"""The command `export`: a session for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from testbench.cli.options import (
    JsonOption,
    NoVerifyOption,
    SessionArgument,
    SetOption,
    complete_filter,
    filter_parameters,
    optional,
    session_of,
)
from testbench.cli.output import say, say_json


class ExportFrame(StrEnum):
    """Frame of the orientations in a file for OpenSim."""

    opensim = "opensim"
    world = "world"


class OpenSimModel(StrEnum):
    """Model whose coordinates the columns of a .mot are."""

    rajagopal = "rajagopal"
    gait2392 = "gait2392"


def _complete_export(incomplete: str) -> list[str]:
    from testbench.formats.exporters import EXPORTS

    return [name for name in EXPORTS if name.startswith(incomplete)]


# Long by its options, one parameter each.
def export(
    session: SessionArgument,
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="csv, parquet, mcap, sto, mot, mat or rrd.",
            autocompletion=_complete_export,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="File (csv, parquet: folder) to write, in place of SESSION/export/..."
        ),
    ] = None,
    filter_name: Annotated[
        str | None,
        typer.Option(
            "--filter",
            help="Whose orientation: a filter's name, path/to/file.py:ClassName, or 'truth'. "
            "Default: the protocol's first.",
            autocompletion=complete_filter,
        ),
    ] = None,
    frame: Annotated[
        ExportFrame,
        typer.Option(
            "--frame", help="Frame of a .sto: OpenSim's ground (y up), or the world (z up)."
        ),
    ] = ExportFrame.opensim,
    model: Annotated[
        OpenSimModel,
        typer.Option(
            "--model",
            help="Model of OpenSim whose coordinates the columns of a .mot are: knees flex "
            "positively in rajagopal, negatively in gait2392.",
        ),
    ] = OpenSimModel.rajagopal,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export.")] = False,
    parameters: SetOption = None,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Write a session in a format that other programs read."""
    from testbench.pipeline.exports import export as write_export
    from testbench.pipeline.request import ExportRequest

    where: Any = frame.value
    coordinates: Any = model.value
    asked = ExportRequest(
        format=to,
        out=optional(out),
        filter=filter_name,
        parameters=filter_parameters(parameters),
        frame=where,
        model=coordinates,
        force=force,
    )
    result = write_export(session_of(session, no_verify), asked)
    if json:
        say_json(
            {
                "session": str(session),
                "format": to,
                "file": str(result.path),
                "filters": result.filters,
                "notes": result.notes,
            }
        )
    else:
        say(f"written: {result.path}")
        say(f"orientation by: {', '.join(result.filters) or 'none, for no filter could run'}")
        for note in result.notes:
            say(f"note: {note}")
