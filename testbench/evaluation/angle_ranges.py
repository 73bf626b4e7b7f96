"""Angles over a whole recording that nobody judges: Euler angles of sensors, angles of joints.

Near gimbal lock the outer angles are not defined apart: there they are left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.evaluation.euler_ranges import LOCKED, MOSTLY_LOCKED, ranges_deg
from testbench.model.decomposition import Decomposition, Euler
from testbench.model.joint_angle import INDEX, decomposition_of, unwrapped
from testbench.records.results.estimate import JointEstimate, SensorEstimate
from testbench.records.results.evaluation import ResultTables
from testbench.records.results.recording_rows import AngleRangeRow
from testbench.records.session.layout import euler_table, motion_table
from testbench.records.specs.protocol import JointDefinition

HEADING_FIRST = ("ZYX", "ZXY")
"""Sequences that begin with the heading; no orientation is in gimbal lock for both."""
SELDOM = 1.0
"""Percent of a recording in gimbal lock that a sequence is not changed for."""
PLACES = tuple(INDEX)


def usual_sequence(sensor: SensorEstimate) -> str:
    """ZYX, or ZXY where ZYX is in gimbal lock for a longer part of the recording."""
    q = next((q[np.isfinite(q).all(axis=1)] for q in sensor.orientation.values()), None)
    if q is None or not len(q):
        return HEADING_FIRST[0]
    usual, other = (_locked_percent(Euler(sequence), q) for sequence in HEADING_FIRST)
    return HEADING_FIRST[0] if usual <= max(other, SELDOM) else HEADING_FIRST[1]


def _locked_percent(kind: Euler, q: np.ndarray) -> float:
    return float(100 * (kind.margins(kind.angles(q)).min(axis=-1) < LOCKED).mean())


def sensor_angles(name: str, sensor: SensorEstimate, sequence: str | None) -> ResultTables:
    """Euler angles of a sensor by every filter, over time and their ranges.

    Args:
        name: Of the sensor.
        sensor: Its estimate.
        sequence: Of the angles; by `usual_sequence` if None.
    """
    sequence = sequence or usual_sequence(sensor)
    kind = Euler(sequence)
    rows: list[AngleRangeRow] = []
    columns: dict[str, np.ndarray] = {}
    for key, q in sensor.orientation.items():
        known = np.isfinite(q).all(axis=1) & ~sensor.flagged
        angles = np.full((len(q), 3), np.nan)
        angles[known] = kind.angles(q[known])
        rows += _rows(name, "sensor", (key, sequence), kind, angles)
        columns |= _columns(key, sequence, kind, angles, columns)
    series = {euler_table(name): {"host_time_ns": sensor.host_time_ns} | columns}
    return ResultTables(angle_ranges=rows, series=series if columns else {})


def joint_angles(name: str, joint: JointDefinition, estimate: JointEstimate) -> ResultTables:
    """Angles of a joint by every filter and definition, over time and their ranges."""
    defined = {item.label: item for item in joint.definitions()}
    rows: list[AngleRangeRow] = []
    columns: dict[str, np.ndarray] = {}
    for (key, label), angles in estimate.angles.items():
        kind = decomposition_of(defined[label])
        signed = angles.copy()
        flexion = INDEX[defined[label].flexion]
        signed[:, flexion] *= defined[label].sign
        rows += _rows(name, "joint", (key, label), kind, signed, flexion)
        columns |= _columns(key, label, kind, signed, columns)
    series = {motion_table(name): {"host_time_ns": estimate.host_time_ns} | columns}
    return ResultTables(angle_ranges=rows, series=series if columns else {})


def _locked(kind: Decomposition, angles: np.ndarray) -> np.ndarray:
    """Where each angle is not defined by itself, shape (n, 3), bool."""
    return np.asarray(kind.margins(np.nan_to_num(angles)) < LOCKED) & np.isfinite(angles)


def _columns(
    key: str,
    label: str,
    kind: Decomposition,
    angles: np.ndarray,
    others: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """The three angles, unwrapped beside those of the first filter, where they are defined.

    Args:
        key: Of the filter.
        label: Of the sequence or definition.
        kind: That gave the angles.
        angles: Shape (n, 3) [rad].
        others: Columns of the filters before.
    """
    shown = np.where(_locked(kind, angles), np.nan, angles)
    columns = {}
    for i, place in enumerate(PLACES):
        ending = f"_{label}_{place}_rad"
        first = next((own for name, own in others.items() if name.endswith(ending)), None)
        own = unwrapped(shown[:, i]) if first is None else unwrapped_beside(shown[:, i], first)
        columns[f"{key}{ending}"] = own.astype(np.float32)
    return columns


def unwrapped_beside(angle: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """An angle without jumps of a turn, which crosses gaps as another estimate of it does.

    Across gimbal lock an angle moves by up to half a turn, so that two estimates of one motion
    would part by a whole one for the rest of the recording.

    Args:
        angle: Shape (n,) [rad]; NaN in gaps.
        beside: The other estimate, unwrapped, shape (n,) [rad].

    Returns:
        Shape (n,) [rad].
    """
    result = np.array(angle, float)
    apart = 0.0
    known = np.flatnonzero(np.isfinite(result))
    for run in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        own = np.unwrap(result[run])
        difference = own - beside[run]
        difference = difference[np.isfinite(difference)]
        if len(difference):
            middle = float(np.median(difference))
            turns = np.round((apart - middle) / (2 * np.pi))
            apart = middle + 2 * np.pi * turns
            own = own + 2 * np.pi * turns
        result[run] = own
    return result


def _rows(
    owner: str,
    what: str,
    key: tuple[str, str],
    kind: Decomposition,
    angles: np.ndarray,
    flexion: int | None = None,
) -> list[AngleRangeRow]:
    known = np.isfinite(angles).all(axis=1)
    if not known.any():
        return []
    locked = _locked(kind, angles)[known]
    own, names = angles[known], getattr(kind, "names", PLACES)
    rows = []
    for i, place in enumerate(PLACES):
        percent = float(100 * locked[:, i].mean())
        low = high = reach = None
        if not percent:
            degrees = np.degrees(unwrapped(own[:, i]))
            low, high = float(degrees.min()), float(degrees.max())
            reach = high - low
        elif isinstance(kind, Euler):  # passages of lock leave whole turns open
            reach = ranges_deg(own, locked[:, i], percent > MOSTLY_LOCKED)[i]
        rows.append(
            AngleRangeRow(
                owner=owner,
                kind=what,
                filter=key[0],
                sequence=key[1],
                angle=place,
                name="" if names[i] == place else names[i],
                flexion=i == flexion,
                n=len(own),
                lowest_deg=low,
                highest_deg=high,
                range_deg=reach,
                locked_percent=percent,
            )
        )
    return rows
