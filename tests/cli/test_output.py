"""What people read on the terminal: lists of steps in few words."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.cli.output import in_ranges, say_findings
from testbench.records.findings.finding import Finding, Severity


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ([], ""),
        ([7], "7"),
        ([3, 4], "3-4"),
        ([*range(12, 41), 45], "12-40, 45"),
        ([0, 2, 3, 5, 6, 7], "0, 2-3, 5-7"),
        (list(range(10_000)), "0-9999"),
    ],
)
def test_numbers_that_follow_one_another_are_a_range(numbers, said):
    assert in_ranges(numbers) == said


def test_a_list_that_would_be_too_long_says_how_many_more_there_are():
    assert in_ranges(range(0, 200, 2), longest=20) == "0, 2, 4, 6, 8, 10 and 94 more"


@given(st.sets(st.integers(0, 400)), st.integers(1, 120))
def test_every_number_is_named_or_counted(numbers, longest):
    said, _, more = in_ranges(sorted(numbers), longest).partition(" and ")
    named: list[int] = []
    for span in filter(None, said.split(", ")):
        first, _, last = span.partition("-")
        named += range(int(first), int(last or first) + 1)
    assert named == sorted(numbers)[: len(named)]
    assert len(named) + int(more.removesuffix(" more") or 0) == len(numbers)
    assert len(said) <= max(longest, 7)


def test_what_is_the_same_of_several_sensors_is_said_once_and_warnings_first(capsys):
    lacks = [Finding("a.b", Severity.NOTE, name, "it lacks x", remedy="add x") for name in "lr"]
    other = Finding("a.c", Severity.NOTE, "l", "it lacks y", remedy="add x")
    wrong = Finding("a.d", Severity.WARNING, "", "it is late")
    say_findings([lacks[0], other, lacks[1], wrong])
    assert capsys.readouterr().out.splitlines() == [
        "warning: it is late",
        "note: l, r: it lacks x - add x",
        "note: l: it lacks y - add x",
    ]
