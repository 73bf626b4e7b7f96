"""A part of the campaign `tests.benchmarks.comparisons`, and how its claims are counted."""

from __future__ import annotations

from tests.benchmarks import comparisons
from tests.benchmarks.comparisons import SHOWN, alarms, coverage, found_share, pairs_of


def metric(told: str, difference: float, error: float | None = 1.0) -> dict:
    ends = None if error is None else [difference - 2, difference + 2]
    place = {"filter": "a", "section": "static", "freedom": 30, "ci95": ends}
    return place | {"told": told, "difference": difference, "error": error}


def test_a_comparison_with_any_difference_told_is_one_alarm() -> None:
    quiet, loud = metric("not_shown", 0.1), metric("worse", 3.0)
    assert alarms([[quiet, quiet], [loud, loud], [quiet, loud], [quiet]]) == 0.5
    assert coverage([[quiet, metric("not_known", 5.0, None)], [loud]]) == (2 / 3, 0.5)


def test_twice_the_margin_is_asked_of_what_can_be_told() -> None:
    """A metric that lies two standard errors below what was put in is found all the same; one that
    lies three below is not.
    """
    rows = [
        [metric("not_shown", -2.0)],
        [metric("not_shown", -3.0)],
        [metric("not_known", 0, None)],
    ]
    assert found_share(rows, {"a"}) == {"a, static": 0.5}


def test_pairs_of_one_part_and_of_two(monkeypatch) -> None:
    """Two sessions of a part, and one of another."""
    monkeypatch.setattr(comparisons, "SESSIONS", 2)
    (found,) = pairs_of(range(1))
    assert len(found["same"]) == 1
    assert len(found["two"]) == 2
    assert all(own["told"] == "not_known" for rows in found["two"] for own in rows)
    assert any(own["told"] != "not_known" for own in found["same"][0])
    assert {"worse", "better"} == SHOWN
