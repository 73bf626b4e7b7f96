"""What a study hands on: tables with published values beside ours, curves, surfaces. Plain data, for any report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

Cell = str | float | int | None


@dataclass(frozen=True)
class ResultTable:
    """A table.

    Attributes:
        title: What it shows. columns: Headings, each with its unit. rows: One cell for each column; None for none.
        caption: How to read it. published: The columns that are copied from a publication. source: That publication.
    """

    title: str
    columns: list[str]
    rows: list[list[Cell]]
    caption: str = ""
    published: list[str] = field(default_factory=list)
    source: str | None = None

    def __post_init__(self) -> None:
        wrong = [row for row in self.rows if len(row) != len(self.columns)]
        if wrong:
            raise ValueError(f"table '{self.title}': a row has {len(wrong[0])} cells for {len(self.columns)} columns")

    def column(self, name: str) -> list[Cell]:
        """The cells of a column."""
        return [row[self.columns.index(name)] for row in self.rows]


@dataclass(frozen=True)
class ResultCurve:
    """One line or one set of points of a figure.

    Attributes:
        kind: "theory" and "fit" are drawn as lines, "simulation" and "measurement" as points.
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    kind: Literal["theory", "fit", "simulation", "measurement"]


@dataclass(frozen=True)
class ResultFigure:
    """Curves that share their axes; labels carry the unit."""

    title: str
    x_label: str
    y_label: str
    curves: list[ResultCurve]
    caption: str = ""


@dataclass(frozen=True)
class ResultSurface:
    """Values over a grid, shape (len(y), len(x)); labels carry the unit."""

    title: str
    x_label: str
    y_label: str
    z_label: str
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    caption: str = ""


@dataclass(frozen=True)
class StudyResult:
    """All that a study found."""

    name: str
    purpose: str
    tables: list[ResultTable]
    figures: list[ResultFigure] = field(default_factory=list)
    surfaces: list[ResultSurface] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def table(self, title: str) -> ResultTable:
        """A table by the beginning of its title."""
        return next(table for table in self.tables if table.title.startswith(title))
