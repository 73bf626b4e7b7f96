"""What a YAML or JSON file is, by its keys.

So one given in the place of another is called by its name.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

FEWEST_KEYS = 2
"""Of the marks of a kind, to recognise it by."""
MOST_SHOWN = 4


@dataclass(frozen=True)
class FileKind:
    """A kind of file.

    Attributes:
        name: For people.
        marks: Keys that it has at its top and a protocol has not.
        use: What it is for, a clause.
    """

    name: str
    marks: frozenset[str]
    use: str


KINDS = (
    FileKind(
        "a robot file",
        frozenset({"urdf", "home_deg", "servo", "collision"}),
        "name it with --robot",
    ),
    FileKind(
        "a sensor preset",
        frozenset({"accelerometer", "gyroscope", "rate_hz", "device_orientation"}),
        "name it as the preset of a sensor, in a protocol beside it",
    ),
    FileKind(
        "the manifest of a session",
        frozenset({"schema_version", "session", "status", "clocks", "started_utc"}),
        "give the folder of the session to `testbench report` or `evaluate`",
    ),
    FileKind(
        "a stored calibration",
        frozenset({"calibrated_utc", "fingerprint", "accelerometer", "gyroscope"}),
        "name it with --calibration",
    ),
    FileKind(
        "tuned parameters",
        frozenset({"filter", "objective", "tuned", "split"}),
        "name it with --tuned",
    ),
)
MAPPING = FileKind(
    "a mapping of the generic format",
    frozenset({"text", "time", "rate_hz", "description", "source"}),
    "name it with --mapping in `testbench import generic`",
)
COLUMNS = frozenset({"acc", "gyr", "mag", "quaternion", "counter"})
"""Keys of a sensor in a mapping."""


def kind_of(data: dict[str, Any]) -> FileKind | None:
    """The kind of a file by its content; None where it is like none of those known."""
    sensors = data.get("sensors")
    if isinstance(sensors, dict) and any(
        isinstance(sensor, dict) and COLUMNS & set(sensor) for sensor in sensors.values()
    ):
        return MAPPING
    shared = {kind: len(kind.marks & set(data)) for kind in KINDS}
    best = max(shared, key=lambda kind: shared[kind])
    return best if shared[best] >= FEWEST_KEYS else None


def why_no_protocol(
    data: dict[str, Any], needed: Collection[str], known: Collection[str]
) -> str | None:
    """A sentence that says that a file is no protocol and what it looks like.

    None where it may be meant as one.

    Args:
        data: Its content.
        needed: Keys that every protocol has.
        known: All keys of a protocol.
    """
    missing = [key for key in needed if key not in data]
    foreign = [key for key in data if key not in known]
    kind = kind_of(data)
    if "sections" in data or (kind is None and (len(missing) < len(needed) - 1 or not foreign)):
        return None
    if kind is not None:  # its own marks tell most
        foreign.sort(key=lambda key: key not in kind.marks)
    sentence = f"this is no protocol: it lacks {_listed(missing)}"
    if foreign:
        sentence += f", and a protocol has no {_listed(foreign)}"
    if kind is None:
        return f"{sentence}. `testbench protocols` lists protocols to begin from"
    return f"{sentence}. It looks like {kind.name}: {kind.use}"


def _listed(keys: list[str]) -> str:
    shown = [f"'{key}'" for key in keys[:MOST_SHOWN]]
    return ", ".join(shown) + (" ..." if len(keys) > MOST_SHOWN else "")
