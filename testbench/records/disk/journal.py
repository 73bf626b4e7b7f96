"""Streams of samples that survive a kill, and how they become tables."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import zip_longest
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from testbench.exceptions import SessionError
from testbench.records.disk.replacing import replaced_file
from testbench.records.disk.tables import (
    ROWS_PER_GROUP,
    Columns,
    from_arrow,
    parquet_shape,
    read_parquet_batches,
    regrouped,
    to_arrow,
    write_pieces,
)


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
        """Append rows and hand them to the operating system.

        Args:
            columns: By name, each of shape (n,).
        """
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
    """The schema of a journal, and its whole batches one by one.

    Also of one that was cut off in the middle of a batch.

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
    # Not mapped: a long journal would count as memory of this process.
    with path.open("rb") as source:
        reader = pa.ipc.open_stream(source)
        while True:
            try:
                batch = reader.read_next_batch()
            except (StopIteration, pa.ArrowException, OSError) as end:
                _refuse_damage(path, source, end)
                return
            yield batch


def _refuse_damage(path: Path, source: BinaryIO, end: Exception) -> None:
    """Let a journal end where its file does, be it within a batch, and nowhere else.

    Raises:
        SessionError: The disk does not give what follows, or what follows is no batch.
    """
    damaged = SessionError(
        f"the journal {path} is damaged at byte {source.tell()}: {end or 'its end is marked there'}"
        "; it is kept, and what stands before that byte is whole"
    )
    if isinstance(end, OSError) and end.errno is not None:
        raise damaged from None
    # What a file system set aside for a writer that was cut off reads as zeros.
    if any(source.read().strip(b"\0")):
        raise damaged from None


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
        count = write_pieces(partial, schema, batches)
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
        expected = regrouped(schema, batches, ROWS_PER_GROUP)
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
