"""Rows as a notebook shows them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def html_table(
    caption: str, columns: Sequence[str], rows: Iterable[Sequence[str | float | None]]
) -> str:
    """A plain table as HTML, whatever its words are made of.

    Args:
        caption: Above it.
        columns: Titles; none for a table of names and values.
        rows: Numbers with three significant digits, None as a dash.
    """
    head = "".join(f"<th>{escape(title)}</th>" for title in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(_shown(cell))}</td>" for cell in row) + "</tr>"
        for row in rows
    )
    return (
        f"<table><caption>{escape(caption)}</caption>"
        + (f"<thead><tr>{head}</tr></thead>" if columns else "")
        + f"<tbody>{body}</tbody></table>"
    )


def _shown(cell: str | float | None) -> str:
    if cell is None:
        return "–"
    return cell if isinstance(cell, str) else f"{cell:.3g}"
