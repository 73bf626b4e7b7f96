"""Rows of an evaluation arranged over flexion and misalignment, or over the variables of sweeps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from testbench.records.results.evaluation import JointRow
from testbench.records.specs.published import FlexionErrors, PublishedResults

Key = tuple[str, str]
"""Filter and Euler sequence."""


@dataclass(frozen=True)
class Pooled:
    """Errors of several rows taken together, each sample with the same weight; sd is that within a
    pose or sweep [deg].
    """

    n: int
    mean: float
    mean_abs: float
    sd: float
    rmse: float
    max_abs: float


def pool(rows: Iterable[JointRow]) -> Pooled:
    """Errors of rows taken together; the sd is about the mean of each row, RMS, so that it does not
    hold what parts them.
    """
    rows = list(rows)
    if len(rows) == 1:
        row = rows[0]
        return Pooled(
            row.n,
            row.flexion_mean_error_deg,
            row.flexion_mean_abs_error_deg,
            row.flexion_sd_deg,
            row.flexion_rmse_deg,
            row.flexion_max_abs_error_deg,
        )
    weight = np.array([row.n for row in rows], dtype=float)
    mean = float(np.average([row.flexion_mean_error_deg for row in rows], weights=weight))
    mean_abs = float(np.average([row.flexion_mean_abs_error_deg for row in rows], weights=weight))
    square = float(np.average([row.flexion_rmse_deg**2 for row in rows], weights=weight))
    within = float(np.average([row.flexion_sd_deg**2 for row in rows], weights=weight))
    largest = max(row.flexion_max_abs_error_deg for row in rows)
    return Pooled(int(weight.sum()), mean, mean_abs, within**0.5, square**0.5, largest)


class PoseErrors:
    """Errors of one joint in one section, at commanded flexions and misalignments.

    Args:
        rows: All of the joint and section, with a commanded flexion.

    Attributes:
        flexions: Commanded, increasing [deg].
        misalignments: Commanded, increasing [deg]; empty where the protocol varies none.
        keys: Filters and sequences, in the order of the rows.
        pooled: Other variables, whose values are taken together.
    """

    def __init__(self, rows: list[JointRow]):
        self.flexions = sorted({row.flexion_deg for row in rows if row.flexion_deg is not None})
        self.misalignments = sorted(
            {row.misalignment_deg for row in rows if row.misalignment_deg is not None}
        )
        self.keys: list[Key] = list(dict.fromkeys((row.filter, row.sequence) for row in rows))
        groups: dict[tuple[Key, float | None, float], list[JointRow]] = defaultdict(list)
        for row in rows:
            if row.flexion_deg is not None:
                groups[(row.filter, row.sequence), row.misalignment_deg, row.flexion_deg].append(
                    row
                )
        self._errors = {place: pool(group) for place, group in groups.items()}
        names = dict.fromkeys(name for row in rows for name in row.variables)
        self.pooled = [
            name
            for name in names
            if any(len({row.variables.get(name) for row in group}) > 1 for group in groups.values())
        ]

    @property
    def sequences(self) -> list[str]:
        return list(dict.fromkeys(sequence for _, sequence in self.keys))

    @property
    def aligned(self) -> float | None:
        """The misalignment nearest to none [deg]."""
        return min(self.misalignments, key=abs) if self.misalignments else None

    def filters(self, sequence: str) -> list[str]:
        return [name for name, own in self.keys if own == sequence]

    def at(self, key: Key, flexion: float, misalignment: float | None = None) -> Pooled | None:
        """Errors in one pose; at the misalignment nearest to none if None."""
        return self._errors.get(
            (key, self.aligned if misalignment is None else misalignment, flexion)
        )

    def grid(self, key: Key) -> np.ndarray:
        """Mean |error| [deg], shape (flexions, misalignments), NaN where there was no pose."""
        grid = np.full((len(self.flexions), len(self.misalignments)), np.nan)
        for i, flexion in enumerate(self.flexions):
            for j, misalignment in enumerate(self.misalignments):
                found = self.at(key, flexion, misalignment)
                grid[i, j] = np.nan if found is None else found.mean_abs
        return grid


class SweepErrors:
    """Errors of one joint in one section that commands no flexion, by the values of its variables.

    Args:
        rows: All of the joint and section.

    Attributes:
        variables: Names of the loop variables, in the order of the protocol.
        keys: Filters and sequences.
        errors: By key and by the values of the variables.
        sweeps: The rows of sweeps behind them.
    """

    def __init__(self, rows: list[JointRow]):
        self.variables = list(dict.fromkeys(name for row in rows for name in row.variables))
        self.keys: list[Key] = list(dict.fromkeys((row.filter, row.sequence) for row in rows))
        groups: dict[tuple[Key, tuple[float | None, ...]], list[JointRow]] = defaultdict(list)
        for row in rows:
            values = tuple(row.variables.get(name) for name in self.variables)
            groups[(row.filter, row.sequence), values].append(row)
        self.errors = {place: pool(group) for place, group in groups.items()}
        self.sweeps = {
            place: [row for row in group if row.kind == "sweep"] for place, group in groups.items()
        }

    def values(self, variable: int) -> list[float]:
        """What a variable took, increasing."""
        return sorted(
            {value for _, values in self.errors if (value := values[variable]) is not None}
        )

    @property
    def is_grid(self) -> bool:
        """Whether there are two variables that both change, so that a table of rows and columns
        says it all.
        """
        return len(self.variables) == 2 and all(len(self.values(i)) > 1 for i in (0, 1))

    def grid(self, key: Key) -> np.ndarray:
        """RMS error [deg], shape (values of the first variable, values of the second), NaN where
        there was no sweep.
        """
        rows, columns = self.values(0), self.values(1)
        grid = np.full((len(rows), len(columns)), np.nan)
        for (own, (row, column)), error in self.errors.items():
            if own == key and row is not None and column is not None:
                grid[rows.index(row), columns.index(column)] = error.rmse
        return grid


def by_section(rows: Iterable[JointRow]) -> dict[str, list[JointRow]]:
    """Rows by section, in their order."""
    result: dict[str, list[JointRow]] = {}
    for row in rows:
        result.setdefault(row.section, []).append(row)
    return result


def published_beside(
    published: PublishedResults | None, flexions: list[float]
) -> dict[str, list[tuple[FlexionErrors, list[float | None]]]]:
    """Published rows by sequence, with their values at the given flexions; none where they share
    fewer than two, or where the protocol does not say that it repeats the publication.
    """
    if published is None:
        return {}
    columns = [
        next((i for i, own in enumerate(published.flexion_deg) if abs(own - f) < 1e-6), None)
        for f in flexions
    ]
    if sum(column is not None for column in columns) < 2:
        return {}
    result: dict[str, list[tuple[FlexionErrors, list[float | None]]]] = {}
    for row in published.flexion_mean_abs_error:
        values = [None if column is None else row.mean_abs_error_deg[column] for column in columns]
        result.setdefault(row.sequence, []).append((row, values))
    return result
