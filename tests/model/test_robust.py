"""Which of several filters is far from the others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.model.statistics.robust import far_ones, outer_fence

ALIKE = {"a": 0.5, "b": 0.9, "c": 0.8, "d": 1.1, "e": 0.7}


def test_the_fence_is_tukeys_outer_one_and_a_degree_above_the_median_at_least():
    assert outer_fence(ALIKE) == pytest.approx(max(0.9 + 3 * (0.9 - 0.7), 0.8 + 1.0))
    wide = {name: 10 * value for name, value in ALIKE.items()}
    assert outer_fence(wide) == pytest.approx(9 + 3 * 2)


@given(st.floats(4.0, 1e6))
def test_one_that_runs_away_cannot_bend_the_rule(size):
    assert far_ones(ALIKE | {"runs": size}) == {"runs": size}
    four = {name: ALIKE[name] for name in "abcd"}
    assert far_ones(four | {"runs": size}) == {"runs": size}


@given(st.lists(st.floats(0, 1), min_size=4, max_size=12))
def test_filters_within_a_degree_of_one_another_are_never_outliers(values):
    assert far_ones({str(i): value for i, value in enumerate(values)}) == {}


def test_of_four_filters_none_is_far_and_missing_values_are_passed_over():
    assert far_ones({"a": 1.0, "b": 1.0, "c": 1.0, "d": 100.0}) == {}
    assert far_ones(ALIKE | {"gone": np.nan, "runs": 50.0}) == {"runs": 50.0}
