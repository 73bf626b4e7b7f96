"""The sentences at the top of the report crown nobody whom the ranking does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from testbench.records.results.answer import answers, known_to, listed
from testbench.records.results.evaluation import (
    Evaluation,
    JointRow,
    Metric,
    OrientationRow,
    Outcome,
)
from testbench.records.results.evaluation_rows import MEAN_SQUARE, RankRow

FLEXION = {"vqf_6d": 4.99, "gyro": 5.0, "vqf_9d": 3.21}
TOTAL = {"vqf_6d": 5.0, "gyro": 5.02, "vqf_9d": 24.0}


def judged(
    alike: dict[str, list[str]], total: dict[str, float] = TOTAL, left_out: tuple[str, ...] = ()
) -> Evaluation:
    """A sweep of a knee by three filters. By its flexion vqf_9d is nearest: its errors of heading
    and mounting cancel.
    """
    row = JointRow("knee", "gyro", "ZXY", "sweep", 0, "sweep", None, None, {}, 1, *[0.0] * 5, [])
    metrics = [
        Metric(
            "knee.flexion_mean_abs_error_deg",
            value,
            "deg",
            None,
            None,
            None,
            "",
            name,
            "ZXY",
            "sweep",
            0.2,
        )
        for name, value in FLEXION.items()
    ]
    ranks = [
        RankRow(*place, None, MEAN_SQUARE, name, value, 1, 3, "a", alike.get(name, []))
        for place in (("knee", "sweep"), ("shank", None))
        for name, value in total.items()
        if name not in left_out
    ]
    own = [
        RankRow("knee", "sweep", "ZXY", "mean |flexion error|", name, value, 1, 3, "a")
        for name, value in FLEXION.items()
    ]
    sensor = [
        OrientationRow("shank", name, 9, value, value, 5.0, value) for name, value in total.items()
    ]
    return Evaluation(
        session="session",
        joint_angle=[row],
        orientation=sensor,
        metrics=metrics,
        ranking=[*own, *ranks] if total else [],
    )


def told(evaluation: Evaluation) -> list[str]:
    return [answer.text for answer in answers(evaluation)]


FLEXION_SAID = (
    "Flexion of knee (ZXY, sweep): mean error 3.21 deg (vqf_9d) to 5.00 deg (gyro), known to ± "
    "0.20 deg; "
)


def test_the_filter_that_was_shown_to_be_best_by_its_whole_error_is_named():
    assert told(judged({}))[0] == (
        f"{FLEXION_SAID}by all of the error (RMS total error) vqf_6d is best."
    )


def test_filters_that_were_not_shown_to_differ_have_no_best():
    two = told(judged({"vqf_6d": ["gyro"], "gyro": ["vqf_6d"]}))[0]
    assert two.endswith("vqf_6d and gyro are best, and not told apart.")
    everyone = told(judged({"vqf_6d": ["gyro", "vqf_9d"]}))[0]
    assert everyone.endswith("no difference was shown between vqf_6d, gyro and vqf_9d.")


def test_what_was_not_ranked_is_said():
    unranked = told(replace(judged({}), ranking=[]))[0]
    assert unranked == f"{FLEXION_SAID}too little was evaluated to rank the 3 filters."
    drifted = told(judged({}, left_out=("gyro",)))[0]
    assert drifted.endswith("vqf_6d is best; not ranked: gyro.")


def test_an_orientation_that_the_angle_does_not_see_is_told():
    rows = [
        JointRow("knee", name, "ZXY", "sweep", 0, "sweep", None, None, {}, 1, 0, 0, 0, rmse, 0, [])
        for name, rmse in (("gyro", 5.0), ("vqf_6d", 5.0), ("vqf_9d", 3.3))
    ]
    said = told(replace(judged({}), joint_angle=rows))
    assert said[-1] == (
        "The flexion of knee does not see all: as an orientation, vqf_9d is wrong by up to 24 deg "
        "(RMS)."
    )
    assert not any("does not see" in text for text in told(replace(judged({}), ranking=[])))


def test_a_limit_is_told_with_its_scope():
    evaluation = judged({})
    limited = [
        replace(m, upper=4.0, outcome=Outcome.PASS if m.filter == "vqf_9d" else Outcome.FAIL)
        for m in evaluation.metrics
        if m.filter != "gyro"
    ]
    said = answers(replace(evaluation, metrics=limited))
    assert [answer.outcome for answer in said[:3]] == [Outcome.FAIL, Outcome.PASS, None]
    assert said[0].text == (
        "Flexion of knee by vqf_6d (ZXY, sweep): mean error 4.99 deg, known to ± 0.20 deg; limit "
        "at most 4 deg: fail."
    )
    assert said[2].text == (
        "1 of 2 limits kept, of 2 of 3 filters (vqf_6d and vqf_9d); gyro has none."
    )


@pytest.mark.parametrize(
    ("value", "expanded", "said"),
    [
        (0.0218, 0.2306, "0.02 deg, known to ± 0.23 deg"),
        (12.34, 15.2, "12 deg, known to ± 15 deg"),
        (0.5, None, "0.50 deg, its uncertainty is not known"),
        (112.69, None, "113 deg, its uncertainty is not known"),
        (None, 0.2, "not measured"),
    ],
)
def test_no_value_is_told_finer_than_it_is_known(value, expanded, said):
    assert known_to(value, expanded, "deg") == said


def test_names_are_listed_as_in_a_sentence():
    assert [listed("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]
