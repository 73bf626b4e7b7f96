"""The command `export`: a session for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.output import say, say_json


class ExportFrame(StrEnum):
    """Frame of the orientations in a file for OpenSim."""

    opensim = "opensim"
    world = "world"


def _complete_export(incomplete: str) -> list[str]:
    from testbench.formats.exporters import EXPORTS

    return [name for name in EXPORTS if name.startswith(incomplete)]


def export(
    session: Annotated[Path, typer.Argument(help="Folder of a session.")],
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
        ),
    ] = None,
    frame: Annotated[
        ExportFrame,
        typer.Option(
            "--frame", help="Frame of a .sto: OpenSim's ground (y up), or the world (z up)."
        ),
    ] = ExportFrame.opensim,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export.")] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of tables.")
    ] = False,
) -> None:
    """Write a session in a format that other programs read."""
    from testbench.cli.filtering import parse_filter
    from testbench.pipeline.analyse import export as write_export
    from testbench.records.session import Session

    result = write_export(Session(session), to, out, parse_filter(filter_name), frame.value, force)
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
        say(f"orientation by: {', '.join(result.filters)}")
        for note in result.notes:
            say(f"note: {note}")
