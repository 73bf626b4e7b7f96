"""What a ranking cannot say is said beside it."""

from __future__ import annotations

from dataclasses import replace

from testbench.records.results.evaluation import Evaluation, OrientationRow
from testbench.records.results.evaluation_rows import RankRow, TunedRow
from testbench.reporting.page.page import Sentence
from testbench.reporting.page.tables import Table
from testbench.reporting.sections.ranking import ranking_blocks, ranking_doubts

NAMES = ["good", "worse", "wild"]


def rank(name: str, value: float, group: str, *alike: str) -> RankRow:
    return RankRow("shank", None, None, "RMS total error", name, value, 1, 3, group, list(alike))


EVALUATION = Evaluation(
    session="s",
    orientation=[
        OrientationRow("shank", name, 10, 1.0, 1.0, 1.0, 1.0) for name in (*NAMES, "drifting")
    ],
    ranking=[
        rank("good", 0.2, "a", "wild"),
        rank("worse", 0.9, "b", "wild"),
        rank("wild", 75.8, "ab", "good", "worse"),
    ],
)


def said(evaluation: Evaluation) -> list[str]:
    blocks = ranking_doubts(evaluation, "shank")
    assert all(isinstance(block, Sentence) for block in blocks)
    return [block.text for block in blocks]


def test_a_filter_that_is_left_out_and_one_that_is_placed_nowhere_are_named() -> None:
    left_out, nowhere = said(EVALUATION)
    assert left_out.startswith("drifting is not ranked")
    assert nowhere.startswith("wild (75.8") and "shares a letter with every other" in nowhere


def test_those_that_are_placed_nowhere_share_one_sentence() -> None:
    rows = [rank("good", 0.2, "a", "wild", "wilder"), rank("worse", 0.9, "b", "wild", "wilder")]
    rows += [
        rank("wild", 7.0, "ab", "good", "worse", "wilder"),
        rank("wilder", 8.0, "ab", "good", "worse", "wild"),
    ]
    evaluation = replace(EVALUATION, ranking=rows, orientation=EVALUATION.orientation[:3])
    (nowhere,) = said(evaluation)
    assert nowhere.startswith(
        "wild (7.000 deg), wilder (8.000 deg) share a letter with every other by RMS total error"
    )
    (table,) = (block for block in ranking_blocks(evaluation, "shank") if isinstance(block, Table))
    alike = [row.cells[-1].text for row in table.rows]
    assert alike == ["wild, wilder", "wild, wilder", "any other", "any other"]


def test_where_nobody_is_told_apart_the_letters_say_enough() -> None:
    alike = [rank(name, 1.0, "a", *(other for other in NAMES if other != name)) for name in NAMES]
    assert said(replace(EVALUATION, ranking=alike, orientation=EVALUATION.orientation[:3])) == []
    assert said(replace(EVALUATION, ranking=[])) == []


def test_a_filter_that_was_tuned_on_the_session_has_the_place_of_a_fit() -> None:
    for here in (True, False):
        tuned = [TunedRow("good", {"beta": 0.1}, "RMS total error", "2026-01-02", ["s"], here)]
        blocks = ranking_blocks(replace(EVALUATION, tuned=tuned), "shank")
        told = [block.text for block in blocks if isinstance(block, Sentence)]
        fit = "good was tuned on this session: the place in this ranking is that of a fit"
        assert any(text.startswith(fit) for text in told) is here
