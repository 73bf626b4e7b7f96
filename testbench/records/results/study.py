"""Study: the answer to a question that was asked of whole runs, as tables beside published ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, TypeAdapter, with_config

from testbench.records.disk.json_file import plain_values, write_json
from testbench.records.disk.json_record import AS_WRITTEN, Array, read_record
from testbench.records.disk.replacing import stored

SCHEMA_VERSION = 1
FILE = "study.json"

Value = float | str | None


@with_config(ConfigDict(extra="ignore"))  # the ratio, which is written beside its values
@dataclass(frozen=True)
class StudyRow:
    """One row of ours, and the published one beside it.

    Attributes:
        label: What it is.
        values: One for each column of the table, in its unit; None where there is none.
        published: Those of the publication, in the same order; empty where it has no such row.
        note: More on it, in a sentence.
    """

    label: str
    values: tuple[Value, ...]
    published: tuple[Value, ...] = ()
    note: str = ""

    @property
    def published_alone(self) -> bool:
        """Whether there is nothing of ours in it."""
        return bool(self.published) and all(value is None for value in self.values)

    def ratio(self, column: int) -> float | None:
        """Ours divided by the published value; None where either is missing or no number."""
        ours, theirs = self.values[column], self.published[column] if self.published else None
        numbers = isinstance(ours, int | float) and isinstance(theirs, int | float)
        return float(ours) / float(theirs) if numbers and theirs else None  # type: ignore[arg-type]


@dataclass(frozen=True)
class StudyTable:
    """A table.

    Attributes:
        key: Its name in JSON.
        caption: What it shows.
        columns: Titles with units.
        rows: At least one.
        how: How to read it, one line.
        short: Title for lists of contents, "Table <number>" if empty.
        why: Why ours and the published values differ, in sentences.
        table: Number of the published table; empty without one.
        decimals: Of the numbers of each column.
        ratio_column: Column whose ratio, ours to published, is shown.
    """

    key: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[StudyRow, ...]
    how: str
    why: str = ""
    table: str = ""
    decimals: tuple[int, ...] = ()
    ratio_column: int | None = None
    short: str = ""

    @property
    def title(self) -> str:
        """For lists of contents."""
        return self.short or (f"Table {self.table}" if self.table else self.key.capitalize())

    def __post_init__(self) -> None:
        n = len(self.columns)
        for row in self.rows:
            if len(row.values) != n or (row.published and len(row.published) != n):
                raise ValueError(
                    f"table {self.key}: row '{row.label}' does not have the {n} values of its "
                    "columns"
                )


@dataclass(frozen=True)
class BoxNumbers:
    """A box plot in numbers.

    Attributes:
        lower: End of the lower whisker: the farthest value within 1.5 interquartile ranges of the
            box.
        q1: Lower quartile.
        median: The middle quartile.
        q3: Upper quartile.
        upper: End of the upper whisker, as far as the lower may reach.
        outliers: Values beyond the whiskers, ascending.
    """

    lower: float
    q1: float
    median: float
    q3: float
    upper: float
    outliers: tuple[float, ...] = ()

    @property
    def iqr(self) -> float:
        """Interquartile range."""
        return self.q3 - self.q1

    @staticmethod
    def of(values: np.ndarray) -> BoxNumbers:
        """The numbers of a sample.

        Quartiles are MATLAB's: the kth smallest value is the (k - 1/2)/n quantile.

        Args:
            values: Shape (n,), n >= 1, in any unit.
        """
        ordered = np.sort(np.asarray(values, float))
        q1, median, q3 = np.quantile(ordered, [0.25, 0.5, 0.75], method="hazen").tolist()
        reach = 1.5 * (q3 - q1)
        near = ordered[(ordered >= q1 - reach) & (ordered <= q3 + reach)]
        beyond = ordered[(ordered < q1 - reach) | (ordered > q3 + reach)]
        return BoxNumbers(float(near[0]), q1, median, q3, float(near[-1]), tuple(beyond.tolist()))


@dataclass(frozen=True)
class StudyBoxes:
    """A figure of box plots.

    Attributes:
        caption: What it shows.
        axis: Title of the axis, with the unit.
        boxes: By name; those of the publication under `published`.
        how: How to read it.
        logarithmic: Axis.
    """

    caption: str
    axis: str
    boxes: dict[str, BoxNumbers]
    published: dict[str, BoxNumbers]
    how: str
    logarithmic: bool = False


CurveKind = Literal["theory", "fit", "simulation", "measurement", "truth"]


@dataclass(frozen=True, eq=False)
class StudyCurve:
    """One line or one set of points of a figure.

    Attributes:
        name: As the legend has it.
        x: Abscissae, shape (n,); NaN where there is no value.
        y: Ordinates, shape (n,); NaN where there is no value.
        kind: "theory", "fit" and "truth" are drawn as lines, "simulation" and "measurement" as
            points.
        group: Curves of one group have one colour; the curve's own name if empty.
    """

    name: str
    x: Array
    y: Array
    kind: CurveKind
    group: str = ""


@dataclass(frozen=True, eq=False)
class StudyCurves:
    """Curves that share their axes.

    Attributes:
        caption: What they show.
        x_axis: Title of the abscissa with its unit.
        y_axis: Title of the ordinate with its unit.
        curves: Lines and sets of points.
        how: How to read it.
        logarithmic: The vertical axis, which has no place for zeros.
        plane: Both axes are places and have one scale, and points are joined.
        ordered: The groups are values of one quantity in their order, and their colours are, too.
    """

    caption: str
    x_axis: str
    y_axis: str
    curves: tuple[StudyCurve, ...]
    how: str = ""
    logarithmic: bool = False
    plane: bool = False
    ordered: bool = False


@dataclass(frozen=True, eq=False)
class StudySurface:
    """Values over a grid; the titles of the axes carry the unit.

    Attributes:
        caption: What it shows.
        x_axis: Title of the abscissa.
        y_axis: Title of the ordinate.
        z_axis: Title of the values.
        x: Shape (m,).
        y: Shape (n,).
        z: Shape (n, m).
        how: How to read it.
    """

    caption: str
    x_axis: str
    y_axis: str
    z_axis: str
    x: Array
    y: Array
    z: Array
    how: str = ""


@with_config(AS_WRITTEN)
@dataclass(frozen=True)
class StudyRecord:
    """A finished study.

    Attributes:
        name: Of the study.
        title: For people.
        question: What was asked, in a sentence.
        source: The publication it stands beside, as cited.
        started_utc: ISO 8601.
        settings: What it was run with.
        sessions: Folders that its numbers come from.
        findings: The answer, in sentences.
        tables: In their order.
        figures: Box plots in their order.
        software: Versions.
        curves: Figures of curves in their order.
        surfaces: Figures of surfaces in their order.
        trace: Which numbers come from which session, where not all come from all.
    """

    name: str
    title: str
    question: str
    source: str
    started_utc: str
    settings: dict[str, Any]
    sessions: tuple[str, ...]
    findings: tuple[str, ...]
    tables: tuple[StudyTable, ...]
    figures: tuple[StudyBoxes, ...] = ()
    software: dict[str, str] = field(default_factory=dict)
    curves: tuple[StudyCurves, ...] = ()
    surfaces: tuple[StudySurface, ...] = ()
    trace: str = ""

    def table(self, key: str) -> StudyTable:
        """A table by its key.

        Raises:
            KeyError: No such table.
        """
        return {table.key: table for table in self.tables}[key]

    def to_dict(self) -> dict[str, Any]:
        """For JSON; rows carry the ratio of their table's ratio column."""
        data: dict[str, Any] = plain_values({"schema_version": SCHEMA_VERSION} | vars(self))
        for table, plain in zip(self.tables, data["tables"], strict=True):
            for row, entry in zip(table.rows, plain["rows"], strict=True):
                entry["ratio"] = (
                    None if table.ratio_column is None else row.ratio(table.ratio_column)
                )
        return data

    def save(self, folder: Path) -> Path:
        """Write study.json into a folder.

        Raises:
            StorageError: The disk does not take it.
        """
        with stored(folder / FILE, "the sessions of the study are as they were"):
            write_json(folder / FILE, self.to_dict())
        return folder / FILE

    @staticmethod
    def load(folder: Path) -> StudyRecord:
        """Read study.json of a folder.

        Raises:
            SessionError: It is missing, damaged, or of another version.
        """
        return read_record(folder / FILE, _as_written(), SCHEMA_VERSION, "run the study again")


@cache
def _as_written() -> TypeAdapter[StudyRecord]:
    return TypeAdapter(StudyRecord)
