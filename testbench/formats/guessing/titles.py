"""What the titles of a table, and the names of arrays, say: quantity, axis, unit, and of what."""

from __future__ import annotations

import re
from dataclasses import dataclass

from testbench.formats.tables.units import known_unit

_WORDS_OF_TIME = {"millis": "ms", "milliseconds": "ms", "ms": "ms", "micros": "us"}
_WORDS_OF_TIME |= {"microseconds": "us", "us": "us", "nanos": "ns", "nanoseconds": "ns"}
"""Words that are a time and its unit; `millis` and `micros` are the clocks of Arduino."""
_WORDS = {
    "acc": {"acc", "accel", "accelerometer", "acceleration", "accelerations", "acel", "force"},
    "gyr": {"gyr", "gyro", "gyroscope", "omega", "angular", "rotation", "giro", "turn", "rot"},
    "mag": {"mag", "magn", "magnetometer", "magnetic", "magneto", "compass", "field"},
    "quaternion": {"q", "quat", "quaternion", "quaternions", "orientation"},
    "time": {"time", "timestamp", "t", "seconds", "elapsed", "stamp", "tiempo", "zeit"}
    | set(_WORDS_OF_TIME),
    "counter": {"counter", "packet", "frame", "index", "sample", "samples", "count", "seq", "n"},
    "temperature": {"temperature", "temp"},
}
_FILLERS = {"rate", "velocity", "of", "specific", "linear", "cal", "data", "sensor", "imu", "the"}
_WITHOUT_GRAVITY = {"free", "user"}
"""Words before an acceleration without gravity: Xsens writes FreeAcc, Apple userAcceleration."""
TRIADS = ["xyz", "123", "012"]
"""Parts of the three columns of a vector, in their order."""
_OF_TRUTH = {"opt", "optical", "truth", "ref", "reference", "mocap", "vicon", "gt", "groundtruth"}
"""Words before a quaternion that the sensor did not make: BROAD writes opt_quat."""
_QUATERNIONS = ("quaternion", "truth")
_LIKE = {"free": "acc", "truth": "quaternion"}
_LETTERS = {"a": "acc", "g": "gyr", "w": "gyr", "m": "mag", "q": "quaternion", "b": "mag"}
_PARTS = {"x", "y", "z", "w", "0", "1", "2", "3", "i", "j", "k", "s"}
_UNIT = re.compile(r"\s*[\[(]\s*([^\[\]()]*(?:\([^()]*\))?[^\[\]()]*)\s*[\])]\s*$")
_SUFFIXES = {
    "m_s2": "m/s^2",
    "rad_s": "rad/s",
    "deg_s": "deg/s",
    "ut": "uT",
    "dps": "deg/s",
    "mg": "mg",
    "ns": "ns",
    "us": "us",
    "ms": "ms",
    "s": "s",
}
_TIME_UNITS = {"s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms"}
_TIME_UNITS |= {"us": "us", "µs": "us", "μs": "us", "usec": "us", "ns": "ns", "nsec": "ns"}


@dataclass(frozen=True)
class Title:
    """What a title says.

    Attributes:
        kind: acc, gyr, mag, quaternion, time, counter or temperature; free where it is acceleration
            without gravity, truth where it is the quaternion of a reference system; None where it
            says none.
        part: Axis x, y or z, or part w, x, y or z of a quaternion; "" for a whole.
        unit: As it is written; "" where it is not.
        owner: What is left: the sensor; "" for one alone.
    """

    kind: str | None
    part: str
    unit: str
    owner: str


def read_title(title: str) -> Title:
    """What a title says."""
    plain, unit = title.strip(), ""
    found = _UNIT.search(plain)
    if found and not re.fullmatch(r"[xyzw]|\d+", found[1], re.IGNORECASE):
        plain, unit = plain[: found.start()], found[1]
    else:
        for suffix, meant in _SUFFIXES.items():
            if re.search(rf"[_ ]{suffix}$", plain, re.IGNORECASE) and len(plain) > len(suffix) + 1:
                plain, unit = plain[: -len(suffix) - 1], meant
                break
    words = [w.lower() for w in re.findall(r"[A-Z]?[a-zµ]+|[A-Z]+(?![a-z])|\d+", plain)]
    words = [part for word in words for part in _split(word)]
    part = next((word for word in reversed(words) if word in _PARTS), "")
    if not part and len(words) > 1 and words[-1] == "r" and words[-2] in _WORDS["quaternion"]:
        part = "r"  # the real part beside i, j and k
    kind = next(
        (k for k, known in _WORDS.items() if any(w in known for w in words if w != part)), None
    )
    if kind is None and len(words) >= 2 and words[-2] in _LETTERS and part == words[-1]:
        kind = _LETTERS[words[-2]]
        words[-2] = ""
    if kind in ("time", "counter", "temperature"):
        part = ""
    if kind == "time" and not unit:
        unit = next((_WORDS_OF_TIME[word] for word in words if word in _WORDS_OF_TIME), "")
    if kind == "acc" and _WITHOUT_GRAVITY & set(words):
        kind = "free"
    if kind == "quaternion" and _OF_TRUTH & set(words):
        kind, words = "truth", [word for word in words if word not in _OF_TRUTH]
    known = _WORDS.get(_LIKE.get(kind or "", kind or ""), set()) | _FILLERS | {part, ""}
    rest = [word for word in words if word not in known]
    return Title(kind, _part(kind, part), unit, " ".join(rest))


def _split(word: str) -> list[str]:
    """`ax` is `a x`, `accx` is `acc x`, `qw` is `q w`."""
    if word in ("qi", "qj", "qk", "qr", "qs"):
        return ["q", word[-1]]
    if len(word) > 1 and word[-1] in "xyzw0123" and word not in ("index", "max", "matrix"):
        stem = word[:-1]
        if stem in _LETTERS or any(stem in known for known in _WORDS.values()):
            return [stem, word[-1]]
    return [word]


def _part(kind: str | None, part: str) -> str:
    """The part as x, y, z and w; numbers of vectors and quaternions stay as they are."""
    if kind in _QUATERNIONS:
        return {"i": "x", "j": "y", "k": "z", "s": "w", "r": "w"}.get(part, part)
    return part if part in {"x", "y", "z", "0", "1", "2", "3"} else ""


def unit_of(kind: str, written: str) -> str | None:
    """A unit as a title writes it, by its name here; None where it is none of that quantity."""
    if kind == "time":
        return _TIME_UNITS.get(written.strip().lower())
    unit = known_unit(kind, written) if written else None
    return None if unit is None else unit.name


def in_order(parts: dict[str, str], kind: str) -> list[str] | None:
    """Columns of a quantity in the order x, y, z or w, x, y, z; None where some are missing.

    Args:
        parts: Columns by their part.
        kind: Of the quantity.
    """
    orders = ["wxyz", "0123"] if kind in _QUATERNIONS else TRIADS
    return next(
        ([parts[p] for p in order] for order in orders if all(p in parts for p in order)), None
    )
