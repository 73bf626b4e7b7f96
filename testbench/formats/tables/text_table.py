"""Tables of numbers in text files: fast where all is well, exact about the line where not.

pyarrow reads the columns in blocks; when it refuses one, the rows are read once more, slowly, to
say which line is at fault and why.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv as arrow_csv

from testbench.exceptions import FileProblems, Problem, one_line
from testbench.formats.tables.ahead import worked_ahead
from testbench.formats.tables.broken_lines import Broken, ends_a_line, find_broken, without
from testbench.formats.tables.bytes_stream import (
    BLOCK,
    LineStream,
    check_readable,
    encoding_of,
)
from testbench.formats.tables.fields import BLANKS, MISSING, NUMBER, split_line
from testbench.formats.tables.monitor import Written, written_in
from testbench.formats.tables.source import Columns, Kind
from testbench.records.disk.tables import from_arrow

HEAD_LINES = 200
"""A header and what stands before it are looked for among so many lines."""
Layout = tuple[arrow_csv.ReadOptions, arrow_csv.ParseOptions, arrow_csv.ConvertOptions]
_CLOCK = (
    r"(?:(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})[T_ ]+)?"
    r"(?P<h>\d{1,2}):(?P<m>\d{2})(?::(?P<s>\d{2}(?:[.,]\d+)?))?\s*"
    r"(?:(?P<p>[AaPp])\.?\s?[Mm]\.?|Z|(?P<zone>[+-]\d{2}):?(?P<zone_min>\d{2}))?\s*$"
)
"""A time of day, with a date before it or not: others than those that begin with the year can be
read in two ways and are left out."""


def head_of(file: Path, encoding: str | None = None) -> list[str]:
    """The first lines of a text file, for finding its header.

    Raises:
        FileProblems: The file is missing, empty, or not text.
    """
    check_readable(file)
    lines: list[str] = []
    with LineStream(file, encoding_of(file, encoding)) as stream:
        for line in stream.lines():
            lines.append(line)
            if len(lines) == HEAD_LINES:
                break
    if not any(line.strip() for line in lines):
        raise FileProblems(file, [Problem("the file holds nothing but blank lines")])
    return lines


def guess_separator(header: str) -> str:
    """The separator that cuts a header, or a row, into most fields; blanks if none occurs.

    Commas between digits count only where there is neither a semicolon nor a tab.
    """
    if re.search(r"[;\t]", header):
        header = re.sub(r"(?<=\d),(?=\d)", ".", header)
    elif re.fullmatch(r"\s*([-+]?\d+(,\d+)?(e[-+]?\d+)?\s+)+[-+]?\d+(,\d+)?\s*", header, re.I):
        return BLANKS
    best = max((",", ";", "\t"), key=lambda separator: len(split_line(header, separator)))
    return best if len(split_line(header, best)) > 1 else BLANKS


@dataclass
class TextTable:
    """A table in a text file.

    Attributes:
        file: Where it is.
        names: Of the columns, from left to right.
        first_line: Of the data, from 1.
        separator: One character, or BLANKS.
        decimal: "." or ",".
        encoding: Of the file; None, or "utf-16", to go by its first bytes.
        twice: Places (from 1) of the columns of a title that stands more than once; such columns
            have their place behind the title in `names`.
        broken: Lines that hold no sample and are left out; None as long as none was met.
        written: How a serial monitor or a sketch wrote the lines; None where they are plain rows.
    """

    file: Path
    names: list[str]
    first_line: int
    separator: str = ","
    decimal: str = "."
    encoding: str | None = None
    _width: int = field(default=0, init=False)
    broken: Broken | None = field(default=None, init=False)
    written: Written | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.encoding = encoding_of(self.file, self.encoding)
        self.written = written_in(self.file, self.encoding)
        self.arrays: dict[str, list[str]] = {}
        self.twice: dict[str, list[int]] = {}
        self._fit_width()

    def _fit_width(self) -> None:
        """Let the columns be as many as the first row has.

        That is done where they differ only by separators at the end of a line.
        """
        self._width = len(self.names)
        with self._stream() as stream:
            first = next((line for line in stream.lines() if line.strip()), None)
        if first is None:
            raise self.problem("there are no samples after the header")
        fields = split_line(first, self.separator)
        extra_fields, extra_names = fields[self._width :], self.names[len(fields) :]
        if extra_fields and not any(extra_fields):
            self._width = len(fields)
        elif extra_names and not any(extra_names):
            self._width = len(fields)
            self.names = self.names[: self._width]

    def tell_apart(self) -> None:
        """Give columns of the same title names of their own, `x (column 3)`.

        They can then be read by their place, and still not by their title.
        """
        for title, count in Counter(self.names).items():
            if count > 1:
                self.twice[title] = [i + 1 for i, name in enumerate(self.names) if name == title]
        self.names = [
            f"{name} (column {i + 1})" if name in self.twice else name
            for i, name in enumerate(self.names)
        ]

    def _stream(self) -> LineStream:
        return LineStream(
            self.file, self.encoding or "utf-8", self.first_line - 1, self.separator == BLANKS
        )

    def require(self, wanted: list[str], what: str) -> None:
        """Refuse a table that lacks columns or has one of them twice.

        Args:
            wanted: Names of columns.
            what: Kind of file, for the message.
        """
        missing = [name for name in wanted if name not in self.names]
        if missing:
            raise self.problem(
                f"not {what}: it lacks the column {', '.join(missing)}; it has "
                f"{', '.join(self.names[:40])}"
            )
        twice = [
            name for name, count in Counter(self.names).items() if count > 1 and name in wanted
        ]
        if twice:
            raise self.problem(f"the column {', '.join(twice)} stands twice in the header")

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """The wanted columns in pieces; see `Source.chunks`."""
        self.require(list(kinds), "a table of the kind that was asked for")
        at = {name: f"c{self.names.index(name)}" for name in kinds}
        types = {"float": pa.float64(), "integer": pa.int64(), "clock": pa.string()}
        done = 0
        layout: Layout = (
            arrow_csv.ReadOptions(
                column_names=[f"c{i}" for i in range(self._width)],
                block_size=2 * BLOCK,
                use_threads=False,
            ),
            arrow_csv.ParseOptions(delimiter=self.separator),
            arrow_csv.ConvertOptions(
                include_columns=list(at.values()),
                column_types={at[name]: types[kind] for name, kind in kinds.items()},
                null_values=MISSING,
                strings_can_be_null=True,
                decimal_point=self.decimal,
            ),
        )
        try:
            with self._stream() as stream:
                # by hand and not by open_csv: its thread that reads ahead calls Python, and where
                # the reading breaks off aborts the interpreter at its end
                blocks = worked_ahead(lambda block: _parsed(block, layout), stream.blocks())
                for block, table_of in blocks:
                    try:
                        table = table_of()
                    except pa.ArrowInvalid:
                        rest = self._without_broken(block)
                        if not rest.strip():
                            continue
                        table = _parsed(rest, layout)
                    batch = table.combine_chunks().to_batches()[0]
                    columns = {
                        name: self._array(batch.column(at[name]), kind, done, name)
                        for name, kind in kinds.items()
                    }
                    done += batch.num_rows
                    yield columns
        except pa.ArrowInvalid as error:
            raise self._explain(kinds, done, str(error)) from None

    def _without_broken(self, block: bytes) -> bytes:
        """A block without the lines that hold no sample, which are looked for once in the file."""
        if self.broken is None:
            ended = ends_a_line(self.file)
            found = find_broken(self._rows(), self.separator, self._width, ended)
            self.broken = Broken() if found is None else found
        return without(block, self.broken)

    def _array(self, column: pa.Array, kind: Kind, done: int, name: str) -> np.ndarray:
        if kind == "float":
            return from_arrow(column)
        if column.null_count:
            row = int(np.argmax(column.is_null().to_numpy(zero_copy_only=False)))
            raise self.problem(f"the column {name} is empty here", done + row)
        if kind == "integer":
            return from_arrow(column)
        parts = pc.extract_regex(column, _CLOCK)
        if parts.null_count:
            row = int(np.argmax(parts.is_null().to_numpy(zero_copy_only=False)))
            text = str(column[row])
            raise self.problem(
                f"'{text[:40]}' does not end in a time of day hh:mm:ss (column {name})"
                f"{_rewritten(text)}",
                done + row,
            )
        return _instants(parts)

    def _rows(self) -> Iterator[tuple[int, str]]:
        """Number and text of every line that is a row."""
        with self._stream() as stream:
            for number, line in enumerate(stream.lines(), self.first_line):
                out = self.broken is not None and number in self.broken.texts
                if line.strip("\r") and not out:
                    yield number, line

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """The error that says `message` of the file, or of a row of it (from 0)."""
        line = None
        if row is not None:
            line = next((number for i, (number, _) in enumerate(self._rows()) if i == row), None)
        return FileProblems(self.file, [Problem(message, line=line)])

    def _explain(self, kinds: Mapping[str, Kind], done: int, said: str) -> FileProblems:
        """Which line pyarrow did not like, and why."""
        for i, (number, line) in enumerate(self._rows()):
            if i < done:
                continue
            fault = self._fault(line, kinds)
            if fault:
                return FileProblems(self.file, [Problem(fault, line=number)])
        return FileProblems(
            self.file, [Problem(f"cannot be read as a table: {said.splitlines()[0][:200]}")]
        )

    def _fault(self, line: str, kinds: Mapping[str, Kind]) -> str | None:
        fields = split_line(line, self.separator)
        if len(fields) != self._width:
            hint = ""
            if len(fields) > self._width and self.separator == ",":
                hint = "; if its decimals are commas, its columns need another separator"
            elif len(fields) < self._width:
                hint = "; the file may be cut off there"
            return f"has {len(fields)} fields where {self._width} are expected{hint}"
        for name, kind in kinds.items():
            text = fields[self.names.index(name)]
            if kind == "clock" or (kind == "float" and text in MISSING):
                continue
            plain = text if self.decimal == "." else text.replace(".", "x").replace(",", ".")
            pattern = (
                r"[-+]?\d+"
                if kind == "integer"
                else r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(inf|nan|Inf|NaN)"
            )
            if not re.fullmatch(pattern, plain):
                what = (
                    "a whole number"
                    if kind == "integer"
                    else f"a number with decimal {'comma' if self.decimal == ',' else 'point'}"
                )
                shown = one_line(text[:40])
                return f"'{shown}' in the column {name} is not {what}{_rewritten(text)}"
        return None

    def rounded_times(self, column: str) -> FileProblems | None:
        """The error that the times of a column were rounded until they are the same.

        None where they were not. Spreadsheets write 1.7E+12 for a stamp of 13 digits.
        """
        at = self.names.index(column)
        seen: list[tuple[int, str]] = []
        for number, line in self._rows():
            fields = split_line(line, self.separator)
            seen.append((number, fields[at] if at < len(fields) else ""))
            if len(seen) == 2:
                break
        found = re.fullmatch(r"\d(?:[.,](\d*))?[eE]\+?(\d+)", seen[0][1]) if seen else None
        if len(seen) < 2 or found is None or int(found[2]) <= len(found[1] or ""):
            return None
        (row, text), (_, following) = seen
        if text != following:
            return None
        message = f"the time '{text}' in the column {column} was rounded{_rewritten(text)}"
        return FileProblems(self.file, [Problem(message, line=row)])


def _parsed(block: bytes, layout: Layout) -> pa.Table:
    """The columns of whole lines; raises pyarrow's error where one is not as laid out."""
    return arrow_csv.read_csv(pa.BufferReader(block), *layout)


def _rewritten(text: str) -> str:
    """What to add where a spreadsheet has written a number or time in a way of its own."""
    if re.fullmatch(r"\d{1,2}:\d{2}([.,]\d+)?", text):
        lost = "which shows times so and loses the hours"
    elif re.fullmatch(r"[-+]?\d(?:[.,]\d*)?[eE]\+?\d+", text):
        lost = "which shows long numbers so and loses their last digits"
    else:
        return ""
    return (
        f": it looks saved by a spreadsheet, {lost}; export the file again without opening it in "
        "one, or state --rate HZ in place of the times"
    )


def _instants(parts: pa.Array) -> np.ndarray:
    """Seconds since midnight, or since 1970 where there is a date; in UTC where a zone is stated.

    Args:
        parts: Structs of text as `_CLOCK` finds them, n of them.

    Returns:
        Shape (n,) [s].
    """

    def texts(part: str) -> pa.Array:
        return pc.struct_field(parts, part)

    def number(part: str) -> np.ndarray:
        text = pc.replace_substring(pc.utf8_ltrim(texts(part), "+"), ",", ".")
        filled = pc.if_else(pc.equal(text, ""), "0", text)
        return pc.cast(filled, pa.float64()).to_numpy(zero_copy_only=False)

    hours, half = number("h"), pc.utf8_upper(texts("p")).to_numpy(zero_copy_only=False)
    if np.any(half != ""):
        hours = np.where(half == "", hours, hours % 12 + 12 * (half == "P"))
    seconds = 3600.0 * hours + 60.0 * number("m") + number("s")
    if pc.any(pc.not_equal(texts("zone"), "")).as_py():
        zone_min = number("zone_min")
        behind = pc.starts_with(texts("zone"), "-").to_numpy(zero_copy_only=False)
        seconds -= 3600.0 * number("zone") + 60.0 * np.where(behind, -zone_min, zone_min)
    if pc.all(pc.not_equal(texts("year"), "")).as_py():
        months = (number("year") - 1970) * 12 + number("month") - 1
        first = months.astype(np.int64).astype("datetime64[M]").astype("datetime64[D]")
        seconds += 86_400.0 * (first.astype(np.int64) + number("day") - 1)
    return seconds


def decimal_of(rows: Sequence[str], separator: str) -> str:
    """A comma where rows hold numbers such as 9,81 between other separators, else a point.

    Args:
        rows: The first ones of a table; the very first may hold whole numbers only.
        separator: Between their columns.
    """
    if separator == ",":
        return "."
    commas = points = 0
    for row in rows:
        for text in split_line(row, separator):
            commas += bool(re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", text))
            points += bool(re.fullmatch(r"[-+]?\d*\.\d+([eE][-+]?\d+)?", text))
    return "," if commas > points else "."


def first_row(lines: Sequence[str], width: int) -> int:
    """Which line is the first that has so many fields, numbers for the most part; 0 if none has.

    Args:
        lines: The first ones of a file.
        width: Fields of a row.
    """
    for at, line in enumerate(lines):
        fields = split_line(line, guess_separator(line))
        numbers = sum(bool(NUMBER.fullmatch(text)) for text in fields)
        if len(fields) == width and numbers > width / 2:
            return at
    return 0


def find_table(
    file: Path,
    is_header: re.Pattern[str],
    what: str,
    lines_below: int = 0,
    encoding: str | None = None,
) -> tuple[TextTable, list[str]]:
    """The table below the first line that looks like its header.

    Args:
        file: To read.
        is_header: Found somewhere in the header line.
        what: Kind of file, for the message.
        lines_below: Lines between the header and the data.
        encoding: Of the file, None to go by its mark.

    Returns:
        The table, and the lines above its header.

    Raises:
        FileProblems: There is no such line.
    """
    lines = head_of(file, encoding)
    written = written_in(file, encoding_of(file, encoding))
    if written is not None and is_header.search(",".join(written.titles)):
        at = first_row(lines, len(written.titles))
        separator = guess_separator(lines[at])
        decimal = decimal_of(lines[at:], separator)
        return TextTable(file, written.titles, at + 1, separator, decimal, encoding), lines[:at]
    number = next((i for i, line in enumerate(lines) if is_header.search(line)), None)
    if number is None:
        first = one_line(next(line for line in lines if line.strip())[:60])
        raise FileProblems(
            file,
            [
                Problem(
                    f"not {what}: no line of its beginning is such a header; it begins with "
                    f"'{first}'"
                )
            ],
        )
    header = lines[number]
    separator = guess_separator(header)
    names = split_line(header, separator)
    data = number + 1 + lines_below
    decimal = decimal_of(lines[data:], separator)
    table = TextTable(file, names, data + 1, separator, decimal, encoding)
    return table, lines[:number]
