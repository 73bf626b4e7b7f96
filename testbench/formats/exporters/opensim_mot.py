"""Joint angles over time in degrees, as a motion file of OpenSim."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.exporters.opensim_text import gap_notes, overlap, write_text
from testbench.formats.exporters.settings import settings_lines
from testbench.formats.exporters.source import ExportSource, increasing
from testbench.model.joint_angle import flexion_of


def write(source: ExportSource, path: Path) -> list[str]:
    """Write the angles of every joint by the chosen filter, and the arm's measured joint angles.

    Rows are the instants of the first joint's proximal sensor, or of the arm where the session
    defines no joint; other series are interpolated to them. Angles run on beyond 180 degrees
    instead of jumping.

    Raises:
        InputError: The session has neither joints nor an arm.
    """
    series = _series(source)
    if not series:
        raise InputError(
            f"{source.session.path} has no joint angles: it defines no joints and has no arm"
        )
    times = {name: time for name, (time, _) in series.items()}
    first = next(iter(times.values()))
    time_ns = first[overlap(times)]
    columns = {
        column: np.degrees(np.interp(time_ns, time, angles))
        for time, own in series.values()
        for column, angles in own.items()
    }
    header = [
        "joint_angles",
        "version=1",
        f"nRows={len(time_ns)}",
        f"nColumns={1 + len(columns)}",
        "inDegrees=yes",
        f"session={source.session.name}",
        f"filter={source.filter}",
        *settings_lines(source),
    ]
    texts = "\t".join(["%.9f"] * len(columns))
    write_text(path, header, list(columns), time_ns, texts, np.column_stack(list(columns.values())))
    return gap_notes(times, int(time_ns[0]), int(time_ns[-1]))


def _series(source: ExportSource) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Instants [ns] and continuous angles [rad] by column, for each joint and for the arm.

    All are finite.
    """
    result: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]] = {}
    for joint in source.joint_names():
        time, by_sequence = source.angles(joint)
        definitions = source.definitions(joint)
        columns: dict[str, np.ndarray] = {}
        own = source.session.analysis.joints[joint].label
        if own in by_sequence:
            columns[f"{joint}_flexion"] = flexion_of(definitions[own], by_sequence[own])
        for sequence, angles in by_sequence.items():
            columns |= {
                f"{joint}_{sequence}_{which}": angles[:, i]
                for i, which in enumerate(("first", "second", "third"))
            }
        rows = np.flatnonzero(np.isfinite(np.column_stack(list(columns.values()))).all(axis=1))
        rows = rows[increasing(time[rows])]
        result[f"joint '{joint}'"] = (
            time[rows],
            {name: np.unwrap(values[rows]) for name, values in columns.items()},
        )
    if source.arm is not None:
        rows = increasing(source.arm.host_time_ns)
        measured = dict(zip(source.arm.joint_names, source.arm.q_measured[rows].T, strict=True))
        result["the arm"] = source.arm.host_time_ns[rows], measured
    return result
