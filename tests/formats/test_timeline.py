"""Time: counters that wrap, whatever the pieces they come in; stamps of whole seconds; times of
day.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.formats.tables.timeline import (
    BadRowError,
    CounterUnwrapper,
    RegularTime,
    SpreadTime,
    StampedTime,
    Unwrapper,
    rate_of_stamps,
)


@st.composite
def pieces(draw: st.DrawFn, largest_step: int) -> tuple[int, np.ndarray, list[int]]:
    start = draw(st.integers(0, 2**40))
    steps = draw(st.lists(st.integers(0, largest_step), min_size=1, max_size=60))
    cuts = sorted(draw(st.lists(st.integers(0, len(steps)), max_size=4)))
    return start, np.concatenate([[start], start + np.cumsum(steps)]), cuts


@given(st.sampled_from([8, 16, 24, 32]), st.data())
def test_a_wrapped_counter_is_unwrapped_in_any_pieces(bits: int, data: st.DataObject) -> None:
    start, true, cuts = data.draw(pieces((1 << (bits - 1)) - 1))
    unwrap = Unwrapper(bits)
    parts = np.split(true % (1 << bits), cuts)
    result = np.concatenate([unwrap(part) for part in parts])
    np.testing.assert_array_equal(result - result[0], true - start)
    assert result[0] == start % (1 << bits)


@given(st.sampled_from([8, 16, 32]), st.data())
def test_a_sample_counter_is_unwrapped_without_knowing_its_width(
    bits: int, data: st.DataObject
) -> None:
    start = data.draw(st.integers((1 << bits) - 30, (1 << bits) - 1))
    steps = data.draw(st.lists(st.integers(1, 40), min_size=2, max_size=60))
    true = start + np.concatenate([[0], np.cumsum(steps)])
    if true[-1] >= start + (1 << bits):
        true = true[true < start + (1 << bits)]
    unwrap = CounterUnwrapper()
    cut = data.draw(st.integers(0, len(true)))
    wrapped = true % (1 << bits)
    result = np.concatenate([unwrap(wrapped[:cut]), unwrap(wrapped[cut:])])
    np.testing.assert_array_equal(result, true)


def test_a_step_back_without_a_wrap_stays_a_step_back() -> None:
    assert list(CounterUnwrapper()(np.array([5000, 5001, 100, 101]))) == [5000, 5001, 100, 101]


def test_microseconds_of_32_bits_go_on_after_71_minutes() -> None:
    true = np.arange(2**32 - 50_000, 2**32 + 50_000, 16_667)
    time = StampedTime("t", "us", bits=32)
    result = np.concatenate(
        [time({"t": part % 2**32}, len(part)) for part in np.array_split(true, 3)]
    )
    np.testing.assert_array_equal(np.diff(result), 16_667_000)
    assert result.dtype == np.int64


@pytest.mark.parametrize(("unit", "factor"), [("s", 1e9), ("ms", 1e6), ("us", 1e3)])
def test_units_of_time_become_nanoseconds(unit: str, factor: float) -> None:
    assert list(StampedTime("t", unit)({"t": np.array([0.0, 1.5])}, 2)) == [0, round(1.5 * factor)]


def test_nanoseconds_since_1970_keep_every_digit() -> None:
    stamps = np.array([1_600_000_000_123_456_789, 1_600_000_000_123_456_790])
    assert list(StampedTime("t", "ns")({"t": stamps}, 2)) == list(stamps)


def test_a_time_of_day_passes_midnight() -> None:
    time = StampedTime("t", "clock")
    first, second = (
        time({"t": np.array([86_398.5, 86_399.5])}, 2),
        time({"t": np.array([0.5, 1.5])}, 2),
    )
    assert list(np.diff(np.concatenate([first, second]))) == [1_000_000_000] * 3


def test_a_missing_time_is_refused_with_its_row() -> None:
    with pytest.raises(BadRowError) as caught:
        StampedTime("t", "s")({"t": np.array([0.0, 0.1, np.nan])}, 3)
    assert caught.value.row == 2


def test_a_rate_alone_counts_on_across_pieces_and_over_lost_samples() -> None:
    plain, counted = RegularTime(200.0), RegularTime(200.0, "n")
    assert list(np.concatenate([plain({}, 2), plain({}, 1)])) == [0, 5_000_000, 10_000_000]
    times = np.concatenate(
        [counted({"n": np.array([65_534, 65_535])}, 2), counted({"n": np.array([2])}, 1)]
    )
    assert list(times) == [0, 5_000_000, 20_000_000]


def stamps_of(t: np.ndarray) -> np.ndarray:
    return np.floor(t)


@pytest.mark.parametrize("phase", [0.0, 0.37, 0.99])
@pytest.mark.parametrize("size", [7, 100, 10_000])
def test_whole_seconds_are_spread_by_the_rate(phase: float, size: int) -> None:
    true = phase + np.arange(1234) / 100
    time = SpreadTime("t", 100.0)
    parts = [stamps_of(true)[i : i + size] for i in range(0, len(true), size)]
    result = np.concatenate([time({"t": part}, len(part)) for part in parts]) / 1e9
    np.testing.assert_allclose(np.diff(result), 0.01, atol=1e-9)
    if size > 1234:
        assert np.all(np.floor(result + 1e-9) == stamps_of(true))
    assert time.gaps == 0


def test_a_pause_of_the_recording_stays_a_pause() -> None:
    true = np.concatenate([np.arange(500) / 100, 12.0 + np.arange(500) / 100])
    time = SpreadTime("t", 100.0)
    result = time({"t": stamps_of(true)}, 1000) / 1e9
    assert time.gaps == 1
    assert np.argmax(np.diff(result)) == 499
    np.testing.assert_allclose(np.diff(result)[499], 7.0, atol=1.0)


def test_a_rate_that_the_stamps_deny_is_refused() -> None:
    with pytest.raises(BadRowError, match="behind a rate of 50 Hz"):
        SpreadTime("t", 50.0)({"t": stamps_of(np.arange(3000) / 100)}, 3000)


def test_the_rate_is_measured_from_whole_seconds_and_kept_where_they_cannot_deny_it() -> None:
    assert rate_of_stamps(stamps_of(np.arange(60_000) / 98.0), 100.0)[0] == pytest.approx(
        98.0, rel=1e-3
    )
    assert rate_of_stamps(stamps_of(np.arange(1000) / 99.9), 100.0)[0] == 100.0


def test_hours_at_an_odd_rate_are_spread_without_a_jump() -> None:
    true = 0.6 + np.arange(900_000) / 99.87
    rate, _ = rate_of_stamps(stamps_of(true), 100.0)
    time = SpreadTime("t", rate)
    result = (
        np.concatenate(
            [time({"t": stamps_of(part)}, len(part)) for part in np.array_split(true, 9)]
        )
        / 1e9
    )
    assert time.gaps == 0 and np.abs(result - true - np.median(result - true)).max() < 0.1


def test_the_rate_leaves_out_pauses() -> None:
    paused = np.concatenate([np.arange(30_000) / 98.0, 900 + np.arange(30_000) / 98.0])
    assert rate_of_stamps(stamps_of(paused), 100.0)[0] == pytest.approx(98.0, rel=1e-3)
    rate, doubt = rate_of_stamps(np.zeros(50), 100.0)
    assert rate == 100.0 and np.isinf(doubt)


@pytest.mark.parametrize("value", [1e308, -1e300, 5e18])
def test_a_time_that_64_bits_do_not_hold_is_refused_with_its_row(value: float) -> None:
    with pytest.raises(BadRowError, match="cannot be: it is more than 140 years") as caught:
        StampedTime("t", "s")({"t": np.array([0.0, value])}, 2)
    assert caught.value.row == 1
    with pytest.raises(BadRowError, match="the counter n jumps by years"):
        RegularTime(1.0, "n")({"n": np.array([0, 1 << 62])}, 2)


def test_unix_times_of_a_column_of_numbers_keep_their_last_digits() -> None:
    stamps = 1_600_000_000_123.0 + np.arange(4)
    result = StampedTime("t", "ms")({"t": stamps}, 4)
    assert list(result) == [1_600_000_000_123_000_000 + 1_000_000 * i for i in range(4)]
