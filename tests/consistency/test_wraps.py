"""Counts that ran over the end of 16 bits are named, and no motion or impact is taken for them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.consistency import Consistency
from testbench.consistency.doubtful import WRAPPED, Belief, Gates, doubts_on
from testbench.consistency.refused import Refusals
from testbench.consistency.traits import Traits
from testbench.consistency.wraps import wrapped_rows
from tests.benchmarks.recordings import of_arrays

RATE, COUNT = 100.0, np.radians(2000.0) / 32768
T = np.arange(0, 60, 1 / RATE)


def spun(fastest: float) -> np.ndarray:
    """Rates of turns that grow until they reach so much, with noise, shape (n, 3) [rad/s]."""
    noise = 0.005 * np.random.default_rng(3).standard_normal((len(T), 3))
    pace = fastest * np.sin(0.13 * T) * np.sin(1.1 * T)
    return np.column_stack([pace, 0.3 * np.sin(T), 0.4 * np.cos(0.7 * T)]) + noise


def held_in_16_bits(true: np.ndarray) -> np.ndarray:
    return ((np.round(true / COUNT) + 32768) % 65536 - 32768) * COUNT


def recording(gyr: np.ndarray):
    acc = np.random.default_rng(4).normal([0, 0, 9.81], 0.02, gyr.shape)
    return of_arrays(RATE, gyr, acc)


@pytest.mark.parametrize("fastest", [35.5, 45.0])
def test_rates_that_ran_over_the_end_are_lost_and_no_others(fastest):
    true = spun(fastest)
    over = np.flatnonzero(np.abs(np.round(true[:, 0] / COUNT)) > 32767)
    assert len(over) > 20
    doubts = doubts_on(recording(held_in_16_bits(true)), Belief())
    np.testing.assert_array_equal(np.flatnonzero(doubts.flags[WRAPPED]), over)
    assert set(doubts.flags) == {WRAPPED} and doubts.quantities[WRAPPED] == {"gyr"}
    kept = Belief(keep=frozenset({WRAPPED}))
    assert WRAPPED not in doubts_on(recording(held_in_16_bits(true)), kept).flags


def test_pieces_tell_the_same_as_the_whole():
    samples = recording(held_in_16_bits(spun(45.0)))
    gates = Gates(Traits().add(samples), Belief())
    whole = gates.doubt(samples).flags[WRAPPED]
    inside = int(np.flatnonzero(whole)[4])
    piece = samples.rows(slice(inside, None))
    np.testing.assert_array_equal(gates.doubt(piece).flags[WRAPPED], whole[inside:])


@pytest.mark.parametrize("what", ["none", "clipped", "rung", "two spikes"])
def test_what_a_sensor_may_read_is_none(what):
    gyr = spun(34.0 if what == "none" else 45.0 if what == "clipped" else 5.0)
    if what == "clipped":
        gyr = np.clip(gyr, -32768 * COUNT, 32767 * COUNT)
    at = 2_000
    if what == "rung":  # an impact that swings from one end of all readings to the other
        gyr[at : at + 8, 0] += 30 * np.array([0.4, 1, -1, 0.8, -0.6, 0.4, -0.2, 0.1])
    if what == "two spikes":
        gyr[at : at + 2, 0] = 30.0, -30.0
    assert WRAPPED not in doubts_on(recording(gyr), Belief()).flags


def test_the_side_on_which_fewer_rows_stand_is_that_of_the_wrapped_ones():
    rise = np.r_[np.linspace(0, 0.99, 40), np.linspace(-0.99, -0.9, 10), np.linspace(0.99, 0, 40)]
    np.testing.assert_array_equal(wrapped_rows(rise, -1.0, 1.0), np.arange(40, 50))
    np.testing.assert_array_equal(wrapped_rows(-rise, -1.0, 1.0), np.arange(40, 50))
    np.testing.assert_array_equal(wrapped_rows(rise[45:], -1.0, 1.0), np.arange(5))


class _File:
    """Samples as a file gives them."""

    def __init__(self, samples):
        self._samples = samples

    def pieces(self, _rows, _margin):
        yield self._samples, slice(0, len(self._samples))


@pytest.mark.parametrize("kept", [0.5, 0.75])
def test_readings_beyond_the_range_are_no_evidence_of_a_wrong_scale(kept):
    """What is left of clipped turns would turn gravity too little."""
    t = np.arange(0, 60, 0.002)
    angles = np.array([2.0, 1.6, 2.4]) * np.sin(t[:, None] * [2.9, 3.7, 2.3])
    pose = Rotation.from_rotvec(angles)
    true = (pose[:-1].inv() * pose[1:]).as_rotvec() * 500
    gyr = true[: len(true) // 5 * 5].reshape(-1, 5, 3).mean(axis=1)
    acc = pose[2::5][: len(gyr)].inv().apply([0, 0, 9.80665])
    rng = np.random.default_rng(2)
    acc, gyr = (own + rng.normal(0, 0.01, own.shape) for own in (acc, gyr))
    most = np.quantile(np.abs(gyr).max(axis=1), kept)
    samples = of_arrays(RATE, np.clip(gyr, -most, most), acc)
    refusals, seen = Refusals(Belief()), Consistency()
    for _ in refusals.watch(seen.watch([samples])):
        pass
    told = {found.code for found in refusals.findings(_File(samples))}
    assert told == {"samples.clipped"} and refusals.in_range is not None
    assert {found.code for found in refusals.in_range.findings()} <= {"consistency.unchecked"}
