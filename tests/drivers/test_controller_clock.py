"""The controller's clock against the host's: drift and delays are not steps, steps are followed
where something proves them.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.drivers.arms.controller_clock import ControllerClock
from testbench.drivers.arms.onset import Onset
from testbench.drivers.arms.ur_client import UrSettings
from testbench.drivers.arms.worker import Worker

SECOND, PERIOD = 1_000_000_000, 8_000_000
OFFSET, LEAST = 123_456_789_000, 300_000


class Packages:
    """A controller's packages as they arrive; what its clock and its network do may change at any
    time.
    """

    def __init__(self, seed: int = 0) -> None:
        self.clock, self.rng = ControllerClock(), np.random.default_rng(seed)
        self.now, self.shift, self.delay = 0, 0, 0
        self.error = 0
        self.arrived = 0
        self.stamp = 0

    def send(self, count: int) -> None:
        """The next packages; `error` is then that of the newest one's host time [ns]."""
        for _ in range(count):
            self.now += PERIOD
            self.stamp = self.now - OFFSET + self.shift
            late = LEAST + self.delay + int(self.rng.exponential(1_000_000))
            self.arrived = max(self.now + late, self.arrived + 1)
            self.error = self.clock.host_ns(self.stamp, self.arrived) - self.now


@pytest.fixture
def packages() -> Packages:
    result = Packages()
    result.send(250)
    result.clock.begin()
    result.send(250)
    assert abs(result.error - LEAST) < 200_000
    return result


def test_packages_that_come_late_for_minutes_do_not_move_the_clock(packages):
    packages.delay = SECOND // 5
    for _ in range(20):
        packages.send(800)
        lead = packages.clock.not_before(
            packages.stamp, packages.now - 3_000_000
        )  # a motion begins soon after its command
        assert lead == 0
        assert abs(packages.error - LEAST) < 500_000
    assert packages.clock.steps() == []


@pytest.mark.parametrize("delay_s", [0.0, 0.3])
@pytest.mark.parametrize("behind_s", [0.02, 0.4])
def test_stamps_that_go_back_are_followed_as_soon_as_ten_packages_bear_it_out(
    packages, behind_s, delay_s
):
    packages.delay = round(delay_s * SECOND)
    packages.send(100)
    packages.shift = -round(behind_s * SECOND)
    packages.send(9)
    assert packages.error == pytest.approx(-behind_s * SECOND, abs=2_000_000)
    packages.send(1)
    assert abs(packages.error - LEAST) < 2_000_000
    (step,) = packages.clock.steps()
    assert step.by_ns == pytest.approx(behind_s * SECOND, abs=2_000_000)


def test_stamps_that_go_back_alone_prove_nothing(packages):
    packages.send(100)
    before = packages.clock.offset_ns
    packages.clock.host_ns(packages.stamp - 20_000_000, packages.arrived + 1)
    packages.send(100)
    assert packages.clock.steps() == []
    assert packages.clock.offset_ns == pytest.approx(before, abs=1_000_000)


def test_how_sure_the_times_are_follows_from_answers_and_from_the_least_late_of_each_block(
    packages,
):
    packages.clock.round_trip_ns = 700_000
    assert packages.clock.unsure_ns == pytest.approx(1_200_000, abs=300_000)
    packages.delay = 6_000_000
    packages.send(2000)
    assert packages.clock.unsure_ns == pytest.approx(7_200_000, abs=1_500_000)


def test_stamps_that_fall_behind_in_a_gap_are_followed_where_an_effect_precedes_its_cause(packages):
    packages.now += SECOND
    packages.shift = -SECOND // 2
    packages.send(100)
    assert packages.error == pytest.approx(-SECOND / 2, abs=2_000_000), "nothing has proved it yet"
    assert packages.clock.not_before(packages.stamp, packages.now - 3_000_000) == 0
    packages.send(1)
    assert abs(packages.error - LEAST) < 1_000_000
    (step,) = packages.clock.steps()
    assert step.by_ns == pytest.approx(SECOND / 2, abs=1_000_000)
    packages.send(3000)
    assert abs(packages.error - LEAST) < 500_000
    assert packages.clock.steps() == []


def test_an_effect_before_its_cause_is_told_where_the_packages_do_not_bear_a_step_out(packages):
    lead = packages.clock.not_before(packages.stamp, packages.now + SECOND // 10)
    assert lead == pytest.approx(0.1, abs=0.002)
    packages.send(1)
    assert abs(packages.error - LEAST) < 500_000


def test_stamps_that_run_ahead_are_followed_at_once(packages):
    packages.shift = 3 * SECOND // 10
    packages.send(1)
    assert abs(packages.error) < 12_000_000
    packages.send(700)
    assert abs(packages.error - LEAST) < 2_000_000


@settings(max_examples=40, deadline=None)
@given(
    changes=st.lists(
        st.tuples(st.sampled_from(["delay", "behind"]), st.floats(0.03, 1.5)),
        min_size=1,
        max_size=5,
    ),
    seed=st.integers(0, 1000),
)
def test_with_a_motion_now_and_then_no_step_and_no_delay_leaves_the_clock_wrong(changes, seed):
    packages = Packages(seed)
    packages.send(250)
    packages.clock.begin()
    for kind, size in changes:
        if kind == "delay":
            packages.delay = round(size * SECOND)
        else:
            packages.shift -= round(size * SECOND)
        packages.send(150)
        packages.clock.not_before(packages.stamp, packages.now - 4_000_000)
        packages.send(1)
        assert abs(packages.error) < 12_000_000


def test_the_beginning_of_a_motion_is_seen_in_the_reference():
    onset, place = Onset(), np.zeros(6)
    assert onset.cause(place) is None
    assert onset.cause(place) is None
    onset.expect(5)
    assert onset.cause(place) is None
    assert onset.cause(place + 2e-4) == 5
    assert onset.cause(place + 4e-4) is None
    onset.expect(9)  # it still moves: where the next motion begins nobody can tell
    assert onset.cause(place + 6e-4) is None


class Listener:
    """The bench's end of the connection."""

    def __init__(self) -> None:
        self.told: list[tuple] = []

    def send(self, message: tuple) -> None:
        self.told.append(message)


def test_a_motion_that_seems_to_precede_its_command_is_an_event(packages):
    packages.send(50)
    client = SimpleNamespace(clock=packages.clock, now_ns=lambda: packages.arrived, now=lambda: 0.0)
    listener = Listener()
    worker = Worker(listener, client, UrSettings("nowhere"))
    worker.origin_ns = 0
    place = np.zeros(6)
    row = (place, place)

    def keep(host: int, target: np.ndarray) -> None:
        worker._keep([(host, packages.stamp, *row, target, 0)])

    for _ in range(2):
        packages.send(1)
        keep(packages.now, place)
    worker.onset.expect(packages.now + 40_000_000)
    packages.send(1)
    keep(packages.now, place + 0.01)
    (event,) = listener.told
    assert event[0] == "event"
    assert event[2] == "arm_time_doubtful"
    assert event[3]["lead_s"] == pytest.approx(0.032, abs=0.001)


def test_a_step_of_the_clock_is_an_event_and_the_sample_that_shows_it_has_the_new_time(packages):
    client = SimpleNamespace(clock=packages.clock, now_ns=lambda: packages.arrived, now=lambda: 0.0)
    worker = Worker(Listener(), client, UrSettings("nowhere"))
    worker.origin_ns, place = 0, np.zeros(6)
    packages.shift = -SECOND // 2
    for _ in range(60):
        packages.send(1)
        worker._keep([(packages.now + packages.error, packages.stamp, place, place, place, 0)])
    commanded = packages.now
    worker.onset.expect(commanded)
    packages.send(1)
    worker._keep([(packages.now + packages.error, packages.stamp, place, place, place + 0.01, 0)])
    assert [message[2] for message in worker.connection.told] == ["arm_time_step"]
    assert worker.connection.told[0][3]["by_s"] == pytest.approx(0.5, abs=0.002)
    assert worker.rows[-1][0] >= commanded
