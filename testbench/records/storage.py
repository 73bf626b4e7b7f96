"""Tables on disk: Parquet with units and frames in the schema, and the crash-safe journals they are
made from.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pyarrow as pa
import pyarrow.parquet as pq

from testbench.exceptions import SessionError
from testbench.records.replacing import replaced_file, write_text

ROWS_PER_GROUP = 65_536
LARGEST_JSON = 200_000_000
"""Bytes of a JSON file that is read; evaluations of the longest campaigns are a tenth of it."""
Columns = Mapping[str, np.ndarray]


def _encoding(schema: pa.Schema) -> dict[str, Any]:
    """How columns are stored: measured numbers hardly repeat, and their bytes compress when like
    stands beside like; times and counters go up by nearly the same step.

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
    """A column of numbers or truth values, shape (n,), as Arrow's; NaN stays NaN.

    `pa.array` would first load pandas where it is installed, to see whether it is given something
    of it: a quarter of a second.

    Args:
        values: Shape (n,).
        kind: As which; that of the values if None.
    """
    values = np.asarray(values)
    kind = pa.from_numpy_dtype(values.dtype) if kind is None else kind
    values = np.ascontiguousarray(values, dtype=kind.to_pandas_dtype())
    bits = np.packbits(values, bitorder="little") if pa.types.is_boolean(kind) else values
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(bits)])


def from_arrow(column: pa.ChunkedArray) -> np.ndarray:
    """The values of a column of Arrow, shape (n,), as `to_arrow` took them; read-only where they
    are in one piece. `to_numpy` would load pandas likewise.
    """
    kind = column.type
    plain = pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)
    if not plain or column.null_count or pa.types.is_float16(kind):
        return np.asarray(column.to_numpy())
    pieces = [_values(piece) for piece in column.chunks]
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
    """Write a Parquet file in one step."""
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
        return _write_pieces(partial, schema, batches)


def _write_pieces(
    path: Path, schema: pa.Schema, batches: Iterable[pa.RecordBatch | pa.Table]
) -> int:
    count = 0
    with pq.ParquetWriter(path, schema, **_encoding(schema)) as file:
        for table in _regrouped(schema, batches, ROWS_PER_GROUP):
            file.write_table(table, row_group_size=ROWS_PER_GROUP)
            count += table.num_rows
    return count


def _regrouped(
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
    single = [group for group in groups.values() if isinstance(group, str)]
    wanted = single + [
        name for group in groups.values() if not isinstance(group, str) for name in group
    ]
    missing = [name for name in wanted if name not in names]
    if missing:
        raise SessionError(f"{path} lacks the column {missing[0]}; it has {', '.join(names)}")
    rows = max(end - begin, 0) // every
    result: dict[str, np.ndarray] = {}
    first = 0
    for batch in read_parquet_batches(path, wanted):
        length = len(batch[wanted[0]])
        start = begin + every - 1 - first  # of the first row that is wanted, seen from this piece
        start += max(-(start // every), 0) * every
        place = (first + start - begin) // every
        taken = slice(start, max(end - first, 0), every)
        for key, group in groups.items():
            if isinstance(group, str):
                values = result.setdefault(key, np.empty(rows, dtype=batch[group].dtype))
                part = batch[group][taken]
                values[place : place + len(part)] = part
            else:
                matrix = result.setdefault(
                    key, np.empty((rows, len(group)), dtype=batch[group[0]].dtype)
                )
                for i, name in enumerate(group):
                    part = batch[name][taken]
                    matrix[place : place + len(part), i] = part
        first += length
        if first >= end:
            break
    return result


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


def last_value(path: Path, column: str) -> int | None:
    """The last number of a column of a Parquet file, or None where it has no rows.

    Raises:
        SessionError: The file is missing or damaged.
    """
    values = np.zeros(0, dtype=np.int64)
    for batch in read_parquet_batches(path, [column]):
        values = batch[column]
    return int(values[-1]) if len(values) else None


def write_json(path: Path, data: Any) -> None:
    """Write readable JSON in one step; see `json_text`."""
    write_text(path, json_text(data))


def json_text(data: Any) -> str:
    """Readable JSON of mappings, lists, dataclasses, arrays and numbers, one value a line; NaN
    becomes null, as JSON wants.
    """
    try:
        return orjson.dumps(data, default=_plain, option=_READABLE).decode() + "\n"
    except orjson.JSONEncodeError:  # an integer beyond 64 bits, or a file's name that is no text
        return json.dumps(_plain_tree(data), indent=2, allow_nan=False) + "\n"


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
        SessionError: The file is missing or not JSON.
    """
    try:
        if path.stat().st_size > LARGEST_JSON:
            raise SessionError(
                f"{path} has {path.stat().st_size} bytes, more than the {LARGEST_JSON} allowed"
            )
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None


class Journal:
    """A stream of samples that survives a kill: an Arrow IPC stream, flushed at every append.

    Args:
        path: File to create; its name ends in .arrows.
        columns: Name to dtype of each column.
        notes: Schema metadata.
        claimed: The file exists, and is empty.
    """

    def __init__(
        self,
        path: Path,
        columns: Mapping[str, Any],
        notes: Mapping[str, str] | None = None,
        claimed: bool = False,
    ):
        self.path, self.rows = path, 0
        metadata = {key: str(value) for key, value in (notes or {}).items()}
        self._schema = pa.schema(
            [(name, pa.from_numpy_dtype(dtype)) for name, dtype in columns.items()],
            metadata=metadata,
        )
        self._file = path.open("wb" if claimed else "xb")
        self._writer = pa.ipc.new_stream(self._file, self._schema)
        self._file.flush()

    @classmethod
    def continued(
        cls,
        path: Path,
        columns: Mapping[str, Any],
        table: Path,
        notes: Mapping[str, str] | None = None,
    ) -> Journal:
        """A journal that begins with the rows of a Parquet file, which it replaces.

        A cut at any moment leaves the table or the journal, whole.

        Args:
            path: Of the journal.
            columns: Names and types.
            table: The Parquet file; it must have the same columns.
            notes: By column, kept in the schema.

        Raises:
            SessionError: The table has others, or cannot be read.
            OSError: The journal cannot be written; the table is as it was.
        """
        with replaced_file(path) as partial:
            journal = cls(partial, columns, notes, claimed=True)
            try:
                if parquet_shape(table)[1] != journal._schema.names:
                    raise SessionError(
                        f"{table} has other columns than the stream it is to be continued with"
                    )
                # in chunks: the memory does not grow with the recording
                for batch in read_parquet_batches(table):
                    journal.append(batch)
                journal.sync()
            except BaseException:
                journal.abandon()
                raise
        journal.path = path
        table.unlink()
        return journal

    def append(self, columns: Columns) -> None:
        """Append equally long columns and hand them to the operating system."""
        arrays = [
            to_arrow(columns[name], self._schema.field(name).type) for name in self._schema.names
        ]
        if len(arrays[0]) == 0:
            return
        self._writer.write_batch(pa.record_batch(arrays, schema=self._schema))
        self.rows += len(arrays[0])
        self._file.flush()

    def sync(self) -> None:
        """Force what was appended onto the disk."""
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """End the stream; a second call does nothing."""
        if not self._file.closed:
            self._writer.close()
            self.sync()
            self._file.close()

    def abandon(self) -> None:
        """Let go of the file as it is, whatever cannot be written any more; never raises."""
        for let_go in (self._writer.close, self._file.close):
            with suppress(OSError, ValueError, pa.ArrowException):
                let_go()


def journal_batches(path: Path) -> tuple[pa.Schema, Iterator[pa.RecordBatch]]:
    """The schema of a journal, and its whole batches one by one, also of one that was cut off in
    the middle of a batch.

    Raises:
        SessionError: Not even the schema can be read.
    """
    try:
        with path.open("rb") as source:
            schema = pa.ipc.open_stream(source).schema
    except (pa.ArrowException, OSError) as error:
        raise SessionError(f"the journal {path} cannot be read: {error}") from None
    return schema, _whole_batches(path)


def _whole_batches(path: Path) -> Iterator[pa.RecordBatch]:
    with path.open(
        "rb"
    ) as source:  # not mapped: a long journal would count as memory of this process
        reader = pa.ipc.open_stream(source)
        while True:
            try:
                batch = reader.read_next_batch()
            except (StopIteration, pa.ArrowException, OSError):
                return
            yield batch


def compact(journal: Path, target: Path) -> int:
    """Turn a journal into a Parquet file, read it back, compare, and only then remove the journal.

    Both are gone through in pieces: the memory does not grow with the length of the recording.

    Returns:
        Number of rows.

    Raises:
        SessionError: What was read back differs; the journal is kept.
    """
    schema, batches = journal_batches(journal)
    with replaced_file(target) as partial:
        count = _write_pieces(partial, schema, batches)
        if not _same_rows(partial, schema, journal_batches(journal)[1]):
            raise SessionError(
                f"{target} differs from its journal {journal} after writing; the journal is kept"
            )
    journal.unlink()
    return count


def _same_rows(path: Path, schema: pa.Schema, batches: Iterable[pa.RecordBatch]) -> bool:
    """Whether a Parquet file holds these rows and no others, NaN being equal to NaN."""
    with pq.ParquetFile(path) as file:
        if file.schema_arrow.names != schema.names:
            return False
        found = (file.read_row_group(group) for group in range(file.num_row_groups))
        expected = _regrouped(schema, batches, ROWS_PER_GROUP)
        return all(
            first is not None
            and second is not None
            and first.num_rows == second.num_rows
            and _same_values(first, second)
            for first, second in zip_longest(found, expected)
        )


def _same_values(first: pa.Table, second: pa.Table) -> bool:
    """Whether two tables of the same columns hold the same, NaN being equal to NaN."""
    return all(
        np.array_equal(
            from_arrow(first[name]),
            from_arrow(second[name]),
            equal_nan=first.schema.field(name).type == pa.float64(),
        )
        for name in first.column_names
    )


def plain_values(value: Any) -> Any:
    """The value as JSON knows it: of dataclasses, arrays and numbers of NumPy only mappings, lists
    and numbers are left; NaN becomes null.
    """
    return json.loads(json_text(value))


_READABLE = orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS


def _plain(value: Any) -> Any:
    """What orjson does not know by itself."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in JSON")


def _plain_tree(value: Any) -> Any:
    """The same without orjson."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain_tree(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain_tree(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain_tree(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
