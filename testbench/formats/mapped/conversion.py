"""Rows of a table become quantities in SI units and in the axes of the sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.formats.axes import AxisMap
from testbench.formats.mapped.axes import axes_meant, enu_orientations, own_axes
from testbench.formats.mapped.beside import acc_as_meant
from testbench.formats.mapped.build import Build
from testbench.formats.mapped.columns import MAGNETIC, QUATERNION, Placed
from testbench.formats.mapping import AccColumns, QuaternionColumns, VectorColumns
from testbench.formats.tables.samples_stream import Quantities, stack
from testbench.formats.tables.source import Columns, Kind


@dataclass(frozen=True)
class Vector:
    """A vector of a sensor.

    Attributes:
        titles: Its columns, x, y, z.
        part: Of the mapping.
        axes: Its own, or those of the sensor.
    """

    titles: list[str]
    part: VectorColumns
    axes: AxisMap


@dataclass(frozen=True)
class Conversion:
    """What makes quantities of rows; its units may be told after the first were read.

    Attributes:
        vectors: By quantity.
        factors: To SI, by quantity; 1 as long as a unit is open.
        open_units: Quantities whose unit nobody stated.
        axes: Of the sensor.
        quaternion: What its orientations mean; None where it has none.
        q_titles: Their columns, w, x, y, z.
        temperature: Column of it, or None.
    """

    vectors: dict[str, Vector]
    factors: dict[str, float]
    open_units: list[str]
    axes: AxisMap
    quaternion: QuaternionColumns | None
    q_titles: list[str]
    temperature: str | None

    @property
    def kinds(self) -> dict[str, Kind]:
        """What each column that is read holds."""
        read = [title for vector in self.vectors.values() for title in vector.titles]
        further = [] if self.temperature is None else [self.temperature]
        return dict.fromkeys([*read, *self.q_titles, *further], "float")

    def __call__(self, columns: Columns) -> Quantities:
        """The quantities of rows."""
        values: dict[str, np.ndarray | None] = dict.fromkeys(("acc", "gyr", MAGNETIC))
        for quantity, vector in self.vectors.items():
            part = vector.part
            factor = part.scale * self.factors[quantity]
            values[quantity] = vector.axes.vectors(
                stack(columns, vector.titles, factor, part.offset)
            )
        q = None
        if self.quaternion is not None:
            q = self.axes.orientations(enu_orientations(columns, self.q_titles, self.quaternion))
        return Quantities(
            values["gyr"],
            values["acc"],
            values[MAGNETIC],
            q,
            temperature=columns[self.temperature] if self.temperature else None,
        )


def conversion_of(
    build: Build,
    placed: dict[str, Placed],
    titles: dict[str, list[str]],
    temperature: str | None,
) -> Conversion:
    """What makes quantities of the rows of a sensor.

    Args:
        build: The sensor.
        placed: Its quantities.
        titles: Their columns in the rows.
        temperature: Column of it, or None.

    Raises:
        InputError: A unit is stated that does not exist.
        FileProblems: Its axes are none.
    """
    axes = axes_meant(build.place, build.spec.axes)
    vectors: dict[str, Vector] = {}
    for quantity in ("acc", "gyr", MAGNETIC):
        if quantity in placed:
            part = placed[quantity].part
            assert isinstance(part, VectorColumns)
            if isinstance(part, AccColumns):
                part = acc_as_meant(build, part)
            own = axes
            if part.axes:
                own = own_axes(build.place.inside(quantity, "axes"), part.axes)
            vectors[quantity] = Vector(titles[quantity], part, own)
    units = {
        quantity: build.options.unit(quantity, getattr(vector.part, "unit", None))
        for quantity, vector in vectors.items()
    }
    return Conversion(
        vectors,
        {quantity: 1.0 if unit is None else unit.factor for quantity, unit in units.items()},
        [quantity for quantity, unit in units.items() if unit is None],
        axes,
        build.spec.quaternion if QUATERNION in placed else None,
        titles.get(QUATERNION, []),
        temperature,
    )
