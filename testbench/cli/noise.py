"""The command `noise`: what a sensor reads at rest, kept as a preset for simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.options import (
    JsonOption,
    NoVerifyOption,
    SensorOption,
    optional,
    session_of,
)
from testbench.cli.output import say, say_json, say_noise


def noise(
    session: Annotated[
        Path, typer.Argument(help="Folder of a session with a rest of ten seconds or more.")
    ],
    sensor: SensorOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Write the sensor as a preset for protocols.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            "--like",
            help="Preset (a name or a .yaml file) that gives what a rest cannot show, such as "
            "ranges.",
        ),
    ] = None,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Noise at rest in data-sheet units; --out keeps it as a sensor preset. Exit code 2: none."""
    from testbench.exceptions import InputError
    from testbench.pipeline.noise import measure_noise
    from testbench.pipeline.request import NoiseRequest

    opened = session_of(session, no_verify)
    found = measure_noise(opened, NoiseRequest(sensor=sensor, out=optional(out), like=like))
    if json:
        say_json(
            {
                "session": str(opened.path),
                "simulated": opened.simulated,
                "noise": [vars(row) for row in found.rows],
                "file": str(out) if out else None,
                "notes": found.notes,
            }
        )
    else:
        say_noise(found.rows)
        for note in found.notes:
            say(f"note: {note}")
        if opened.simulated:
            say(f"simulated: {' and '.join(opened.simulated)}")
        if out is not None:
            say(f"written: {out}; name it in a protocol beside it as preset: {out.name}")
    if not found.rows:
        raise typer.Exit(InputError.exit_code)
