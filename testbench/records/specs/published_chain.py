"""Published results of a filter over a kinematic chain.

Tables of joints, where `published` has tables of flexions.
"""

from __future__ import annotations

from functools import cache
from typing import Literal

from pydantic import Field, model_validator

from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.protocol_chain import ChainState
from testbench.records.specs.published import PUBLISHED, Publication
from testbench.records.specs.strict import StrictModel


class ServoErrors(StrictModel):
    """RMS errors of a rig of servos.

    Attributes:
        table: Number of the table.
        unit: As printed, which may be none.
        joints: From the base on.
        states: By state of the filter, for each joint that of angle, rate and acceleration.
    """

    table: str
    unit: str
    joints: list[str] = Field(min_length=1)
    states: dict[ChainState, list[list[float]]]

    @model_validator(mode="after")
    def _complete(self) -> ServoErrors:
        for state, rows in self.states.items():
            if len(rows) != len(self.joints) or any(len(row) != 3 for row in rows):
                raise ValueError(
                    f"table {self.table}, {state}: three numbers for each of "
                    f"{', '.join(self.joints)} are needed"
                )
        return self


class GaitErrors(StrictModel):
    """Errors of one axis of a joint in walking; percents and degrees, means signed."""

    joint: Literal["hip", "knee", "ankle"]
    axis: Literal["X", "Y", "Z"]
    mean_error_deg: float
    relative_percent: float
    median_error_deg: float
    largest_error_deg: float
    smallest_error_deg: float


class GaitTables(StrictModel):
    """Walking: tables by number, a row for each axis, and the totals as printed."""

    tables: list[str]
    rows: list[GaitErrors] = Field(min_length=1)
    mean_error_deg: float
    relative_percent: float

    @property
    def mean_magnitude_deg(self) -> float:
        """Mean of the magnitudes of the signed means, in which nothing cancels."""
        return sum(abs(row.mean_error_deg) for row in self.rows) / len(self.rows)


class PublishedChain(Publication):
    """The numbers of one publication."""

    servo_rms: list[ServoErrors]
    gait: GaitTables


@cache
def load_published_chain(name: str = "reference_5") -> PublishedChain:
    """Published results that ship with the bench."""
    return load_yaml(PUBLISHED / f"{name}.yaml", PublishedChain).value
