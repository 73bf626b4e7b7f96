"""A summary in Markdown as GitHub reads it.

GitHub Flavored Markdown Spec, https://github.github.com/gfm; tables: section 4.10.
"""

from __future__ import annotations

import re

from testbench.reporting.summaries.summary import Summary

SPECIAL = re.compile(r"([\\`*<>|\[\]~])")
"""What would be read as a sign; underscores within words are not (section 6.2)."""


def markdown_text(summary: Summary) -> str:
    """A summary as Markdown.

    Args:
        summary: What was found.
    """
    lines = [f"### {_plain(summary.title)}: {_plain(summary.verdict)}", ""]
    lines += [f"- {_plain(sentence)}" for sentence in summary.sentences]
    if summary.rows:
        lines += ["", _row(summary.columns), _row(["---"] * len(summary.columns))]
        lines += [_row([_plain(cell) for cell in row]) for row in summary.rows]
    if summary.facts:
        told = [f"{_plain(name)}: {_plain(value)}" for name, value in summary.facts.items()]
        lines += ["", f"<sub>{'; '.join(told)}</sub>"]
    return "\n".join([*lines, ""])


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _plain(text: str) -> str:
    """Words that are shown as they are, in one line."""
    return SPECIAL.sub(r"\\\1", " ".join(text.split()))
