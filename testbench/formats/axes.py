"""Axis maps: which axis of the file, with which sign, is each axis of the sensor frame."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from testbench.exceptions import InputError, NotFoundError
from testbench.model import rotation
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.session.samples import AXES
from testbench.records.specs.strict import Name, StrictModel

PRESETS = Path(__file__).resolve().parent / "presets"
Signed = Annotated[str, Field(pattern=r"^[-+]?[xyz]$")]
"""An axis of the file with its sign, such as -z."""


class AxisNames(StrictModel):
    """A map as a person writes it, e.g. {x: -z, y: -y, z: -x}."""

    x: Signed = Field(description="Axis of the file that is the sensor's x, e.g. -z.")
    y: Signed = Field(description="Axis of the file that is the sensor's y.")
    z: Signed = Field(description="Axis of the file that is the sensor's z.")


class AxisPreset(AxisNames):
    """A map that ships with the bench."""

    description: str
    source: str


class AxisPresets(StrictModel):
    """The content of presets/axes.yaml."""

    axes: dict[Name, AxisPreset]


@dataclass(frozen=True)
class AxisMap:
    """A signed permutation: x_sensor = matrix @ x_file, shape (3, 3), entries 0, 1 and -1."""

    matrix: np.ndarray

    @staticmethod
    def from_names(names: AxisNames) -> AxisMap:
        """From what a person wrote.

        Raises:
            InputError: An axis of the file stands twice.
        """
        matrix = np.zeros((3, 3))
        for row, target in enumerate(AXES):
            text: str = getattr(names, target)
            matrix[row, AXES.index(text[-1])] = -1.0 if text[0] == "-" else 1.0
        if np.any(np.abs(matrix).sum(axis=0) != 1):
            listing = ", ".join(f"{target}: {getattr(names, target)}" for target in AXES)
            raise InputError(
                f"axes {{{listing}}}: each of x, y, z of the file must stand exactly once"
            )
        return AxisMap(matrix)

    @property
    def is_rotation(self) -> bool:
        """Whether right-handed axes stay right-handed."""
        return bool(np.linalg.det(self.matrix) > 0)

    def vectors(self, x_file: np.ndarray) -> np.ndarray:
        """Vectors in the sensor frame.

        Args:
            x_file: In the axes of the file, shape (n, 3), in any unit.

        Returns:
            Shape (n, 3), in the same unit.
        """
        if np.array_equal(self.matrix, IDENTITY.matrix):
            return x_file
        source = np.argmax(np.abs(self.matrix), axis=1)
        result = np.empty((3, len(x_file)))  # each column in one piece, as they were read
        for own, column, row in zip(self.matrix, source, result, strict=True):
            np.multiply(x_file[:, column], own[column], out=row)
        return result.T

    def orientations(self, q_earth_from_file: np.ndarray) -> np.ndarray:
        """Orientations of the sensor frame; the map must be a rotation.

        Args:
            q_earth_from_file: Of the axes of the file, shape (n, 4).

        Returns:
            q_earth_from_sensor, shape (n, 4).
        """
        return rotation.multiply(q_earth_from_file, self.q_file_from_sensor)

    @property
    def q_file_from_sensor(self) -> np.ndarray:
        """The map as a rotation, shape (4,)."""
        return rotation.conjugate(rotation.from_matrix(self.matrix))


IDENTITY = AxisMap(np.eye(3))


def find_axes(text: str) -> AxisMap:
    """A map by the name of a preset, or as text: "x: -z, y: -y, z: -x".

    Raises:
        NotFoundError: No such preset; lists those that exist.
        InputError: The text is not a map, or one that would mirror the sensor.
    """
    parts = re.findall(r"([xyz])\s*[:=]\s*([-+]?[xyz])", text)
    if len(parts) == 3 and len({target for target, _ in parts}) == 3:
        names = AxisNames(**dict(parts))
        result = AxisMap.from_names(names)
    elif ":" in text or "=" in text:
        raise InputError(
            f"'{text}' is not an axis map; write it like 'x: -z, y: -y, z: -x', or name a preset"
        )
    else:
        presets = axis_presets()
        if text not in presets:
            raise NotFoundError("axis map", text, list(presets))
        result = AxisMap.from_names(presets[text])
    if not result.is_rotation:
        raise InputError(
            f"the axis map '{text}' turns right-handed axes into left-handed ones: a sign or two "
            "axes are wrong"
        )
    return result


def axis_presets() -> dict[str, AxisPreset]:
    """The maps that ship with the bench, by name."""
    return load_yaml(PRESETS / "axes.yaml", AxisPresets).value.axes
