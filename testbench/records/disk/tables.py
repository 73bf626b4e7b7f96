"""Tables on disk: Parquet, with units and frames in the schema."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from testbench.exceptions import SessionError
from testbench.records.disk.replacing import replaced_file

ROWS_PER_GROUP = 65_536
Columns = Mapping[str, np.ndarray]


def _encoding(schema: pa.Schema) -> dict[str, Any]:
    """How columns are stored.

    Measured numbers hardly repeat, and their bytes compress when like stands beside like; times and
    counters go up by nearly the same step.

    Without dictionaries, with numbers split by bytes and integers as differences, tables are a
    quarter smaller than with plain zstd and are written and read in about half the time.
    """
    encodings = {}
    for field in schema:
        if pa.types.is_floating(field.type):
            encodings[field.name] = "BYTE_STREAM_SPLIT"
        elif pa.types.is_integer(field.type):
            encodings[field.name] = "DELTA_BINARY_PACKED"
    return {"compression": "lz4", "use_dictionary": False, "column_encoding": encodings}


def to_arrow(values: np.ndarray, kind: pa.DataType | None = None) -> pa.Array:
    """A column, shape (n,), as Arrow's; NaN stays NaN.

    `pa.array` would first load pandas where it is installed, to see whether it is given something
    of it: a quarter of a second.

    Args:
        values: Shape (n,).
        kind: As which; that of the values if None.
    """
    values = np.asarray(values)
    if values.dtype.kind not in "biuf":  # text, as of the names of steps
        return pa.array(values, type=kind)
    kind = pa.from_numpy_dtype(values.dtype) if kind is None else kind
    given = values
    values = given.astype(kind.to_pandas_dtype(), order="C", casting="same_kind", copy=False)
    if pa.types.is_integer(kind) and values.dtype != given.dtype and (values != given).any():
        raise OverflowError(f"a column of {kind} does not hold all of its numbers")
    bits = np.packbits(values, bitorder="little") if pa.types.is_boolean(kind) else values
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(bits)])


def from_arrow(column: pa.ChunkedArray | pa.Array) -> np.ndarray:
    """The values of a column of Arrow, shape (n,), as `to_arrow` took them; NaN for a number that
    is missing.

    Read-only where they are in one piece. `to_numpy` would load pandas likewise.

    Args:
        column: Shape (n,).
    """
    kind = column.type
    if pa.types.is_floating(kind) and column.null_count:
        column = pc.fill_null(column, float("nan"))
    plain = pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)
    if not plain or column.null_count or pa.types.is_float16(kind):
        return np.asarray(column.to_numpy(zero_copy_only=False))
    chunks = [column] if isinstance(column, pa.Array) else column.chunks
    pieces = [_values(piece) for piece in chunks if len(piece)]
    if not pieces:
        return np.zeros(0, dtype=kind.to_pandas_dtype())
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)


def _values(piece: pa.Array) -> np.ndarray:
    """The values of an array without nulls, shape (n,), where they lie."""
    begin, end = piece.offset, piece.offset + len(piece)
    data = piece.buffers()[1]
    if pa.types.is_boolean(piece.type):
        bits = np.frombuffer(data, np.uint8)
        return np.unpackbits(bits, count=end, bitorder="little")[begin:].astype(bool)
    return np.frombuffer(data, piece.type.to_pandas_dtype(), end)[begin:]


def to_table(columns: Columns, notes: Mapping[str, str] | None = None) -> pa.Table:
    """An Arrow table of equally long columns.

    Args:
        columns: Column name (with its unit) to array of shape (n,).
        notes: What the table is, by key; kept in the schema's metadata.
    """
    table = pa.table({name: to_arrow(values) for name, values in columns.items()})
    return table.replace_schema_metadata({key: str(value) for key, value in (notes or {}).items()})


def write_parquet(path: Path, columns: Columns, notes: Mapping[str, str] | None = None) -> None:
    """Write a Parquet file in one step.

    Args:
        path: Of the file.
        columns: By name, each of shape (n,).
        notes: What the table is, by key; kept in the schema's metadata.
    """
    table = to_table(columns, notes)
    with replaced_file(path) as partial:
        pq.write_table(table, partial, row_group_size=ROWS_PER_GROUP, **_encoding(table.schema))


def write_parquet_batches(
    path: Path, schema: pa.Schema, batches: Iterable[pa.RecordBatch | pa.Table]
) -> int:
    """Write a Parquet file from pieces as they come, under another name until it is whole.

    Row groups have `ROWS_PER_GROUP` rows whatever the length of the pieces, so that the same rows
    give the same bytes.

    Returns:
        Number of rows.
    """
    with replaced_file(path) as partial:
        return write_pieces(partial, schema, batches)


def write_pieces(
    path: Path, schema: pa.Schema, batches: Iterable[pa.RecordBatch | pa.Table]
) -> int:
    """Write batches of rows into a new file, each group of rows while the next one is gathered.

    Returns:
        Number of rows.
    """
    count, under_way = 0, None
    with (
        pq.ParquetWriter(path, schema, **_encoding(schema)) as file,
        ThreadPoolExecutor(1) as thread,
    ):
        for table in regrouped(schema, batches, ROWS_PER_GROUP):
            if under_way is not None:
                under_way.result()  # one at a time: memory is that of two groups
            under_way = thread.submit(file.write_table, table, row_group_size=ROWS_PER_GROUP)
            count += table.num_rows
        if under_way is not None:
            under_way.result()
    return count


def regrouped(
    schema: pa.Schema, batches: Iterable[pa.RecordBatch | pa.Table], rows: int
) -> Iterator[pa.Table]:
    """The same rows in tables of `rows` rows each, but for the last."""
    waiting: list[pa.RecordBatch] = []
    count = 0
    for piece in batches:
        for batch in piece.to_batches() if isinstance(piece, pa.Table) else [piece]:
            start = 0
            while start < batch.num_rows:
                taken = batch.slice(start, rows - count)
                waiting.append(taken)
                start, count = start + taken.num_rows, count + taken.num_rows
                if count == rows:
                    yield pa.Table.from_batches(waiting, schema).combine_chunks()
                    waiting, count = [], 0
    if waiting:
        yield pa.Table.from_batches(waiting, schema).combine_chunks()


def rows_to_arrow(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Rows as a table: a column for each key, in the order of the first row.

    What is nested in a row becomes columns of its own, their names joined by dots; lists stay.

    Args:
        rows: All with the same keys; nested ones may differ.
    """
    return pa.Table.from_pylist([_flat(row) for row in rows])


def _flat(row: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in row.items():
        nested = isinstance(value, Mapping)
        found |= _flat(value, f"{prefix}{key}.") if nested else {f"{prefix}{key}": value}
    return found


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a Parquet file.

    Args:
        path: The file.
        columns: Those to read; all if None.

    Raises:
        SessionError: The file is missing or damaged.
    """
    try:
        with pq.ParquetFile(path) as file:
            table = file.read(None if columns is None else list(columns))
    except (OSError, pa.ArrowException) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None
    return _Table(path, _columns(table))


class _Table(dict[str, np.ndarray]):
    """Columns of a file; a missing one is a sentence."""

    def __init__(self, path: Path, columns: dict[str, np.ndarray]):
        super().__init__(columns)
        self._path = path

    def __missing__(self, name: str) -> np.ndarray:
        raise SessionError(f"{self._path} lacks the column {name}; it has {', '.join(self)[:300]}")


def read_parquet_batches(
    path: Path, columns: Sequence[str] | None = None, rows: int = ROWS_PER_GROUP
) -> Iterator[dict[str, np.ndarray]]:
    """Columns of a Parquet file, piece by piece; one piece without rows where the file has none.

    Args:
        path: The file.
        columns: Those to read; all if None.
        rows: Most rows of a piece.

    Raises:
        SessionError: The file is missing or damaged.
    """
    try:
        with pq.ParquetFile(path) as file:
            wanted = None if columns is None else list(columns)
            if not file.metadata.num_rows:
                yield _Table(path, _columns(file.read(wanted)))
            for group in range(file.num_row_groups):
                table = file.read_row_group(
                    group, wanted
                )  # `iter_batches` would keep all that it has read
                for begin in range(0, table.num_rows, rows):
                    yield _Table(path, _columns(table.slice(begin, rows)))
    except (OSError, pa.ArrowException) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None


def _columns(table: pa.Table) -> dict[str, np.ndarray]:
    return {
        name: from_arrow(column)
        for name, column in zip(table.column_names, table.columns, strict=True)
    }


def read_stacked(
    path: Path,
    groups: Mapping[str, str | Sequence[str]],
    begin: int = 0,
    end: int | None = None,
    every: int = 1,
) -> dict[str, np.ndarray]:
    """Columns of a Parquet file side by side, read in chunks straight to their places.

    Nothing is in memory twice.

    Args:
        path: The file.
        groups: By the name of the result, a column, or several that stand side by side in an array
            (n, k).
        begin: First row.
        end: The row after the last; to the end if None.
        every: Only one row of so many, the last of them.

    Raises:
        SessionError: The file is missing or damaged, or lacks a column.
    """
    count, names = parquet_shape(path)
    end = count if end is None else min(end, count)
    stack = Stack(groups, max(end - begin, 0) // every)
    missing = [name for name in stack.columns if name not in names]
    if missing:
        raise SessionError(f"{path} lacks the column {missing[0]}; it has {', '.join(names)}")
    first = 0
    for batch in read_parquet_batches(path, stack.columns):
        length = len(batch[stack.columns[0]])
        start = begin + every - 1 - first  # of the first row that is wanted, seen from this piece
        start += max(-(start // every), 0) * every
        stack.put((first + start - begin) // every, batch, slice(start, max(end - first, 0), every))
        first += length
        if first >= end:
            break
    return stack.arrays


class Stack:
    """Arrays of a known length that are filled from pieces of a table.

    Args:
        groups: By the name of the result, a column, or several that stand side by side in an array
            (n, k).
        rows: Length of the arrays.

    Attributes:
        columns: Names of all the columns.
        arrays: The results by name, shape (rows,) or (rows, k), once a first piece has come.
    """

    def __init__(self, groups: Mapping[str, str | Sequence[str]], rows: int):
        self._groups, self._rows = groups, rows
        self.columns = [
            name
            for group in groups.values()
            for name in ([group] if isinstance(group, str) else group)
        ]
        self.arrays: dict[str, np.ndarray] = {}

    def put(self, place: int, piece: Columns, taken: slice | np.ndarray) -> int:
        """Put rows of a piece to their place.

        Args:
            place: Row of the arrays that the first of them takes.
            piece: Columns by name, each of shape (k,).
            taken: Which of its rows; a mask of shape (k,), or a slice.

        Returns:
            The row after the last of them.
        """
        end = place
        for key, group in self._groups.items():
            names = [group] if isinstance(group, str) else group
            shape = (self._rows,) if isinstance(group, str) else (self._rows, len(names))
            if key not in self.arrays:
                self.arrays[key] = np.empty(shape, dtype=piece[names[0]].dtype)
            array = self.arrays[key]
            for i, name in enumerate(names):
                part = piece[name][taken]
                end = place + len(part)
                (array if isinstance(group, str) else array[:, i])[place:end] = part
        return end


def parquet_shape(path: Path) -> tuple[int, list[str]]:
    """Number of rows, and names of the columns, of a Parquet file.

    Raises:
        SessionError: The file is missing or damaged.
    """
    try:
        with pq.ParquetFile(path) as file:
            return file.metadata.num_rows, list(file.schema_arrow.names)
    except (OSError, pa.ArrowException) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None


def parquet_kinds(path: Path) -> dict[str, str]:
    """What each column of a Parquet file holds, by name: `INTEGER`, `NUMBER`, `FLAG`, or the name
    of another type.

    Raises:
        SessionError: The file is missing or damaged.
    """
    try:
        with pq.ParquetFile(path) as file:
            schema = file.schema_arrow
    except (OSError, pa.ArrowException) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None
    return {field.name: _kind(field.type) for field in schema}


INTEGER, NUMBER, FLAG = "int64", "double", "bool"


def _kind(kind: pa.DataType) -> str:
    if pa.types.is_int64(kind):
        return INTEGER
    if pa.types.is_float64(kind):
        return NUMBER
    return FLAG if pa.types.is_boolean(kind) else str(kind)[:50]


def last_value(path: Path, column: str) -> int | None:
    """The last number of a column of a Parquet file, or None where it has no rows.

    Raises:
        SessionError: The file is missing or damaged.
    """
    try:
        with pq.ParquetFile(path) as file:
            rows = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
            filled = [i for i, count in enumerate(rows) if count]
            table = file.read_row_group(filled[-1], [column]) if filled else file.read([column])
    except (OSError, pa.ArrowException) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None
    values = _Table(path, _columns(table))[column]
    return int(values[-1]) if len(values) else None
