"""Stated 95 % intervals hold the truth 95 times of 100; `python -m tests.benchmarks.intervals` asks
thousands.
"""

from __future__ import annotations

import pytest

from tests.estimation.calibration.covering import TRIALS, as_often_as_stated, chance, held

pytestmark = pytest.mark.slow

COUNT = 200
FEWER = {"gyroscope": 30, "norm_only": 60, "ellipsoid": 60, "ellipsoid_dip": 60}
"""Of what takes milliseconds, by a word of the name."""


@pytest.mark.parametrize("name", TRIALS)
def test_95_percent_intervals_hold_the_truth_95_times_of_100(name: str) -> None:
    count = min(FEWER.get(word, COUNT) for word in name.split())
    inside = held(TRIALS[name], range(count))
    assert as_often_as_stated(inside, count), (inside, chance(count))


def test_intervals_that_are_too_narrow_or_too_wide_are_found_out() -> None:
    fewest, most = chance(COUNT)
    assert 0.87 * COUNT < fewest < most < COUNT
