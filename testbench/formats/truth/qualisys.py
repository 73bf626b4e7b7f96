"""Qualisys Track Manager: TSV of markers (3D) and of rigid bodies (6D).

The header has a key and its values a line (docs.qualisys.com, Motion data (.tsv)): NO_OF_MARKERS,
FREQUENCY, MARKER_NAMES, or NO_OF_BODIES and BODY_NAMES. Rows may begin with the frame, and the
time. Positions are in mm. A body has X Y Z, Roll Pitch Yaw, Residual and the elements Rot[0] to
Rot[8] of its rotation matrix, column by column; where the angles fit only the other reading, that
is taken.
"""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.text_table import head_of
from testbench.formats.truth.number_rows import number_rows, rows_apart
from testbench.formats.truth.tracked import (
    LARGEST_PART,
    Tracked,
    points,
    stated_rate,
    tracked_times,
)
from testbench.model import rotation

_KEY = re.compile(r"^[A-Z][A-Z_0-9]+(\t|$)")
BODY_COLUMNS = 16
COUNT = "NO_OF_FRAMES"
"""Key of the number of frames."""
MM = 1e-3
AGREES = np.radians(0.5)
"""Angles and matrix of a body agree if they differ by less [rad]."""
ORTHOGONAL = 0.01
"""Rows of a matrix may be wrong by so much."""


def is_qualisys(lines: list[str]) -> bool:
    """Whether there are the keys of such a file."""
    return any(line.startswith(("NO_OF_MARKERS\t", "NO_OF_BODIES\t")) for line in lines)


def read_qualisys(file: Path, rate: float | None) -> Tracked:
    """Markers or bodies of a file.

    Args:
        file: To read.
        rate: In place of its frequency [Hz], or None.

    Raises:
        FileProblems: It is malformed, which names the line, or nobody states the rate.
    """
    lines = head_of(file)
    header: dict[str, list[str]] = {}
    keys = list(itertools.takewhile(_KEY.match, lines))
    for line in keys:
        key, *values = line.rstrip("\t").split("\t")
        header.setdefault(key, values)
    at = min(len(keys), len(lines) - 1)
    bodies = "BODY_NAMES" in header
    names = [name.strip() for name in header.get("BODY_NAMES" if bodies else "MARKER_NAMES", [])]
    if not names:
        raise FileProblems(file, [Problem("has no names: neither MARKER_NAMES nor BODY_NAMES")])
    while at < len(lines) - 1 and not re.match(r"^\s*[-+.\d]", lines[at]):
        at += 1
    width = len(names) * (BODY_COLUMNS if bodies else 3)
    extra = len(lines[at].rstrip("\t\r").split("\t")) - width
    titled = lines[at - 1].split("\t")[:2] if at else []
    lead = 2 if titled == ["Frame", "Time"] else 1 if titled[:1] == ["Frame"] else 0
    if lead == 0 and extra in {1, 2}:
        lead = extra
    rows = number_rows(file, at + 1, "\t", lead + width)
    stated = stated_rate((header.get("FREQUENCY") or [""])[0])
    times = tracked_times(file, len(rows), rows[:, 1] if lead == 2 else None, rate, stated, at + 1)
    tracked = Tracked("Qualisys", times)
    tracked.findings += rows_apart(file, COUNT, (header.get(COUNT) or [""])[0], len(rows))
    if bodies:
        for i, name in enumerate(names):
            own = rows[:, lead + BODY_COLUMNS * i : lead + BODY_COLUMNS * (i + 1)]
            tracked.bodies[name] = _orientation(own)
    else:
        tracked.markers = points(np.array(rows[:, lead:]), names, MM)
    return tracked


def _orientation(own: np.ndarray) -> np.ndarray:
    """q_world_from_body of a body's columns, shape (n, 16) to (n, 4); NaN where lost."""
    q = np.full((len(own), 4), np.nan)
    matrices = own[:, 7:16].reshape(-1, 3, 3).transpose(0, 2, 1)
    matrices = np.where(np.abs(matrices) <= LARGEST_PART, matrices, np.nan)
    product = np.einsum("nij,nkj->nik", matrices, matrices)
    known = np.abs(product - np.eye(3)).max(axis=(1, 2)) < ORTHOGONAL
    known &= np.linalg.det(np.where(known[:, None, None], matrices, np.eye(3))) > 0
    if not known.any():
        return q
    q[known] = rotation.from_matrix(rotation.nearest_rotation(matrices[known]))
    angles = np.radians(own[known, 3:6])
    if np.isfinite(angles).all():
        by_angles = rotation.from_euler("XYZ", angles)
        off = [
            float(np.median(rotation.angle(rotation.multiply(rotation.conjugate(turn), by_angles))))
            for turn in (q[known], rotation.conjugate(q[known]))
        ]
        if off[1] < AGREES < off[0]:
            return rotation.conjugate(q)
    return q
