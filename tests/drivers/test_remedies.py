"""What a person is told to do after a stop is what the maker of that very arm says."""

from __future__ import annotations

import inspect
import re

import pytest

from testbench.drivers.arms import ur_client, worker, xarm_client
from testbench.drivers.arms.remedies import PENDANT, STUDIO, UR_REMEDIES, XARM_REMEDIES
from testbench.drivers.arms.ur import UrArm
from testbench.drivers.arms.xarm import XArm

BEFORE_A_SESSION = {"extra_missing", "connection", "watchdog", "silence"}
"""Faults that end a run before there is a session to advise on, whose sentence says all."""


@pytest.mark.parametrize(("arm", "client"), [(UrArm, ur_client), (XArm, xarm_client)])
def test_every_fault_in_motion_has_its_advice(arm, client):
    told = {
        kind
        for module in (client, worker)
        for kind in re.findall(r'ArmFault\(\s*"(\w+)"', inspect.getsource(module))
    }
    assert (
        {"disconnect", "protective_stop", "tracking_error"}
        <= told - BEFORE_A_SESSION
        <= set(arm.entry.remedies)
    )


def test_no_arm_is_given_another_makers_advice():
    assert "pendant" not in " ".join(XARM_REMEDIES.values()) and "brakes" not in " ".join(
        XARM_REMEDIES.values()
    )
    assert "Studio" not in " ".join(UR_REMEDIES.values())
    assert PENDANT in UR_REMEDIES["protective_stop"] and STUDIO in XARM_REMEDIES["protective_stop"]
