"""What the driver of an arm says has happened, where the first sign of it is misleading."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from testbench.drivers.arms.client import ArmFault
from testbench.drivers.arms.ur_client import UrClient, UrSettings
from testbench.drivers.arms.worker import Worker
from tests.conftest import FakeClock

JOINTS = ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def worker(silent_for: float) -> Worker:
    client = SimpleNamespace(q=np.zeros(6), silent_for=silent_for, now=lambda: 0.0)
    return Worker(
        None, client, UrSettings("127.0.0.1", tracking=np.radians(5.0), joint_names=JOINTS)
    )


def sent(*degrees: float) -> np.ndarray:
    """Targets of the elbow, newest last."""
    targets = np.zeros((len(degrees), 6))
    targets[:, 2] = np.radians(degrees)
    return targets


def test_an_arm_that_does_not_follow_is_told_with_its_joint():
    with pytest.raises(ArmFault, match=r"elbow is 6\.00 deg from where it was sent") as caught:
        worker(0.008)._compare(sent(9, 6, 8))
    assert caught.value.kind == "tracking_error"
    worker(0.008)._compare(sent(9, 4, 8))  # it was sent there lately: a lag


def test_where_the_arm_is_nobody_knows_after_a_silence():
    with pytest.raises(
        ArmFault, match="the controller sent no data for 120 ms of a motion"
    ) as caught:
        worker(0.12)._compare(sent(9, 6, 8))
    assert caught.value.kind == "report_silence"


def client(clock: FakeClock, running: bool = False) -> UrClient:
    made = UrClient(UrSettings("127.0.0.1", watchdog=0.1), clock)
    made._control = SimpleNamespace(isConnected=lambda: True)
    made._stream = SimpleNamespace(ended="", garbled=False, take=list)
    made.may_move = running
    made._modes, made._program_seen = (7, 1), True
    return made


def answer_after(clock: FakeClock, seconds: float) -> bool:
    clock.sleep(seconds)
    return True


def test_a_program_that_ended_while_the_controller_was_waited_for_was_stopped_by_nobody(clock):
    slow = client(clock)
    slow._command("", answer_after, clock, 0.25)
    with pytest.raises(
        ArmFault, match=r"did not answer a command within 0\.\d s: its watchdog, which waits 0\.1 s"
    ) as caught:
        slow.check()
    assert caught.value.kind == "slow_response"


def test_a_program_that_ended_while_this_machine_was_busy_was_not_stopped_by_anybody(clock):
    busy = client(clock)
    busy._command("", answer_after, clock, 0.0)
    clock.sleep(0.25)
    with pytest.raises(
        ArmFault, match=r"nothing was sent to the controller for 0\.\d s, this machine is too busy"
    ):
        busy.check()


def test_a_program_that_ended_though_it_was_fed_was_stopped_by_somebody(clock):
    fed = client(clock)
    fed._command("", answer_after, clock, 0.0)
    with pytest.raises(ArmFault, match="the program on the controller was stopped") as caught:
        fed.check()
    assert caught.value.kind == "program_stopped"
    client(clock, running=True).check()


@pytest.mark.parametrize(
    ("states", "told"),
    [
        (["PAUSED mine.urp"] * 99, "paused"),
        (["PLAYING rtde_control"] * 99, "running"),
        (["PLAYING x", "STOPPED null"], None),
    ],
    ids=["paused", "running", "ended by its watchdog while it was asked for"],
)
def test_a_program_on_the_controller_is_somebody_elses_unless_it_is_just_ending(
    clock, states, told
):
    asked = iter(states)
    dashboard = SimpleNamespace(programState=lambda: next(asked))
    assert (
        UrClient(UrSettings("127.0.0.1", watchdog=0.1), clock)._program_of_others(dashboard) == told
    )
