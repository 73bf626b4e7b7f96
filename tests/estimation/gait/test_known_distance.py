"""Step lengths by a known distance."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.gait.known_distance import fit_lengths
from testbench.exceptions import InputError

RNG = np.random.default_rng(1)
SLOW, FAST = 30 + RNG.normal(0, 1, 50), 40 + RNG.normal(0, 1, 45)


def test_the_intercept_gives_the_distance():
    slope, intercept = fit_lengths([SLOW], [70.0], 0.0294)
    assert slope == 0.0294
    assert float(np.sum(slope * SLOW + intercept)) == pytest.approx(70.0)


def test_slope_and_intercept_of_a_line_are_found_by_two_speeds():
    distances = [float(np.sum(0.021 * swings + 0.5)) for swings in (SLOW, FAST)]
    assert fit_lengths([SLOW, FAST], distances) == pytest.approx((0.021, 0.5))


def test_one_speed_tells_no_slope_and_an_empty_walk_nothing():
    with pytest.raises(InputError, match="two walks or more of different speeds"):
        fit_lengths([SLOW, SLOW + 0.1], [70.0, 70.5])
    with pytest.raises(InputError, match="without a gait cycle"):
        fit_lengths([np.zeros(0)], [10.0], 0.03)
