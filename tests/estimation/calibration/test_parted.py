"""Recordings whose accelerations were kept at rest alone and whose rates in motion alone."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.calibration.gyroscope import BIAS_SIZE, unrested
from testbench.estimation.calibration.parted import parted
from testbench.estimation.calibration.turns import Turn
from testbench.records.session.samples import ImuSamples


def samples(pattern: str) -> ImuSamples:
    """One row a letter: a has an acceleration, g a rate, b both, n neither."""
    n = len(pattern)
    acc, gyr = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    for i, letter in enumerate(pattern):
        if letter in "ab":
            acc[i] = 1.0
        if letter in "gb":
            gyr[i] = 1.0
    time = np.arange(n) * 20_000_000
    return ImuSamples(time, time, gyr, acc, None, None, np.arange(n), np.zeros(n, dtype=bool))


def test_a_rest_between_two_turns_is_two_rests():
    found = parted(samples("aaaa" + "ggg" + "aaaaaa" + "ggggg" + "aaaa"))
    assert found.turns.tolist() == [[4, 7], [13, 18]]
    assert found.rests.tolist() == [[0, 4], [7, 10], [10, 13], [18, 22]]
    assert found.between.tolist() == [[0, 1], [2, 3]]


def test_a_turn_without_a_rest_on_both_sides_is_left_out():
    found = parted(samples("ggg" + "aaaaaa" + "gggg" + "aaaa"))
    assert found.turns.tolist() == [[9, 13]] and found.between.tolist() == [[0, 1]]
    assert found.rests.tolist() == [[6, 9], [13, 17]]
    assert parted(samples("gggg" + "aaaa")) is None


@pytest.mark.parametrize("pattern", ["b" * 40, "a" * 40, "g" * 40, "b" * 10 + "a" * 30, "n" * 9])
def test_other_recordings_are_not_taken_for_it(pattern):
    assert parted(samples(pattern)) is None


def test_a_row_of_both_at_the_border_does_no_harm():
    found = parted(samples("a" * 30 + "b" + "g" * 30 + "a" * 30))
    assert found.turns.tolist() == [[30, 61]] and found.rests.tolist() == [[0, 30], [61, 91]]


def test_noise_is_found_in_rates_that_move_and_of_the_bias_only_the_data_sheets_are_known():
    rng = np.random.default_rng(5)
    t = 0.02 * np.arange(200)
    moving = np.stack([np.sin(t), np.cos(2 * t), 0.5 * t], axis=1)
    turns = [Turn(moving + 0.01 * rng.standard_normal((200, 3)), 0.02) for _ in range(10)]
    reading = unrested(turns)
    assert reading.noise == pytest.approx(0.01, rel=0.1) and reading.samples == 0
    assert (reading.bias == 0).all() and (reading.sd == BIAS_SIZE).all()
