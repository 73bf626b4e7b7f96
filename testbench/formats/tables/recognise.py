"""Columns by the usual spellings of their titles.

It is for formats whose exact titles vary from version to version.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from testbench.formats.tables.units import TimeUnit

_KINDS = {
    "acc": r"accelerometers?|accelerations?|accels?|acc|aceleracion|aceler[oó]metro",
    "gyr": r"gyroscopes?|angular[ _]?(?:velocity|rate)|rate[ _]of[ "
    r"_]turn|gyros?|gyr|omega|giroscopio|giro",
    "mag": r"magnetometers?|magnetic(?:[ _]?field)?|mag|magnetometro|magnet[oó]metro",
    "quaternion": r"quaternions?|quat|cuaternion|q",
}
_TITLE = re.compile(
    r"^(?P<prefix>.*?)[\s_.:\-]*(?:"
    + "|".join(f"(?P<{kind}>{words})" for kind, words in _KINDS.items())
    + r")"
    r"[\s_.:\-\[(]*(?P<axis>[xyzw0-3])[\])]?(?:[\s_]*[\[(](?P<unit>[^\])]*)[\])])?$",
    re.IGNORECASE,
)
_AXES: dict[str, list[tuple[str, ...]]] = {
    "vector": [("x", "y", "z"), ("1", "2", "3"), ("0", "1", "2")],
    "quaternion": [("w", "x", "y", "z"), ("0", "1", "2", "3")],
}


@dataclass
class Found:
    """The columns of one sensor.

    Attributes:
        columns: By quantity ("acc", "gyr", "mag", "quaternion"), in the order x, y, z or w, x, y,
            z.
        units: As the titles state them, by quantity.
    """

    columns: dict[str, list[str]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)


def find_sensors(names: Sequence[str]) -> dict[str, Found]:
    """Sensors among the columns of a table, by what stands before the quantity in their titles.

    It is "" for one sensor alone.

    `IMU2 Acc X (g)` is the x axis of the accelerometer of a sensor `IMU2`; a quantity counts only
    if all its axes are there.
    """
    seen: dict[str, dict[str, dict[str, tuple[str, str | None]]]] = {}
    for name in names:
        match = _TITLE.match(name.strip())
        if match is None:
            continue
        kind = next(kind for kind in _KINDS if match.group(kind))
        axes = seen.setdefault(match.group("prefix").strip(), {}).setdefault(kind, {})
        axes.setdefault(match.group("axis").lower(), (name, match.group("unit")))
    result: dict[str, Found] = {}
    for prefix, kinds in seen.items():
        found = Found()
        for kind, axes in kinds.items():
            order = next(
                (
                    o
                    for o in _AXES["quaternion" if kind == "quaternion" else "vector"]
                    if set(o) <= set(axes)
                ),
                None,
            )
            if order is None:
                continue
            found.columns[kind] = [axes[axis][0] for axis in order]
            units = {axes[axis][1] for axis in order}
            unit = units.pop() if len(units) == 1 else None
            if unit:
                found.units[kind] = unit
        if found.columns.keys() & {"acc", "gyr", "quaternion"}:
            result[prefix] = found
    return result


_TIME = re.compile(
    r"^[_%]*(?:time|timestamp|t|tiempo|zeit|seconds|elapsed)[\s_]*(?:stamp)?"
    r"[\s_]*[\[(]?(?P<unit>s|sec|seconds|ms|us|µs|ns)?[\])]?$",
    re.I,
)
_TIME_UNITS: dict[str | None, TimeUnit | None] = {
    None: None,
    "s": "s",
    "sec": "s",
    "seconds": "s",
    "ms": "ms",
    "us": "us",
    "µs": "us",
    "ns": "ns",
}


def find_time(names: Sequence[str]) -> tuple[str, TimeUnit | None] | None:
    """The column of time and the unit its title states, or None."""
    for name in names:
        match = _TIME.match(name.strip())
        if match:
            unit = match.group("unit")
            return name, _TIME_UNITS[unit.lower() if unit else None]
    return None
