"""A few sessions of the campaign `tests.benchmarks.same_part`, and how its claims are counted."""

from __future__ import annotations

from tests.benchmarks.same_part import claims_of, counted


def test_opposite_claims_are_counted_once_a_pair():
    one = [["elbow", "a", "b"], ["elbow", "a", "c"]]
    other = [["elbow", "b", "a"], ["hand", "c", "a"]]
    pairs, opposite = counted([one, other, one])
    assert pairs == 4
    assert opposite == [("elbow", "a", "b")]


def test_two_sessions_of_one_part_do_not_contradict_each_other():
    _, opposite = counted(list(claims_of("quick", (), range(2))))
    assert opposite == []
