"""Universal Robots e-series arms through ur_rtde: poses by moveJ, sweeps by servoJ."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from testbench.drivers.arms.catalogue import UR
from testbench.drivers.arms.entry import WantedArm
from testbench.drivers.arms.remote import RemoteArm, common_settings
from testbench.drivers.arms.settings import STOP_RAD_S2
from testbench.drivers.arms.standing import Standing
from testbench.drivers.arms.ur_client import UrClient, UrSettings
from testbench.drivers.arms.ur_outside import stop_from_outside
from testbench.drivers.session_time import SessionTime
from testbench.records.session.plan import Plan


class UrArm(RemoteArm):
    """An arm of the e-series.

    Args:
        robot: What the plan is for.
        settings: Address, rates, limits.
        time: Of the session; a new one if None.
        serial: Number that the arm must have; any if None.
    """

    entry = UR
    client = UrClient
    joint_columns: ClassVar[tuple[str, ...]] = ("current_{}_A", "temperature_{}_degC")
    columns: ClassVar[dict[str, Any]] = {
        "robot_mode": np.int64,
        "safety_mode": np.int64,
        "speed_scaling": np.float64,
    }
    told: ClassVar[tuple[str, ...]] = ("model", "serial", "polyscope", "speed_slider")

    def _stop_orphan(self) -> Standing:
        return stop_from_outside(self.settings.host, STOP_RAD_S2, self.clock)

    def _wrong_model(self, info: dict[str, Any]) -> str | None:
        model, expected = str(info.get("model", "")), self.robot.name.removesuffix("e").upper()
        if model.upper().removesuffix("E") == expected:
            return None
        return f"the plan is for a {self.robot.name}, the controller calls its arm {model}"


def ur_arm(plan: Plan, wanted: WantedArm, time: SessionTime) -> UrArm:
    """An arm for a plan; nothing is connected."""
    return UrArm(plan.robot, ur_settings(plan, wanted.host), time, wanted.serial)


def ur_settings(plan: Plan, host: str) -> UrSettings:
    """What the driving process must know of a plan."""
    return UrSettings(
        host,
        **common_settings(plan),
        least_slider=plan.protocol.spec.arm.speed_slider_percent / 100 - 0.005,
    )
