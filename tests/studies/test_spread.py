"""Changes over parts: the interval and what may be said of it; and the sentences of reference-5
that are made of them.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import ttest_1samp

from testbench.model.statistics.spread import Change, by_verdict, in_percent, told
from testbench.studies.chain import words

ERRORS = st.lists(st.floats(0.01, 100), min_size=2, max_size=8)


@given(ERRORS, st.data())
def test_more_or_less_is_shown_where_a_t_test_of_the_logarithms_says_so(first, data):
    second = data.draw(st.lists(st.floats(0.01, 100), min_size=len(first), max_size=len(first)))
    change = Change.of(first, second)
    logarithms = np.log(np.array(first) / np.array(second))
    if np.ptp(logarithms) < 1e-6:
        return
    test = ttest_1samp(logarithms, 0)
    low, high = test.confidence_interval(0.95)
    assert change.interval == pytest.approx(
        (100 * (np.exp(low) - 1), 100 * (np.exp(high) - 1)), rel=1e-6, abs=1e-6
    )
    if abs(test.pvalue - 0.05) > 1e-6:
        assert (change.verdict != "not shown") == (test.pvalue < 0.05)


@given(ERRORS)
def test_turned_about_more_becomes_less(errors):
    other = [1.0] * len(errors)
    turned = {"more": "less", "less": "more", "not shown": "not shown"}
    assert Change.of(other, errors).verdict == turned[Change.of(errors, other).verdict]


def test_a_single_part_shows_nothing():
    change = Change.of([1.0], [5.0])
    assert (
        change.interval is None
        and change.verdict == "not shown"
        and change.percent == pytest.approx(-80)
    )


def test_a_change_is_told_in_words():
    assert [in_percent(value) for value in (-9.4, 31, 0.2, -0.04, 150, 68900, -99.5, -100)] == [
        "9 % less",
        "31 % more",
        "0.2 % more",
        "as much",
        "2.5 times as much",
        "690 times as much",
        "1/200 as much",
        "next to nothing",
    ]


LESS, MORE, NEITHER = (
    Change.of([1, 1.1, 0.9], [2, 2, 2]),
    Change.of([3, 3.1, 2.9], [2, 2, 2]),
    Change.of([1, 2, 3], [2, 2, 2]),
)


def test_the_sentence_says_what_each_change_shows():
    changes = {"angle of q": NEITHER, "rate of q": LESS, "acceleration of q": MORE}
    assert by_verdict(changes) == {
        "more": ["acceleration of q"],
        "less": ["rate of q"],
        "not shown": ["angle of q"],
    }
    said = words.states_judged("squat", changes, 3)
    assert said.startswith("squat: by intervals of 95 %, less error in rate of q (50 % less); ")
    assert "; more error in acceleration of q (50 % more); " in said
    assert "neither shown in angle of q (" in said
    assert said.endswith("(Fourier against kinematic, 3 runs).")
    only = words.order_judged({"angle": LESS}, 3)
    assert "more error" not in only and "neither" not in only
    assert only.endswith("The thesis has more in all 1.")


def test_of_one_run_the_sentence_claims_nothing():
    changes = {"angle": Change.of([3.0], [2.0]), "rate": Change.of([1.0], [2.0])}
    for said in (words.states_judged("squat", changes, 1), words.order_judged(changes, 1)):
        assert "ne run does not show which" in said
        assert not any(word in said for word in ("less", "more", "%", "thesis"))


def test_joints_that_are_not_covered_are_named_the_worst_first():
    said = words.covered(
        "kinematic", {"hip (gait)": (0.2, 70.0), "pelvis_tilt (gait)": (9.51, 30.0)}, 23, 80
    )
    assert "2 of 23 joints and motions are covered below 80 %" in said
    assert (
        "(pelvis_tilt (gait): RMS 9.51 deg, 30 % covered, hip (gait): RMS 0.20 deg, 70 % "
        "covered)" in said
    )
    assert "covers at least 80 %" in words.covered("fourier", {}, 23, 80)


def test_what_the_parts_show_is_told_no_wider_than_their_spread():
    assert told(Change.of([1.0], [2.0])) == "one part does not show which has less"
    assert told(LESS).startswith("50 % less (") and told(LESS).endswith(
        "less, 95 % interval over 3 parts)"
    )
    assert told(MORE).startswith("50 % more (")
    assert told(NEITHER).startswith("neither more nor less is shown (")
