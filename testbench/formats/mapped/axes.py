"""Axes and orientations as a mapping states them."""

from __future__ import annotations

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.axes import IDENTITY, AxisMap, AxisNames, find_axes
from testbench.formats.mapped.files import Place
from testbench.formats.mapping import QuaternionColumns
from testbench.formats.tables.samples_stream import stack
from testbench.formats.tables.source import Columns
from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM


def axes_meant(place: Place, axes: str | AxisNames | None) -> AxisMap:
    """The axes of a sensor.

    Args:
        place: Of the sensor in the mapping.
        axes: Name of an axis map, or what each axis is; None where they are those of the file.

    Raises:
        FileProblems: They are no axes, or change the hand.
    """
    if axes is None:
        return IDENTITY
    if isinstance(axes, str):
        try:
            return find_axes(axes)
        except InputError as error:
            raise place.problem(str(error), "axes") from None
    result = own_axes(place.inside("axes"), axes)
    if not result.is_rotation:
        raise place.problem(
            "turns right-handed axes into left-handed ones; if the file's are, give acc, gyr and "
            "mag axes of their own",
            "axes",
        )
    return result


def own_axes(place: Place, axes: AxisNames) -> AxisMap:
    """The axes of one quantity, which may change the hand.

    Args:
        place: Of the axes in the mapping.
        axes: What each is.

    Raises:
        FileProblems: They are no axes.
    """
    try:
        return AxisMap.from_names(axes)
    except InputError as error:
        raise place.problem(str(error)) from None


def enu_orientations(columns: Columns, titles: list[str], spec: QuaternionColumns) -> np.ndarray:
    """Orientations as rows of a file hold them.

    Args:
        columns: Of the file, each of shape (n,).
        titles: Of w, x, y and z there.
        spec: What they mean.

    Returns:
        q_enu_from_file, w, x, y, z, shape (n, 4).
    """
    q = stack(columns, titles)
    q = q if spec.direction == "earth_from_sensor" else rotation.conjugate(q)
    return q if spec.earth == "ENU" else rotation.multiply(np.array(Q_ENU_FROM[spec.earth]), q)
