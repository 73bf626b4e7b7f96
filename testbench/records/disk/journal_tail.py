"""Read a stream while another process writes it: what came since the last look, and no more."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa

from testbench.records.disk.tables import from_arrow, read_parquet_batches

MOST_BYTES = 4 << 20
"""So much of a journal is read at one look; more where a single batch is larger."""


class JournalTail:
    """The rows of a journal in the order in which they were appended.

    Nothing is locked, and nothing is written: who appends does not notice. The file stays open, so
    that the end of a journal can be read that became a table meanwhile.

    Args:
        journal: Of the stream; it need not exist yet.
        table: What the journal becomes once it is closed; read where there is no journal any more.
    """

    def __init__(self, journal: Path, table: Path):
        self._journal, self._table = journal, table
        self._file: BinaryIO | None = None
        self._schema: pa.Schema | None = None
        self._batches: Iterator[dict[str, np.ndarray]] | None = None
        self._at, self._size = 0, MOST_BYTES

    def read(self) -> dict[str, np.ndarray] | None:
        """Rows that are new, by column, each of shape (n,); None if there are none yet."""
        if self._batches is None and self._file is None:
            self._open()
        if self._batches is not None:
            return next(self._batches, None)
        return None if self._file is None else self._news(self._file)

    def _open(self) -> None:
        """The journal, or the table that it became."""
        try:
            self._file = self._journal.open("rb")
        except FileNotFoundError:
            if self._table.is_file():
                self._batches = read_parquet_batches(self._table)

    def _news(self, file: BinaryIO) -> dict[str, np.ndarray] | None:
        """Whole batches behind those that were read; what is being written comes next time."""
        file.seek(self._at)
        data = file.read(self._size)
        reader, batches = pa.BufferReader(data), []
        whole = 0
        while True:
            try:
                message = pa.ipc.read_message(reader)
                if self._schema is None:
                    self._schema = pa.ipc.read_schema(message)
                else:
                    batches.append(pa.ipc.read_record_batch(message, self._schema))
            except (EOFError, pa.ArrowException, OSError):  # its end is not there yet, or never is
                break
            whole = reader.tell()
        self._at += whole
        if not whole and len(data) == self._size:
            self._size *= 2
        if not batches or self._schema is None:
            return None
        rows = pa.Table.from_batches(batches, self._schema)
        return {name: from_arrow(rows[name]) for name in rows.column_names}

    def close(self) -> None:
        """Let go of the file; a second call does nothing."""
        if self._file is not None:
            self._file.close()
