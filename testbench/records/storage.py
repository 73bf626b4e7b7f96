"""Tables on disk: Parquet with units and frames in the schema, and the crash-safe journals they are made from."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from testbench.exceptions import SessionError

ROWS_PER_GROUP = 65_536
LARGEST_JSON = 200_000_000
"""Bytes of a JSON file that is read; evaluations of the longest campaigns are a tenth of it."""
Columns = Mapping[str, np.ndarray]


def to_table(columns: Columns, notes: Mapping[str, str] | None = None) -> pa.Table:
    """An Arrow table of equally long columns.

    Args:
        columns: Column name (with its unit) to array of shape (n,).
        notes: What the table is, by key; kept in the schema's metadata.
    """
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    return table.replace_schema_metadata({key: str(value) for key, value in (notes or {}).items()})


def write_parquet(path: Path, columns: Columns, notes: Mapping[str, str] | None = None) -> None:
    """Write a Parquet file in one step: under another name, synced, then renamed."""
    partial = path.with_suffix(".partial")
    pq.write_table(to_table(columns, notes), partial, compression="zstd", row_group_size=ROWS_PER_GROUP)
    replace_synced(partial, path)


def read_parquet(path: Path) -> dict[str, np.ndarray]:
    """Columns of a Parquet file.

    Raises:
        SessionError: The file is missing or damaged.
    """
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None
    return _Table(path, {name: table[name].to_numpy() for name in table.column_names})


class _Table(dict[str, np.ndarray]):
    """Columns of a file; a missing one is a sentence."""

    def __init__(self, path: Path, columns: dict[str, np.ndarray]):
        super().__init__(columns)
        self._path = path

    def __missing__(self, name: str) -> np.ndarray:
        raise SessionError(f"{self._path} lacks the column {name}; it has {', '.join(self)[:300]}")


def write_json(path: Path, data: Any) -> None:
    """Write readable JSON in one step; NaN becomes null, as JSON wants."""
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(plain_values(data), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    replace_synced(partial, path)


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
        SessionError: The file is missing or not JSON.
    """
    try:
        if path.stat().st_size > LARGEST_JSON:
            raise SessionError(f"{path} has {path.stat().st_size} bytes, more than the {LARGEST_JSON} allowed")
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None


def replace_synced(partial: Path, path: Path) -> None:
    """Bring a finished file to its name so that a power cut leaves the old or the new one, whole."""
    with partial.open("rb+") as file:
        os.fsync(file.fileno())
    partial.replace(path)


class Journal:
    """A stream of samples that survives a kill: an Arrow IPC stream, flushed at every append.

    Args:
        path: File to create; its name ends in .arrows. columns: Name to dtype of each column. notes: Schema metadata.
    """

    def __init__(self, path: Path, columns: Mapping[str, Any], notes: Mapping[str, str] | None = None):
        self.path, self.rows = path, 0
        metadata = {key: str(value) for key, value in (notes or {}).items()}
        self._schema = pa.schema([(name, pa.from_numpy_dtype(dtype)) for name, dtype in columns.items()], metadata=metadata)
        self._file = path.open("xb")
        self._writer = pa.ipc.new_stream(self._file, self._schema)
        self._file.flush()

    @classmethod
    def continued(cls, path: Path, columns: Mapping[str, Any], table: Path, notes: Mapping[str, str] | None = None) -> Journal:
        """A journal that begins with the rows of a Parquet file, which it replaces.

        A cut at any moment leaves the table or the journal, whole.

        Args:
            path, columns, notes: As above. table: The Parquet file; it must have the same columns.

        Raises:
            SessionError: It has others, or cannot be read.
        """
        partial = path.with_suffix(".partial")
        partial.unlink(missing_ok=True)
        journal = cls(partial, columns, notes)
        try:
            with pq.ParquetFile(table) as file:
                if file.schema_arrow.names != journal._schema.names:
                    raise SessionError(f"{table} has other columns than the stream it is to be continued with")
                for batch in file.iter_batches(batch_size=ROWS_PER_GROUP):
                    journal._writer.write_batch(pa.record_batch(batch.columns, schema=journal._schema))
                    journal.rows += batch.num_rows
        except (OSError, pa.ArrowException) as error:
            raise SessionError(f"{table} cannot be read: {error}") from None
        journal.sync()
        journal.path = partial.rename(path)
        table.unlink()
        return journal

    def append(self, columns: Columns) -> None:
        """Append equally long columns and hand them to the operating system."""
        arrays = [pa.array(columns[name], type=self._schema.field(name).type) for name in self._schema.names]
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


def journal_batches(path: Path) -> tuple[pa.Schema, list[pa.RecordBatch]]:
    """The whole batches of a journal, also of one that was cut off in the middle of a batch.

    Raises:
        SessionError: Not even the schema can be read.
    """
    batches: list[pa.RecordBatch] = []
    with pa.memory_map(str(path)) as source:
        try:
            reader = pa.ipc.open_stream(source)
        except (pa.ArrowException, OSError) as error:
            raise SessionError(f"the journal {path} cannot be read: {error}") from None
        while True:
            try:
                batches.append(reader.read_next_batch())
            except (StopIteration, pa.ArrowException, OSError):
                return reader.schema, batches


def compact(journal: Path, target: Path) -> int:
    """Turn a journal into a Parquet file, read it back, compare, and only then remove the journal.

    Returns:
        Number of rows.

    Raises:
        SessionError: What was read back differs; the journal is kept.
    """
    schema, batches = journal_batches(journal)
    partial = target.with_suffix(".partial")
    table = pa.Table.from_batches(batches, schema)
    pq.write_table(table.combine_chunks(), partial, compression="zstd", row_group_size=ROWS_PER_GROUP)
    if not _same_values(pq.read_table(partial), table):
        raise SessionError(f"{target} differs from its journal {journal} after writing; the journal is kept")
    replace_synced(partial, target)
    journal.unlink()
    return table.num_rows


def _same_values(first: pa.Table, second: pa.Table) -> bool:
    """Whether two tables hold the same, NaN being equal to NaN."""
    return first.column_names == second.column_names and all(
        np.array_equal(first[name].to_numpy(), second[name].to_numpy(), equal_nan=first.schema.field(name).type == pa.float64())
        for name in first.column_names
    )


def plain_values(value: Any) -> Any:
    """The value with arrays, numpy numbers and NaN turned into what JSON knows; NaN becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_values(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain_values(value.tolist())
    if isinstance(value, np.generic):
        return plain_values(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
