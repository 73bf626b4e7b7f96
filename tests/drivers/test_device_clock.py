"""The clock of a device: wraps, restarts, stamps that cannot be, and samples that were lost."""

from __future__ import annotations

from testbench.drivers.imus.device_clock import DeviceClock, SampleCounter

S = 1_000_000_000


def test_wraps_are_resolved_even_across_a_gap_longer_than_a_turn() -> None:
    wrap = 1000 << 32  # microseconds in 32 bits: 71.6 minutes
    clock = DeviceClock(wrap)
    truth = [0, 10 * S, wrap - S, wrap + S, wrap + 2 * S, 4 * wrap + 5 * S]
    begin = wrap - 15 * S
    for passed in truth:
        time_ns = clock.unwrap(
            (begin + passed) % wrap, 3 * S + passed + (passed // 20_000)
        )  # the host runs 50 ppm faster
        assert time_ns == begin + passed
        clock.accept(time_ns, 3 * S + passed + passed // 20_000)


def test_a_stamp_that_contradicts_the_host_is_not_believed_and_a_restart_goes_on_by_it() -> None:
    clock = DeviceClock(None)
    clock.accept(100 * S, 5 * S)
    assert clock.unwrap(101 * S, 6 * S) == 101 * S
    assert clock.unwrap(200 * S, 6 * S) is None
    assert clock.restart(2 * S, 8 * S) == 103 * S
    assert clock.unwrap(3 * S, 9 * S) == 104 * S


def test_losses_are_counted_by_the_devices_counter_or_else_by_its_time() -> None:
    by_own = SampleCounter(100.0, wrap=256)
    assert [
        by_own.step(t, c) for t, c in ((0, 254), (10**7, 255), (4 * 10**7, 2), (4 * 10**7, 2))
    ] == [1, 1, 3, 0]
    assert (
        by_own.step(5 * 10**7, 250) == 1
    )  # a counter that jumps while time does not: a digit was lost
    by_time = SampleCounter(400.0)  # stamps in whole milliseconds
    assert [by_time.step(t * 10**6) for t in (0, 2, 5, 7, 10, 20, 20)] == [1, 1, 1, 1, 1, 4, 1]
