"""Which formats read files, and a mapping of them to begin with."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from testbench.exceptions import BenchError, FileProblems, InputError
from testbench.formats import FORMATS
from testbench.formats.any_table import kind_of
from testbench.formats.guessing.proposed import proposed_mapping
from testbench.formats.mapping import list_mappings
from testbench.formats.names import sensor_name, stem_without_stamp
from testbench.formats.options import Options
from testbench.formats.plausibility import UNSTATED_WITHIN
from testbench.formats.signatures import likely_format
from testbench.formats.tables.text_table import head_of
from testbench.frames import STANDARD_GRAVITY

_ASKS = "it asks: "
_TECHNAID = re.compile(r"tech(naid|[\W_]?(imu|mcs))|\bIMU\d+[\s_.]*(acc|gyr|q)", re.IGNORECASE)


@dataclass
class Guess:
    """What files seem to be.

    Attributes:
        formats: Those that read the files, each with what it found or asks.
        shipped: Mappings that ship with the bench and read the files, each with what it found.
        mapping: Of the generic format; None where no columns were recognised.
        seen: What the mapping rests on, a sentence each.
    """

    formats: dict[str, str]
    shipped: dict[str, str]
    mapping: dict[str, Any] | None
    seen: list[str]

    @property
    def open_options(self) -> list[str]:
        """Options that the import by the mapping asks for."""
        if self.mapping is None:
            return []
        parts = [(q, p) for of in self.mapping["sensors"].values() for q, p in of.items()]
        timed = self.mapping.keys() & {"time", "rate_hz"} or any("time" in p for _, p in parts)
        units = {q for q, p in parts if q in ("acc", "gyr") and "unit" not in p}
        return ([] if timed else ["--rate HZ"]) + [f"--unit {q}=UNIT" for q in sorted(units)]


def guess(files: Sequence[Path]) -> Guess:
    """Look into files.

    Args:
        files: Of one recording.

    Raises:
        InputError: Nothing fits; says what was seen.
    """
    for file in files:
        kind_of(file)  # refuses what is not there
    formats = {
        name: found
        for name in FORMATS
        if name != "generic" and (found := _tried(name, list(files))) is not None
    }
    reading = {name: found for name, found in formats.items() if not found.startswith(_ASKS)}
    formats = reading or formats
    shipped = {name: what for name in list_mappings() if (what := _by_shipped(name, list(files)))}
    likely = likely_format(files[0])
    if likely in formats:
        formats = {likely: formats[likely]} | formats
    said: list[str] = []
    try:
        mapping, why = proposed_mapping(files, said), None
    except BenchError as error:
        mapping, why = None, str(error)
    if mapping is None and not formats and not shipped:
        listing = ", ".join(file.name for file in files)
        raise InputError(f"{why}; no format reads {listing} (`testbench formats` lists them)")
    if mapping is None and why:
        said.append(f"no mapping: {why}")
    return Guess(formats, shipped, mapping, said)


def _tried(name: str, files: list[Path]) -> str | None:
    """What a format finds in the files, or asks; None where they are none of its own."""
    if name == "technaid" and not any(_is_of_technaid(file) for file in files):
        return None
    try:
        recording = FORMATS[name].read(files, Options())
        counts = [f"{key} at {sensor.rate:g} Hz" for key, sensor in recording.sensors.items()]
        if any(sensor.head() is None for sensor in recording.sensors.values()):
            return None
    except FileProblems:
        return None
    except BenchError as error:
        asks = "--unit" in str(error) or "--rate" in str(error)
        return f"{_ASKS}{error}" if asks else None
    return ", ".join(counts)


def _is_of_technaid(file: Path) -> bool:
    """Whether a file speaks of Technaid: columns AccX and GyrX alone, which it reads, many have."""
    try:
        lines = head_of(file)
    except BenchError:
        return False
    return any(_TECHNAID.search(line) for line in [file.name, *lines])


def _by_shipped(name: str, files: list[Path]) -> str | None:
    """What a mapping that ships finds in the files; None where they are none of its kind.

    One that goes by the places of columns reads many files: gravity must be there in its unit.
    """
    try:
        recording = FORMATS["generic"].read(files, Options(mapping=name))
        heads = {key: sensor.head() for key, sensor in recording.sensors.items()}
    except BenchError:
        return None
    for head in heads.values():
        if head is None or head.acc is None:
            return None
        norm = float(np.median(np.linalg.norm(head.acc, axis=1)))
        if not abs(norm / STANDARD_GRAVITY - 1) < UNSTATED_WITHIN:
            return None
    return ", ".join(f"{key} at {recording.sensors[key].rate:g} Hz" for key in heads)


def default_name(files: Sequence[Path]) -> str:
    """Name of a file for the mapping."""
    return f"{sensor_name(stem_without_stamp(files[0].stem))}_mapping.yaml"
