"""Joint angles over time in degrees, as a motion file of OpenSim."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.exporters.chain_columns import chain_series
from testbench.formats.exporters.opensim_text import gap_notes, overlap, write_text
from testbench.formats.exporters.settings import settings_lines
from testbench.formats.exporters.source import TRUTH, ExportSource, increasing
from testbench.formats.opensim_names import FILES, anatomical_columns
from testbench.model.joint_angle import flexion_of

NOT_THERE = ("joint.not_placed", "joint.not_computed")
"""Findings on joints that have no angles."""


def write(source: ExportSource, path: Path) -> list[str]:
    """Write the angles of every joint by the chosen filter.

    What an arm measured stands beside them, called so; it is the truth, and alone there in an
    export of it. Rows are the instants of the first joint's proximal sensor, or of the arm where
    the session defines no joint; other series are interpolated to them. Angles run on beyond 180
    degrees instead of jumping.

    Raises:
        InputError: The session has neither joints nor an arm, or none of them by that filter.
    """
    joints = source.session.analysis.joints
    known = bool(joints or source.chains) or source.arm is not None
    series = _series(source) if known else {}
    if not series:
        raise InputError(_nothing(source))
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
        # the joints of a chain are those of its own model, in its own order of turns
        *([] if source.chain is not None else [f"coordinates={FILES[source.model]}"]),
        *settings_lines(source),
    ]
    texts = "\t".join(["%.9f"] * len(columns))
    write_text(path, header, list(columns), time_ns, texts, np.column_stack(list(columns.values())))
    return gap_notes(times, int(time_ns[0]), int(time_ns[-1]))


def _nothing(source: ExportSource) -> str:
    """Why there is no angle to write."""
    path, joints = source.session.path, list(source.session.analysis.joints)
    if joints:
        estimated = source.estimate.joints.values()
        told = [own for joint in estimated for own in joint.findings if own.code in NOT_THERE]
        own = (one for one in told if source.filter in str(one.values["filter"]).split(", "))
        why = "; ".join(dict.fromkeys(map(str, own))) or "it gave no orientation of both sensors"
        others = list(dict.fromkeys(key for joint in estimated for key, _ in joint.angles))
        there = f"; there are angles by {', '.join(others)} (--filter)" if others else ""
        return f"{path} has no angles of {', '.join(joints)} by '{source.filter}': {why}{there}"
    if source.arm is not None:
        return (
            f"{path} has no joint angles by '{source.filter}': it defines no joints between "
            "sensors; --filter truth writes those that the arm measured"
        )
    return (
        f"{path} has no joint angles: it defines no joints and has no arm; import it with --joint "
        "NAME=PROXIMAL:DISTAL"
    )


def _series(source: ExportSource) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Instants [ns] and continuous angles [rad] by column, for each joint and for the arm.

    All are finite.
    """
    if source.chain is not None:
        return chain_series(source)
    result: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]] = {}
    used: set[str] = set()
    for joint in source.joint_names():
        time, by_sequence = source.angles(joint)
        definitions = source.definitions(joint)
        columns: dict[str, np.ndarray] = {}
        defined = source.session.analysis.joints[joint]
        own = defined.label
        named = (
            anatomical_columns(joint, defined, by_sequence[own], source.model)
            if own in by_sequence
            else None
        )
        if named is not None and not used & set(named):
            columns |= named
            used |= set(named)
        elif own in by_sequence:
            columns[f"{joint}_flexion"] = flexion_of(definitions[own], by_sequence[own])
        for sequence, angles in by_sequence.items():
            if sequence == own and named is not None and columns:
                continue
            columns |= {
                f"{joint}_{sequence}_{which}": angles[:, i]
                for i, which in enumerate(("first", "second", "third"))
            }
        columns = {name: own for name, own in columns.items() if np.isfinite(own).any()}
        if not columns:
            continue
        rows = np.flatnonzero(np.isfinite(np.column_stack(list(columns.values()))).all(axis=1))
        rows = rows[increasing(time[rows])]
        result[f"joint '{joint}'"] = (
            time[rows],
            {name: np.unwrap(values[rows]) for name, values in columns.items()},
        )
    if source.filter != TRUTH:
        result |= chain_series(source)
    if source.arm is not None and (result or source.filter == TRUTH):
        rows = increasing(source.arm.host_time_ns)
        alone = "" if source.filter == TRUTH else "_measured"
        titles = [f"{name}{alone}" for name in source.arm.joint_names]
        measured = dict(zip(titles, source.arm.q_measured[rows].T, strict=True))
        result["the arm"] = source.arm.host_time_ns[rows], measured
    return result
