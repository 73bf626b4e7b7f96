"""Study: the answer to a question that was asked of whole runs, as tables beside published ones."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, TypeAdapter, with_config

from testbench.records.disk.json_file import plain_values, write_json
from testbench.records.disk.json_record import AS_WRITTEN, Array, read_record
from testbench.records.disk.replacing import stored

SCHEMA_VERSION = 1
"""What has come since has defaults, with which earlier ones are read."""
FILE = "study.json"

Value = float | str | None
Settings = Literal["", "published", "ours"]
"""Whose settings a method runs with; empty where it has none, or both are the same."""
Print = Literal["", "text", "listing", "upstream code"]
"""Which print of a publication a method follows: what it says in words and equations, the program
that it lists, or the library that its authors used; empty where it is none of theirs.
"""


@with_config(ConfigDict(extra="ignore"))  # the ratio, which is written beside its values
@dataclass(frozen=True)
class StudyRow:
    """One row of ours, and the published one beside it.

    Attributes:
        label: What it is.
        values: One for each column of the table, in its unit; None where there is none.
        published: Those of the publication, in the same order; empty where it has no such row.
        note: More on it, in a sentence.
        spread: Of ours over the parts, one for each column; empty where one part was run.
        published_spread: As printed beside the published values; empty where nothing is.
        settings: Whose settings the method runs with.
        printed: Which print of the publication the method follows.
        other: What the published values are, where that is not what ours are: then there is no
            ratio. Empty where both sides have one definition.
    """

    label: str
    values: tuple[Value, ...]
    published: tuple[Value, ...] = ()
    note: str = ""
    spread: tuple[Value, ...] = ()
    published_spread: tuple[Value, ...] = ()
    settings: Settings = ""
    printed: Print = ""
    other: str = ""

    @property
    def title(self) -> str:
        """The label, with whose settings and which print it is of."""
        whose = f", {_WHOSE[self.settings]}" if self.settings else ""
        return self.label + whose + (f", as printed ({self.printed})" if self.printed else "")

    @property
    def published_title(self) -> str:
        """Of the published values beneath."""
        return f"published: {self.other}" if self.other else "published"

    @property
    def published_alone(self) -> bool:
        """Whether there is nothing of ours in it."""
        return bool(self.published) and all(value is None for value in self.values)

    def without_published(self) -> StudyRow:
        """What is ours of it."""
        return replace(self, published=(), published_spread=(), other="")

    def ratio(self, column: int) -> float | None:
        """Ours divided by the published value.

        None where either is missing or no number, or they are not of one definition.
        """
        if self.other:
            return None
        ours, theirs = self.values[column], self.published[column] if self.published else None
        numbers = isinstance(ours, int | float) and isinstance(theirs, int | float)
        return float(ours) / float(theirs) if numbers and theirs else None  # type: ignore[arg-type]


_WHOSE = {"published": "published settings", "ours": "our settings"}

Explained = Literal["shown", "refuted", "candidate", "open"]
"""Of a reason: a run shows that it makes the difference; a run shows that it does not; a run shows
that it could, and nothing tells it from others; nobody knows.
"""


@dataclass(frozen=True)
class StudyReason:
    """Why ours and the published values may differ, and what became of the idea.

    Attributes:
        claim: A sentence.
        verdict: What a run says of it.
        run: Key of the table, or caption of the figure, that shows it; empty of an open one alone.
    """

    claim: str
    verdict: Explained
    run: str = ""

    def __post_init__(self) -> None:
        if (self.verdict == "open") == bool(self.run):
            raise ValueError(
                f"a reason that is {self.verdict} needs {'no' if self.run else 'a'} run: "
                f"{self.claim}"
            )


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
        why: What is to be known of ours beside the published values, in sentences.
        table: Number of the published table; empty without one.
        decimals: Of the numbers of each column.
        ratio_column: Column whose ratio, ours to published, is shown.
        spread: What the spread of our values is; empty without one.
        published_spread: What stands beside the published values as their spread.
        reasons: Why they may differ, each with what a run says of it.
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
    spread: str = ""
    published_spread: str = ""
    reasons: tuple[StudyReason, ...] = ()

    @property
    def title(self) -> str:
        """For lists of contents."""
        return self.short or (f"Table {self.table}" if self.table else self.key.capitalize())

    def __post_init__(self) -> None:
        n = len(self.columns)
        for row in self.rows:
            others = (row.published, row.spread, row.published_spread)
            if len(row.values) != n or any(values and len(values) != n for values in others):
                raise ValueError(
                    f"table {self.key}: row '{row.label}' does not have the {n} values of its "
                    "columns"
                )

    def without_published(self) -> StudyTable | None:
        """What is ours of it; None where nothing is."""
        rows = tuple(row.without_published() for row in self.rows if not row.published_alone)
        if not rows:
            return None
        return replace(
            self, rows=rows, why="", table="", ratio_column=None, published_spread="", reasons=()
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


CurveKind = Literal["theory", "fit", "simulation", "measurement", "published", "line", "truth"]


@dataclass(frozen=True, eq=False)
class StudyCurve:
    """One line or one set of points of a figure.

    Attributes:
        name: As the legend has it.
        x: Abscissae, shape (n,); NaN where there is no value.
        y: Ordinates, shape (n,); NaN where there is no value.
        kind: "theory", "fit", "line" and "truth" are drawn as lines, "simulation", "measurement"
            and "published" as points.
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
        simulated: Whether ours come from models of sensors.
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
    simulated: bool = True

    def table(self, key: str) -> StudyTable:
        """A table by its key.

        Raises:
            KeyError: No such table.
        """
        return {table.key: table for table in self.tables}[key]

    @property
    def beside_published(self) -> bool:
        """Whether published values stand beside ours."""
        return any(row.published for table in self.tables for row in table.rows)

    def without_published(self) -> StudyRecord:
        """What is ours of it, as of data that the publication says nothing of."""
        curves = []
        for figure in self.curves:
            left = tuple(curve for curve in figure.curves if curve.kind != "published")
            if left:
                curves.append(replace(figure, curves=left))
        tables = (table.without_published() for table in self.tables)
        return replace(
            self,
            tables=tuple(table for table in tables if table is not None),
            figures=tuple(replace(f, published={}) for f in self.figures if f.boxes),
            curves=tuple(curves),
        )

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
