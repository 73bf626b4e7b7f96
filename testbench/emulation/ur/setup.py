"""Put an emulated controller together from what a person asks for."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from testbench.emulation.faults import load_scenario
from testbench.emulation.setup import emulated_robot, start_angles
from testbench.emulation.ur.controller import Controller, Identity
from testbench.emulation.ur.faults import UrScenario
from testbench.emulation.ur.server import UrServer
from testbench.exceptions import InputError

DASHBOARD_MODELS = {"ur3e": "UR3", "ur5e": "UR5", "ur10e": "UR10"}
"""What the dashboard of an e-series arm calls itself."""


def make_controller(
    model: str,
    polyscope: str | None = None,
    q_deg: list[float] | None = None,
    seed: int = 0,
    scenario: Path | None = None,
    local_control: bool = False,
) -> Controller:
    """A controller with its arm at rest.

    Args:
        model: ur3e, ur5e or ur10e.
        polyscope: Version it claims.
        q_deg: Joint angles at the start [deg]; home if None.
        seed: Of the encoders' noise.
        scenario: File of faults to come.
        local_control: Start out of remote control.

    Raises:
        InputError: The model is not emulated, a version is no version, or the angles are not six.
    """
    robot = emulated_robot(model, DASHBOARD_MODELS)
    if polyscope is not None and not re.fullmatch(r"\d{1,3}(\.\d{1,6}){1,3}", polyscope):
        raise InputError(f"'{polyscope}' is no version; it must look like 5.17.0.128818")
    identity = Identity(DASHBOARD_MODELS[model], **({"polyscope": polyscope} if polyscope else {}))
    faults = load_scenario(scenario, UrScenario) if scenario else None
    controller = Controller(robot, identity, start_angles(robot, q_deg), seed, faults)
    controller.remote_control = not local_control
    return controller


def make_server(
    address: str, token: str | None, at_deg: list[float] | None, **asked: Any
) -> UrServer:
    """A server that listens.

    Args:
        address: To listen on, as for `UrServer`.
        token: What clients must say first, as for `UrServer`.
        at_deg: Joint angles at the start [deg]; home if None.
        asked: The other arguments of `make_controller`, and `port_shift`, as for `UrServer`.

    Raises:
        InputError: As for `make_controller` and `UrServer`.
    """
    port_shift = asked.pop("port_shift", 0)
    controller = make_controller(q_deg=at_deg, **asked)
    return UrServer(controller, address, token, port_shift=port_shift)
