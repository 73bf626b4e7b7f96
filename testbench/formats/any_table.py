"""A file of samples as a table, whatever holds it: text, Parquet, MATLAB or HDF5."""

from __future__ import annotations

from pathlib import Path

from testbench.exceptions import FileProblems, Problem
from testbench.formats.mapping import TextLayout
from testbench.formats.tables.array_table import ArrayTable
from testbench.formats.tables.binary_kinds import HDF5, MATLAB, PARQUET, BinaryKind, binary_kind
from testbench.formats.tables.bytes_stream import encoding_of
from testbench.formats.tables.fields import BLANKS, split_line
from testbench.formats.tables.monitor import written_in
from testbench.formats.tables.parquet_table import ParquetTable
from testbench.formats.tables.text_table import (
    TextTable,
    decimal_of,
    first_row,
    guess_separator,
    head_of,
)

Table = TextTable | ParquetTable | ArrayTable
_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "blanks": BLANKS}
_BY_SUFFIX = {
    ".parquet": PARQUET,
    ".pq": PARQUET,
    ".mat": MATLAB,
    ".h5": HDF5,
    ".hdf5": HDF5,
    ".hdf": HDF5,
}


def open_table(file: Path, layout: TextLayout) -> Table:
    """A file as a source.

    Args:
        file: To read.
        layout: How it is written, if it is text.

    Raises:
        FileProblems: It is none of these, or damaged.
    """
    kind = kind_of(file)
    if kind is PARQUET:
        return ParquetTable(file)
    if kind in (HDF5, MATLAB):
        return _scientific(file, kind)
    return _text_table(file, layout)


def _scientific(file: Path, kind: BinaryKind) -> ArrayTable:
    """A file of MATLAB or HDF5, whose libraries are loaded for it alone: that takes longer than
    most files of text do.
    """
    from testbench.formats.tables.hdf5_file import hdf5_table
    from testbench.formats.tables.matlab_file import mat_table

    if kind is HDF5:
        return hdf5_table(file)
    with file.open("rb") as stream:
        is_hdf5 = stream.read(10) == b"MATLAB 7.3"
    return hdf5_table(file) if is_hdf5 else mat_table(file)


def kind_of(file: Path) -> BinaryKind | None:
    """What a file is by its first bytes, else by its suffix; None where that is text.

    Raises:
        FileProblems: There is no such file.
    """
    if not file.is_file():
        raise FileProblems(
            file, [Problem("this is not a file" if file.exists() else "the file does not exist")]
        )
    try:
        kind = binary_kind(file) or _BY_SUFFIX.get(file.suffix.lower())
        return None if kind is MATLAB and _is_text(file) else kind
    except OSError as error:
        raise FileProblems(file, [Problem(f"cannot be read: {error.strerror}")]) from None


def _is_text(file: Path) -> bool:
    """Whether a file begins with printable ASCII other than MATLAB's own, whatever it is called."""
    with file.open("rb") as stream:
        head = stream.read(512)
    printable = all(byte in b"\t\r\n" or 32 <= byte < 127 for byte in head)
    return bool(head) and printable and not head.startswith(b"MATLAB")


def _text_table(file: Path, layout: TextLayout) -> TextTable:
    encoding = None if layout.encoding == "auto" else layout.encoding
    lines = head_of(file, encoding)
    at = layout.skip_lines
    if layout.header:
        while at < len(lines) and (
            not lines[at].strip() or lines[at].strip(' "').lower().startswith("sep=")
        ):
            at += 1
    else:
        at = next((i for i in range(at, len(lines)) if lines[i].strip()), len(lines))
    if at >= len(lines):
        raise FileProblems(
            file, [Problem(f"there is nothing after the {layout.skip_lines} lines to skip")]
        )
    separator = (
        guess_separator(lines[at]) if layout.separator == "auto" else _SEPARATORS[layout.separator]
    )
    titles = split_line(lines[at].lstrip("#% ") if layout.header else lines[at], separator)
    data = at + 1 + layout.lines_below_header if layout.header else at
    written = written_in(file, encoding_of(file, encoding))
    if written is not None and written.titles and layout.header:
        titles, data = written.titles, first_row(lines, len(written.titles))
        separator = guess_separator(lines[data])
    stated = {"point": ".", "comma": ","}.get(layout.decimal)
    decimal = stated or decimal_of(lines[data:], separator)
    names = titles if layout.header else [str(i + 1) for i in range(len(titles))]
    table = TextTable(file, names, data + 1, separator, decimal, encoding)
    table.tell_apart()
    return table
