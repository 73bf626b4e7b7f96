"""Time of a session: of this machine, or of a simulation that may be held."""

from __future__ import annotations

import pytest

from testbench.drivers.session_time import CYCLE_NS, HOLD_S, STRETCH_NS, SessionTime, VirtualTime

SECOND = 1_000_000_000


def test_real_time_goes_on_by_a_cycle_or_by_what_has_passed(clock):
    time = SessionTime(clock)
    assert time.now_ns() == 0
    time.start()
    assert time.next_ns(0) == CYCLE_NS
    clock.sleep(3.0)  # a slow disk
    assert time.next_ns(CYCLE_NS) == 3 * SECOND
    time.wait_until(3 * SECOND + 7)
    assert time.now_ns() == 3 * SECOND + 7
    time.start()
    assert time.now_ns() == 3 * SECOND + 7


def test_virtual_time_passes_at_once_where_somebody_waits_for_it(clock):
    time = VirtualTime(clock)
    time.start()
    assert time.next_ns(0) == STRETCH_NS
    time.wait_until(STRETCH_NS)
    assert time.now_ns() == STRETCH_NS
    time.wait_until(5)
    assert time.now_ns() == STRETCH_NS
    assert clock.slept == []


@pytest.mark.parametrize("known_s", [0, 2])
def test_virtual_time_keeps_to_seconds_but_for_what_is_known(clock, known_s):
    time = VirtualTime(clock, "realtime", known_s * SECOND)
    time.start()
    began, now = clock.now_ns, 0
    while now < 5 * SECOND:
        now = time.next_ns(now)
        time.wait_until(now)
    assert now == time.now_ns() == 5 * SECOND
    assert clock.now_ns - began == (5 - known_s) * SECOND


def test_held_time_stands_still_and_goes_on_as_if_it_had_not_been_held(clock):
    time = VirtualTime(clock, "realtime")
    time.start()
    began = clock.now_ns
    time.wait_until(SECOND)
    time.hold()
    for _ in range(50):
        assert time.next_ns(SECOND) == SECOND
        time.wait_until(time.next_ns(SECOND))
    assert time.now_ns() == SECOND
    assert clock.slept[-50:] == [HOLD_S] * 50
    time.go_on()
    time.wait_until(2 * SECOND)
    assert time.now_ns() == 2 * SECOND
    assert clock.now_ns - began == 3 * SECOND  # two of the session, and one of the pause
