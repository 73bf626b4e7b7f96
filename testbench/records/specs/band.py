"""A normal band: how an angle goes over a cycle in persons without complaints."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from testbench.exceptions import NotFoundError
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.shipped import shipped_data, shipped_names
from testbench.records.specs.strict import StrictModel

BANDS = shipped_data("reporting", "bands")
Percent = Annotated[float, Field(ge=0, lt=100)]


class NormalCurve(StrictModel):
    """One angle over the cycle."""

    joint: str = Field(description="Word in the name of the joints that it is of, such as knee.")
    angle: str = Field(default="flexion", description="Which of their angles.")
    percent: list[Percent] = Field(
        min_length=4, description="Of the cycle, increasing; 0 is where it begins."
    )
    mean_deg: list[float] = Field(description="At each of them [deg].")
    sd_deg: list[Annotated[float, Field(ge=0)]] = Field(
        description="Standard deviation between persons [deg]."
    )

    @model_validator(mode="after")
    def _equally_long(self) -> NormalCurve:
        if not len(self.percent) == len(self.mean_deg) == len(self.sd_deg):
            raise ValueError("percent, mean_deg and sd_deg must be equally long")
        if (np.diff(self.percent) <= 0).any():
            raise ValueError("percent must increase")
        return self

    def at(self, percent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation [deg] at any percent, for cycles follow one another.

        Args:
            percent: Shape (k,).
        """
        mean, sd = (
            np.interp(percent, self.percent, values, period=100.0)
            for values in (self.mean_deg, self.sd_deg)
        )
        return mean, sd


class Band(StrictModel):
    """Angles of one source."""

    description: str = Field(description="Of whom, and how they moved, in a few words.")
    source: str = Field(description="How to cite it.")
    persons: int = Field(ge=1, description="How many.")
    curves: list[NormalCurve] = Field(min_length=1)

    @property
    def told(self) -> str:
        """What it has, in words."""
        return ", ".join(f"{curve.joint} {curve.angle}" for curve in self.curves)

    def curve(self, name: str) -> NormalCurve | None:
        """The curve of an angle by its name, such as `knee_r_flexion`; None where it has none."""
        words = re.split(r"[\W_]+", name.lower())
        fitting = (own for own in self.curves if {own.joint, own.angle} <= set(words))
        return next(fitting, None)


def load_band(name: str) -> Band:
    """A band by its file, or by the name of one that ships.

    Raises:
        NotFoundError: There is neither; lists those that ship.
        FileProblems: The file is no band.
    """
    if Path(name).is_file():
        return load_yaml(name, Band).value
    known = shipped_names(BANDS)
    if name not in known:
        raise NotFoundError("normal band", name, known)
    return load_yaml(BANDS / f"{name}.yaml", Band).value
