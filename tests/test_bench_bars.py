"""`make bench` says which of its bars are missed, and ends with an error then."""

from __future__ import annotations

import pytest

from tests.benchmarks import __main__ as bench
from tests.benchmarks.bars import Bar, show_bars

FAST = Bar("speed", 301.0, 300.0, "/s", at_least=True)
SLOW = Bar("speed", 299.0, 300.0, "/s", at_least=True)
SMALL = Bar("session", 89.9, 90.0, "MB")
LARGE = Bar("session", 90.0, 90.0, "MB")


@pytest.mark.parametrize(
    ("bar", "kept"),
    [
        (FAST, True),
        (SLOW, False),
        (SMALL, True),
        (LARGE, False),
        (Bar("speed", float("nan"), 300.0, "/s", at_least=True), False),
        (Bar("session", float("nan"), 90.0, "MB"), False),
    ],
)
def test_a_bar_is_kept_on_its_own_side(bar: Bar, kept: bool) -> None:
    assert bar.kept is kept


def test_each_bar_stands_beside_what_was_measured(capsys) -> None:
    assert show_bars([FAST, SMALL])
    assert "all 2 kept" in capsys.readouterr().out
    assert not show_bars([FAST, LARGE])
    lines = capsys.readouterr().out.splitlines()
    (large,) = [line for line in lines if "session" in line]
    assert large.split() == ["session", "90", "MB", "below", "90", "MB", "MISSED"]
    assert lines[-1].strip() == "1 of 2 missed"


@pytest.mark.parametrize(("bars", "code"), [([FAST], 0), ([FAST, SLOW], 1)])
def test_the_exit_code_tells_whether_a_bar_is_missed(bars, code, monkeypatch, capsys) -> None:
    for name in vars(bench).copy():
        if name.startswith("bench_"):
            monkeypatch.setattr(bench, name, list)
    monkeypatch.setattr(bench, "bench_pipeline", lambda: bars)
    assert bench.main() == code
