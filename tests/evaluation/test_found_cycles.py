"""Cycles that nobody planned: found where a signal repeats itself, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.evaluation.found_cycles import average_cycle, find_borders, period_of

RATE = 100.0


def walk(period: float = 1.1, cycles: int = 12, rest: float = 4.0, noise: float = 0.02):
    """A signal with a strong second harmonic between two rests."""
    time = np.arange(round((cycles * period + 2 * rest) * RATE)) / RATE
    phase = 2 * np.pi * np.clip(time - rest, 0, cycles * period) / period
    signal = np.sin(phase) + 0.9 * np.sin(2 * phase + 0.4) - 0.9 * np.sin(0.4)
    return time, signal + np.random.default_rng(1).normal(0, noise, len(time))


@pytest.mark.parametrize("period", [0.5, 1.1, 3.0])
def test_the_period_is_that_of_the_whole_motion_and_not_of_its_harmonic(period):
    time, signal = walk(period)
    assert period_of(time, signal) == pytest.approx(period, rel=0.02)
    borders = find_borders(time, signal)
    assert np.median(borders.end - borders.begin) == pytest.approx(period, rel=0.01)
    assert 10 <= len(borders.begin) <= 12
    average = average_cycle(borders, time, signal)
    assert average.ranges.mean() == pytest.approx(np.ptp(signal), rel=0.1)
    assert average.likeness > 0.99
    assert average.left_out == 0


@pytest.mark.parametrize("seed", range(8))
def test_what_does_not_repeat_itself_has_no_cycles(seed):
    draw = np.random.default_rng(seed)
    time = np.arange(4000) / RATE
    steps = draw.normal(size=len(time))
    smooth = np.convolve(steps, np.hanning(150), "same")
    for signal in (steps, np.cumsum(steps), smooth):
        borders = find_borders(time, signal)
        assert borders is None or average_cycle(borders, time, signal) is None


def test_two_cycles_are_too_few():
    time, signal = walk(cycles=2)
    assert find_borders(time, signal) is None


def test_a_gap_takes_its_cycle_away_and_the_others_stay():
    time, signal = walk()
    whole = average_cycle(find_borders(time, signal), time, signal)
    kept = (time < 9.0) | (time > 9.4)
    borders = find_borders(time[kept], signal[kept])
    average = average_cycle(borders, time[kept], signal[kept])
    missing = len(whole.ranges) - len(average.ranges)
    assert 1 <= missing <= 2
    assert average.left_out == missing


def test_a_stumble_is_left_out_and_counted():
    time, signal = walk()
    inside = (time > 8.4) & (time < 9.5)
    stumbled = np.where(inside, -signal, signal)
    average = average_cycle(find_borders(time, stumbled), time, stumbled)
    assert average.left_out >= 1
    assert average.likeness > 0.95
