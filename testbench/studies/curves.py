"""What a study hands on beside tables: curves and surfaces, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from testbench.records.study import StudyTable


@dataclass(frozen=True)
class StudyCurve:
    """One line or one set of points of a figure.

    Attributes:
        kind: "theory" and "fit" are drawn as lines, "simulation" and "measurement" as points. x, y: Shape (n,).
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    kind: Literal["theory", "fit", "simulation", "measurement"]


@dataclass(frozen=True)
class StudyCurves:
    """Curves that share their axes; the axes' titles carry the unit. how: How to read it."""

    caption: str
    x_axis: str
    y_axis: str
    curves: tuple[StudyCurve, ...]
    how: str = ""


@dataclass(frozen=True)
class StudySurface:
    """Values over a grid, z of shape (len(y), len(x)); the axes' titles carry the unit. how: How to read it."""

    caption: str
    x_axis: str
    y_axis: str
    z_axis: str
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    how: str = ""


@dataclass(frozen=True)
class StudyResult:
    """All that a study found.

    Attributes:
        findings: The answer, in sentences. source: The publication it stands beside, as cited.
    """

    source: str
    findings: tuple[str, ...]
    tables: tuple[StudyTable, ...]
    curves: tuple[StudyCurves, ...] = ()
    surfaces: tuple[StudySurface, ...] = field(default=())

    def table(self, key: str) -> StudyTable:
        """A table by its key.

        Raises:
            KeyError: No such table.
        """
        return {table.key: table for table in self.tables}[key]
