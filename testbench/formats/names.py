"""Names of sensors from whatever a file or a person calls them."""

from __future__ import annotations

import re
from collections.abc import Iterable

LONGEST = 64
_STAMP = re.compile(r"[_-]\d{8}[_-]\d{6}([_-]\d{1,6})?$")


def sensor_name(text: str) -> str:
    """A name that can stand in a file name, an expression and a metric.

    It is a letter, then letters, digits and _.

    Whatever else a file says, such as a path, spaces or a dot, becomes _; what then does not begin
    with a letter is put behind `imu_`.
    """
    plain = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")
    if not plain:
        return "imu"
    return (plain if plain[0].isalpha() else f"imu_{plain}")[:LONGEST]


def stem_without_stamp(stem: str) -> str:
    """The stem of a file without the date and time that vendors' apps append.

    Pelvis_20210820_202113_836 is Pelvis.
    """
    return _STAMP.sub("", stem) or stem


def unique_names(texts: Iterable[str]) -> list[str]:
    """A valid name for each text.

    What would stand twice gets _2, _3, also where only upper and lower case differ.
    """
    names: list[str] = []
    taken: set[str] = set()
    for text in texts:
        base = sensor_name(text)
        name, count = base, 1
        while name.lower() in taken:
            count += 1
            suffix = f"_{count}"
            name = base[: LONGEST - len(suffix)] + suffix
        taken.add(name.lower())
        names.append(name)
    return names
