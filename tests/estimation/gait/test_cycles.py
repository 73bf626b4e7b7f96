"""Gait cycles: exact counts, whatever the offset, the noise and the rate; and none where nobody
walks.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.estimation.gait.cycles import find_cycles, without_offset
from testbench.estimation.gait.parameters import PUBLISHED, PedestrianParameters

PARAMETERS = PUBLISHED["universal"]


def swing(
    cycles: int,
    amplitude_deg=30.0,
    frequency=0.9,
    rate=100.0,
    offset_deg=0.0,
    noise_deg=0.0,
    phase_deg=0.0,
    seed=0,
):
    """Rest, whole cycles of a sine, rest; times [ns] and angle [rad]."""
    t = np.arange(-3.0, cycles / frequency + 3.0, 1 / rate)
    during = (t >= 0) & (t < cycles / frequency)
    x = np.where(
        during, amplitude_deg * np.sin(2 * np.pi * frequency * t + np.radians(phase_deg)), 0.0
    )
    x = (
        x + offset_deg + np.random.default_rng(seed).normal(scale=noise_deg, size=len(t))
        if noise_deg
        else x + offset_deg
    )
    return np.round((t - t[0]) * 1e9).astype(np.int64), np.radians(x)


@pytest.mark.parametrize("cycles", [1, 14, 109])
def test_every_cycle_is_counted_once(cycles):
    assert len(find_cycles(*swing(cycles), PARAMETERS)) == cycles


@given(
    st.integers(2, 30),
    st.floats(16, 60),
    st.floats(0.6, 1.4),
    st.sampled_from([50.0, 60.0, 100.0, 400.0]),
    st.floats(-90, 90),
    st.floats(0, 0.5),
    st.integers(0, 1000),
)
def test_neither_offset_nor_noise_nor_rate_change_the_count(
    cycles, amplitude, frequency, rate, offset, noise, seed
):
    time, x = swing(cycles, amplitude, frequency, rate, offset, noise, seed=seed)
    assert len(find_cycles(time, x, PARAMETERS)) == cycles


def test_a_walk_that_begins_backwards_has_as_many_cycles():
    assert len(find_cycles(*swing(14, phase_deg=180), PARAMETERS)) == 14


def test_steps_are_two_for_each_cycle():
    assert find_cycles(*swing(14), PARAMETERS).steps == 28


def test_the_swing_of_a_cycle_is_from_its_smallest_to_its_largest_angle():
    cycles = find_cycles(*swing(10, amplitude_deg=27, offset_deg=40), PARAMETERS)
    np.testing.assert_allclose(np.degrees(cycles.swing), 54, atol=0.1)
    _, x = swing(10, amplitude_deg=27, offset_deg=40)
    np.testing.assert_allclose(np.degrees(x[cycles.peak]), 67, atol=0.1)
    assert (
        (np.diff(cycles.begin) > 0).all()
        and (cycles.begin < cycles.peak).all()
        and (cycles.peak <= cycles.end).all()
    )


def test_rest_and_swings_below_the_threshold_are_no_cycles():
    assert len(find_cycles(*swing(20, amplitude_deg=0, noise_deg=1.0), PARAMETERS)) == 0
    assert len(find_cycles(*swing(20, amplitude_deg=9), PARAMETERS)) == 0
    assert (
        len(
            find_cycles(
                *swing(20, amplitude_deg=9),
                PedestrianParameters(amplitude_deg=10, false_zero_deg=2),
            )
        )
        == 20
    )


def test_a_swing_that_fails_does_not_shift_those_after_it():
    # a twitch, a rest, then ten cycles: the twitch is one half swing without a partner
    time, x = swing(10)
    x[100:140] = np.radians(12) * np.sin(np.linspace(0, np.pi, 40))
    assert len(find_cycles(time, x, PARAMETERS)) == 10


def test_lost_samples_are_passed_over():
    time, x = swing(14)
    x[600:605] = np.nan
    cycles = find_cycles(time, x, PARAMETERS)
    assert len(cycles) == 14
    assert np.isfinite(x[cycles.peak]).all()


def test_nothing_has_no_cycles():
    assert len(find_cycles(np.zeros(0, np.int64), np.zeros(0), PARAMETERS)) == 0


def test_the_mean_that_is_taken_off_is_that_of_the_window_before():
    time, x = swing(3, rate=100)
    centred, first = without_offset(time, x, 1.0)
    assert first == 100
    expected = [x[i - 100 : i].mean() - x[i] for i in range(100, len(x))]
    np.testing.assert_allclose(centred[100:], expected, atol=1e-12)
