"""OpenSim .sto as truth: orientations of bodies, a column each."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.source import Kind
from testbench.formats.tables.sto_table import AXES, TIME, find_sto
from testbench.formats.truth.tracked import Tracked, quaternions, tracked_times


def is_sto(lines: list[str]) -> bool:
    """Whether the header is that of a table of orientations."""
    return any(line.strip().lower() == "datatype=quaternion" for line in lines)


def read_sto(file: Path, rate: float | None) -> Tracked:
    """Bodies of a file.

    Args:
        file: To read.
        rate: In place of its times [Hz], or None.

    Raises:
        FileProblems: It is malformed; names the line.
    """
    table = find_sto(file)
    kinds: dict[str, Kind] = dict.fromkeys(table.names, "float")
    chunks = list(table.chunks(kinds))
    if not chunks:
        raise FileProblems(file, [Problem("there are no rows below the titles")])
    columns = {name: np.concatenate([chunk[name] for chunk in chunks]) for name in kinds}
    times = tracked_times(
        file, len(columns[TIME]), columns[TIME], rate, first_line=table.first_line
    )
    bodies = {
        body: quaternions(np.column_stack([columns[f"{body}_{axis}"] for axis in AXES]))
        for body in table.bodies
    }
    return Tracked("OpenSim", times, bodies=bodies)
