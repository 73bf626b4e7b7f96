"""Arrays of one file as a source: each array is a column, or as many as it is wide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.source import ROWS_PER_CHUNK, Columns, Kind

WIDEST = 64
"""An array with more columns than this holds something else than the signals of a sensor."""


class Rows(Protocol):
    """An array with time along its first axis, wherever it is kept."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(n,) or (n, k)."""
        ...

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Some of its rows."""
        ...


@dataclass
class ArrayTable:
    """Arrays with one name each as a source.

    An array of shape (n, 3) called `acc` has the columns `acc[1]`, `acc[2]` and `acc[3]`; one of
    shape (n,) is a column by its own name. Arrays of different length may stand in one file, but
    not be read together.

    Attributes:
        file: Where they are from.
        found: By name, time along the first axis.
        closed: Names of what is in the file and cannot be opened, such as objects of MATLAB.
        numbers: Single numbers that stand beside the arrays, such as a sampling rate.
    """

    file: Path
    found: Mapping[str, Rows]
    closed: tuple[str, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._at: dict[str, tuple[str, int | None]] = {}
        self.arrays: dict[str, list[str]] = {}
        for name, array in self.found.items():
            if len(array.shape) == 1:
                self._at[name] = (name, None)
                continue
            self.arrays[name] = [f"{name}[{i + 1}]" for i in range(array.shape[1])]
            self._at |= {column: (name, i) for i, column in enumerate(self.arrays[name])}

    @property
    def names(self) -> list[str]:
        """Of the columns."""
        return list(self._at)

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        wanted = {self._at[name][0] for name in kinds}
        lengths = {name: self.found[name].shape[0] for name in sorted(wanted)}
        if len(set(lengths.values())) > 1:
            listing = ", ".join(f"{name} has {length}" for name, length in lengths.items())
            raise self.problem(f"arrays that are read together must be as long: {listing} rows")
        count = max(lengths.values(), default=0)
        for start in range(0, count, ROWS_PER_CHUNK):
            try:
                read = {name: self.found[name][start : start + ROWS_PER_CHUNK] for name in wanted}
            except (OSError, RuntimeError) as error:
                raise self.problem(f"cannot be read on: {str(error)[:200]}", start) from None
            columns = {}
            for name, kind in kinds.items():
                array, column = self._at[name]
                values = read[array] if column is None else read[array][:, column]
                columns[name] = self._typed(values, kind, name, start)
            yield columns

    def _typed(self, values: np.ndarray, kind: Kind, name: str, start: int) -> np.ndarray:
        """The values of a column as they are asked for, shape (n,)."""
        if kind == "clock":
            raise self.problem(f"{name} holds numbers, where a time of day hh:mm:ss is expected")
        if kind == "float":
            return np.ascontiguousarray(values, dtype=float)
        if values.dtype.kind == "f":
            with np.errstate(invalid="ignore"):
                whole = np.isfinite(values) & (values == np.round(values)) & (abs(values) < 2**63)
            if not whole.all():
                raise self.problem(f"{name} is not a whole number here", start + _first(~whole))
        elif values.dtype.kind == "u" and (values > np.iinfo(np.int64).max).any():
            raise self.problem(f"{name} is too large", start + _first(values > 2**63 - 1))
        return np.ascontiguousarray(values).astype(np.int64)

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the file, or of a sample (counted from 1)."""
        return FileProblems(
            self.file, [Problem(message if row is None else f"sample {row + 1}: {message}")]
        )


def _first(marks: np.ndarray) -> int:
    return int(np.argmax(marks))


def upright(array: np.ndarray) -> np.ndarray:
    """An array with time along its first axis, shape (n,) or (n, k).

    Args:
        array: Shape (n,), (n, k) or (k, n); the longer axis is taken for time.
    """
    array = np.squeeze(array) if array.ndim > 1 and 1 in array.shape else array
    return array.T if array.ndim == 2 and array.shape[1] > array.shape[0] else array


def is_signal(shape: tuple[int, ...]) -> bool:
    """Whether an array of this shape can be samples: one column or a few, and not one number."""
    long = [length for length in shape if length != 1]
    return 1 <= len(long) <= 2 and (len(long) == 1 or min(long) <= WIDEST)
