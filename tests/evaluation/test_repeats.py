"""Intervals and rankings over sessions, on numbers of known law."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.evaluation.repeats import intervals, with_repeats
from testbench.records.results.evaluation import Evaluation, Metric
from testbench.records.results.evaluation_rows import RepeatedSession

DRAWS = 3000


def _of(filters: dict[str, float], kind: str = "flexion_mean_abs_error_deg") -> Evaluation:
    metrics = [
        Metric(f"elbow.{kind}", value, "deg", None, None, None, "", name, "ZXZ", "sweep")
        for name, value in filters.items()
    ]
    return Evaluation(session="one", metrics=metrics)


def _together(rows: list[dict[str, float]]) -> Evaluation:
    first, *others = [_of(row) for row in rows]
    names = [RepeatedSession(f"session {i}", f"part {i}", None) for i in range(len(rows))]
    return with_repeats(first, others, names)


@pytest.mark.parametrize("n", [2, 4, 12])
@pytest.mark.parametrize("logarithmic", [False, True])
def test_intervals_cover_another_session_as_often_as_they_say(n, logarithmic):
    """Drawn normal, or with normal logarithms; the share of 3,000 draws is known to 0.4 points."""
    rng = np.random.default_rng(n)
    drawn = 0.3 + 0.2 * rng.standard_normal((DRAWS, n + 1))
    drawn = np.exp(drawn) if logarithmic else drawn
    inside = 0
    for values in drawn:
        _, (low, high) = intervals(values[:-1], logarithmic)
        inside += low <= values[-1] <= high
    assert inside / DRAWS == pytest.approx(0.95, abs=0.015)


@pytest.mark.parametrize("logarithmic", [False, True])
def test_intervals_of_the_mean_cover_it(logarithmic):
    """Of magnitudes with a log-normal spread of 30 %, whose mean is known."""
    rng = np.random.default_rng(3)
    drawn = rng.lognormal(0.0, 0.3, (DRAWS, 8)) if logarithmic else rng.standard_normal((DRAWS, 8))
    mean = np.exp(0.3**2 / 2) if logarithmic else 0.0
    ends = [intervals(values, logarithmic)[0] for values in drawn]
    inside = np.mean([low <= mean <= high for low, high in ends])
    assert inside == pytest.approx(0.95, abs=0.02)


def test_magnitudes_end_at_zero():
    (low, _), (another, _) = intervals(np.array([0.0, 0.1, 0.4]), logarithmic=True)
    assert low == 0.0
    assert another == 0.0


def test_equal_filters_are_seldom_told_apart_and_different_ones_are():
    """Of eight sessions; an offset that all filters of a session share does not count."""
    rng = np.random.default_rng(4)
    false = told = 0
    for _ in range(300):
        shared = 1.0 + rng.exponential(0.5, 8)
        own = rng.normal(0, 0.1, (8, 4))
        alike = [dict(zip("abcd", shared[i] + own[i], strict=True)) for i in range(8)]
        false += any(c.p_holm < 0.05 for c in _together(alike).repeat_comparisons)
        apart = [row | {"d": row["d"] + 0.3} for row in alike]
        rows = {row.filter: row for row in _together(apart).repeat_ranking}
        told += rows["d"].best_rank == 4
    assert false / 300 < 0.09
    assert told / 300 > 0.8


def test_what_a_session_lacks_is_not_made_up():
    found = _together([{"a": 1.0, "b": 2.0}, {"a": 1.2}, {"a": 0.8, "b": 2.1}])
    rows = {row.filter: row for row in found.repeats}
    assert rows["b"].values == [2.0, None, 2.1]
    assert rows["a"].mean == pytest.approx(1.0)
    assert rows["a"].sd == pytest.approx(0.2)
    assert found.repeat_comparisons == []  # b did not run in all of them


def test_one_value_has_no_scatter():
    found = _together([{"a": 1.0}, {"b": 1.0}])
    assert found.repeats == []
