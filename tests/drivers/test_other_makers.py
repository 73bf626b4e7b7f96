"""A driver refuses another maker's arm by its name, in the dry run and before anything is
connected.
"""

from __future__ import annotations

import socket

import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.drivers.arms.catalogue import refuse_other_maker
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.arms.xarm import XArm, xarm_settings
from testbench.exceptions import InputError
from testbench.pipeline.prepared import make_plan
from tests.asking import run_of


@pytest.mark.parametrize(
    ("protocol", "arm", "said"),
    [
        ("quick", "xarm", "--arm xarm drives xarm6; the plan is for ur3e: say --arm ur"),
        (
            "quick_xarm6",
            "ur",
            "--arm ur drives e-series arms such as ur3e; the plan is for xarm6: say --arm xarm",
        ),
    ],
)
@pytest.mark.parametrize("confirmed", [False, True])
def test_another_makers_arm_is_refused_by_name_before_anything_is_connected(
    monkeypatch, tmp_path, protocol, arm, said, confirmed
):
    def connect(*arguments):
        raise AssertionError("something was connected")

    monkeypatch.setattr(socket.socket, "connect", connect)
    options = ["--confirm-motion", "--hazards-checked"] if confirmed else []
    asked = [
        "run",
        protocol,
        "--arm",
        arm,
        "--host",
        "192.0.2.1",
        "--simulate-imus",
        "--logs",
        str(tmp_path / "logs"),
    ]
    result = CliRunner().invoke(app, [*asked, *options])
    assert isinstance(result.exception, InputError) and str(result.exception) == said
    assert "Motion, from" not in result.output
    assert not (tmp_path / "logs").exists()


def test_each_driver_takes_its_own_arms_and_a_replay_takes_all():
    for name in ("ur3e", "ur5e", "ur10e"):
        refuse_other_maker("ur", name)
    refuse_other_maker("xarm", "xarm6")
    for name in ("ur3e", "xarm6", "panda"):
        refuse_other_maker("replay", name)
    with pytest.raises(InputError, match="the plan is for panda, which no driver is for"):
        refuse_other_maker("ur", "panda")


def test_the_drivers_themselves_refuse_too():
    ours, theirs = make_plan(run_of("quick")), make_plan(run_of("quick_xarm6"))
    with pytest.raises(InputError, match="the plan is for xarm6"):
        UrArm(theirs.robot, ur_settings(theirs, "192.0.2.1"))
    with pytest.raises(InputError, match="the plan is for ur3e"):
        XArm(ours.robot, xarm_settings(ours, "192.0.2.1"))
