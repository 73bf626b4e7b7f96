"""A table for people: cells that know how to be shown, and the line that says how to read it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbench.records.results.numbers import decimals_by

NOTHING = "–"
AGAIN = "again"
"""The kind of a cell whose words stand above already: left off paper."""
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@dataclass(frozen=True)
class Cell:
    """One cell.

    Attributes:
        text: What is shown.
        title: More, on hovering.
        kind: CSS classes: "number", "wide", "badge pass"...
        head: A header of its row.
        span: Columns it covers.
        link: Where its text leads, relative to the page; empty for nowhere.
    """

    text: str
    title: str = ""
    kind: str = ""
    head: bool = False
    span: int = 1
    link: str = ""


@dataclass(frozen=True)
class Row:
    """One row; its kind becomes a CSS class: "published", "group"."""

    cells: list[Cell]
    kind: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        caption: What it shows.
        columns: Header.
        rows: Body.
        how: How to read it, one line.
        over: A header above the header.
        folded: Shown only when asked for.
        screen: Left off paper, for its numbers stand in another table.
    """

    caption: str
    columns: list[Cell]
    rows: list[Row]
    how: str
    over: list[Cell] = field(default_factory=list)
    folded: bool = False
    screen: bool = False


def mean_of_known(values: Sequence[float | None]) -> float | None:
    """The mean of those that are known; None where none is."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def header(*titles: str, numbers_from: int = 1) -> list[Cell]:
    """Column titles; those from `numbers_from` on stand over numbers."""
    return [
        Cell(title, kind="number" if i >= numbers_from else "") for i, title in enumerate(titles)
    ]


def label(text: Any, title: str = "") -> Cell:
    """The name a row begins with."""
    return Cell(str(text), title, head=True)


def text(value: Any, title: str = "", kind: str = "") -> Cell:
    """Words."""
    return Cell(NOTHING if value in (None, "") else str(value), title, kind)


def number(value: float | None, decimals: int = 2, title: str = "", kind: str = "") -> Cell:
    """A number with fixed decimals; a dash where there is none."""
    return Cell(digits(value, decimals), title, f"number {kind}".strip())


def significant(value: float | None, count: int = 3, title: str = "") -> Cell:
    """A number with a fixed count of significant digits, final zeros too.

    A power of ten where it has many zeros.
    """
    return Cell(significant_digits(value, count), title, "number")


def significant_digits(value: float | None, count: int = 3) -> str:
    """As `significant`, for a cell with more in it."""
    if value is None or not np.isfinite(value):
        return NOTHING
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{count - 1}e}".split("e")
    if not -5 < int(exponent) < 6:
        return power_of_ten(mantissa, int(exponent))
    return f"{float(f'{value:.{count - 1}e}'):.{max(count - 1 - int(exponent), 0)}f}".replace(
        "-", "−"
    )


def to_uncertainty(value: float | None, sd: float | None) -> str:
    """A value to the second significant digit of its standard uncertainty.

    By itself where that is unknown.
    """
    decimals = decimals_by(sd)
    return significant_digits(value) if decimals is None else digits(value, decimals)


def powers_of_ten(text: str) -> str:
    """Words in which numbers such as 3e-06 are written as people write them."""
    return re.sub(
        r"(?<![\w.])(\d(?:\.\d+)?)e([-+]\d+)\b",
        lambda found: power_of_ten(found[1], int(found[2])),
        text,
    )


def power_of_ten(mantissa: str, exponent: int) -> str:
    """A number in scientific notation, with true minus signs."""
    return f"{mantissa}·10{str(exponent).translate(_RAISED)}".replace("-", "−")


def unit_words(unit: str | None) -> str | None:
    """A unit as it is written by hand, from one in ASCII: "ug/sqrt(Hz)" to "µg/√Hz"."""
    if unit is None:
        return None
    return (
        re.sub(r"sqrt\((\w+)\)", r"√\1", re.sub(r"\bu(?=[gT]\b)", "µ", unit))
        .replace("^2", "²")
        .replace("^3", "³")
    )


def ratio(value: float | None) -> Cell:
    """How many times as large: two significant digits, with a power of ten only where the zeros
    would have to be counted.
    """
    if value is None or not np.isfinite(value):
        return Cell(NOTHING, kind="number")
    mantissa, exponent = f"{value:.1e}".split("e")
    if value == 0 or -4 <= int(exponent) <= 4:
        shown = f"{float(f'{value:.2g}'):.6f}".rstrip("0").rstrip(".")
    else:
        shown = power_of_ten(mantissa, int(exponent))
    return Cell(shown.replace("-", "−"), kind="number")


def digits(value: float | None, decimals: int = 2) -> str:
    """A number with fixed decimals and a true minus sign; never a negative zero."""
    if value is None or not np.isfinite(value):
        return NOTHING
    shown = f"{value:.{decimals}f}"
    if shown.strip("-0.") == "":
        shown = shown.lstrip("-")
    return shown.replace("-", "−")


def counted(count: int, what: str) -> str:
    """A count with its noun: 1 row, 2 rows."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def vector(values: Iterable[float], decimals: int = 2) -> str:
    """Numbers in a row."""
    return ", ".join(digits(value, decimals) for value in values)
