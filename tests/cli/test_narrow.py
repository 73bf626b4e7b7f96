"""A table on a narrow terminal breaks words, never numbers, and loses nothing."""

from __future__ import annotations

import re
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.cli.narrow import TIGHT_GAP, fit
from testbench.cli.output import say_table

WORDS = st.text("abc_ ", min_size=1, max_size=30)
NUMBERS = st.floats(-1e4, 1e4).map(lambda value: f"{value:.3f}")


@st.composite
def tables(draw: st.DrawFn) -> tuple[list[str], list[list[str]], list[bool]]:
    numeric = draw(st.lists(st.booleans(), min_size=1, max_size=9))
    columns = [draw(WORDS) for _ in numeric]
    same = [draw(st.booleans()) for _ in numeric]
    first = [draw(NUMBERS if own else WORDS) for own in numeric]
    count = draw(st.integers(1, 4))
    rows = [
        [
            value if alike else draw(NUMBERS if own else WORDS)
            for own, alike, value in zip(numeric, same, first, strict=True)
        ]
        for _ in range(count)
    ]
    return columns, rows, numeric


@given(tables(), st.integers(20, 140))
def test_numbers_stay_whole_and_what_is_left_out_is_said(
    table: tuple[list[str], list[list[str]], list[bool]], room: int
) -> None:
    columns, rows, numeric = table
    layout = fit(columns, rows, numeric, room)
    left_out = [i for i in range(len(columns)) if i not in layout.kept]
    assert layout.same == [(columns[i], rows[0][i]) for i in left_out]
    assert all(len({row[i] for row in rows}) == 1 for i in left_out)
    if layout.widths is None:
        assert layout.width <= room
        return
    assert layout.width == sum(layout.widths) + TIGHT_GAP * (len(layout.kept) - 1)
    for i, width in zip(layout.kept, layout.widths, strict=True):
        assert not numeric[i] or width >= max(len(row[i]) for row in rows)
    if layout.width > room:  # only where nothing can be folded any more
        assert all(
            numeric[i] or width <= 8 for i, width in zip(layout.kept, layout.widths, strict=True)
        )


def test_a_table_of_errors_fits_a_terminal_of_80_characters(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    columns = [
        "section",
        "joint",
        "state",
        "mean",
        "U",
        "mean |e|",
        "RMSE",
        "largest",
        "stated",
        "covered [%]",
    ]
    rows = [
        ["waves", joint, "kinematic", -0.19, 0.2, 0.19, 0.214, -0.472, 0.429, 93.725]
        for joint in ("shoulder_pan_joint", "shoulder_lift_joint")
    ]
    say_table("Joints of the chain", columns, rows)
    lines = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0] == "Joints of the chain; section waves; state kinematic"
    for joint in ("shoulder_pan_joint", "shoulder_lift_joint"):
        (line,) = (line for line in lines if joint in line)
        assert line.split()[1:] == [
            "-0.190",
            "0.200",
            "0.190",
            "0.214",
            "-0.472",
            "0.429",
            "93.725",
        ]
