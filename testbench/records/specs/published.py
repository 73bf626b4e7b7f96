"""Published results that ours are shown beside, each with the table it stands in."""

from __future__ import annotations

from functools import cache
from typing import TypeVar

from pydantic import Field, model_validator

from testbench.exceptions import NotFoundError
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.shipped import shipped_data
from testbench.records.specs.strict import EulerSequence, StrictModel

PUBLISHED = shipped_data("studies", "published")


class Publication(StrictModel):
    """What was published where, and how it was measured."""

    id: str
    description: str
    authors: str
    institution: str
    year: int
    setup: str

    @property
    def source(self) -> str:
        """How to cite it."""
        return f"{self.authors}, {self.institution}, {self.year}"


class FlexionErrors(StrictModel):
    """One published table of mean absolute flexion errors.

    Attributes:
        table: Number of the table.
        sensor: Name of the sensor, as published.
        method: Name of the method, as published.
        filters: Those of ours that the method is.
        sequence: Of the Euler angles.
        mean_abs_error_deg: One value for each commanded flexion, None where none is given.
    """

    table: str
    sensor: str
    method: str
    filters: list[str]
    sequence: EulerSequence
    mean_abs_error_deg: list[float | None]


class CalibrationBias(StrictModel):
    """What was left of an accelerometer's bias after a published calibration [mg].

    |bias| and standard deviation of x, y, z.
    """

    table: str
    sensor: str
    method: str
    bias_mg: list[float] = Field(min_length=3, max_length=3)
    sd_mg: list[float] = Field(min_length=3, max_length=3)


class PublishedResults(Publication):
    """Flexion errors and biases of one publication."""

    reference_angle: str
    flexion_deg: list[float] = Field(min_length=1)
    flexion_mean_abs_error: list[FlexionErrors]
    calibration_bias: list[CalibrationBias] = []

    @model_validator(mode="after")
    def _equally_long(self) -> PublishedResults:
        for row in self.flexion_mean_abs_error:
            if len(row.mean_abs_error_deg) != len(self.flexion_deg):
                raise ValueError(
                    f"table {row.table} has {len(row.mean_abs_error_deg)} values for "
                    f"{len(self.flexion_deg)} flexions"
                )
        return self


class PublishedRow(StrictModel):
    """One row of a published table: its values in the order of the columns.

    None where none is given.
    """

    label: str
    values: list[float | None]
    corrected: list[float | None] = Field(
        default=[],
        description="Where a value is a misprint by the source's own numbers: what these make of "
        "it, in its place; none elsewhere.",
    )
    outliers: list[float] = Field(default=[], description="Of a box plot, one by one.")
    outlier_count: int | None = Field(default=None, description="Where only their number is given.")
    remark: str = ""


class PublishedTable(StrictModel):
    """One published table."""

    caption: str
    columns: list[str] = Field(min_length=1)
    rows: list[PublishedRow] = Field(min_length=1)

    @model_validator(mode="after")
    def _equally_wide(self) -> PublishedTable:
        for row in self.rows:
            if len(row.values) != len(self.columns):
                raise ValueError(
                    f"row '{row.label}' has {len(row.values)} values for {len(self.columns)} "
                    "columns"
                )
            if row.corrected and len(row.corrected) != len(row.values):
                raise ValueError(
                    f"row '{row.label}' has {len(row.corrected)} corrected values for "
                    f"{len(row.values)} printed ones"
                )
        return self

    def row(self, label: str) -> PublishedRow:
        """A row by its label.

        Raises:
            NotFoundError: No such row; lists those that exist.
        """
        found = {row.label: row for row in self.rows}
        if label not in found:
            raise NotFoundError("row of a published table", label, list(found))
        return found[label]


class PublishedTables(Publication):
    """The tables of one publication, as printed."""

    tables: dict[str, PublishedTable]


def load_published(name: str = "reference_1") -> PublishedResults:
    """Published flexion errors that ship with the bench.

    Raises:
        NotFoundError: No such publication; lists those that exist.
    """
    return _load(name, PublishedResults, "flexion_mean_abs_error:")


def load_published_tables(name: str) -> PublishedTables:
    """Published tables that ship with the bench.

    Raises:
        NotFoundError: No such publication; lists those that exist.
    """
    return _load(name, PublishedTables, "tables:")


Kind = TypeVar("Kind", PublishedResults, PublishedTables)


@cache
def _load(name: str, kind: type[Kind], mark: str) -> Kind:
    """A publication of one kind; `mark` begins a line in the files of that kind."""
    known = [
        path
        for path in sorted(PUBLISHED.glob("*.yaml"))
        if f"\n{mark}" in path.read_text(encoding="utf-8")
    ]
    if name not in {path.stem for path in known}:
        raise NotFoundError("published results", name, [path.stem for path in known])
    return load_yaml(PUBLISHED / f"{name}.yaml", kind).value
