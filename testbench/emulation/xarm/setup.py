"""Put an emulated xArm controller together from what a person asks for."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from testbench.emulation.faults import load_scenario
from testbench.emulation.setup import emulated_robot, start_angles
from testbench.emulation.xarm.controller import KINDS, Controller, Identity
from testbench.emulation.xarm.faults import XArmScenario
from testbench.emulation.xarm.server import XArmServer
from testbench.exceptions import InputError


def make_controller(
    model: str,
    firmware: str | None = None,
    q_deg: list[float] | None = None,
    seed: int = 0,
    scenario: Path | None = None,
    claims: str | None = None,
) -> Controller:
    """A controller with its arm at rest, motors on, in position mode.

    Args:
        model: xarm6.
        firmware: Version it claims.
        q_deg: Joint angles at the start [deg]; home if None.
        seed: Of the encoders' noise.
        scenario: File of faults to come.
        claims: The arm that it says it drives; the model if None.

    Raises:
        InputError: The model is not emulated, there is no such arm, a version is no version, or the
            angles are not six.
    """
    robot = emulated_robot(model, ["xarm6"])
    if firmware is not None and not re.fullmatch(r"\d{1,3}\.\d{1,3}\.\d{1,3}", firmware):
        raise InputError(f"'{firmware}' is no version; it must look like 2.5.0")
    if claims is not None and claims not in KINDS:
        raise InputError(f"there is no arm '{claims}'; known: {', '.join(KINDS)}")
    identity = Identity(claims or model, **({"firmware": firmware} if firmware else {}))
    faults = load_scenario(scenario, XArmScenario) if scenario else None
    return Controller(robot, identity, start_angles(robot, q_deg), seed, faults)


def make_server(
    address: str, token: str | None, at_deg: list[float] | None, **asked: Any
) -> XArmServer:
    """A server that listens.

    Args:
        address: To listen on, as for `XArmServer`.
        token: What clients must say first, as for `XArmServer`.
        at_deg: Joint angles at the start [deg]; home if None.
        asked: The other arguments of `make_controller`, and `command_port` and `port_shift`, as for
            `XArmServer`.

    Raises:
        InputError: As for `make_controller` and `XArmServer`.
    """
    command_port = asked.pop("command_port")
    port_shift = asked.pop("port_shift", 0)
    controller = make_controller(q_deg=at_deg, **asked)
    return XArmServer(controller, address, token, command_port, port_shift=port_shift)
