"""A MATLAB file (version 5) with one struct that MATLAB and Octave load as it is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from testbench.exceptions import InputError
from testbench.formats.exporters.settings import settings_of
from testbench.formats.exporters.source import ExportSource, software
from testbench.formats.exporters.tables import Table, all_tables, conventions, grouped, unit_of

STRUCT = "session"
LARGEST = 2**31 - 2**20
"""A variable of a version 5 file ends here [bytes]."""
LONGEST_NAME = 63


def write(source: ExportSource, path: Path) -> list[str]:
    """Write the file.

    Raises:
        InputError: The session is too large for this format, or a name too long.
    """
    tables = all_tables(source)
    size = sum(_size(values) for table in tables.values() for values in table.values())
    if size > LARGEST:
        raise InputError(
            f"{source.session.path}: {size / 1e9:.1f} GB do not fit into a MATLAB file of version "
            "5 (2 GB); export to parquet, which MATLAB reads by parquetread"
        )
    content: dict[str, Any] = {
        "name": source.session.name,
        "started_utc": source.session.manifest.started_utc or "",
        "software": software(),
        "conventions": _cells([f"{key}: {text}" for key, text in conventions().items()]),
    }
    ran_with = settings_of(source, source.filters)
    if ran_with:
        content["parameters"] = _cells([f"{key}: {text}" for key, text in ran_with.items()])
    arm = source.arm
    if arm is not None:
        content["arm_joint_names"] = _cells(arm.joint_names)
    for name, table in tables.items():
        content[field(name)] = _struct(
            arm_matrices(table, arm.joint_names) if name == "arm" and arm else grouped(table)
        )
    with path.open("wb") as file:
        savemat(
            file,
            {STRUCT: content},
            format="5",
            long_field_names=True,
            do_compression=True,
            oned_as="column",
        )
    return []


def arm_matrices(table: Table, joints: list[str]) -> Table:
    """The arm's columns with a matrix for each quantity, one column a joint.

    Joints are in the robot's order.
    """
    result = {name: values for name, values in table.items() if name.endswith(("time_s", "_ns"))}
    for prefix, suffix in (("q_sent", "_rad"), ("q_measured", "_rad"), ("v_measured", "_rad_s")):
        result[f"{prefix}{suffix}"] = np.column_stack(
            [table[f"{prefix}_{joint}{suffix}"] for joint in joints]
        )
    return result


def field(name: str) -> str:
    """A name that MATLAB takes for a field.

    Raises:
        InputError: It is too long.
    """
    result = re.sub(r"[^A-Za-z0-9_]", "_", name)
    if len(result) > LONGEST_NAME:
        raise InputError(
            f"'{name}' is too long for a field of a MATLAB struct: {len(result)} characters, "
            f"{LONGEST_NAME} fit"
        )
    return result


def _struct(table: Table) -> dict[str, Any]:
    columns = {
        field(name): _cells(values.tolist()) if values.dtype == object else values
        for name, values in table.items()
    }
    return columns | {"units": {field(name): unit_of(name) for name in table if unit_of(name)}}


def _cells(texts: list[str]) -> np.ndarray:
    """A column of texts as a cell array."""
    cells = np.empty((len(texts), 1), dtype=object)
    cells[:, 0] = texts
    return cells


def _size(values: np.ndarray) -> int:
    return sum(2 * len(text) for text in values) if values.dtype == object else values.nbytes
