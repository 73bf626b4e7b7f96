"""The command `emulate`: controllers that answer real client libraries, without an arm."""

from __future__ import annotations

import sys
from collections.abc import Callable
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.output import say
from testbench.emulation.catalogue import EMULATED, EmulatedArm, emulated

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


def _command(arm: EmulatedArm) -> Callable[..., None]:
    """The function of a command whose options are those of every controller and the arm's own."""

    def serve(**given: Any) -> None:
        from testbench.emulation.request import EmulationRequest

        asked = EmulationRequest(
            arm=arm.name,
            model=given["model"],
            address=given["address"],
            scenario=given["scenario"],
            at_deg=_angles(given["at"]),
            seed=given["seed"],
            own={own.name: given[own.name] for own in arm.options},
        )
        server = emulated(asked, given["token"])
        say(f"{asked.model} emulated at {server.address}: {server.open_ports}; Ctrl-C ends it")
        _run(server)

    model = typer.Option("--model", help=f"{arm.models}.")
    options: dict[str, tuple[Any, Any]] = {
        "model": (Annotated[str, model], arm.model),
        "address": (AddressOption, "127.0.0.1"),
        "token": (TokenOption, None),
        "scenario": (ScenarioOption, None),
    }
    for own in arm.options:
        kind = str | None if own.default is None else type(own.default)
        option = typer.Option(own.flag, help=own.help, min=own.least, max=own.most)
        options[own.name] = (Annotated[kind, option], own.default)
    options |= {"at": (AtOption, None), "seed": (SeedOption, 0)}
    # typer reads the options of a command from the signature of its function.
    parameters = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, (annotation, default) in options.items()
    ]
    setattr(serve, "__signature__", Signature(parameters))  # noqa: B010 - unknown to mypy
    serve.__doc__ = arm.help
    return serve


for _arm in EMULATED:
    emulate.command(_arm.name)(_command(_arm))


def _angles(at: str | None) -> tuple[float, ...] | None:
    from testbench.exceptions import InputError

    try:
        return None if at is None else tuple(float(angle) for angle in at.split(","))
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
