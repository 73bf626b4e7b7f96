"""Published results that ours are shown beside, each with the table it stands in."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pydantic import Field, model_validator

from testbench.exceptions import NotFoundError
from testbench.records.strict import EulerSequence, StrictModel
from testbench.records.yaml_file import load_yaml

PUBLISHED = Path(__file__).resolve().parent.parent / "studies" / "published"


class FlexionErrors(StrictModel):
    """One published table of mean absolute flexion errors.

    Attributes:
        table: Number of the table. sensor, method: As published. filters: Those of ours that the method is. sequence: Of the
        Euler angles. mean_abs_error_deg: One value for each commanded flexion, None where none is given.
    """

    table: str
    sensor: str
    method: str
    filters: list[str]
    sequence: EulerSequence
    mean_abs_error_deg: list[float | None]


class MisalignmentFit(StrictModel):
    """One published quadratic fit of the theoretical flexion error over the misalignment; degrees.

    Attributes:
        a_interval: Confidence interval of a at 95 %.
    """

    flexion_deg: float
    a: float
    b: float
    c: float
    r_squared: float
    adjusted_r_squared: float
    rmse_deg: float
    a_interval: list[float] = Field(min_length=2, max_length=2)


class PublishedTable(StrictModel):
    """Any other published table, as printed.

    Attributes:
        table: Where it stands. title: What it shows. columns: Headings with units. rows: A cell for each column, None where the
        source gives none. note: What is wrong or doubtful in the source.
    """

    table: str
    title: str
    columns: list[str] = Field(min_length=1)
    rows: list[list[float | str | None]]
    note: str = ""

    @model_validator(mode="after")
    def _a_cell_for_each_column(self) -> PublishedTable:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"table {self.table}: a row has {len(row)} cells for {len(self.columns)} columns")
        return self


class PublishedResults(StrictModel):
    """The numbers of one publication."""

    id: str
    description: str
    authors: str
    institution: str
    year: int
    setup: str
    reference_angle: str = ""
    flexion_deg: list[float] = []
    flexion_mean_abs_error: list[FlexionErrors] = []
    misalignment_fits: list[MisalignmentFit] = []
    tables: list[PublishedTable] = []

    @model_validator(mode="after")
    def _equally_long(self) -> PublishedResults:
        for row in self.flexion_mean_abs_error:
            if len(row.mean_abs_error_deg) != len(self.flexion_deg):
                raise ValueError(
                    f"table {row.table} has {len(row.mean_abs_error_deg)} values for {len(self.flexion_deg)} flexions"
                )
        return self

    @property
    def source(self) -> str:
        """How to cite it."""
        return f"{self.authors}, {self.institution}, {self.year}"

    def table(self, name: str) -> PublishedTable:
        """One of its tables.

        Raises:
            NotFoundError: It has no such table; lists those it has.
        """
        for table in self.tables:
            if table.table == name:
                return table
        raise NotFoundError(f"table of {self.id}", name, [table.table for table in self.tables])


@cache
def load_published(name: str = "reference_1") -> PublishedResults:
    """Published results that ship with the bench.

    Raises:
        NotFoundError: No such publication; lists those that exist.
    """
    file = PUBLISHED / f"{name}.yaml"
    if not file.is_file():
        raise NotFoundError("published results", name, sorted(path.stem for path in PUBLISHED.glob("*.yaml")))
    return load_yaml(file, PublishedResults).value
