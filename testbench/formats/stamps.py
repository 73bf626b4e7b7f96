"""In which unit a column of times is, by what is stated, by its size and by the rate it gives.

A unit that nobody states is told where it can be: Unix times of today differ by a thousand from
unit to unit. A unit that makes impossible times, or a rate that no inertial sensor has, is asked
about; a person who states it has confirmed it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np

from testbench.exceptions import FileProblems, InputError
from testbench.formats.tables.source import Kind, Source, first_rows
from testbench.formats.tables.timeline import LATEST_NS, RegularTime, StampedTime, Timeline
from testbench.formats.tables.units import SECONDS, TimeUnit, unit_names
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

LOWEST_HZ, HIGHEST_HZ = 1.0, 10_000.0
"""Rates of inertial sensors. Parts put out 0.78 Hz (Bosch BMA400 and BMI270 in low power: 0.78 and
25 Hz) to 32 kHz (TDK ICM-42688-P, gyroscope and accelerometer), and loggers of whole units hardly
beyond 8 kHz: a rate outside is one of a wrong unit first, and else is confirmed by stating it."""
LOWEST_OF_TRUTH_HZ = 0.01
"""A truth whose unit is stated may be as slow as one of poses that are held for a minute."""
SLOWEST_HZ, FASTEST_HZ = 0.001, 1e6
"""Rates beyond which no answer is believed."""
USUAL_HZ = 100.0
FIRST_UNIX_S, LAST_UNIX_S = 631_152_000, 4_102_444_800
"""1990 and 2100: Unix times between them are told by their size in s, ms, us or ns."""
DECIMAL: tuple[TimeUnit, ...] = ("s", "ms", "us", "ns")
RATES_AGREE = 0.03
"""A stated rate may differ from that of the stamps by this part."""


@dataclass(frozen=True)
class Asking:
    """Whose times they are, and how a person states their unit.

    Attributes:
        who: The sensor or file, for messages.
        answered: Unit that a person stated, None if none.
        flag: Of the answer, with UNIT in place of the unit.
        key: The same in a mapping, "" if there is none.
        lowest_hz: Rate below which the unit is asked about [Hz].
        rate: That a person stated [Hz]: then the column only shows where samples are missing.
    """

    who: str
    answered: str | None = None
    flag: str = "--unit time=UNIT"
    key: str = ""
    lowest_hz: float = LOWEST_HZ
    rate: float | None = None

    def answer(self, unit: str) -> str:
        """How to state a unit."""
        also = f", or {self.key.replace('UNIT', unit)} in the mapping" if self.key else ""
        return self.flag.replace("UNIT", unit) + also


@dataclass(frozen=True)
class Stamps:
    """How a column of times is read.

    Attributes:
        timeline: Makes the clock.
        findings: What was noticed of its unit.
        rate: By the stamps of the first rows, None where they tell none [Hz].
        unix: Whether they are Unix times, the same on every clock that was set.
    """

    timeline: Callable[[], Timeline]
    findings: list[Finding]
    rate: float | None = None
    unix: bool = False

    @property
    def stated(self) -> bool:
        """Whether title, size or a person tell the unit."""
        return all(one.code != "time.unit_unstated" for one in self.findings)


def read_stamps(
    source: Source,
    column: str,
    stated: TimeUnit | None,
    asking: Asking,
    bits: int | None = None,
    tick_ns: float | None = None,
) -> Stamps:
    """How a column of times is to be read.

    Args:
        source: The table.
        column: Of times.
        stated: Unit by the format, the title or the mapping; None where none states it.
        asking: Whose it is, and what a person answered.
        bits: Width of a counter that wraps, None for one that does not.
        tick_ns: Length of the format's own unit, where that is none of the usual [ns].

    Raises:
        InputError: The unit cannot be right; says which fits, and how to state it.
        FileProblems: The column is not one of times.
    """
    values, clock = _first(source, column, stated, asking)
    if clock:
        return _by_clock(column, asking, values)
    if values is None:
        rate = cast(float, asking.rate)
        return Stamps(lambda: RegularTime(rate), [])
    step = _usual_step(values)
    known = values[np.isfinite(values)]
    size = float(np.median(np.abs(known))) if len(known) else 0.0
    unix = None if bits is not None else unix_unit(size)
    unit, findings = _unit(column, stated, asking, (size, step), unix, tick_ns)
    tick = tick_ns if tick_ns is not None and asking.answered is None else None
    seconds = SECONDS[unit] if tick is None else tick / NANOSECONDS
    exact = True if bits is not None else unit == "ns" and _whole(source, column)

    def make() -> Timeline:
        return StampedTime(column, unit, bits, tick, exact, asking.rate)

    measured = None if step is None else 1 / (step * seconds)
    if measured is not None and asking.rate is None and not SLOWEST_HZ <= measured <= FASTEST_HZ:
        raise InputError(
            f"{asking.who}: the column {column} in {unit} gives {measured:.4g} Hz; a rate lies "
            f"between {SLOWEST_HZ:g} and {FASTEST_HZ:g} Hz. State another unit with "
            f"{asking.answer('UNIT')}"
        )
    return Stamps(make, findings, measured, unix == unit)


def unix_unit(size: float) -> TimeUnit | None:
    """The unit in which a number is a Unix time between 1990 and 2100, or None."""
    fitting = (u for u in DECIMAL if FIRST_UNIX_S <= size * SECONDS[u] <= LAST_UNIX_S)
    return next(fitting, None)


def rate_differs(
    stated: float, measured: float | None, code: str = "time.rate_differs"
) -> list[Finding]:
    """A finding where a stated rate is not that of the stamps.

    Args:
        stated: [Hz].
        measured: By the stamps, None where they tell none [Hz].
        code: Of the finding, by who states the rate: a person, who is believed, or the header or
            mapping, which are not.
    """
    if measured is None or abs(measured / stated - 1) <= RATES_AGREE:
        return []
    return [finding(code, measured_hz=measured, stated_hz=stated)]


def _first(
    source: Source, column: str, stated: TimeUnit | None, asking: Asking
) -> tuple[np.ndarray | None, bool]:
    """The first times, and whether they are of a clock; None where they are not needed."""
    kinds: list[Kind] = ["clock"] if stated == "clock" else ["float"]
    kinds += ["clock"] if stated is None else []
    problem: FileProblems | None = None
    for kind in kinds:
        try:
            return first_rows(source, {column: kind})[column], kind == "clock"
        except FileProblems as error:
            problem = problem or error
    if asking.rate is None and problem is not None:
        raise problem
    return None, False


def _by_clock(column: str, asking: Asking, values: np.ndarray | None) -> Stamps:
    def make() -> Timeline:
        return StampedTime(column, "clock", rate=asking.rate)

    step = None if values is None else _usual_step(values)
    unix = values is not None and bool(np.all(np.abs(values[:1]) > FIRST_UNIX_S))
    return Stamps(make, [], None if step is None else 1 / step, unix)


# One piece: what is stated, answered and seen of one unit, each with its own sentence.
def _unit(
    column: str,
    stated: TimeUnit | None,
    asking: Asking,
    seen: tuple[float, float | None],
    unix: TimeUnit | None,
    tick_ns: float | None,
) -> tuple[TimeUnit, list[Finding]]:
    """The unit of a column of numbers, and what is to be said of it."""
    size, step = seen
    if asking.answered is not None:
        return cast(TimeUnit, asking.answered), []
    rates = {} if step is None else {u: 1 / (step * SECONDS[u]) for u in unit_names("time")}
    fitting = [u for u in rates if asking.lowest_hz <= rates[u] <= HIGHEST_HZ]
    fitting.sort(key=lambda u: (u != unix, u not in DECIMAL, abs(np.log(rates[u] / USUAL_HZ))))
    tell = asking.answer("UNIT")
    if stated is None and tick_ns is None and unix is not None and (not rates or unix in fitting):
        found = finding("time.epoch", column=column, about=size, unit=unix, answer=tell)
        return unix, [] if unix == "s" else [found]
    unit: TimeUnit = stated or "s"
    seconds = SECONDS[unit] if tick_ns is None else tick_ns / NANOSECONDS
    read_as = unit if tick_ns is None else f"ticks of {seconds * 1000:g} ms"
    if asking.rate is not None:
        return (unix or "ns") if size * seconds * NANOSECONDS > LATEST_NS else unit, []
    others = [u for u in fitting if u != unit or tick_ns is not None]
    better = others[0] if others else unix
    if size * seconds * NANOSECONDS > LATEST_NS:
        like = f"; they look like Unix times in {unix}" if unix else ""
        raise InputError(
            f"{asking.who}: the column {column} holds times of {size:.4g}, which cannot be "
            f"{read_as}{like}. State their unit with {asking.answer(better or 'UNIT')} "
            f"({', '.join(unit_names('time'))})"
        )
    rate = None if step is None else 1 / (step * seconds)
    if rate is not None and not asking.lowest_hz <= rate <= HIGHEST_HZ:
        fits = f"; in {better} it would be {rates[better]:.4g} Hz" if better in rates else ""
        confirm = f"{asking.flag.replace('UNIT', unit)} confirms it" if tick_ns is None else ""
        raise InputError(
            f"{asking.who}: the column {column} in {read_as} gives {rate:.4g} Hz, where inertial "
            f"sensors have {asking.lowest_hz:g} to {HIGHEST_HZ:g} Hz{fits}. In which unit is it? "
            f"Answer with {asking.answer(better or 'UNIT')} ({', '.join(unit_names('time'))})"
            f"{'; ' + confirm if confirm else ', or state the rate with --rate HZ'}"
        )
    if stated is None and tick_ns is None:
        return unit, [finding("time.unit_unstated", column=column, unit=unit, answer=tell)]
    return unit, []


def _usual_step(values: np.ndarray) -> float | None:
    """Mean time between samples without gaps, in the unit of the column; None where it is none."""
    with np.errstate(over="ignore"):
        steps = np.diff(values[np.isfinite(values)])
        ahead = steps[steps > 0]
        if len(steps) < 2 or not len(ahead):
            return None
        step = float(steps[(steps >= 0) & (steps <= 5 * np.median(ahead))].mean())
    return step if 1e-12 < step < np.inf else None


def _whole(source: Source, column: str) -> bool:
    """Whether a column can be read as whole numbers of 64 bits."""
    try:
        first_rows(source, {column: "integer"})
    except FileProblems:
        return False
    return True
