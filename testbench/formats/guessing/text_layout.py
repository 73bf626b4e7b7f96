"""How a text file is laid out, found from its first lines."""

from __future__ import annotations

import re
from pathlib import Path

from testbench.exceptions import FileProblems, Problem, one_line
from testbench.formats.mapping import TextLayout
from testbench.formats.tables.bytes_stream import encoding_of
from testbench.formats.tables.fields import MISSING, NUMBER, split_line
from testbench.formats.tables.monitor import written_in
from testbench.formats.tables.text_table import first_row, guess_separator, head_of

_MOST_BELOW = 3
"""Lines between titles and samples."""
_LEAST_NUMBERS = 0.5
"""Part of the fields of a row that are numbers."""


def find_layout(file: Path) -> tuple[TextLayout, list[list[str]]]:
    """The layout of a table of numbers, and its first rows as text.

    Raises:
        FileProblems: It is not text, or no table is found at its beginning.
    """
    encoding = "auto"
    try:
        lines = head_of(file)
    except FileProblems as error:
        if "are not utf-8" not in str(error):
            raise
        encoding = "cp1252"
        lines = head_of(file, encoding)
    written = written_in(file, encoding_of(file, None if encoding == "auto" else encoding))
    if written is not None and written.titles:  # they stand beside the numbers
        at = first_row(lines, len(written.titles))
        separator = guess_separator(lines[at])
        rows = [split_line(row, separator) for row in lines[at:] if row.strip()]
        return TextLayout.model_validate({"encoding": encoding}), rows
    for at, line in enumerate(lines):
        if not line.strip() or _is_sep(line):
            continue
        separator = guess_separator(line)
        titles = split_line(line.lstrip("#% "), separator)
        if _is_row(titles):
            rows = [split_line(row, separator) for row in lines[at:] if row.strip()]
            layout = {"encoding": encoding, "header": False, "skip_lines": at}
            return TextLayout.model_validate(layout), rows
        for below in range(_MOST_BELOW + 1):
            rows = [split_line(row, separator) for row in lines[at + 1 + below :] if row.strip()]
            if len(titles) > 1 and rows and _fits(titles, rows):
                skip = at if any(row.strip(' "') and not _is_sep(row) for row in lines[:at]) else 0
                found = {"encoding": encoding, "skip_lines": skip, "lines_below_header": below}
                return TextLayout.model_validate(found), rows
    shown = one_line(next(line for line in lines if line.strip())[:60])
    raise FileProblems(
        file, [Problem(f"no table of numbers is found at its beginning; it begins with '{shown}'")]
    )


def _is_sep(line: str) -> bool:
    return line.strip(' "').lower().startswith("sep=")


def _is_row(fields: list[str]) -> bool:
    """Whether a line is numbers, for the most part."""
    if len(fields) < 2:
        return False
    numbers = sum(bool(NUMBER.fullmatch(text)) for text in fields)
    return numbers >= _LEAST_NUMBERS * sum(text not in MISSING for text in fields) and numbers > 1


def _fits(titles: list[str], rows: list[list[str]]) -> bool:
    """Whether the first rows are numbers below these titles."""
    return all(
        abs(len(row) - len(titles)) <= 1 and _is_row(row) for row in rows[: min(3, len(rows))]
    )


def numeric_columns(names: list[str], rows: list[list[str]]) -> tuple[list[str], list[str]]:
    """Names of the columns of numbers, and of those of times of day.

    Args:
        names: Of the columns.
        rows: The first ones, as text.
    """
    numbers, clocks = [], []
    # what a logger wrote of its own between the samples
    rows = [row for row in rows if any(NUMBER.fullmatch(text) for text in row)]
    for i, name in enumerate(names):
        texts = [row[i] for row in rows if i < len(row) and row[i] not in MISSING]
        if texts and all(NUMBER.fullmatch(text) for text in texts):
            numbers.append(name)
        elif texts and all(re.search(r"\d{1,2}:\d{2}:\d{2}", text) for text in texts):
            clocks.append(name)
    return numbers, clocks
