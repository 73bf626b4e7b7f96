"""Rows of numbers below the headers of motion capture exports, whose cells may be empty."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem, one_line
from testbench.formats.tables.bytes_stream import LineStream, encoding_of
from testbench.formats.tables.fields import BLANKS
from testbench.formats.tables.text_table import decimal_of
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

LINES_PER_BLOCK = 5000


def number_rows(file: Path, first_line: int, separator: str, width: int) -> np.ndarray:
    """The rows from a line on to the end, or to the first blank line below one.

    Args:
        file: Text.
        first_line: Of the rows, from 1; blank lines there are passed over.
        separator: Between the cells.
        width: Cells of a row; further ones must be empty.

    Returns:
        Shape (n, width); NaN where a cell is empty.

    Raises:
        FileProblems: A row has another number of cells, or a cell is no number; names the line.
    """
    blocks: list[np.ndarray] = []
    decimal = ""
    with LineStream(file, encoding_of(file), first_line - 1) as stream:
        numbered = enumerate(stream.lines(), first_line)
        full = itertools.dropwhile(lambda row: not row[1].strip(), numbered)
        rows = itertools.takewhile(lambda row: bool(row[1].strip(f" \t{separator}")), full)
        while block := list(itertools.islice(rows, LINES_PER_BLOCK)):
            decimal = decimal or decimal_of([line for _, line in block], separator)
            cells = [_cells(file, number, line, separator, width) for number, line in block]
            if decimal == ",":
                cells = [[cell.replace(",", ".") for cell in row] for row in cells]
            try:
                blocks.append(np.array(cells, dtype=float))
            except ValueError:
                raise _not_a_number(file, block, cells) from None
    if not blocks:
        raise FileProblems(file, [Problem("there are no rows of numbers below the header")])
    return np.concatenate(blocks)


def line_of_row(file: Path, first_line: int, row: int) -> int:
    """The line at which a row stands that `number_rows` read.

    Args:
        file: Text.
        first_line: As given to `number_rows`.
        row: From 0.
    """
    with LineStream(file, encoding_of(file), first_line - 1) as stream:
        blank = itertools.takewhile(lambda line: not line.strip(), stream.lines())
        return first_line + sum(1 for _ in blank) + row


def rows_apart(file: Path, key: str, stated: str | None, rows: int) -> list[Finding]:
    """Whether a file holds another number of rows than its header says, and what that means.

    Args:
        file: Of the rows.
        key: What the header calls their number.
        stated: As it stands there; None or no whole number where nothing is stated.
        rows: How many were read.
    """
    text = (stated or "").strip()
    count = int(text) if text.isascii() and text.isdigit() else rows
    if count == rows:
        return []
    code = "truth.rows_missing" if count > rows else "truth.rows_beyond"
    return [finding(code, file=file.name, key=key, stated=count, rows=rows)]


def _cells(file: Path, number: int, line: str, separator: str, width: int) -> list[str]:
    parts = line.split() if separator == BLANKS else line.split(separator)
    cells = [cell.strip() or "nan" for cell in parts]
    if len(cells) < width or any(cell != "nan" for cell in cells[width:]):
        hint = "; the file may be cut off there" if len(cells) < width else ""
        raise FileProblems(
            file,
            [Problem(f"has {len(cells)} cells where {width} are expected{hint}", line=number)],
        )
    return cells[:width]


def _not_a_number(file: Path, block: list[tuple[int, str]], cells: list[list[str]]) -> FileProblems:
    for (number, _), row in zip(block, cells, strict=True):
        for cell in row:
            try:
                float(cell)
            except ValueError:
                shown = one_line(cell[:40])
                return FileProblems(file, [Problem(f"'{shown}' is not a number", line=number)])
    return FileProblems(file, [Problem("cannot be read as numbers", line=block[0][0])])
