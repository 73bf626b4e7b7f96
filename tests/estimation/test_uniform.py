"""The regular grid: lost packets are filled in and taken out again."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.signals.uniform import fill_gaps
from testbench.model import rotation
from testbench.records.results.estimate import ClockFit
from testbench.records.session.samples import ImuSamples


def samples(kept: np.ndarray, period_ns: int = 10_000_000, first: int = 0) -> ImuSamples:
    """A steady turn and a steady slope, of which only some samples arrived."""
    t = np.arange(100)
    turn = rotation.from_rotation_vector(t[:, None] * np.array([0.0, 0.02, 0.0]))
    slope = t[:, None] * np.array([1.0, -2.0, 0.5])
    own = 123_456 + t * period_ns
    return ImuSamples(
        own[kept],
        own[kept],
        slope[kept],
        -slope[kept],
        3 * slope[kept],
        turn[kept],
        first + t[kept],
        np.zeros(len(kept), bool),
    )


def test_a_whole_recording_is_passed_on_untouched():
    given = samples(np.arange(100))
    uniform, rows = fill_gaps(given, ClockFit())
    assert uniform.gyr is given.gyr and uniform.acc is given.acc
    np.testing.assert_array_equal(rows, np.arange(100))
    assert uniform.interval == pytest.approx(0.01, rel=1e-12)


def test_gaps_are_filled_on_the_line_between_their_ends_and_taken_out_again():
    kept = np.setdiff1d(np.arange(100), [3, 4, 5, 40, 77, 78])
    given, whole = samples(kept, first=1000), samples(np.arange(100))
    uniform, rows = fill_gaps(given, ClockFit())
    assert uniform.mag is not None and uniform.device_q is not None
    for filled, expected in (
        (uniform.gyr, whole.gyr),
        (uniform.acc, whole.acc),
        (uniform.mag, whole.mag),
    ):
        np.testing.assert_allclose(filled, expected, atol=1e-12)
    np.testing.assert_allclose(uniform.device_q, whole.device_q, atol=1e-9)
    np.testing.assert_array_equal(rows, kept)
    np.testing.assert_array_equal(uniform.gyr[rows], given.gyr)
    assert uniform.interval == pytest.approx(0.01, rel=1e-12)


def test_the_interval_is_in_seconds_of_the_host():
    uniform, _ = fill_gaps(samples(np.arange(100)), ClockFit(drift_ppm=10_000.0))
    assert uniform.interval == pytest.approx(0.01 / 1.01, rel=1e-12)


@pytest.mark.parametrize(
    "counter",
    [np.zeros(100), np.arange(100)[::-1], np.arange(100) * 1000],
    ids=["stuck", "back", "wild"],
)
def test_a_counter_that_cannot_be_trusted_is_not_trusted(counter):
    good = samples(np.arange(100))
    strange = ImuSamples(**{**vars(good), "counter": counter.astype(np.int64)})
    uniform, rows = fill_gaps(strange, ClockFit())
    assert len(uniform.gyr) == 100
    np.testing.assert_array_equal(rows, np.arange(100))


def test_a_sensor_without_magnetometer_and_orientation_has_none_afterwards():
    good = samples(np.setdiff1d(np.arange(100), [50]))
    uniform, _ = fill_gaps(ImuSamples(**{**vars(good), "mag": None, "device_q": None}), ClockFit())
    assert uniform.mag is None and uniform.device_q is None
    assert len(uniform.gyr) == 100


def stamped(offsets_ns: np.ndarray) -> ImuSamples:
    good = samples(np.arange(100))
    return ImuSamples(**{**vars(good), "device_time_ns": good.device_time_ns + offsets_ns})


def test_intervals_that_the_stamps_show_to_differ_are_passed_on_and_others_are_not():
    rng = np.random.default_rng(0)
    uneven = stamped(rng.integers(-3_000_000, 3_000_000, 100))
    uniform, _ = fill_gaps(uneven, ClockFit(drift_ppm=1000.0))
    assert uniform.intervals is not None
    np.testing.assert_allclose(
        uniform.intervals[1:], np.diff(uneven.device_time_ns) / 1e9 / 1.001, rtol=1e-9
    )
    assert fill_gaps(stamped(rng.integers(-100_000, 100_000, 100)), ClockFit())[0].intervals is None
    bursts = stamped(-10_000_000 * (np.arange(100) % 4))  # four at a time
    assert fill_gaps(bursts, ClockFit())[0].intervals is None


def test_a_lost_packet_that_the_counter_hides_is_a_longer_interval_and_a_pause_is_not_held():
    late = stamped(np.where(np.arange(100) > 50, 10_000_000, 0))
    uniform, _ = fill_gaps(late, ClockFit())
    assert uniform.intervals is not None and uniform.intervals[51] == pytest.approx(0.02)
    paused = stamped(np.where(np.arange(100) > 50, 10**12, 0))
    uniform, _ = fill_gaps(paused, ClockFit())
    assert uniform.intervals is not None and uniform.intervals[51] == pytest.approx(0.1)
