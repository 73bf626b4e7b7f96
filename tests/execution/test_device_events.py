"""What happens to sensors during a run of an arm is among the events of the session."""

from __future__ import annotations

import pytest

from testbench import execute, plan
from testbench.drivers import session_time
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.exceptions import DriverError
from testbench.execution import RunOptions, sensors
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Event, RunStatus, list_sessions


class Unsteady(SimulatedImu):
    """A sensor whose link breaks at 1 s and is made again at 2.5 s; it says so when it is next
    asked, newest first.
    """

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.until = 0
        self.waiting = [
            Event(5 * NANOSECONDS // 2, "reconnected", {"gap_s": 1.5, "attempts": 3}),
            Event(NANOSECONDS, "disconnected", {"reason": "out of range"}),
            Event(0, "connected", {}),
        ]

    def read(self, until_ns: int) -> ImuSamples:
        self.until = until_ns
        return super().read(until_ns)

    def events(self) -> list[Event]:
        told = [event for event in self.waiting if event.host_time_ns <= self.until]
        self.waiting = [event for event in self.waiting if event.host_time_ns > self.until]
        return told

    def stop(self) -> None:
        super().stop()
        self.waiting.append(Event(self.until, "samples_lost", {"count": 4}))


class Failing(Unsteady):
    """It is lost for good at its second reading."""

    def read(self, until_ns: int) -> ImuSamples:
        if self.until:
            self.until = until_ns
            raise DriverError("the sensor was lost")
        return super().read(until_ns)


def device_events(session):
    return [
        (event.event, event.host_time_ns)
        for event in session.events
        if event.details.get("sensor") == "hand"
    ]


def test_events_of_a_live_sensor_are_in_the_session_once_and_in_order(
    tiny, tmp_path, clock, monkeypatch
):
    monkeypatch.setattr(sensors, "SimulatedImu", Unsteady)
    monkeypatch.setattr(session_time, "STRETCH_NS", NANOSECONDS // 2)
    session = execute(plan(tiny), tmp_path, 1, RunOptions(clock=clock))
    found = device_events(session)
    assert [name for name, _ in found] == [
        "connected",
        "disconnected",
        "reconnected",
        "samples_lost",
    ]
    assert [time for _, time in found][:3] == [0, NANOSECONDS, 5 * NANOSECONDS // 2]
    lost = next(event for event in session.events if event.event == "reconnected")
    assert lost.details == {"sensor": "hand", "gap_s": 1.5, "attempts": 3}
    assert session.events[-1].event == "run_completed"
    assert [step.index for step in session.steps] == list(
        range(len(session.steps))
    )  # and the steps are as they were


def test_what_a_sensor_said_last_is_kept_when_it_fails(tiny, tmp_path, clock, monkeypatch):
    monkeypatch.setattr(sensors, "SimulatedImu", Failing)
    monkeypatch.setattr(session_time, "STRETCH_NS", NANOSECONDS)
    with pytest.raises(DriverError, match="the sensor was lost"):
        execute(plan(tiny), tmp_path, 1, RunOptions(clock=clock))
    (session,) = list_sessions(tmp_path)
    assert session.status is RunStatus.ERROR
    assert {name for name, _ in device_events(session)} >= {
        "connected",
        "disconnected",
        "samples_lost",
    }
