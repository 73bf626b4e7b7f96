"""Every controller that can be emulated: who adds one adds an entry here.

The command line makes a command of each, so that nothing heavy is imported here: entries say by
name where their servers are.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from testbench.exceptions import NotFoundError

if TYPE_CHECKING:
    from testbench.emulation.request import EmulationRequest
    from testbench.emulation.server import Server


@dataclass(frozen=True)
class OwnOption:
    """An option that only one kind of controller has.

    Attributes:
        name: Of the argument; the option is called like it, with hyphens.
        help: A sentence.
        default: Its type is that of the option; text where it is None.
        least: Smallest number.
        most: Largest number.
    """

    name: str
    help: str
    default: str | int | bool | None = None
    least: int | None = None
    most: int | None = None

    @property
    def flag(self) -> str:
        """As on the command line."""
        return f"--{self.name.replace('_', '-')}"


@dataclass(frozen=True)
class EmulatedArm:
    """A controller that can be emulated.

    Attributes:
        name: Of the command below `emulate`.
        help: A sentence.
        model: The arm that is emulated where nobody says.
        models: Those that can be.
        served_by: `module:function`, called with model, address, shift of the ports' numbers,
            token, joint angles at the start [deg], seed of the encoders' noise, file of faults, and
            the own options by their names.
        ports: Of its clients, as the controller has them.
        options: Its own.
    """

    name: str
    help: str
    model: str
    models: str
    served_by: str
    ports: tuple[int, ...]
    options: tuple[OwnOption, ...] = ()

    def server(self, asked: EmulationRequest, token: str | None = None) -> Server:
        """A server that listens, with its arm at rest.

        Args:
            asked: What is emulated.
            token: What clients must say first, where it listens beyond this machine.

        Raises:
            NotFoundError: It has no such option.
            InputError: There is no such model, version or address.
        """
        own = {option.name: option.default for option in self.options}
        for name in asked.own:
            if name not in own:
                raise NotFoundError(f"option of the emulated {self.name}", name, list(own))
        module, _, function = self.served_by.partition(":")
        server: Server = getattr(import_module(module), function)(
            model=asked.model or self.model,
            address=asked.address,
            port_shift=asked.port_shift,
            token=token,
            at_deg=None if asked.at_deg is None else list(asked.at_deg),
            seed=asked.seed,
            scenario=None if asked.scenario is None else Path(asked.scenario),
            **own | asked.own,
        )
        return server


EMULATED = (
    EmulatedArm(
        "ur",
        "Emulate the controller of a Universal Robots arm until Ctrl-C; port 29998 takes faults.",
        "ur3e",
        "ur3e, ur5e or ur10e",
        "testbench.emulation.ur.setup:make_server",
        (29999, 30001, 30002, 30003, 30004),
        (
            OwnOption("polyscope", "Version that the controller claims."),
            OwnOption("local_control", "Start out of remote control.", default=False),
        ),
    ),
    EmulatedArm(
        "xarm",
        "Emulate the controller of a UFACTORY xArm until Ctrl-C; port 29998 takes faults.",
        "xarm6",
        "xarm6",
        "testbench.emulation.xarm.setup:make_server",
        (502, 30000, 30002),
        (
            OwnOption("firmware", "Version that the controller claims."),
            OwnOption(
                "claims",
                "Arm that the controller says it drives: xarm5, xarm7, lite6, 850.",
            ),
            OwnOption(
                "command_port",
                "Instead of 502, which needs a privileged user.",
                default=502,
                least=1,
                most=65535,
            ),
        ),
    ),
)
"""In the order in which people are told of them."""


def emulated(asked: EmulationRequest, token: str | None = None) -> Server:
    """The server that a request asks for; see `EmulatedArm.server`.

    Raises:
        NotFoundError: There is no such controller, or it has no such option.
        InputError: There is no such model, version or address.
    """
    for arm in EMULATED:
        if arm.name == asked.arm:
            return arm.server(asked, token)
    raise NotFoundError("emulated controller", asked.arm, [arm.name for arm in EMULATED])
