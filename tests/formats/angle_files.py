"""Angles of joints, as other systems write them down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np


def write_mot(
    path: Path, time: np.ndarray, columns: Mapping[str, np.ndarray], degrees: str | None = "yes"
) -> Path:
    """A motion file of OpenSim.

    Args:
        path: Of the file.
        time: Shape (n,) [s].
        columns: As they are to stand there, shape (n,) each.
        degrees: What the header says of the unit, None for nothing.
    """
    head = ["Coordinates", "version=1", f"nRows={len(time)}", f"nColumns={1 + len(columns)}"]
    head += [] if degrees is None else [f"inDegrees={degrees}"]
    lines = [*head, "endheader", "\t".join(["time", *columns])]
    for row in np.column_stack([time, *columns.values()]):
        lines.append("\t".join(f"{value:.9f}" for value in row))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_c3d(
    path: Path, rate: float, points: Mapping[str, np.ndarray], unit: str | None = "deg"
) -> Path:
    """One marker, and angles among the points, by ezc3d's own writer.

    Args:
        path: Of the file.
        rate: Of the frames [Hz].
        points: Angles by name, shape (n, 3) each.
        unit: Of the angles, None for nothing.
    """
    import ezc3d

    content = ezc3d.c3d()
    count = len(next(iter(points.values())))
    values = np.ones((4, 1 + len(points), count))
    for i, own in enumerate(points.values(), 1):
        values[:3, i] = own.T
    names: Sequence[str] = [f"Anna:{name}" for name in points]
    point = content["parameters"]["POINT"]
    point["RATE"]["value"] = [rate]
    point["LABELS"]["value"] = ["Anna:KNEE", *names]
    point["UNITS"]["value"] = ["mm"]
    content.add_parameter("POINT", "ANGLES", list(names))
    content.add_parameter("POINT", "TYPE_GROUPS", ["ANGLES", "ANGLE_UNITS"])
    if unit is not None:
        content.add_parameter("POINT", "ANGLE_UNITS", [unit])
    content["data"]["points"] = values
    content.write(str(path))
    return path
