"""Stamps as loggers and radios write them: faults are put into a regular recording and mended, the
same in one piece as in many.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from testbench.formats.tables.mending import HEAD, Mender
from testbench.formats.tables.order import Order
from testbench.formats.tables.rows import Rows
from testbench.formats.tables.timeline import BadRowError
from testbench.records.findings.finding import Finding

MS = 1_000_000
STEP = 10 * MS
Fault = Callable[[np.ndarray, np.ndarray, np.random.Generator], tuple[np.ndarray, np.ndarray]]
"""From times [ms] and rows to the times and rows that a logger writes."""


def mend(
    time_ms: np.ndarray, values: np.ndarray, cuts: list[int], **order: bool | int
) -> tuple[np.ndarray, np.ndarray, list[Finding]]:
    """Mended times [ms], values, and what was noticed."""
    time = np.round(time_ms * MS).astype(np.int64)
    number = np.arange(len(time))
    mender = Mender(Order(**order))
    pieces = [
        Rows(time[part], part, {"v": values[part]}) for part in np.split(number, cuts) if len(part)
    ]
    out = list(mender(pieces))
    mended = np.concatenate([rows.time for rows in out])
    kept = np.concatenate([rows.columns["v"] for rows in out])
    return mended / MS, kept, mender.findings()


def grouped(size: int) -> Fault:
    def fault(t, v, rng):
        last = np.minimum((np.arange(len(t)) // size + 1) * size - 1, len(t) - 1)
        return t[0] + 10.0 * ((np.arange(len(t)) // size + 1) * size - 1), v[: len(last)]

    return fault


def short_first(t, v, rng):
    stamps, v = grouped(8)(t, v, rng)
    return stamps[5:], v[5:]


def mixed_sizes(t, v, rng):
    ends = np.cumsum(rng.integers(5, 12, len(t)))
    ends = np.append(ends[ends < len(t)], len(t))
    return t[ends[np.searchsorted(ends, np.arange(len(t)), side="right")] - 1], v


def late_packets(t, v, rng):
    stamps, v = grouped(8)(t, v, rng)
    late = rng.uniform(0, 25, len(t) // 8 + 1)
    return stamps + late[np.arange(len(t)) // 8], v


def lost_packets(t, v, rng):
    stamps, v = grouped(8)(t, v, rng)
    kept = ~np.isin(np.arange(len(t)) // 8, rng.choice(np.arange(3, len(t) // 8 - 3), 3))
    return stamps[kept], v[kept]


def rows_twice(t, v, rng):
    index = np.sort(np.concatenate([np.arange(len(t)), rng.integers(0, len(t), 40)]))
    return t[index], v[index]


def all_rows_twice(t, v, rng):
    return np.repeat(t, 2), np.repeat(v, 2)


def a_block_twice(t, v, rng):
    at = int(rng.integers(100, len(t) - 200))
    index = np.concatenate([np.arange(at + 90), np.arange(at, len(t))])
    return t[index], v[index]


def glitch(size: int, by_ms: float) -> Fault:
    def fault(t, v, rng):
        at = int(rng.integers(50, len(t) - 50))
        stamps = t.copy()
        stamps[at : at + size] += by_ms
        return stamps, v

    return fault


def stuck_and_caught_up(t, v, rng):
    at = int(rng.integers(50, len(t) - 50))
    stamps = t.copy()
    stamps[at : at + 7] = stamps[at]
    return stamps, v


def out_of_order(t, v, rng):
    index = np.arange(len(t))
    for at in range(30, len(t) - 30, 97):
        index[at : at + 3] = index[at : at + 3][::-1]
    return t[index], v[index]


def wrapped(bits: int) -> Fault:
    def fault(t, v, rng):
        return (t + (1 << bits) - 700) % (1 << bits), v

    return fault


def an_hour(sign: int) -> Fault:
    def fault(t, v, rng):
        at = int(rng.integers(50, len(t) - 50))
        return t + sign * 3_600_000.0 * (np.arange(len(t)) >= at), v

    return fault


def late_in_a_packet(t, v, rng):
    stamps, v = grouped(8)(t, v, rng)
    stamps[int(rng.integers(100, len(t) - 100))] += 5000.0
    return stamps, v


def twice_in_packets(t, v, rng):
    return rows_twice(*grouped(8)(t, v, rng), rng)


def stale_first(t, v, rng):
    return t - 1e8 * (np.arange(len(t)) < 2), v


FAULTS = {
    "groups of 8": (grouped(8), "time.grouped", 0.01, {}),
    "groups of 3": (grouped(3), "time.grouped", 0.01, {}),
    "a short first packet": (short_first, "time.grouped", 0.01, {}),
    "packets of many sizes": (mixed_sizes, "time.grouped", 0.01, {}),
    "packets that come late": (late_packets, "time.grouped", 26.0, {}),
    "lost packets": (lost_packets, "time.grouped", 0.01, {}),
    "rows twice": (rows_twice, "time.repeated", 0.01, {}),
    "all rows twice": (all_rows_twice, "time.repeated", 0.01, {}),
    "a block of rows twice": (a_block_twice, "time.repeated", 0.01, {}),
    "one stamp too late": (glitch(1, 5000.0), "time.glitch", 0.01, {}),
    "one stamp too early": (glitch(1, -700.0), "time.glitch", 0.01, {}),
    "six stamps too early": (glitch(6, -1e6), "time.glitch", 0.01, {}),
    "a clock that stood still": (stuck_and_caught_up, "time.shared", 0.01, {}),
    "first rows of another day": (stale_first, "time.stale", 0.01, {}),
    "rows out of order": (out_of_order, "time.reordered", 0.01, {}),
    "16 bits": (wrapped(16), "time.wrapped", 0.01, {"tick_ns": MS}),
    "32 bits": (wrapped(32), "time.wrapped", 0.01, {"tick_ns": MS}),
    "an hour on": (an_hour(1), "time.hour", 0.01, {"local": True}),
    "an hour back": (an_hour(-1), "time.hour", 0.01, {"local": True}),
}


@pytest.mark.parametrize("rows", [500, HEAD + 3000])
@pytest.mark.parametrize("name", FAULTS)
def test_what_a_logger_did_to_a_regular_recording_is_found_and_mended(name: str, rows: int) -> None:
    fault, code, within_ms, order = FAULTS[name]
    rng = np.random.default_rng(len(name) + rows)
    true = 10.0 * np.arange(rows)
    stamps, values = fault(true.copy(), np.arange(rows, dtype=float), rng)
    whole, kept, said = mend(stamps, values, [], **order)
    assert [f.code for f in said] == [code]
    expected = true[kept.astype(int)]
    assert np.all(np.diff(kept) > 0) and len(kept) >= rows - 24 - 5
    wrong = whole - whole[0] - (expected - expected[0])
    assert np.ptp(wrong) <= within_ms
    cuts = sorted(rng.integers(0, len(stamps), 9).tolist())
    pieces, again, also = mend(stamps, values, cuts, **order)
    np.testing.assert_array_equal(pieces, whole)
    np.testing.assert_array_equal(again, kept)
    assert also == said


@pytest.mark.parametrize(
    ("fault", "codes", "within_ms"),
    [
        (late_in_a_packet, ["time.glitch", "time.grouped"], 1.0),
        (twice_in_packets, ["time.repeated", "time.grouped"], 10.0),
    ],
)
def test_two_faults_at_once_are_both_mended(fault: Fault, codes: list[str], within_ms) -> None:
    true = 10.0 * np.arange(900)
    stamps, values = fault(true.copy(), np.arange(900.0), np.random.default_rng(2))
    mended, kept, said = mend(stamps, values, [321, 322])
    assert [f.code for f in said] == codes and len(kept) == 900
    assert np.ptp(mended - true) <= within_ms


@pytest.mark.parametrize("rows", [40, 500, HEAD + 3000])
def test_a_regular_recording_with_jitter_and_holes_stays_as_it_is(rows: int) -> None:
    rng = np.random.default_rng(rows)
    true = np.cumsum(rng.uniform(4, 16, rows)) + 4000.0 * (np.arange(rows) > rows // 2)
    mended, _, said = mend(true, rng.normal(size=rows), [rows // 3])
    np.testing.assert_allclose(mended, true, atol=1e-6)
    assert not said


@pytest.mark.parametrize("rows", [30, 500, HEAD + 3000])
def test_a_recording_that_began_again_is_refused_with_its_row(rows: int) -> None:
    true = np.concatenate([10.0 * np.arange(rows), 10.0 * np.arange(rows + 700)])
    for cuts in ([], [rows - 3], [rows, rows + 2]):
        with pytest.raises(
            BadRowError, match=r"does not return.*cut the file.*--rate HZ"
        ) as caught:
            mend(true, np.random.default_rng(1).normal(size=len(true)), cuts, tick_ns=MS)
        assert caught.value.row == rows


def test_a_counter_that_begins_again_is_told_from_one_that_wraps() -> None:
    for last_ms in (250.0, 40_000.0, 65_000.0):  # of 8, 16 bits: far from their end
        true = np.concatenate([np.arange(0.0, last_ms - 100, 10.0), np.arange(0.0, 3e5, 10.0)])
        with pytest.raises(BadRowError):
            mend(true, np.arange(len(true), dtype=float), [], tick_ns=MS)


def test_a_clock_that_stops_is_refused_with_its_row() -> None:
    true = 10.0 * np.arange(900)
    true[400:700] = true[400]
    true[700:] = true[400] + 10.0 * np.arange(1, 201)
    with pytest.raises(BadRowError, match=r"stands still .* 300 samples.*--rate") as caught:
        mend(true, np.arange(900.0), [])
    assert caught.value.row == 400


def test_a_sensor_at_rest_that_repeats_its_values_loses_none_of_a_packet() -> None:
    stamps, _ = grouped(8)(10.0 * np.arange(800), np.zeros(800), np.random.default_rng(0))
    values = np.random.default_rng(3).integers(0, 2, 800).astype(float)
    mended, kept, said = mend(stamps, values, [])
    assert len(kept) == 800 and [f.code for f in said] == ["time.grouped"]
    np.testing.assert_allclose(np.diff(mended), 10.0, atol=1e-6)
