"""Files of motion: poses of bodies over time, which simulated sensors ride on in place of an arm.

A `.csv` has a column `time_s`, and of each body `NAME.q_w` to `NAME.q_z` (from its axes into a
world whose z axis points up, Hamilton) and `NAME.x_m` to `NAME.z_m`; of a single body the name and
its point may be left out. An `.npz` has the arrays `time_s`, shape (n,), and of each body `NAME.q`,
shape (n, 4), and `NAME.position_m`, shape (n, 3).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.csv as arrow_csv
from pyarrow import ArrowInvalid

from testbench.exceptions import FileProblems, Problem
from testbench.frames import NANOSECONDS
from testbench.model.rigid_motion import LEAST_POSES, RigidMotion

SINGLE = "sensor"
"""Name of a body that has none."""
QUATERNION, POSITION = ("q_w", "q_x", "q_y", "q_z"), ("x_m", "y_m", "z_m")
NEAR_UNIT = 0.02
"""A quaternion's length may differ from 1 by rounding only [1]."""
Poses = tuple[np.ndarray, np.ndarray]
"""Quaternions, shape (n, 4), and positions, shape (n, 3) [m]."""


def read_motion(file: Path) -> dict[str, RigidMotion]:
    """The bodies of a file, by name.

    Raises:
        FileProblems: It is not such a file; says what it lacks.
    """
    time, bodies = _read_npz(file) if file.suffix == ".npz" else _read_csv(file)
    problems = _wrong(time, bodies)
    if problems:
        raise FileProblems(file, [Problem(text) for text in problems])
    time_ns = np.round((time - time[0]) * NANOSECONDS).astype(np.int64)
    return {name: RigidMotion(time_ns, place, q) for name, (q, place) in bodies.items()}


def _read_npz(file: Path) -> tuple[np.ndarray, dict[str, Poses]]:
    try:
        with np.load(file, allow_pickle=False) as content:
            arrays = {key: np.asarray(content[key], float) for key in content.files}
    except (OSError, ValueError) as error:
        raise FileProblems(file, [Problem(f"not a readable .npz: {error}")]) from None
    time = arrays.pop("time_s", np.zeros(0))
    names = dict.fromkeys(key.rpartition(".")[0] for key in arrays)
    nothing, bodies = np.zeros((0, 0)), {}
    for name in names:
        prefix = f"{name}." if name else ""
        q, place = (arrays.get(prefix + key, nothing) for key in ("q", "position_m"))
        bodies[name or SINGLE] = (q, place)
    return time, bodies


def _read_csv(file: Path) -> tuple[np.ndarray, dict[str, Poses]]:
    try:
        table = arrow_csv.read_csv(file)
    except (OSError, ArrowInvalid) as error:
        raise FileProblems(file, [Problem(f"not a readable table: {error}")]) from None
    columns: dict[str, np.ndarray] = {}
    for title in table.column_names:
        try:
            columns[title.strip()] = table[title].to_numpy().astype(float)
        except (TypeError, ValueError):
            raise FileProblems(file, [Problem(f"column {title} holds no numbers")]) from None
    time = columns.pop("time_s", np.zeros(0))
    names = dict.fromkeys(title.rpartition(".")[0] for title in columns)
    bodies = {}
    for name in names:
        prefix = f"{name}." if name else ""
        parts = [
            np.column_stack([columns[prefix + key] for key in keys])
            if all(prefix + key in columns for key in keys)
            else np.zeros((0, 0))
            for keys in (QUATERNION, POSITION)
        ]
        bodies[name or SINGLE] = (parts[0], parts[1])
    return time, bodies


def _wrong(time: np.ndarray, bodies: dict[str, Poses]) -> list[str]:
    """What keeps poses from being a motion, in sentences."""
    if time.ndim != 1 or len(time) < LEAST_POSES:
        return [f"a motion has a column time_s with {LEAST_POSES} times or more"]
    if not np.isfinite(time).all() or not (np.diff(time) > 0).all():
        return ["time_s must increase from row to row"]
    if not bodies:
        return [f"a motion has a body: {', '.join((*QUATERNION, *POSITION))}"]
    problems = []
    for name, (q, place) in bodies.items():
        if q.shape != (len(time), 4) or place.shape != (len(time), 3):
            problems.append(
                f"body {name} needs {len(time)} orientations ({', '.join(QUATERNION)}) and "
                f"positions ({', '.join(POSITION)})"
            )
        elif not np.isfinite(q).all() or not np.isfinite(place).all():
            problems.append(f"body {name} has values that are no numbers")
        elif np.abs(np.linalg.norm(q, axis=1) - 1).max() > NEAR_UNIT:
            problems.append(f"body {name} has quaternions that are not of unit length")
    return problems
