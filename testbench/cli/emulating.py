"""The command `emulate`: controllers that answer real client libraries, without an arm."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.output import say

if TYPE_CHECKING:
    from testbench.emulation.server import Server

emulate = typer.Typer(
    help="Emulate hardware on this machine, to rehearse without it.", no_args_is_help=True
)


@emulate.callback()
def _emulate() -> None:
    """Emulate hardware on this machine, to rehearse without it."""


AddressOption = Annotated[
    str, typer.Option("--address", help="Address to listen on; the ports are the controller's own.")
]
TokenOption = Annotated[
    str | None,
    typer.Option(
        "--token",
        envvar="TESTBENCH_EMULATOR_TOKEN",
        help="Needed for an address that is not loopback.",
    ),
]
ScenarioOption = Annotated[
    Path | None, typer.Option("--scenario", help="YAML file of faults to come.")
]
AtOption = Annotated[
    str | None,
    typer.Option("--at", metavar="DEG,DEG,...", help="Joint angles at the start, in degrees."),
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Seed of the encoders' noise.")]


@emulate.command("ur")
def emulate_ur(
    model: Annotated[str, typer.Option("--model", help="ur3e, ur5e or ur10e.")] = "ur3e",
    address: AddressOption = "127.0.0.1",
    token: TokenOption = None,
    scenario: ScenarioOption = None,
    polyscope: Annotated[
        str | None, typer.Option("--polyscope", help="Version that the controller claims.")
    ] = None,
    at: AtOption = None,
    local_control: Annotated[
        bool, typer.Option("--local-control", help="Start out of remote control.")
    ] = False,
    seed: SeedOption = 0,
) -> None:
    """Emulate the controller of a Universal Robots arm until Ctrl-C; port 29998 takes faults."""
    from testbench.emulation.ur.server import UrServer
    from testbench.emulation.ur.setup import make_controller

    controller = make_controller(model, polyscope, _angles(at), seed, scenario, local_control)
    server = UrServer(controller, address, token)
    say(
        f"{model} emulated at {address}: dashboard 29999, scripts 30001 to 30003, RTDE 30004, "
        "faults 29998; Ctrl-C ends it"
    )
    _run(server)


@emulate.command("xarm")
def emulate_xarm(
    model: Annotated[str, typer.Option("--model", help="xarm6.")] = "xarm6",
    address: AddressOption = "127.0.0.1",
    token: TokenOption = None,
    scenario: ScenarioOption = None,
    firmware: Annotated[
        str | None, typer.Option("--firmware", help="Version that the controller claims.")
    ] = None,
    claims: Annotated[
        str | None,
        typer.Option(
            "--claims", help="Arm that the controller says it drives: xarm5, xarm7, lite6, 850."
        ),
    ] = None,
    command_port: Annotated[
        int,
        typer.Option(
            "--command-port",
            min=1,
            max=65535,
            help="Instead of 502, which needs a privileged user.",
        ),
    ] = 502,
    at: AtOption = None,
    seed: SeedOption = 0,
) -> None:
    """Emulate the controller of a UFACTORY xArm until Ctrl-C; port 29998 takes faults."""
    from testbench.emulation.xarm.server import XArmServer
    from testbench.emulation.xarm.setup import make_controller

    controller = make_controller(model, firmware, _angles(at), seed, scenario, claims)
    server = XArmServer(controller, address, token, command_port)
    say(
        f"{model} emulated at {address}: commands {command_port}, reports 30000 and 30002, faults "
        "29998; Ctrl-C ends it"
    )
    _run(server)


def _angles(at: str | None) -> list[float] | None:
    from testbench.exceptions import InputError

    try:
        return None if at is None else [float(angle) for angle in at.split(",")]
    except ValueError:
        raise InputError(
            f"--at {at}: must be joint angles in degrees, separated by commas"
        ) from None


def _run(server: Server) -> None:
    """Serve until Ctrl-C."""
    sys.stdout.flush()
    try:
        server.run(lambda text: print(text, flush=True))
    except KeyboardInterrupt:
        server.close()
