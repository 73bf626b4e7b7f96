"""Parquet files as a source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.source import ROWS_PER_CHUNK, Columns, Kind


@dataclass
class ParquetTable:
    """A Parquet file.

    Attributes:
        file: Where it is.
    """

    file: Path

    def __post_init__(self) -> None:
        self.arrays: dict[str, list[str]] = {}
        try:
            self._schema = pq.read_schema(self.file)
        except (OSError, pa.ArrowInvalid) as error:
            raise self.problem(f"not a readable Parquet file: {str(error)[:200]}") from None

    @property
    def names(self) -> list[str]:
        """Its columns."""
        return list(self._schema.names)

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        row = 0
        try:
            with pq.ParquetFile(self.file) as content:
                for group in range(
                    content.num_row_groups
                ):  # over all of them, pyarrow would keep all that it has read
                    for batch in content.iter_batches(ROWS_PER_CHUNK, [group], list(kinds)):
                        yield {
                            name: self._array(batch.column(name), kind, name, row)
                            for name, kind in kinds.items()
                        }
                        row += batch.num_rows
        except (OSError, pa.ArrowInvalid) as error:
            raise self.problem(f"not a readable Parquet file: {str(error)[:200]}") from None

    def _array(self, column: pa.Array, kind: Kind, name: str, done: int) -> np.ndarray:
        if pa.types.is_timestamp(column.type):
            column = column.cast(pa.timestamp("ns")).cast(pa.int64())
        number = (
            pa.types.is_floating(column.type)
            or pa.types.is_integer(column.type)
            or pa.types.is_boolean(column.type)
        )
        if kind == "clock" or not number:
            raise self.problem(
                f"the column {name} is of type {column.type}, where numbers are expected"
            )
        if kind == "float":
            return column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        if column.null_count:
            raise self.problem(
                f"the column {name} is empty here",
                done + int(np.argmax(column.is_null().to_numpy(zero_copy_only=False))),
            )
        try:
            return column.cast(pa.int64()).to_numpy()
        except pa.ArrowInvalid:
            raise self.problem(f"the column {name} is not of whole numbers") from None

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the file, or of a row (from 0)."""
        return FileProblems(
            self.file, [Problem(message if row is None else f"row {row}: {message}")]
        )
