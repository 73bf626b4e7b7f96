"""Flat tables of a session on the common host time.

Raw samples stand there with the estimates and the truth beside them.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from testbench.formats.exporters.settings import settings_of
from testbench.formats.exporters.source import TRUTH, ExportSource, software, true_orientation
from testbench.frames import NANOSECONDS
from testbench.model.joint_angle import flexion_of
from testbench.records.results.estimate import angle_sd_columns
from testbench.records.results.gait import STRIDE_COLUMNS, Stride
from testbench.records.session.layout import walk_table
from testbench.records.session.samples import QUATERNION, names, split

Table = dict[str, np.ndarray]

UNITS = {
    "_rad_s": "rad/s",
    "_m_s2": "m/s^2",
    "_uT": "uT",
    "_rad": "rad",
    "_deg": "deg",
    "_deg_s": "deg/s",
    "_m": "m",
    "_ns": "ns",
    "_s": "s",
}
"""Unit by the end of a column's name; the longest that fits counts."""


def unit_of(column: str) -> str:
    """Unit of a column, empty where it has none."""
    return next(
        (UNITS[end] for end in sorted(UNITS, key=len, reverse=True) if column.endswith(end)), ""
    )


def all_tables(source: ExportSource) -> dict[str, Table]:
    """Every table of a session by name: imu_<sensor>, truth_<sensor>, joint_<joint>,
    strides_<sensor>, walk_<sensor>, chain_<section>_<state>, arm, steps.
    """
    result = {f"imu_{name}": sensor_table(source, name) for name in source.sensor_names}
    for name, truth in source.truths.items():
        if truth is not None:
            result[f"truth_{name}"] = timed(truth.host_time_ns) | truth.to_columns()
    for name in source.estimate.joints:
        result[f"joint_{name}"] = joint_table(source, name)
    if source.gait is not None:
        for name, own in source.gait.sensors.items():
            if own.strides:
                result[f"strides_{name}"] = stride_table(own.strides)
        result |= {walk_table(name): columns for name, columns in source.gait.walks.items()}
    for key, one in source.chains.items():
        result[key] = timed(one.host_time_ns) | one.to_columns()
    if source.arm is not None:
        result["arm"] = timed(source.arm.host_time_ns) | source.arm.to_columns()
    if source.session.steps:
        result["steps"] = step_table(source)
    return result


def timed(host_time_ns: np.ndarray) -> Table:
    """The two columns every table begins with: seconds, and the same instants in nanoseconds.

    Args:
        host_time_ns: Shape (n,).
    """
    return {"time_s": host_time_ns / NANOSECONDS, "host_time_ns": host_time_ns}


def sensor_table(source: ExportSource, name: str) -> Table:
    """Raw samples of a sensor at the instants they were taken, and its orientations.

    They are those of the filters, and the true one.
    """
    samples, estimated = source.imus[name], source.estimate.sensors[name]
    raw = samples.to_columns()
    result = timed(estimated.host_time_ns) | {"arrival_time_ns": raw.pop("host_time_ns")} | raw
    result |= {"static": estimated.static, "flagged": estimated.flagged}
    for key in source.filters:
        if key in estimated.orientation:
            result |= split(
                names(f"{key}_q_world_from_sensor", "", QUATERNION), estimated.orientation[key]
            )
    if source.truths[name] is not None:
        q = true_orientation(source.truths[name], estimated.host_time_ns)
        result |= split(names("true_q_world_from_sensor", "", QUATERNION), q)
    return result


def joint_table(source: ExportSource, name: str) -> Table:
    """Angles and flexion of a joint by every filter and by the truth.

    They are at the proximal sensor's instants.
    """
    estimated, definitions = source.estimate.joints[name], source.definitions(name)
    result = timed(estimated.host_time_ns)
    series = {key: angles for key, angles in estimated.angles.items() if key[0] in source.filters}
    for sequence, angles in source.true_angles(name, estimated.host_time_ns).items():
        if np.isfinite(angles).any():
            series["true", sequence] = angles
    for (key, sequence), angles in series.items():
        columns = [f"{key}_{sequence}_{which}_rad" for which in ("first", "second", "third")]
        result |= split(columns, angles)
        if (key, sequence) in estimated.sd:
            result |= split(angle_sd_columns(key, sequence), estimated.sd[key, sequence])
        if sequence in definitions:
            result[f"{key}_{sequence}_flexion_rad"] = flexion_of(definitions[sequence], angles)
    return result


def stride_table(strides: list[Stride]) -> Table:
    """The strides of a walk, a row each."""
    return {
        key: np.array(
            [getattr(stride, key) for stride in strides],
            dtype=object if key == "left_out" else None,
        )
        for key in STRIDE_COLUMNS
    }


def step_table(source: ExportSource) -> Table:
    """The protocol's steps as they happened."""
    steps = source.session.steps
    texts = ("section", "role", "name", "kind")
    result: Table = {"index": np.array([step.index for step in steps], dtype=np.int64)}
    result |= {
        key: np.array([str(getattr(step, key)) for step in steps], dtype=object) for key in texts
    }
    times = {"start": "start_ns", "settled": "settled_ns", "end": "end_ns"}
    result |= {
        f"{key}_s": np.array([getattr(step, field) for step in steps]) / NANOSECONDS
        for key, field in times.items()
    }
    return result | {
        "variables": np.array([json.dumps(step.variables) for step in steps], dtype=object)
    }


AXIS = re.compile(r"(?P<before>.+)_(?P<part>[wxyz])(?P<after>(?:_.+)?)")


def grouped(table: Table) -> Table:
    """The table with the parts of one vector or quaternion side by side.

    So gyr_x_rad_s, ... become gyr_rad_s.
    """
    groups: dict[str, list[np.ndarray]] = {}
    for column, values in table.items():
        match = AXIS.fullmatch(column)
        groups.setdefault(match["before"] + match["after"] if match else column, []).append(values)
    return {
        name: np.column_stack(parts) if len(parts) > 1 else parts[0]
        for name, parts in groups.items()
    }


def conventions() -> dict[str, str]:
    """What a reader of the tables must know, by column."""
    return {
        "time_s": "seconds since the start of the session on the host's clock; host_time_ns is the "
        "same in nanoseconds",
        "arrival_time_ns": "when the sample reached the host; host_time_ns is when it was taken, "
        "by the fitted clock",
        "device_time_ns": "the sensor's own clock",
        "gyr, acc, mag": "as the sensor reported them, in the sensor frame; acc is the specific "
        "force, +9.81 upwards at rest",
        "device_q": "q_earth_from_sensor by the sensor's own filter, as it reported it",
        "static, flagged": "at rest by its own signals; refused by the quality gates",
        "<filter>_q_world_from_sensor": "estimated orientation: unit quaternion w x y z, Hamilton; "
        "world z up",
        "true_q_world_from_sensor": "the truth, interpolated to the sample; missing where it is "
        "unknown",
        "<filter>_<sequence>_first_rad": "intrinsic Euler angles of the distal segment against the "
        "proximal one",
        "<filter>_<sequence>_first_sd_rad": "standard uncertainty of that angle, where it is known",
        "q_<joint>_rad, v_..., a_...": "in tables chain_<section>_<state>: angle, rate and "
        "acceleration of a joint by the chain filter, with standard uncertainties (q_sd_...)",
        "<filter>_<sequence>_flexion_rad": "the one that is the flexion, with its sign",
    }


def description(source: ExportSource, tables: dict[str, Table]) -> dict[str, Any]:
    """What the tables are, for the file beside them."""
    manifest = source.session.manifest
    return {
        "software": software(),
        "session": source.session.name,
        "started_utc": manifest.started_utc,
        "protocol": manifest.protocol.written() or None,
        "filters": [key for key in source.filters if key != TRUTH],
        "parameters": settings_of(source, source.filters),
        "conventions": conventions(),
        "tables": {
            name: {
                "rows": len(next(iter(table.values()))),
                "units": {column: unit_of(column) for column in table},
            }
            for name, table in tables.items()
        },
    }
