"""Which filter is better, and where no difference is shown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from testbench.evaluation.ranking import group_letters, holm, rank_filters
from testbench.model.statistics.memory import ErrorSeries, error_series, layout
from testbench.records.results.evaluation_rows import MEAN_MAGNITUDE, MEAN_SQUARE

RATE = 20.0


def test_holm_corrects_as_the_textbook_does():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


def sample_series(values: np.ndarray) -> ErrorSeries:
    """Of a recording of 20 Hz without a protocol."""
    own = layout(np.arange(len(values)) / RATE, [np.arange(len(values))], equally=False)
    assert own is not None
    return error_series(own, values)


NAMES = ["p", "q", "r", "s", "t", "u"]
PAIRS = [frozenset((a, b)) for i, a in enumerate(NAMES) for b in NAMES[i + 1 :]]


@given(st.sets(st.sampled_from(PAIRS)))
def test_filters_share_a_letter_exactly_where_they_do_not_differ(apart):
    letters = group_letters(NAMES, apart)
    assert all(letters.values())
    for pair in PAIRS:
        first, second = pair
        assert bool(set(letters[first]) & set(letters[second])) == (pair not in apart)
    assert "a" in letters["p"]


def errors(bias: float, seed: int, n: int = 600, memory: float = 0.5) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(n)
    return bias + 0.2 * lfilter([1.0], [1.0, -memory], noise)


@pytest.mark.parametrize("criterion", [MEAN_MAGNITUDE, MEAN_SQUARE])
def test_a_filter_that_is_worse_is_shown_to_be_and_equal_ones_are_not_parted(criterion):
    series = {
        "good": sample_series(errors(0.0, 1)),
        "as_good": sample_series(errors(0.0, 2)),
        "bad": sample_series(errors(1.0, 3)),
    }
    rows, comparisons = rank_filters("elbow", "static", "ZXZ", criterion, series)
    by_name = {row.filter: row for row in rows}
    assert [row.filter for row in rows][-1] == "bad"
    assert by_name["bad"].best_rank == by_name["bad"].worst_rank == 3
    for name in ("good", "as_good"):
        assert (by_name[name].best_rank, by_name[name].worst_rank, by_name[name].group) == (
            1,
            2,
            "a",
        )
    assert by_name["good"].no_difference == ["as_good"]
    assert by_name["bad"].no_difference == []
    assert len(comparisons) == 3
    assert all(c.p_holm >= c.p for c in comparisons)
    worst = next(c for c in comparisons if {c.first, c.second} == {"good", "bad"})
    assert worst.p_holm < 1e-3 and worst.difference < 0  # the first of a pair is the better one


def test_the_value_of_a_row_is_that_of_the_criterion():
    signal = errors(0.3, 4)
    series = {"one": sample_series(signal), "two": sample_series(2 * signal)}
    means, _ = rank_filters("elbow", None, None, MEAN_MAGNITUDE, series)
    squares, _ = rank_filters("arm", None, None, MEAN_SQUARE, series)
    assert means[0].value == pytest.approx(np.abs(signal).mean())
    assert squares[1].value == pytest.approx(2 * np.sqrt(np.mean(signal**2)))


def test_a_difference_below_a_hundredth_of_a_degree_is_none_however_sure():
    signal = errors(0.5, 5)
    series = {"one": sample_series(signal), "two": sample_series(signal + 0.005)}
    rows, comparisons = rank_filters("elbow", None, None, MEAN_MAGNITUDE, series)
    assert comparisons[0].p == 1.0 and {row.group for row in rows} == {"a"}
    shown, _ = rank_filters(
        "elbow", None, None, MEAN_MAGNITUDE, series | {"three": sample_series(signal + 0.1)}
    )
    assert shown[-1].filter == "three" and shown[-1].group == "b"


def test_slow_errors_alone_seldom_part_filters_that_are_alike():
    parted = 0
    for seed in range(200):
        series = {
            name: sample_series(errors(0.5, 1000 * i + seed, 400, 0.9))
            for i, name in enumerate(("one", "two"))
        }
        _, comparisons = rank_filters("elbow", None, None, MEAN_MAGNITUDE, series)
        parted += any(c.p_holm < 0.05 for c in comparisons)
    assert parted < 0.12 * 200


@pytest.mark.parametrize(("seconds", "ranked"), [(0.4, False), (2, False), (8, True), (60, True)])
def test_a_section_of_few_memories_ranks_nothing(seconds, ranked):
    """Of errors that last 0.4 s; all seeds of the shorter sections must keep silent."""
    found = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noise = lfilter(
            [1.0],
            [1.0, -np.exp(-1 / (0.2 * RATE))],
            rng.standard_normal((2, int(seconds * RATE) + 100)),
        )[:, 100:]
        if len(noise[0]) > 8:
            series = {"one": sample_series(noise[0]), "two": sample_series(80 + noise[1])}
            rows, comparisons = rank_filters("elbow", None, None, MEAN_MAGNITUDE, series)
            assert (len(rows), len(comparisons)) in ((2, 1), (0, 0))
            found.append(bool(rows))
    assert np.mean(found or [0]) > 0.8 if ranked else np.mean(found or [0]) < 0.3


def test_sweeps_are_enough_for_filters_that_are_far_apart():
    rng = np.random.default_rng(8)
    noise = lfilter([1.0], [1.0, -0.9], 0.05 * rng.standard_normal((3, 4000)))
    own = layout(np.arange(4000) / RATE, np.split(np.arange(4000), 4), equally=True)
    series = {
        name: error_series(own, error)
        for name, error in (("good", noise[0]), ("as_good", noise[1]), ("lost", 3 + noise[2]))
    }
    rows = {
        row.filter: row for row in rank_filters("shank", "walk", "ZXZ", MEAN_MAGNITUDE, series)[0]
    }
    assert rows["lost"].best_rank == 3 and not set(rows["lost"].group) & set(rows["good"].group)


def test_a_filter_that_drifts_all_the_time_does_not_take_the_ranking_from_the_others():
    names = ("good", "as_good", "bad")
    series = {
        name: sample_series(errors(bias, i, n=240, memory=0.0))
        for i, (name, bias) in enumerate(zip(names, (0, 0, 5), strict=True))
    }
    drifting = series | {"drifting": sample_series(np.linspace(0, 80, 240))}
    alone, together = (
        rank_filters("elbow", None, None, MEAN_MAGNITUDE, given)[0] for given in (series, drifting)
    )
    assert {row.filter for row in together} == set(names)
    assert [row.filter for row in together] == [row.filter for row in alone]


def test_what_is_shown_is_shown_at_five_percent_of_the_whole_family():
    signal = errors(0.0, 7)
    doubtful = 0
    for offset in np.linspace(0.02, 0.12, 60):
        series = {
            name: sample_series(np.abs(signal) + gain * offset + errors(0.0, 8 + gain))
            for gain, name in enumerate(("one", "two", "three"))
        }
        rows, comparisons = rank_filters("elbow", None, None, MEAN_MAGNITUDE, series)
        assert [c.p_holm for c in comparisons] == pytest.approx(holm([c.p for c in comparisons]))
        letters = {row.filter: set(row.group) for row in rows}
        for c in comparisons:
            assert bool(letters[c.first] & letters[c.second]) == (c.p_holm >= 0.05)
            doubtful += c.p < 0.05 <= c.p_holm < 0.10
    assert doubtful > 2  # the level, and the family, decide


def test_ranks_by_rms_do_not_part_what_differs_by_less_than_a_hundredth_of_a_degree():
    signal = errors(3.0, 5)
    for more, shown in ((0.005, False), (0.02, True)):
        series = {"one": sample_series(signal), "two": sample_series(signal + more)}
        _, comparisons = rank_filters("arm", None, None, MEAN_SQUARE, series)
        assert (comparisons[0].p < 0.05) == shown
