"""The mapping that fits what was seen in files, and what it rests on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.consistency.evidence import Evidence
from testbench.exceptions import BenchError
from testbench.formats.guessing.seen import KINDS, Quantity, Seen, look, path_of
from testbench.formats.guessing.titles import read_title
from testbench.formats.guessing.told import (
    Time,
    by_values,
    evidence_in,
    evidence_of_pair,
    orientation_told,
    stated_rate,
    time_of,
    unit_told,
)
from testbench.formats.names import unique_names
from testbench.formats.plausibility import no_gravity
from testbench.formats.raw_counts import UNIT_OF_COUNTS, counts_per_unit


@dataclass
class Said:
    """What a mapping rests on.

    Attributes:
        units: As a person states them, by quantity.
        rate: As a person states it [Hz].
        sentences: What was seen; is added to.
    """

    units: dict[str, str] = field(default_factory=dict)
    rate: float | None = None
    sentences: list[str] = field(default_factory=list)

    def append(self, sentence: str) -> None:
        """Add what was seen."""
        self.sentences.append(sentence)

    def time_of(self, seen: Seen, among: Sequence[str]) -> Time | None:
        """Where the times of a table stand; see `told.time_of`."""
        return time_of(seen, among, self.units.get("time"))


def proposed_mapping(files: Sequence[Path], said: Said) -> dict[str, Any]:
    """A mapping of the files.

    Args:
        files: Of one recording.
        said: What the mapping rests on; is added to.

    Raises:
        BenchError: No quantity of a sensor is recognised.
    """
    looked, beside = _recognised(files, said)
    truths = _truths(looked)
    looked = [seen for seen in looked if seen not in truths]
    result = _of_samples(looked, said)
    for truth in truths:
        beside.append(truth.table.file.name)
        _add_truth(result, truth, said)
    return result | ({"beside": beside} if beside else {})


def _of_samples(looked: Sequence[Seen], said: Said) -> dict[str, Any]:
    """A mapping of the files that hold samples.

    Raises:
        BenchError: No quantity of a sensor is recognised.
    """
    whole = [seen for seen in looked if _is_whole(seen)]
    if len(looked) > 1 and not whole:
        return _of_one_file_each(list(looked), said)
    # a quantity that was not recorded in one of the files is that of the others all the same
    first = max(looked, key=lambda seen: sum(map(len, seen.sensors.values())))
    if not first.sensors:
        raise first.table.problem(
            "no accelerometer, gyroscope or quaternion is recognised among its columns: "
            f"{', '.join(first.table.names[:40]) or 'none'}; name them in a mapping"
        )
    for other in looked:
        if other.table.names != first.table.names:
            raise other.table.problem(
                f"has other columns than {first.table.file.name}; guess file by file"
            )
    for seen in looked:
        _say_empty(seen, said)
    return _of_one_file(first, said)


def _say_empty(seen: Seen, said: Said) -> None:
    """That titles speak of quantities of which the file holds no number."""
    empty = [
        name
        for name in seen.table.names
        if name not in seen.values and read_title(path_of(seen, name)[1]).kind in KINDS
    ]
    if empty and seen.sensors:
        said.append(f"{seen.table.file.name}: no number stands in {', '.join(empty)}")


def _recognised(files: Sequence[Path], said: Said) -> tuple[list[Seen], list[str]]:
    """The files in which anything of a sensor is recognised, and the names of the others; all of
    them where it is in none.

    Raises:
        BenchError: None of them can be read.
    """
    looked: list[Seen] = []
    problems: dict[str, str] = {}
    first: BenchError | None = None
    for file in files:
        try:
            looked.append(_looked_into(file))
        except BenchError as error:
            first = first or error
            problems[file.name] = "it cannot be read as a table"
    if not looked:
        assert first is not None
        raise first
    speaking = [seen for seen in looked if seen.sensors]
    if not speaking:
        return looked, []
    silent = "nothing of a sensor is recognised in it"
    problems |= {seen.table.file.name: silent for seen in looked if not seen.sensors}
    for name, why in problems.items():
        said.append(f"{name}: left out, {why}")
    return speaking, list(problems)


def _truths(looked: Sequence[Seen]) -> list[Seen]:
    """Files of orientations alone, beside one that has accelerometer and gyroscope."""
    kinds = {id(seen): {kind for of in seen.sensors.values() for kind in of} for seen in looked}
    if not any({"acc", "gyr"} <= own for own in kinds.values()):
        return []
    return [seen for seen in looked if kinds[id(seen)] <= {"quaternion", "truth"}]


def _add_truth(mapping: dict[str, Any], seen: Seen, said: Said) -> None:
    """Give the sensor of a mapping the truth of a file of its own, if there is but one of each."""
    file, sensors = seen.table.file.name, list(mapping["sensors"].values())
    time = said.time_of(seen, list(seen.values))
    found = [own for of in seen.sensors.values() for own in of.values()]
    if len(sensors) != 1 or len(found) != 1 or time is None or "truth" in sensors[0]:
        said.append(f"{file}: orientations of which nobody tells whose they are; see --truth")
        return
    where: dict[str, Any] = {"columns": found[0].columns}
    where = {"array": found[0].array} if found[0].array else where
    where |= orientation_told(seen, found[0], None)
    text = seen.layout.model_dump(exclude_defaults=True)
    stamps = {"time": {"column": time.column, "unit": time.unit}}
    sensors[0]["truth"] = {"file": file, **({"text": text} if text else {}), **where, **stamps}
    said.append(
        f"{file}: orientations in {', '.join(map(str, found[0].columns))}, taken for the truth of "
        "another system; leave them out if they are of the sensor's own filter"
    )
    _say_time(time, file, said)


def _looked_into(file: Path) -> Seen:
    """A file, its quantities told by titles, else by numbers."""
    seen = look(file)
    if not seen.sensors:
        seen.sensors = by_values(seen)
    return seen


def _is_whole(seen: Seen) -> bool:
    """Whether a file has a sensor that can be used by itself."""
    return any({"acc", "gyr"} <= set(q) or "quaternion" in q for q in seen.sensors.values())


# Complex by where times may stand: with a quantity, with all, or nowhere.
def _of_one_file(seen: Seen, said: Said) -> dict[str, Any]:
    """A mapping of a file with one or more sensors."""
    sensors: dict[str, Any] = {}
    if seen.free:
        said.append(f"{', '.join(seen.free)}: left out, an acceleration without gravity")
    if seen.second:
        said.append(f"{seen.table.file.name}: two lines of titles are read as one")
    owners = list(seen.sensors)
    labels = unique_names(owner.rpartition("/")[2] or "imu" for owner in owners)
    times: dict[tuple[str, str], Time | None] = {}
    for label, (owner, quantities) in zip(labels, seen.sensors.items(), strict=True):
        for kind, quantity in quantities.items():
            length = len(seen.values[quantity.names[0]])
            times[label, kind] = said.time_of(seen, _near(seen, owner, length))
        sensors[label] = _sensor(
            seen, quantities, times[label, next(iter(quantities))], label, said
        )
    result: dict[str, Any] = {"description": f"guessed from {seen.table.file.name}"}
    text = seen.layout.model_dump(exclude_defaults=True)
    result |= {"text": text} if text else {}
    common = next(iter(times.values()))
    if common is not None:
        result["time"] = {"column": common.column, "unit": common.unit}
        _say_time(common, seen.table.file.name, said)
    elif said.rate is not None:
        result["rate_hz"] = said.rate
        said.append(f"{seen.table.file.name}: no times; --rate states {said.rate:g} Hz")
    elif (rate := stated_rate(seen.table)) is not None:
        result["rate_hz"] = rate[1]
        said.append(f"{seen.table.file.name}: no times; {rate[0]} states {rate[1]:g} Hz")
    else:
        said.append(
            f"{seen.table.file.name}: no times are recognised; state --rate HZ, or --unit "
            "time=ms (us, ns) where a column of times is in another unit than its title says"
        )
    for (label, kind), own in times.items():
        if kind not in sensors[label]:
            continue
        if own is not None and common is not None and own.column != common.column:
            sensors[label][kind]["time"] = {"column": own.column, "unit": own.unit}
    return result | {"sensors": sensors}


def _near(seen: Seen, owner: str, length: int) -> list[str]:
    """Columns as long as a sensor's, those of its own group first."""
    fitting = [name for name, values in seen.values.items() if len(values) == length]
    return sorted(fitting, key=lambda name: path_of(seen, name)[0] != owner)


def _of_one_file_each(looked: list[Seen], said: Said) -> dict[str, Any]:
    """A mapping of files with one quantity each.

    Raises:
        BenchError: Two files have the same one, or a file has none, or no times.
    """
    parts: dict[str, Any] = {}
    times = []
    acc = next((seen for seen in looked if "acc" in next(iter(seen.sensors.values()), {})), None)
    for seen in looked:
        quantities = next(iter(seen.sensors.values()), {})
        time = said.time_of(seen, list(seen.values))
        if len(quantities) != 1 or next(iter(quantities)) in parts or time is None:
            raise seen.table.problem(
                "is neither a sensor nor one quantity, with times, of a sensor whose others stand "
                f"in the other files; its columns are {', '.join(seen.table.names[:40])}"
            )
        ((kind, found),) = quantities.items()
        evidence = (
            evidence_of_pair(seen, found, time, acc) if kind == "gyr" and acc is not None else None
        )
        own = _sensor(seen, quantities, time, "imu", said, evidence)
        parts[kind] = {"file": seen.table.file.name, **own[kind]}
        times.append(time)
        _say_time(time, seen.table.file.name, said)
    if acc is None and "quaternion" not in parts and "gyr" not in parts:
        raise looked[0].table.problem("none of the files holds an accelerometer or gyroscope")
    first = {"column": times[0].column, "unit": times[0].unit}
    for part, time in zip(parts.values(), times, strict=True):
        if (own_time := {"column": time.column, "unit": time.unit}) != first:
            part["time"] = own_time
    text = looked[0].layout.model_dump(exclude_defaults=True)
    names = ", ".join(seen.table.file.name for seen in looked)
    result: dict[str, Any] = {"description": f"guessed from {names}"}
    result |= {"text": text} if text else {}
    return result | {"time": first, "sensors": {"imu": parts}}


def _say_time(time: Time, file: str, said: Said) -> None:
    rate = f", {time.rate:.4g} Hz" if time.rate else ""
    said.append(f"{file}: times in column {time.column}, in {time.unit}{rate}")


# Complex by who tells a unit: a person, titles, numbers, or raw counts.
def _sensor(
    seen: Seen,
    quantities: dict[str, Quantity],
    time: Time | None,
    label: str,
    said: Said,
    evidence: Evidence | None = None,
) -> dict[str, Any]:
    """The part of a mapping for one sensor."""
    rate = time.rate if time is not None and time.rate else said.rate or 100.0
    acc, gyr = quantities.get("acc"), quantities.get("gyr")
    if evidence is None and acc is not None:
        evidence = evidence_in(seen, acc.names, gyr.names if gyr else None, rate)
    parts: dict[str, Any] = {}
    for kind in KINDS:
        if kind not in quantities:
            continue
        found = quantities[kind]
        where: dict[str, Any] = {"columns": found.columns}
        if found.array is not None:
            where = {"array": found.array}
        shown = found.array or ", ".join(map(str, found.columns))
        if kind == "acc" and evidence is not None and no_gravity(evidence):
            said.append(
                f"{label}: {shown} left out, which reads {evidence.rest_norm:.3g} at rest: gravity "
                "was removed; take the columns with gravity"
            )
            continue
        if KINDS[kind] == 4:
            parts[kind] = where | orientation_told(seen, found, acc)
            what = "truth, of a reference system by its title," if kind == "truth" else kind
            said.append(f"{label}: {what} in {shown}")
            continue
        unit, why = unit_told(kind, found, seen, evidence)
        if kind in said.units:
            unit, why = said.units[kind], "as --unit states"
        counts = None
        if unit is None and kind != "mag" and evidence is not None:
            counts = counts_per_unit(kind, evidence)
        if counts is not None:
            unit = UNIT_OF_COUNTS[kind]
            where["scale"] = 1 / counts
            told = "gravity at rest" if kind == "acc" else "turns as the accelerometer sees them"
            why = f"raw counts, {counts:g} to one, by {told}: look into the data sheet"
        parts[kind] = where | ({"unit": unit} if unit else {})
        said.append(f"{label}: {kind} in {shown}, {f'in {unit} ({why})' if unit else why}")
    if not parts.keys() & {"acc", "gyr", "quaternion"}:
        raise seen.table.problem(f"nothing is left to be a sensor: {said.sentences[-1]}")
    return parts
