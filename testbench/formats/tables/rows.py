"""Rows on their way from a table to samples: a time each, and their place in the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.formats.tables.source import Columns


@dataclass
class Rows:
    """Rows of a table.

    Attributes:
        time: Shape (n,), int64 [ns].
        number: Of the row in the file from 0, shape (n,), int64.
        columns: By name, each of shape (n,).
    """

    time: np.ndarray
    number: np.ndarray
    columns: Columns

    def __len__(self) -> int:
        return len(self.time)

    def take(self, which: np.ndarray | slice) -> Rows:
        """Some of them.

        Args:
            which: A slice, a mask of shape (n,), or their indices in any order, shape (k,).
        """
        columns = {name: values[which] for name, values in self.columns.items()}
        return Rows(self.time[which], self.number[which], columns)

    def put_in_order(self, since: int, order: np.ndarray) -> None:
        """Put some consecutive rows in another order, where they stand.

        Args:
            since: The first of them.
            order: Their indices from there, in the order wanted, shape (k,).
        """
        part = slice(since, since + len(order))
        self.time[part], self.number[part] = self.time[part][order], self.number[part][order]
        for name, values in self.columns.items():
            if not values.flags.writeable:
                values = self.columns[name] = values.copy()
            values[part] = values[part][order]

    def with_more(self, more: Rows) -> Rows:
        """These and others behind them, as a copy."""
        columns = {
            name: np.concatenate([values, more.columns[name]])
            for name, values in self.columns.items()
        }
        return Rows(
            np.concatenate([self.time, more.time]),
            np.concatenate([self.number, more.number]),
            columns,
        )

    def alike(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Whether two rows of each pair agree in every column, whatever their times.

        Args:
            one: Index of the first of each, shape (k,).
            other: Index of the second of each, shape (k,).

        Returns:
            Shape (k,), bool; values that are missing in both agree.
        """
        result = np.ones(len(one), dtype=bool)
        for values in self.columns.values():
            a, b = values[one], values[other]
            same = a == b
            result &= same | ((a != a) & (b != b)) if values.dtype.kind == "f" else same
        return result
