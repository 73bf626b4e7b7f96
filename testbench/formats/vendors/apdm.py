"""APDM Opal: HDF5 of Mobility Lab and Motion Studio, the layouts of its versions.

Version 5 has /Sensors/<id> with Accelerometer [m/s^2], Gyroscope [rad/s], Magnetometer [uT] and
Time [us since 1970], the sensor's label in the attribute `Label 0` of its Configuration, and
/Processed/<id>/Orientation. Versions 2 to 4 have a group a sensor, named in the attribute
CaseIdList, its label in MonitorLabelList, with Time and Calibrated/Accelerometers, Gyroscopes,
Magnetometers, Orientation; version 1 has Acceleration, AngularVelocity and MagneticField. (APDM,
Motion Studio user guide; readers of both layouts: github bensenderling/DAMVi_App, skdh.)

The file does not say which way its quaternion (w first) turns; gravity does. All sensors of a file
are synchronised: they share one clock.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.common_clock import share_origin
from testbench.formats.dates import Recorded
from testbench.formats.names import sensor_name, unique_names
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import Layout, table_sensor
from testbench.formats.tables.matlab_file import MOST_COMPRESSED
from testbench.formats.tables.recognise import Found
from testbench.formats.tables.source import ROWS_PER_CHUNK, Columns, Kind
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

_QUANTITIES = {
    "acc": ("Accelerometer", "Accelerometers", "Acceleration"),
    "gyr": ("Gyroscope", "Gyroscopes", "AngularVelocity"),
    "mag": ("Magnetometer", "Magnetometers", "MagneticField"),
    "quaternion": ("Orientation",),
}
_UNITS = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}
_LATEST_US = 4_102_444_800_000_000
"""The year 2100: later stamps are damaged [us since 1970]."""
_FIRST_SOLD_US = 1_262_304_000_000_000
"""The year 2010: earlier stamps are no date [us since 1970]."""
UPRIGHT = 0.9
"""Cosine between the vertical and the measured gravity beyond which an orientation fits it."""
TIME = "Time"


@dataclass
class Opal:
    """Where one sensor's data lie.

    Attributes:
        label: As the file names it.
        paths: Of its datasets, by quantity and "time".
        count: Of its samples.
        rate: By an attribute [Hz], or None.
    """

    label: str
    paths: dict[str, str] = field(default_factory=dict)
    count: int = 0
    rate: float | None = None


@dataclass(frozen=True)
class OpalTable:
    """The datasets of one sensor as a table with columns such as acc_x, and Time."""

    file: Path
    opal: Opal

    @property
    def names(self) -> list[str]:
        """Of the columns."""
        columns = [
            f"{quantity}_{axis}"
            for quantity in _QUANTITIES
            if quantity in self.opal.paths
            for axis in _axes(quantity)
        ]
        timed = "time" in self.opal.paths or self.opal.rate is not None
        return [*columns, *([TIME] if timed else [])]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """See `Source.chunks`."""
        wanted = {name: name.rpartition("_")[0] or "time" for name in kinds}
        for start in range(0, self.opal.count, ROWS_PER_CHUNK):
            rows = slice(start, start + ROWS_PER_CHUNK)
            arrays = self._read({wanted[name] for name in kinds}, rows)
            yield {
                name: arrays[part]
                if part == "time"
                else arrays[part][:, _axes(part).index(name[-1])]
                for name, part in wanted.items()
            }

    def _read(self, parts: set[str], rows: slice) -> dict[str, np.ndarray]:
        try:
            with h5py.File(self.file) as content:
                own = parts & self.opal.paths.keys()
                arrays = {part: content[self.opal.paths[part]][rows] for part in own}
        except Exception as error:  # a damaged file raises errors of many kinds
            raise self.problem(f"cannot be read: {_short(error)}") from None
        if "time" in arrays:
            if not np.all((arrays["time"] >= 0) & (arrays["time"] <= _LATEST_US)):
                raise self.problem(
                    f"{self.opal.paths['time']} holds times that are no microseconds since 1970"
                )
            arrays["time"] = arrays["time"].astype(np.int64)
        elif "time" in parts:
            index = np.arange(rows.start, min(rows.stop, self.opal.count))
            arrays["time"] = np.round(index * (1e6 / (self.opal.rate or 1.0))).astype(np.int64)
        return {
            part: array if part == "time" else array.astype(float) for part, array in arrays.items()
        }

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the file, or of a sample (from 1)."""
        place = f"sensor {self.opal.label}" + ("" if row is None else f", sample {row + 1}")
        return FileProblems(self.file, [Problem(f"{place}: {message}")])


def read(files: list[Path], options: Options) -> Recording:
    """Read one recording.

    Args:
        files: One .h5 file.
        options: Rate, where the file has no times, and units.

    Raises:
        InputError: Not one file, or the rate is open.
        FileProblems: The file is none of APDM, or damaged.
    """
    if len(files) != 1:
        raise InputError(f"an APDM recording is one file, {len(files)} were given")
    file = files[0]
    opals = _find(file)
    findings: list[Finding] = []
    sensors: dict[str, ImportedSensor] = {}
    for name, opal in zip(unique_names(opal.label for opal in opals), opals, strict=True):
        sensors[name] = _sensor(OpalTable(file, opal), name, options, findings)
    date = None
    if all("time" in opal.paths for opal in opals) and options.rate is None:
        origin = share_origin(sensors.values())
        if origin >= 1000 * _FIRST_SOLD_US:
            at = datetime.fromtimestamp(origin // NANOSECONDS, UTC)
            date = Recorded(at, "the first stamp of the file")
    return suited_recording(
        sensor_name(file.stem),
        "APDM Opal recording",
        sensors,
        findings,
        recorded=date,
    )


def _axes(quantity: str) -> str:
    return "wxyz" if quantity == "quaternion" else "xyz"


def _short(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text[:150] or type(error).__name__


_FORWARD, _NWU = "sensor into earth", "north, west, up"


def _find(file: Path) -> list[Opal]:
    """The sensors of a file.

    Raises:
        FileProblems: It holds none, or is damaged.
    """

    def refuse(message: str) -> FileProblems:
        return FileProblems(file, [Problem(message)])

    if not file.is_file():
        raise refuse("the file does not exist")
    try:
        with h5py.File(file) as content:
            listing = ", ".join(sorted(map(str, content))[:20]) or "nothing"
            opals = _version_5(content) if "Sensors" in content else _older(content)
            for opal in opals:
                _check_size(content, opal, file)
    except FileProblems:
        raise
    except Exception as error:  # a damaged file raises errors of many kinds
        raise refuse(f"not a readable HDF5 file: {_short(error)}") from None
    if not opals:
        raise refuse(
            "not a recording of APDM: no /Sensors/<id> and no group of CaseIdList with an "
            f"accelerometer or a gyroscope of shape (n, 3); the file has {listing}"
        )
    return opals


def _version_5(content: h5py.File) -> list[Opal]:
    opals = []
    for key, group in content["Sensors"].items():
        if not isinstance(group, h5py.Group):
            continue
        settings = group.get("Configuration")
        attributes: Mapping[str, Any] = {} if settings is None else settings.attrs
        label = _text(attributes.get("Label 0")) or str(key)
        processed = content.get(f"Processed/{key}")
        opal = _opal(label, group, [group, processed])
        opal.rate = _number(attributes.get("Sample Rate"))
        opals.append(opal)
    return [opal for opal in opals if {"acc", "gyr"} & opal.paths.keys()]


def _older(content: h5py.File) -> list[Opal]:
    keys = [_text(key) for key in np.atleast_1d(content.attrs.get("CaseIdList", []))]
    labels = [_text(key) for key in np.atleast_1d(content.attrs.get("MonitorLabelList", []))]
    names = dict(zip(keys, labels, strict=False))
    opals = []
    for key, group in content.items():
        if not isinstance(group, h5py.Group):
            continue
        opal = _opal(names.get(key) or str(key), group, [group.get("Calibrated"), group])
        opal.rate = _number(group.attrs.get("SampleRate"))
        opals.append(opal)
    return [opal for opal in opals if {"acc", "gyr"} & opal.paths.keys()]


def _opal(label: str, group: h5py.Group, places: list[Any]) -> Opal:
    opal = Opal(label)
    for quantity, names in _QUANTITIES.items():
        width = len(_axes(quantity))
        for place in places:
            for name in names:
                item = place.get(name) if isinstance(place, h5py.Group) else None
                if isinstance(item, h5py.Dataset) and item.ndim == 2 and item.shape[1] == width:
                    opal.paths.setdefault(quantity, item.name)
    time = group.get(TIME)
    if isinstance(time, h5py.Dataset) and time.ndim == 1 and time.dtype.kind in "iuf":
        opal.paths["time"] = time.name
    return opal


def _check_size(content: h5py.File, opal: Opal, file: Path) -> None:
    """Refuse a sensor whose datasets contradict one another or the size of the file."""
    counts = {part: len(content[path]) for part, path in opal.paths.items()}
    opal.count = max(counts.get("acc", 0), counts.get("gyr", 0))
    if not opal.count:
        raise FileProblems(file, [Problem(f"sensor {opal.label} has no samples")])
    for part, path in opal.paths.items():
        item = content[path]
        if item.dtype.kind not in "iuf":
            raise FileProblems(file, [Problem(f"{path} holds no numbers")])
        if item.nbytes > file.stat().st_size * MOST_COMPRESSED:
            raise FileProblems(file, [Problem(f"{path} claims more than the file can hold")])
        if counts[part] != opal.count:
            raise FileProblems(
                file,
                [Problem(f"{path} has {counts[part]} rows, where the sensor has {opal.count}")],
            )


def _text(value: Any) -> str:
    """An attribute as text, without the zero bytes that fill it up."""
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size else ""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return str(value or "").split("\0")[0].strip()


def _number(value: Any) -> float | None:
    try:
        number = float(np.asarray(value).reshape(-1)[0])
    except (TypeError, ValueError, IndexError):
        return None
    return number if 0.01 <= number <= 100_000 else None


def _sensor(
    table: OpalTable, name: str, options: Options, findings: list[Finding]
) -> ImportedSensor:
    paths = table.opal.paths
    found = Found({q: [f"{q}_{axis}" for axis in _axes(q)] for q in _QUANTITIES if q in paths})
    layout = Layout("APDM Opal", _UNITS, TIME if TIME in table.names else None, "us")
    if "quaternion" in paths:
        reading = _direction(table, name, findings)
        if reading is None:
            del found.columns["quaternion"]
        else:
            conjugate, earth = reading
            layout = Layout("APDM Opal", _UNITS, layout.time, "us", conjugate, earth)
    if "time" not in paths and options.rate is None and table.opal.rate is not None:
        rate, who = table.opal.rate, "the file"
        findings.append(finding("time.by_rows", name, rate_hz=rate, who=who))
    return table_sensor(table, found, layout, name, options, findings)


def _direction(table: OpalTable, name: str, findings: list[Finding]) -> tuple[bool, str] | None:
    """Whether the quaternion turns earth into sensor, and what its earth is; None if neither fits.

    The measured gravity, turned into the earth, must be vertical.
    """
    if "acc" not in table.opal.paths:
        findings.append(finding("orientation.unchecked", name, direction=_FORWARD, earth=_NWU))
        return False, "NWU"
    rows = next(table.chunks(dict.fromkeys((n for n in table.names if n != TIME), "float")))
    q = np.column_stack([rows[f"quaternion_{axis}"] for axis in "wxyz"])
    acc = np.column_stack([rows[f"acc_{axis}"] for axis in "xyz"])
    lengths, norms = rotation.lengths(q), rotation.lengths(acc)
    known = np.isfinite(lengths) & np.isfinite(norms) & (lengths > 0) & (norms > 0)
    if not known.any():
        findings.append(finding("orientation.absent", name))
        return None
    q, acc = q[known] / lengths[known, None], acc[known] / norms[known, None]
    upright = [
        float(np.mean(rotation.rotate(turn, acc)[:, 2])) for turn in (q, rotation.conjugate(q))
    ]
    conjugate = abs(upright[1]) > abs(upright[0])
    best = upright[int(conjugate)]
    if abs(best) < UPRIGHT:
        findings.append(finding("orientation.contradicted", name))
        return None
    earth = "NWU" if best > 0 else "NED"
    tilts = min(map(abs, upright)) < UPRIGHT
    code = "orientation.by_gravity" if tilts else "orientation.level"
    direction = "earth into sensor" if conjugate else _FORWARD
    words = _NWU if best > 0 else "north, east, down"
    findings.append(finding(code, name, direction=direction, earth=words))
    return conjugate, earth
