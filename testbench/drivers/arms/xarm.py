"""UFACTORY xArm arms through xarm-python-sdk: poses in position mode, sweeps in servo mode.

Written against the maker's published interfaces and tested against an emulated controller, never on
an arm.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from testbench.drivers.arms.catalogue import XARM
from testbench.drivers.arms.entry import WantedArm
from testbench.drivers.arms.remote import RemoteArm, common_settings
from testbench.drivers.arms.standing import Standing
from testbench.drivers.arms.xarm_client import (
    CONTROL_PORT,
    XArmClient,
    XArmSettings,
    stop_from_outside,
)
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import InputError
from testbench.records.session.plan import Plan

KINDS = {"xarm6": (6, 6)}
"""Axes and device type of the robots that can be driven (client library, x_config.py)."""


class XArm(RemoteArm):
    """An xArm.

    Args:
        robot: What the plan is for.
        settings: Address, rates, limits.
        time: Of the session; a new one if None.
        serial: Number that the arm must have; any if None.
    """

    entry = XARM
    client = XArmClient
    joint_columns: ClassVar[tuple[str, ...]] = ("current_{}_A", "temperature_{}_degC")
    columns: ClassVar[dict[str, Any]] = {
        "state": np.int64,
        "mode": np.int64,
        "error_code": np.int64,
    }
    told: ClassVar[tuple[str, ...]] = ("model", "serial", "firmware", "axes", "device_type")

    settings: XArmSettings

    def _wrong_model(self, info: dict[str, Any]) -> str | None:
        if (info.get("axes"), info.get("device_type")) == KINDS[self.robot.name]:
            return None
        return (
            f"the plan is for a {self.robot.name}, the controller says that it drives an "
            f"{info.get('model')}"
        )

    def _stop_orphan(self) -> Standing:
        settings = self.settings
        return stop_from_outside(settings.host, settings.control_port, settings.joints, self.clock)

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"unverified_on_hardware": True}


def xarm_arm(plan: Plan, wanted: WantedArm, time: SessionTime) -> XArm:
    """An arm for a plan; nothing is connected."""
    return XArm(plan.robot, xarm_settings(plan, wanted.host), time, wanted.serial)


def xarm_settings(plan: Plan, host: str) -> XArmSettings:
    """What the driving process must know of a plan.

    Args:
        plan: The motion.
        host: Address of the controller, with :PORT where commands do not go to port 502.

    Raises:
        InputError: The port is no number.
    """
    address, colon, port = host.partition(":")
    if colon and not (port.isdigit() and 0 < int(port) < 65536):
        raise InputError(f"--host {host}: after the colon must come the number of a port")
    return XArmSettings(
        address, **common_settings(plan), control_port=int(port) if colon else CONTROL_PORT
    )
