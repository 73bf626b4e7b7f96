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
from testbench.formats.guessing.proposed import Said, proposed_mapping
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
        answers: Options, of those that a person gave, that each format and mapping asks for, by
            its name; "" is the mapping that is proposed.
    """

    formats: dict[str, str]
    shipped: dict[str, str]
    mapping: dict[str, Any] | None
    seen: list[str]
    answers: dict[str, list[str]]

    @property
    def open_options(self) -> list[str]:
        """Options that the import by the mapping asks for."""
        if self.mapping is None:
            return []
        parts = [(q, p) for of in self.mapping["sensors"].values() for q, p in of.items()]
        timed = self.mapping.keys() & {"time", "rate_hz"} or any("time" in p for _, p in parts)
        units = {q for q, p in parts if q in ("acc", "gyr") and "unit" not in p}
        return ([] if timed else ["--rate HZ"]) + [f"--unit {q}=UNIT" for q in sorted(units)]


# Complex by the kinds of what may read files.
def guess(files: Sequence[Path], options: Options | None = None) -> Guess:
    """Look into files.

    Args:
        files: Of one recording.
        options: Rate and units, where a person states them.

    Raises:
        InputError: Nothing fits; says what was seen.
    """
    for file in files:
        kind_of(file)  # refuses what is not there
    given = options or Options()
    answers: dict[str, list[str]] = {}
    formats = {
        name: found
        for name in FORMATS
        if name != "generic" and (found := _tried(name, list(files), given, answers)) is not None
    }
    reading = {name: found for name, found in formats.items() if not found.startswith(_ASKS)}
    formats = reading or formats
    shipped = {
        name: what
        for name in list_mappings()
        if (what := _by_shipped(name, list(files), given, answers))
    }
    likely = likely_format(files[0])
    if likely in formats:
        formats = {likely: formats[likely]} | formats
    said = Said(dict(given.units), given.rate)
    try:
        mapping, why = proposed_mapping(files, said), None
    except BenchError as error:
        mapping, why = None, str(error)
    if mapping is None and not formats and not shipped:
        listing = ", ".join(file.name for file in files)
        raise InputError(f"{why}; no format reads {listing} (`testbench formats` lists them)")
    if mapping is None and why:
        said.append(f"no mapping: {why}")
    if mapping is not None and given.rate is not None and "rate_hz" not in mapping:
        answers[""] = [f"--rate {given.rate:g}"]
    return Guess(formats, shipped, mapping, said.sentences, answers)


def _answers(given: Options, own: Options) -> list[str]:
    """Those of the options that a person gave which an importer asked for."""
    rate = [f"--rate {given.rate:g}"] if given.rate is not None and "rate" in own.asked else []
    return rate + [f"--unit {q}={unit}" for q, unit in given.units.items() if q in own.asked]


def _tried(
    name: str, files: list[Path], given: Options, answers: dict[str, list[str]]
) -> str | None:
    """What a format finds in the files, or asks; None where they are none of its own.

    Args:
        name: Of the format.
        files: Of one recording.
        given: What a person states.
        answers: Of that, what each format asked for; is added to.
    """
    own = Options(rate=given.rate, units=dict(given.units))
    if name == "technaid" and not any(_is_of_technaid(file) for file in files):
        return None
    try:
        recording = FORMATS[name].read(files, own)
        counts = [f"{key} at {sensor.rate:g} Hz" for key, sensor in recording.sensors.items()]
        if any(sensor.head() is None for sensor in recording.sensors.values()):
            return None
    except FileProblems:
        return None
    except BenchError as error:
        asks = "--unit" in str(error) or "--rate" in str(error)
        answers[name] = _answers(given, own)
        return f"{_ASKS}{error}" if asks else None
    answers[name] = _answers(given, own)
    return ", ".join(counts)


def _is_of_technaid(file: Path) -> bool:
    """Whether a file speaks of Technaid: columns AccX and GyrX alone, which it reads, many have."""
    try:
        lines = head_of(file)
    except BenchError:
        return False
    return any(_TECHNAID.search(line) for line in [file.name, *lines])


def _by_shipped(
    name: str, files: list[Path], given: Options, answers: dict[str, list[str]]
) -> str | None:
    """What a mapping that ships finds in the files; None where they are none of its kind.

    One that goes by the places of columns reads many files: gravity must be there in its unit.

    Args:
        name: Of the mapping.
        files: Of one recording.
        given: What a person states.
        answers: Of that, what each mapping asked for; is added to.
    """
    own = Options(mapping=name, rate=given.rate, units=dict(given.units))
    try:
        recording = FORMATS["generic"].read(files, own)
        heads = {key: sensor.head() for key, sensor in recording.sensors.items()}
    except BenchError:
        return None
    for head in heads.values():
        if head is None or head.acc is None:
            return None
        norm = float(np.median(np.linalg.norm(head.acc, axis=1)))
        if not abs(norm / STANDARD_GRAVITY - 1) < UNSTATED_WITHIN:
            return None
    answers[name] = _answers(given, own)
    return ", ".join(f"{key} at {recording.sensors[key].rate:g} Hz" for key in heads)


def default_name(files: Sequence[Path]) -> str:
    """Name of a file for the mapping."""
    return f"{sensor_name(stem_without_stamp(files[0].stem))}_mapping.yaml"
