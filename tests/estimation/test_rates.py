"""What a gyroscope reads at rest, where a truth says whether it rested."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.signals.rates import rest_reading


def reading(degrees: float) -> np.ndarray:
    """Noise about a constant rate, and a faster part."""
    rng = np.random.default_rng(1)
    gyr = np.radians(degrees) * np.array([1.0, 0.0, 0.0]) + 0.002 * rng.standard_normal((2000, 3))
    gyr[500:] += rng.standard_normal((1500, 3))
    return gyr


@pytest.mark.parametrize("degrees", [2.0, 7.0, 30.0])
def test_a_slow_turn_that_a_truth_follows_is_no_bias(degrees):
    assert np.all(rest_reading(reading(degrees), lambda ends: False) == 0)
    found = np.degrees(rest_reading(reading(degrees), lambda ends: True))
    assert found == pytest.approx([degrees, 0, 0], abs=0.1)


def test_a_small_reading_is_a_bias_whatever_a_noisy_truth_says():
    found = np.degrees(rest_reading(reading(0.5), lambda ends: False))
    assert found == pytest.approx([0.5, 0, 0], abs=0.1)
