"""The command `emulate`: controllers that answer real client libraries, without an arm."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.output import say
from testbench.emulation.catalogue import EMULATED, EmulatedArm, emulated

if TYPE_CHECKING:
    from testbench.emulation.server import Server

REALTIME_PRIORITY = 15
"""Of the first-in-first-out class, below that of the process that drives an arm."""

emulate = typer.Typer(
    help="Emulate hardware on this machine, to rehearse without it.", no_args_is_help=True
)


@emulate.callback()
def _emulate() -> None:
    """Emulate hardware on this machine, to rehearse without it."""


AddressOption = Annotated[
    str, typer.Option("--address", help="Address to listen on; the ports are the controller's own.")
]
ShiftOption = Annotated[
    int,
    typer.Option(
        "--port-shift",
        min=-29000,
        max=35000,
        help="Added to the number of each port but --command-port, for clients that can be told.",
    ),
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
            port_shift=given["port_shift"],
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
        "port_shift": (ShiftOption, 0),
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


@emulate.command("proxy")
def _proxy(
    target: Annotated[str, typer.Option("--target", help="Address of the emulated controller.")],
    address: Annotated[
        str, typer.Option("--address", help="Loopback address to listen on.")
    ] = "127.0.0.2",
    ports: Annotated[
        str, typer.Option("--ports", metavar="PORT,PORT,...", help="Ports that are passed on.")
    ] = ",".join(str(port) for port in EMULATED[0].ports),
    seed: SeedOption = 0,
) -> None:
    """Put a bad network before an emulated controller until Ctrl-C; port 29998 takes faults."""
    from testbench.emulation.proxy import Proxy
    from testbench.exceptions import InputError

    numbers = ports.split(",")
    if not all(number.isdigit() and 0 < int(number) < 65536 for number in numbers):
        raise InputError(f"--ports {ports}: must be numbers of ports, separated by commas")
    proxy = Proxy(address, target, map(int, numbers), seed)
    say(f"ports {ports} of {target} at {address}, faults 29998; Ctrl-C ends it")
    sys.stdout.flush()
    with suppress(KeyboardInterrupt):
        proxy.run(lambda text: print(text, flush=True))
    proxy.close()


def _angles(at: str | None) -> tuple[float, ...] | None:
    from testbench.exceptions import InputError

    try:
        return None if at is None else tuple(float(angle) for angle in at.split(","))
    except ValueError:
        raise InputError(
            f"--at {at}: must be joint angles in degrees, separated by commas"
        ) from None


def _run(server: Server) -> None:
    """Serve until Ctrl-C, with real-time priority where the system lets it: a controller is not
    held up by what else this machine does.
    """
    sys.stdout.flush()
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REALTIME_PRIORITY))
    try:
        server.run(lambda text: print(text, flush=True))
    except KeyboardInterrupt:
        server.close()
