"""What numbers tell where titles do not: times, rates, units, and the order of quaternions."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from testbench.consistency.evidence import Evidence
from testbench.formats.any_table import Table
from testbench.formats.guessing.seen import Quantity, Seen, column_of, name_of, path_of
from testbench.formats.guessing.titles import TRIADS, read_title, unit_of
from testbench.formats.plausibility import gather, unit_that_fits
from testbench.formats.raw_counts import counts_per_unit
from testbench.formats.tables.text_table import TextTable
from testbench.formats.tables.units import SECONDS
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.session.samples import ImuSamples

SLOWEST, FASTEST = 4.0, 4000.0
"""Rates of inertial sensors [Hz]: just three decades, so that one unit of time fits at most."""
STAMP_UNITS = ("s", "ms", "us", "ns")
FIELDS = {"uT": (15.0, 120.0), "mG": (150.0, 1200.0), "nT": (15e3, 120e3), "G": (0.15, 0.65)}
"""Strengths of magnetic fields that sensors meet; the earth's is 22 to 67 uT (World
Magnetic Model 2025)."""
MOST_BACK = 1e-3
"""Part of the steps of a clock that may go back: those of a board that booted anew."""
MOST_TRIADS = 10
LEAST_ROWS = 4
_RATE = re.compile(r"^(fs|f_s|rate|freq\w*)(_?hz)?$|sampl\w*_?(rate|freq\w*)", re.IGNORECASE)


@dataclass(frozen=True)
class Time:
    """Where the times of a table stand.

    Attributes:
        column: Title or place.
        unit: Of it.
        rate: That comes of it [Hz].
    """

    column: str | int
    unit: str
    rate: float


def time_of(seen: Seen, among: Sequence[str], said: str | None = None) -> Time | None:
    """The column of times among some, its unit, and the rate that comes of both.

    Args:
        seen: The file.
        among: Columns.
        said: Unit that a person states.
    """
    inside = {column for columns in seen.table.arrays.values() for column in columns}
    candidates = [name for name in among if name not in inside]
    titled = [n for n in candidates if read_title(path_of(seen, n)[1]).kind == "time"]
    if not titled and not seen.layout.header:
        titled = candidates
    # the finest of several clocks, and stamps before whole seconds
    for name in titled:
        values = seen.values[name]
        steps = np.diff(values)
        if (
            len(values) < LEAST_ROWS
            or not np.isfinite(values).all()
            or np.mean(steps < 0) > MOST_BACK
        ):
            continue
        mean = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
        mean = float(steps[steps <= 5 * mean].mean()) if mean else 0.0
        if mean <= 0:
            continue
        stated = unit_of("time", read_title(path_of(seen, name)[1]).unit)
        for unit in [stated] if stated else STAMP_UNITS:
            rate = 1 / (mean * SECONDS[unit])
            if said is not None:
                return Time(column_of(seen, name), said, 1 / (mean * SECONDS[said]))
            if SLOWEST <= rate <= FASTEST:
                return Time(column_of(seen, name), unit, rate)
    for name in seen.clocks:
        return Time(column_of(seen, name), "clock", 0.0)
    return None


def stated_rate(table: Table) -> tuple[str, float] | None:
    """The sampling rate that a file of arrays states beside them, and its name there."""
    for name, value in getattr(table, "numbers", {}).items():
        if _RATE.search(name.rpartition("/")[2]) and SLOWEST <= value <= FASTEST:
            return name, float(value)
    return None


def evidence_in(seen: Seen, acc: list[str], gyr: list[str] | None, rate: float) -> Evidence:
    """What the numbers say of their units."""
    a = np.column_stack([seen.values[name] for name in acc])
    w = np.full_like(a, np.nan)
    if gyr is not None and len(seen.values[gyr[0]]) == len(a):
        w = np.column_stack([seen.values[name] for name in gyr])
    count = np.arange(len(a))
    time_ns = np.round(count * (NANOSECONDS / rate)).astype(np.int64)
    still = np.zeros(len(a), dtype=bool)
    with np.errstate(all="ignore"):
        return gather([ImuSamples(time_ns, time_ns, w, a, None, None, count, still)])


def evidence_of_pair(seen: Seen, gyr: Quantity, time: Time, other: Seen) -> Evidence | None:
    """What an accelerometer of another file says of a gyroscope."""
    own_time = time_of(other, list(other.values))
    acc = next(iter(other.sensors.values()))["acc"]
    if own_time is None or own_time.unit != time.unit or time.unit == "clock":
        return None
    at = other.values[name_of(other, own_time.column)]
    stamps = seen.values[name_of(seen, time.column)]
    rates = {name: np.interp(at - at[0], stamps - at[0], seen.values[name]) for name in gyr.names}
    both = Seen(
        other.table, other.layout, {**other.values, **{f"w {n}": v for n, v in rates.items()}}, []
    )
    return evidence_in(both, acc.names, [f"w {name}" for name in gyr.names], own_time.rate)


def by_values(seen: Seen) -> dict[str, dict[str, Quantity]]:
    """The accelerometer and gyroscope whose numbers fit gravity and one another, without titles;
    raw counts where none do in a unit.
    """
    names = list(seen.values)
    time = time_of(seen, names)
    free = [n for n in names if time is None or n != name_of(seen, time.column)]
    triads = [free[i : i + 3] for i in range(len(free) - 2)][: 3 * MOST_TRIADS]
    rate = time.rate if time is not None and time.rate > 0 else 100.0  # a clock tells none yet
    looked = []
    for acc, gyr in itertools.permutations(triads, 2):
        if set(acc) & set(gyr) or not (_can_be(seen, acc, "acc") and _can_be(seen, gyr, "gyr")):
            continue
        looked.append((acc, gyr, evidence_in(seen, acc, gyr, rate)))
        if all(unit_that_fits(kind, looked[-1][2]) for kind in ("acc", "gyr")):
            return _pair(seen, acc, gyr)
    for acc, gyr, evidence in looked:
        if all(counts_per_unit(kind, evidence) for kind in ("acc", "gyr")):
            return _pair(seen, acc, gyr)
    return {}


def _pair(seen: Seen, acc: list[str], gyr: list[str]) -> dict[str, dict[str, Quantity]]:
    """A sensor of two triads of columns."""
    triads = (("acc", acc), ("gyr", gyr))
    columns = {kind: [column_of(seen, name) for name in triad] for kind, triad in triads}
    return {"": {kind: Quantity(columns[kind], triad) for kind, triad in triads}}


def _can_be(seen: Seen, triad: list[str], kind: str) -> bool:
    """Whether the titles of three columns say nothing else than that they are of a quantity."""
    if not seen.layout.header:
        return True
    if isinstance(seen.table, TextTable) and seen.table.twice:
        return False  # which of them belong together, nobody knows
    titles = [read_title(path_of(seen, name)[1]) for name in triad]
    parts = "".join(title.part for title in titles)
    return all(title.kind in (None, kind) for title in titles) and parts in ("", *TRIADS)


def unit_told(
    kind: str, found: Quantity, seen: Seen, evidence: Evidence | None
) -> tuple[str | None, str]:
    """The unit of a quantity, and how it is known."""
    written = unit_of(kind, found.unit)
    if kind == "mag":
        if written is not None:
            return written, "by its titles"
        with np.errstate(all="ignore"):
            norm = float(
                np.nanmedian(
                    np.linalg.norm(np.column_stack([seen.values[n] for n in found.names]), axis=1)
                )
            )
        for unit, (low, high) in FIELDS.items():
            if low <= norm <= high:
                return unit, f"a strength of {norm:.4g} fits it"
        return "au", f"a strength of {norm:.4g} fits no unit: only its direction is used"
    by_numbers = None if evidence is None else unit_that_fits(kind, evidence)
    fitting = [] if by_numbers is None else [by_numbers.name]
    if written is not None and (not fitting or written in fitting):
        return written, "by its titles"
    if len(fitting) == 1:
        told = "gravity at rest" if kind == "acc" else "turns as the accelerometer sees them"
        against = "" if written is None else f", though its titles say {written}: look which is so"
        return fitting[0], f"by {told}{against}"
    return None, "of which the unit is not told: the import asks for it"


def orientation_told(seen: Seen, found: Quantity, acc: Quantity | None) -> dict[str, str]:
    """Order, direction and earth of a quaternion: the ones by which gravity points up."""
    q = np.column_stack([seen.values[name] for name in found.names])
    best = {"order": "wxyz"}
    if acc is None or len(seen.values[acc.names[0]]) != len(q):
        return best
    a = np.column_stack([seen.values[name] for name in acc.names])
    with np.errstate(all="ignore"):
        norm = np.linalg.norm(a, axis=1, keepdims=True)
        known = np.isfinite(q).all(axis=1) & np.isfinite(norm[:, 0]) & (norm[:, 0] > 0)
        norm = np.where(known[:, None], norm, 1)
    q, up = q[known], (a / norm)[known]
    if not len(q):
        return best
    highest = 0.0
    for order in ("wxyz", "xyzw") if found.array is not None else ("wxyz",):
        own = q if order == "wxyz" else np.roll(q, 1, axis=1)
        for direction in ("earth_from_sensor", "sensor_from_earth"):
            turned = own if direction == "earth_from_sensor" else rotation.conjugate(own)
            z = float(np.mean(rotation.rotate(turned, up)[:, 2]))
            if abs(z) > abs(highest) + 1e-6:
                highest = z
                best = {"order": order, "direction": direction}
    if highest < 0:
        best["earth"] = "NED"
    return best
