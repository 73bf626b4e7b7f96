"""Comparisons of sessions on numbers of known law: how often they are wrong, and what they find."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t

from testbench.evaluation.paired_errors import ErrorSignal, Judged, difference_of_pair, paired
from testbench.evaluation.ranking import Difference
from testbench.evaluation.session_differences import Side, _of_several, compare_metrics, p_values
from testbench.records.results.evaluation import Evaluation, Metric
from testbench.records.results.session_comparison import Told
from testbench.records.session.plan import PlannedStep

RATE, DWELL_S, ALIGNED_S = 20.0, 2.0, 6.0
DRAWS = 1500


def test_without_a_margin_both_p_are_those_of_two_sides() -> None:
    """Against Student's t with 10 degrees of freedom: 2.228 leaves 5 % outside."""
    for difference in (2.228, -2.228):
        assert p_values(difference, 1.0, 10, (0.0, 0.0)) == pytest.approx((0.05, 0.05), abs=1e-4)


def test_far_from_zero_p_at_the_margin_is_that_of_one_side() -> None:
    """1.812 leaves 5 % of one side outside, with 10 degrees of freedom."""
    assert p_values(10 + 1.812, 1.0, 10, (10.0, 10.0))[1] == pytest.approx(0.05, abs=1e-4)
    assert p_values(9.9, 1.0, 10, (10.0, 10.0))[1] == 1.0
    assert p_values(-5 - 1.812, 1.0, 10, (50.0, 5.0))[1] == pytest.approx(0.05, abs=1e-4)
    assert p_values(9.9, 1.0, 10, (10.0, 10.0))[0] < 1e-5


@pytest.mark.parametrize("margin", [0.5, 4.0])
def test_at_the_margin_a_difference_is_told_in_one_of_twenty(margin) -> None:
    rng = np.random.default_rng(1)
    freedom, told = 12, 0
    for _ in range(4000):
        error = math.sqrt(rng.chisquare(freedom) / freedom)
        found = margin + rng.standard_normal()
        told += p_values(found, error, freedom, (margin, margin))[1] < 0.05
    assert told / 4000 == pytest.approx(0.05, abs=0.012)


def steps() -> list[PlannedStep]:
    """Thirty poses of two seconds, four seconds apart, after the one that aligns."""
    begins = [ALIGNED_S + 4 + 4 * i for i in range(30)]
    return [
        PlannedStep(i, "static", "evaluation", f"{i}", "hold", {}, *(round(1e9 * t),) * 2, end)
        for i, t in enumerate(begins)
        for end in [round(1e9 * (t + DWELL_S))]
    ]


def session(rng: np.random.Generator, by_pose: np.ndarray, later_s: float) -> ErrorSignal:
    """Errors of one session: those of the part by the pose, and noise of first order less its mean
    over the pose that aligned; its samples lie `later_s` behind those of another.
    """
    time = np.arange(0, ALIGNED_S + 4 + 4 * 30, 1 / RATE)
    keep = np.exp(-1 / (1.5 * RATE))
    noise = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(len(time)))
    noise -= noise[time < ALIGNED_S].mean()
    pose = np.clip(((time - ALIGNED_S - 4) // 4).astype(int), 0, 29)
    error = 0.1 * noise + by_pose[pose]
    times = np.round(1e9 * (time + later_s)).astype(np.int64)
    return ErrorSignal(times, error, error, steps(), square=False, equally=True)


@pytest.mark.parametrize(("mean", "square"), [(2.0, False), (0.0, False), (2.0, True)])
def test_intervals_hold_no_difference_as_often_as_they_say(mean, square) -> None:
    """Of one part measured twice: what it gets wrong by the pose is large and the same in both."""
    rng = np.random.default_rng(2)
    inside, given = 0, 0
    for _ in range(DRAWS // 3):
        by_pose = mean + 0.5 * rng.standard_normal(30)
        one, other = session(rng, by_pose, 0.0), session(rng, by_pose, 0.013)
        pair = paired(one, other)
        assert pair is not None
        found = difference_of_pair(replace(pair, square=square), ALIGNED_S)
        if isinstance(found, Difference):
            given += 1
            inside += _holds_zero(found)
    assert given / (DRAWS // 3) > 0.9
    assert 0.91 < inside / given < 0.99


def _holds_zero(found: Difference) -> bool:
    return bool(abs(found.mean) < t.ppf(0.975, found.freedom) * found.error)


def test_a_constant_that_alignment_froze_is_in_the_interval() -> None:
    """Errors keep their sign, so that what the alignment froze moves the mean magnitude; without
    it the intervals would hold in fewer than 85 %.
    """
    rng = np.random.default_rng(3)
    apart, within = [], 0
    for _ in range(300):
        by_pose = 3 + 0.2 * rng.standard_normal(30)
        pair = paired(session(rng, by_pose, 0.0), session(rng, by_pose, 0.0))
        frozen, alone = difference_of_pair(pair, ALIGNED_S), difference_of_pair(pair, None)
        if isinstance(frozen, Difference) and isinstance(alone, Difference):
            apart.append(frozen.error / alone.error)
            within += _holds_zero(alone)
    assert np.median(apart) > 1.5
    assert within / len(apart) < 0.85


@pytest.mark.parametrize("sign", [1, -1])
def test_a_larger_error_is_found_with_its_size_whatever_its_sign(sign) -> None:
    rng = np.random.default_rng(4)
    by_pose = 2 + 0.3 * rng.standard_normal(30)
    one = session(rng, sign * by_pose, 0.0)
    found = difference_of_pair(paired(one, session(rng, sign * (by_pose + 0.5), 0.0)), ALIGNED_S)
    assert found.mean == pytest.approx(0.5, abs=4 * found.error)
    assert found.mean > 4 * found.error


def test_steps_are_laid_on_one_another_from_where_they_begin() -> None:
    """The second session did each step a second later; its errors grow with time."""
    time = np.arange(0, 40, 1 / RATE)
    first = [
        PlannedStep(0, "s", "evaluation", "a", "hold", {}, 10**9, 10**9, 9 * 10**9),
        PlannedStep(1, "s", "evaluation", "b", "hold", {}, 20 * 10**9, 20 * 10**9, 30 * 10**9),
    ]
    later = [
        PlannedStep(s.index, s.section, s.role, s.name, s.kind, {}, *(t + 10**9 for t in times))
        for s in first
        for times in [(s.start_ns, s.settled_ns, s.end_ns)]
    ]
    nanoseconds = np.round(1e9 * time).astype(np.int64)
    one = ErrorSignal(nanoseconds, time, time, first, square=False, equally=True)
    other = ErrorSignal(nanoseconds, time - 1.0, time - 1.0, later, square=False, equally=True)
    pair = paired(one, other)
    rows = pair.when.rows
    assert len(rows) > 300
    np.testing.assert_allclose(pair.second[rows], pair.first[rows], atol=1e-6)


@pytest.mark.parametrize("sizes", [(4, 4), (8, 1), (1, 6), (3, 5)])
def test_several_sessions_are_told_apart_falsely_in_one_of_twenty(sizes) -> None:
    """Parts whose errors are log-normal with a spread of 60 %."""
    rng = np.random.default_rng(sum(sizes))
    told = 0
    for _ in range(2000):
        drawn = rng.lognormal(0.0, 0.6, sum(sizes))
        base = {f"p{i}": [value] for i, value in enumerate(drawn[: sizes[0]])}
        new = {f"q{i}": [value] for i, value in enumerate(drawn[sizes[0] :])}
        told += _of_several(base, new, 0.0).p[0] < 0.05
    assert told / 2000 == pytest.approx(0.05, abs=0.015)


def test_the_same_parts_on_both_sides_are_compared_part_by_part() -> None:
    """Parts scatter by far more than what changed from one side to the other."""
    rng = np.random.default_rng(6)
    parts = rng.lognormal(0.0, 1.0, 6)
    base = {f"p{i}": [value] for i, value in enumerate(parts)}
    new = {f"p{i}": [1.1 * value * rng.lognormal(0, 0.01)] for i, value in enumerate(parts)}
    paired_up = _of_several(base, new, 0.0)
    assert paired_up.paired_by == "part"
    assert paired_up.p[0] < 1e-4
    others = {f"q{i}": value for i, value in enumerate(new.values())}
    assert _of_several(base, others, 0.0).p[0] > 0.3


def test_sessions_of_one_part_do_not_stand_for_parts() -> None:
    """Four sessions of one part each: how far parts scatter is in none of them."""
    found = _of_several({"a": [1.0, 1.1, 0.9, 1.0]}, {"b": [2.0, 2.1, 1.9, 2.0]}, 0.0)
    assert found.p is None
    assert "do not show how far parts scatter" in found.why
    again = _of_several({"a": [1.0, 1.1, 0.9, 1.0]}, {"a": [2.0, 2.1, 1.9, 2.0]}, 0.0)
    assert again.p[0] < 1e-3


def test_a_margin_counts_in_the_unit_of_the_metric() -> None:
    base = {f"p{i}": [value] for i, value in enumerate((0.48, 0.5, 0.52, 0.5))}
    new = {f"q{i}": [value] for i, value in enumerate((0.68, 0.7, 0.72, 0.7))}
    assert _of_several(base, new, 0.1).p[1] < 0.001
    assert _of_several(base, new, 0.3).p[1] == 1.0
    assert _of_several(new, base, 0.22).p[1] == 1.0
    assert _of_several(new, base, 0.1).difference == pytest.approx(-0.2, abs=0.01)


def _judged(values: dict[str, float]) -> Judged:
    metrics = [
        Metric("elbow.flexion_mean_abs_error_deg", value, "deg", None, None, None, "", name)
        for name, value in values.items()
    ]
    return Judged(None, Evaluation(session="one", metrics=metrics))


def _side(rows: list[dict[str, float]], first: int) -> Side:
    return Side([_judged(row) for row in rows], [f"part {first + i}" for i in range(len(rows))])


def test_all_metrics_together_are_told_apart_falsely_in_one_of_twenty() -> None:
    """Four filters on five parts a side."""
    rng = np.random.default_rng(7)
    false = found = 0
    for _ in range(400):
        rows = [dict(zip("abcd", rng.lognormal(0, 0.4, 4), strict=True)) for _ in range(10)]
        base, new = _side(rows[:5], 0), _side(rows[5:], 5)
        metrics = base.judged[0].evaluation.metrics
        told = compare_metrics(base, new, metrics, 0.0, False)
        false += any(own.told in {Told.WORSE, Told.BETTER} for own in told)
        worse = _side([row | {"b": 4 * row["b"]} for row in rows[5:]], 5)
        told = compare_metrics(base, worse, metrics, 0.0, False)
        found += told[1].told is Told.WORSE
    assert false / 400 == pytest.approx(0.05, abs=0.035)
    assert found / 400 > 0.9
