"""The process that drives an arm says what ended it, also between motions, and when it found
that.
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from testbench import plan
from testbench.drivers.arms.client import ArmFault
from testbench.drivers.arms.controller_clock import ControllerClock
from testbench.drivers.arms.remedies import UR_REMEDIES
from testbench.drivers.arms.standing import Standing
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.arms.ur_client import UrClient, UrSettings
from testbench.drivers.arms.worker import Worker
from testbench.exceptions import DriverError
from tests.conftest import FakeClock


class Bench:
    """The other end of the connection, which asks for things and hears."""

    def __init__(self, asked: list[tuple]):
        self.asked, self.told = asked, []

    def poll(self, timeout: float = 0.0) -> bool:
        return bool(self.asked)

    def recv(self) -> tuple:
        return self.asked.pop(0)

    def send(self, message: tuple) -> None:
        self.told.append(message)


class Client(SimpleNamespace):
    """A controller whose watchdog cannot be fed any more; stopping it takes a second and a half."""

    time_ns, stopped, listening, clock = 7_000_000_000, 0, False, ControllerClock()

    def now_ns(self) -> int:
        return self.time_ns

    def now(self) -> float:
        return 1e-9 * self.now_ns()

    def keep_alive(self) -> None:
        raise ArmFault("refused", "the watchdog could not be fed")

    def stop(self, deceleration: float) -> None:
        self.stopped += 1
        self.time_ns += 1_500_000_000

    def stop_from_outside(self, deceleration: float) -> Standing:
        return Standing.AT_REST


def test_a_fault_between_motions_is_told_and_what_was_asked_meanwhile_is_not_done():
    bench, client = Bench([("alive",), ("approach", None), ("close",)]), Client()
    Worker(bench, client, UrSettings("nowhere")).serve()
    said = "the watchdog could not be fed"
    assert bench.told[-1] == ("fault", "refused", said, 7_000_000_000, Standing.AT_REST), (
        "when it was found, and what was seen of the arm"
    )
    assert client.stopped == 1
    assert bench.asked == []


@pytest.mark.parametrize("stuck", ["begin", "take"])
def test_a_driving_process_that_is_gone_before_the_start_is_a_fault_with_its_cause(stuck):
    def gone(*message) -> list:
        raise DriverError("the process is silent")

    the_plan = plan("quick")
    arm = UrArm(the_plan.robot, ur_settings(the_plan, "nowhere"))
    arm._stop_orphan = lambda: Standing.UNKNOWN
    arm.info = {"q_rad": [0.0] * 6}
    arm._link = SimpleNamespace(
        **({name: lambda *message: [] for name in ("begin", "tell", "take")} | {stuck: gone})
    )
    with pytest.raises(DriverError, match="is silent; nobody saw the arm come to rest: where"):
        arm.prepare(the_plan)
    (event,) = arm.events()
    assert (event.event, event.details["fault"]) == ("arm_fault", "driver")
    assert event.details["fault"] in UR_REMEDIES


def test_a_fault_has_the_time_at_which_it_was_found():
    the_plan = plan("quick")
    arm = UrArm(the_plan.robot, ur_settings(the_plan, "nowhere"))
    arm._origin_ns, arm._stop_orphan = 1_000_000_000, lambda: Standing.UNKNOWN
    arm._fail(("fault", "report_silence", "no data", 6_500_000_000, Standing.MOVING))
    (event,) = arm.events()
    assert (event.host_time_ns, event.details) == (
        5_500_000_000,
        {"fault": "report_silence", "message": "no data", "arm": "moving"},
    )


def test_a_controller_that_sent_nothing_yet_has_no_sample_and_is_called_silent():
    client = UrClient(UrSettings("1.2.3.4"), FakeClock())
    client._stream = SimpleNamespace(take=list, ended="")
    assert client.samples() == []
    with pytest.raises(ArmFault, match=r"1\.2\.3\.4 takes connections and sends no data") as caught:
        client._wait_for_sample()
    assert caught.value.kind == "silence"
