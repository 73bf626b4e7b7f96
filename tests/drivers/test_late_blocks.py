"""Where least delays fall among the blocks that a controller's clock remembers, and what clipped
readings and loose packages are told as.
"""

from __future__ import annotations

import numpy as np
import pytest

from testbench import plan
from testbench.drivers.arms.controller_clock import BLOCK_NS, STEP_NS, ControllerClock
from tests.drivers.test_simulated_imu import Bench

OFFSET, LEAST, PERIOD = 123_456_789_000, 300_000, 8_000_000


def sent(clock: ControllerClock, begin_ns: int, end_ns: int, late_ns: int) -> None:
    """Packages of a stretch of time that are all late by the same delay."""
    for now in range(begin_ns, end_ns, PERIOD):
        clock.host_ns(now - OFFSET, now + LEAST + late_ns)


def test_packages_that_are_late_through_a_whole_block_do_not_move_the_clock():
    clock = ControllerClock()
    sent(clock, 0, 2_000_000_000, 0)
    clock.begin()
    sent(clock, 2_000_000_000, BLOCK_NS - 100_000_000, 0)
    assert clock.offset_ns == OFFSET + LEAST
    # the next block begins late, and stays so until just before its end
    begin = BLOCK_NS - 100_000_000
    sent(clock, begin, begin + BLOCK_NS - 500_000_000, STEP_NS // 2)
    assert clock.offset_ns == pytest.approx(OFFSET + LEAST, abs=1_000)


def test_the_clock_follows_no_faster_than_drift_can_be():
    clock = ControllerClock()
    sent(clock, 0, 1_000_000_000, STEP_NS // 2)
    clock.begin()
    sent(clock, 1_000_000_000, 2_000_000_000, 0)  # the packages were late, by half a step
    gone = OFFSET + LEAST + STEP_NS // 2 - clock.offset_ns
    assert 0 < gone <= 200e-6 * 1_000_000_000 + 1


def test_a_step_is_told_by_what_was_added_to_the_clocks_difference():
    clock = ControllerClock()
    sent(clock, 0, 1_000_000_000, 0)
    clock.begin()
    early = 40_000_000
    clock.host_ns(1_000_000_000 - OFFSET, 1_000_000_000 + LEAST - early)
    (step,) = clock.steps()
    assert step.by_ns == -early
    assert clock.steps() == []


@pytest.mark.parametrize(
    ("which", "limited"),
    [("accelerometer", {"range_g": 0.9}), ("gyroscope", {"range_deg_s": 10.0})],
)
def test_a_reading_at_full_scale_of_either_triad_marks_the_sample(which, limited):
    bench = Bench(plan("quick"), **{which: limited})
    samples = bench.read(6)
    values = samples.acc if which == "accelerometer" else samples.gyr
    top = 0.9 * 9.80665 if which == "accelerometer" else np.radians(10)
    at_the_end = (np.abs(values) >= top - 1e-12).any(axis=1)
    assert at_the_end.mean() > 0.05
    np.testing.assert_array_equal(samples.saturated, at_the_end)


def test_a_sheet_says_by_how_much_rates_are_late():
    low_pass = {"bandwidth_hz": 20.0}
    for sampling, integration in (("integrated", 0.5 / 100), ("instantaneous", 0.0)):
        bench = Bench(plan("quick"), sampling=sampling, gyroscope=low_pass)
        told = bench.imu.describe()["rate_delay_s"]
        assert told == pytest.approx(integration + 1 / (2 * np.pi * 20))
