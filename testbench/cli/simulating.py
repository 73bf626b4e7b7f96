"""The command `simulate`: sensors that ride on a motion from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.options import JsonOption
from testbench.cli.output import say, say_json


def simulate(
    motion: Annotated[
        Path,
        typer.Argument(
            help="Poses over time, .csv (time_s, q_w to q_z, x_m to z_m; NAME.q_w of several "
            "bodies) or .npz (time_s, NAME.q, NAME.position_m)."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder of the session, to be made.")],
    preset: Annotated[
        str, typer.Option("--preset", help="Data sheet of every sensor, by name or .yaml file.")
    ] = "xsens_dot",
    sensor: Annotated[
        list[str] | None,
        typer.Option("--sensor", help="Data sheet of one body, BODY=PRESET; may be repeated."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the sensors that are drawn.")] = 0,
    json: JsonOption = False,
) -> None:
    """Record simulated sensors that ride on a motion from a file, in place of an arm."""
    from testbench.pipeline.request import SimulateRequest
    from testbench.pipeline.simulate import simulate as ride

    asked = SimulateRequest(
        motion=str(motion), out=str(out), preset=preset, sensors=tuple(sensor or ()), seed=seed
    )
    session = ride(asked)
    if json:
        say_json({"session": str(session.path), "simulated": session.simulated})
        return
    say(f"session: {session.path}")
    say(f"simulated: {' and '.join(session.simulated)}")
    say(f"next: testbench report {session.path}")
