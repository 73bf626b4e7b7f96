"""The raw samples of one sensor on disk, opened once and read from as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from testbench.records.samples import ImuSamples
from testbench.records.storage import (
    ROWS_PER_GROUP,
    parquet_shape,
    read_parquet_batches,
    read_stacked,
)


class SensorFile:
    """Raw samples of a sensor: what algorithms get of a recording that may not fit in memory.

    Args:
        path: Its table.

    Attributes:
        count: Number of samples.
        columns: Names of the columns.

    Raises:
        SessionError: The file is missing or damaged; so do all that read from it.
    """

    def __init__(self, path: Path):
        self._path = path
        self.count, self.columns = parquet_shape(path)

    def read(self, begin: int = 0, end: int | None = None, every: int = 1) -> ImuSamples:
        """Samples in memory.

        Args:
            begin: First sample.
            end: The one after the last; to the end if None.
            every: Only one sample of so many, the last of them.
        """
        groups = ImuSamples.groups(self.columns)
        return ImuSamples.from_groups(read_stacked(self._path, groups, begin, end, every))

    def batches(self, rows: int = ROWS_PER_GROUP) -> Iterator[ImuSamples]:
        """All samples in pieces of at most so many."""
        return (ImuSamples.from_columns(columns) for columns in self.tables(rows))

    def tables(
        self, rows: int = ROWS_PER_GROUP, columns: Sequence[str] | None = None
    ) -> Iterator[dict[str, np.ndarray]]:
        """Some columns, all if None, in pieces of at most so many samples, shape (n,) each."""
        return read_parquet_batches(self._path, columns, rows)

    def column(self, name: str, begin: int = 0, end: int | None = None) -> np.ndarray:
        """One column, from sample `begin` to before `end`, shape (n,)."""
        return read_stacked(self._path, {name: name}, begin, end)[name]
