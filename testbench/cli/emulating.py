"""The command `emulate`: controllers that answer real client libraries, without an arm."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.output import say

emulate = typer.Typer(help="Emulate hardware on this machine, to rehearse without it.", no_args_is_help=True)


@emulate.callback()
def _emulate() -> None:
    """Emulate hardware on this machine, to rehearse without it."""


@emulate.command("ur")
def emulate_ur(
    model: Annotated[str, typer.Option("--model", help="ur3e, ur5e or ur10e.")] = "ur3e",
    address: Annotated[
        str, typer.Option("--address", help="Address to listen on; the ports are the controller's own.")
    ] = "127.0.0.1",
    token: Annotated[
        str | None,
        typer.Option("--token", envvar="TESTBENCH_EMULATOR_TOKEN", help="Needed for an address that is not loopback."),
    ] = None,
    scenario: Annotated[Path | None, typer.Option("--scenario", help="YAML file of faults to come.")] = None,
    polyscope: Annotated[str | None, typer.Option("--polyscope", help="Version that the controller claims.")] = None,
    at: Annotated[str | None, typer.Option("--at", metavar="DEG,DEG,...", help="Joint angles at the start [deg].")] = None,
    local_control: Annotated[bool, typer.Option("--local-control", help="Start out of remote control.")] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the encoders' noise.")] = 0,
) -> None:
    """Emulate the controller of a Universal Robots arm until Ctrl-C; port 29998 takes faults."""
    from testbench.emulation.ur.server import UrServer
    from testbench.emulation.ur.setup import make_controller
    from testbench.exceptions import InputError

    try:
        q_deg = None if at is None else [float(angle) for angle in at.split(",")]
    except ValueError:
        raise InputError(f"--at {at}: must be joint angles in degrees, separated by commas") from None
    server = UrServer(make_controller(model, polyscope, q_deg, seed, scenario, local_control), address, token)
    say(f"{model} emulated at {address}: dashboard 29999, scripts 30001 to 30003, RTDE 30004, faults 29998; Ctrl-C ends it")
    sys.stdout.flush()
    try:
        server.run(lambda text: print(text, flush=True))
    except KeyboardInterrupt:
        server.close()
