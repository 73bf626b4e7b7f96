"""Readings of a worn sensor: what a hole without rows leaves of them."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.filters.base import UniformSamples
from testbench.estimation.gait.readings import _longest_stretch, _piece

RATE = 200.0


@pytest.mark.parametrize("hole_s", [0.15, 0.5, 3.0])
def test_of_a_recording_with_a_hole_the_longest_stretch_is_left_with_its_own_interval(hole_s):
    time = np.arange(4000) / RATE
    time[1500:] += hole_s
    stretch, holes = _longest_stretch(time)
    assert (stretch, holes) == (slice(1500, 4000), 1)
    mean = (time[-1] - time[0]) / 3999  # what the grid takes for its interval, the hole with it
    samples = np.tile(time[:, None], 3)
    piece = _piece(UniformSamples(mean, samples, samples), stretch, time)
    assert piece.interval == pytest.approx(1 / RATE, rel=1e-9)
    assert len(piece) == 2500 and piece.gyr[0, 0] == time[1500]


@pytest.mark.parametrize("lost", [0, 10])
def test_a_few_lost_rows_are_no_hole(lost):
    time = np.delete(np.arange(4000), np.arange(1500, 1500 + lost)) / RATE
    assert _longest_stretch(time) == (slice(0, 4000 - lost), 0)
