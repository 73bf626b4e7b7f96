"""MATLAB files with the arrays of an inertial sensor by their usual names.

Scripts around Xsens MTi and others save them.

An array of n samples has the shape (n, 3), or (3, n). Several sensors are structs, each with its
own arrays. The file states no units: gravity at rest and the turns tell them, or a person does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.array_table import ArrayTable
from testbench.formats.tables.matlab_file import load_mat
from testbench.formats.tables.recognise import Found
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

_DATA = r"(_?(data|meas|raw|cal|calibrated))?"
_NAMES = {
    "acc": r"(imu_?)?(acc|accel|accelerations?|accelerometer|specific_?force|a|f)" + _DATA,
    "gyr": r"(imu_?)?(gyr|gyro|gyroscope|angular_?(velocity|rate)|rate_?of_?turn|omega|w)" + _DATA,
    "mag": r"(imu_?)?(mag|magnetometer|magnetic_?field|m)" + _DATA,
    "quaternion": r"(imu_?)?(q|quat|quaternions?|orientation)",
    "time": r"(t|times?|timestamp|time_?s|seconds)",
    "rate": (
        r"(fs|f_?s|rate|sampling_?rate|sample_?rate|freq|frequency|update_?rate"
        r"|sampling_?frequency)(_?hz)?"
    ),
    "interval": r"(dt|ts|t_?s|sample_?(time|period)|period|interval)",
}


def read(files: list[Path], options: Options) -> Recording:
    """Read one file.

    Args:
        files: One .mat file.
        options: Rate and units.

    Raises:
        InputError: Not one file, or a rate or unit is open.
        FileProblems: The file holds no such arrays.
    """
    if len(files) != 1:
        raise InputError(f"a MATLAB recording is one file, {len(files)} were given")
    file = files[0]
    content = load_mat(file)
    groups = {
        name: value
        for name, value in content.items()
        if isinstance(value, dict) and _by_kind(value).keys() & {"acc", "gyr"}
    }
    if _by_kind(content).keys() & {"acc", "gyr"}:
        groups = {"imu": content}
    if not groups:
        listing = ", ".join(sorted(content)[:30]) or "nothing"
        raise FileProblems(
            file,
            [
                Problem(
                    "no arrays called acc, gyr or the like, of shape (n, 3); the file has "
                    f"{listing}"
                )
            ],
        )
    findings: list[Finding] = []
    sensors = {}
    for name, (key, group) in zip(unique_names(groups), groups.items(), strict=True):
        findings += [finding("structure.struct", name, struct=key)] if key != name else []
        sensors[name] = _sensor(file, name, content | group, options, findings)
    return suited_recording(
        sensor_name(file.stem),
        "recording in a MATLAB file",
        sensors,
        findings,
    )


def _by_kind(content: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Arrays by what their names and shapes say they are; scalars for rate and interval."""
    result: dict[str, np.ndarray] = {}
    for kind, pattern in _NAMES.items():
        for name, value in content.items():
            if not re.fullmatch(pattern, name, re.IGNORECASE) or isinstance(value, dict):
                continue
            array = np.asarray(value)
            if array.dtype.kind not in "fiub":
                continue
            width = {"acc": 3, "gyr": 3, "mag": 3, "quaternion": 4}.get(kind)
            if width and array.ndim == 2 and width in array.shape:
                wide = array if array.shape[1] == width else array.T
                result.setdefault(kind, _floats(wide))
            elif kind == "time" and array.ndim == 1 and len(array) > 1:
                result.setdefault(kind, _floats(array))
            elif kind in {"rate", "interval"} and array.size == 1:
                result.setdefault(kind, _floats(array).reshape(1))
    return result


def _floats(array: np.ndarray) -> np.ndarray:
    """Numbers as floats; infinite where they are of a wider kind and too large."""
    with np.errstate(over="ignore"):
        return array.astype(float)


# One piece: the arrays that are found decide what is checked, renamed and noted.
def _sensor(
    file: Path, name: str, content: Mapping[str, Any], options: Options, findings: list[Finding]
) -> ImportedSensor:
    found_arrays = _by_kind(content)
    lengths = {
        kind: len(found_arrays[kind])
        for kind in ("acc", "gyr", "mag", "quaternion", "time")
        if kind in found_arrays
    }
    count = max(lengths.get("acc", 0), lengths.get("gyr", 0))
    different = {kind: length for kind, length in lengths.items() if length != count}
    if different:
        listing = ", ".join(f"{kind} {length}" for kind, length in lengths.items())
        raise FileProblems(
            file, [Problem(f"the arrays of sensor '{name}' differ in length: {listing}")]
        )
    arrays: dict[str, np.ndarray] = {}
    found = Found()
    for kind in ("acc", "gyr", "mag", "quaternion"):
        if kind in found_arrays:
            axes = "wxyz" if kind == "quaternion" else "xyz"
            found.columns[kind] = [f"{kind}_{axis}" for axis in axes]
            arrays |= {
                f"{kind}_{axis}": found_arrays[kind][:, i].copy() for i, axis in enumerate(axes)
            }
    stamped = "time" in found_arrays and np.all(np.isfinite(found_arrays["time"]))
    stated_rate: float | None = None
    if not stamped and options.rate is None:
        if "rate" in found_arrays:
            rate = float(found_arrays["rate"][0])
        elif "interval" in found_arrays and found_arrays["interval"][0] > 0:
            rate = float(1 / found_arrays["interval"][0])
        else:
            raise InputError(
                f"{file}: sensor '{name}' has neither times nor a sampling rate; state it with "
                "--rate HZ"
            )
        if not 0.01 <= rate <= 100_000:
            raise FileProblems(
                file,
                [Problem(f"a sampling rate of {rate:g} Hz cannot be; state it with --rate HZ")],
            )
        stated_rate = rate
    if stamped:
        arrays["time"] = found_arrays["time"]
    if "quaternion" in found_arrays:
        findings.append(finding("orientation.assumed", name))
    layout = Layout(
        "inertial sensor of a MATLAB file",
        {},
        "time" if stamped else None,
        None,
        rate=stated_rate,
    )
    return table_sensor(ArrayTable(file, arrays), found, layout, name, options, findings)
