"""From what a file says of time to nanoseconds.

It is counters that wrap, seconds and their parts, a time of day, or only a rate.

Every class keeps its place from chunk to chunk, so that pieces give the same times as the whole.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.units import SECONDS, TimeUnit
from testbench.frames import NANOSECONDS

DAY_S, MINUTE_S = 86_400, 60
YEAR_NS = 365 * DAY_S * NANOSECONDS
LATEST_NS = 140 * YEAR_NS
"""The year 2109 of Unix times; 64 bits hold twice as much."""
LONGEST_LOSS = 2000
"""A counter that seems to go back may have wrapped if fewer samples than this are missing then."""


class Unwrapper:
    """A counter of a given number of bits, without its wraps.

    A step counts as the shorter way round.

    Args:
        bits: Width of the counter.
    """

    def __init__(self, bits: int):
        self._span = 1 << bits
        self._raw: int | None = None
        self._value = 0

    def __call__(self, raw: np.ndarray) -> np.ndarray:
        """Increasing where the counter increases, shape (n,), int64.

        The first value is kept as it is.
        """
        raw = np.asarray(raw, dtype=np.int64)
        if not len(raw):
            return raw
        if self._raw is None:
            self._raw = self._value = int(raw[0])
        steps = np.diff(raw, prepend=self._raw)
        half = self._span // 2
        values = self._value + np.cumsum((steps + half) % self._span - half)
        self._raw, self._value = int(raw[-1]), int(values[-1])
        return values


class CounterUnwrapper:
    """A sample counter whose width the file does not tell: 8, 16 or 32 bits.

    It is whichever makes a step back a small step on.
    """

    def __init__(self) -> None:
        self._raw: int | None = None
        self._wrapped = self._highest = 0

    def __call__(self, raw: np.ndarray) -> np.ndarray:
        """Shape (n,), int64; a step back that no wrap explains stays one."""
        raw = np.asarray(raw, dtype=np.int64)
        if not len(raw):
            return raw
        steps = np.diff(raw, prepend=raw[0] if self._raw is None else self._raw)
        wraps = np.zeros(len(raw), dtype=np.int64)
        highest = np.maximum(np.maximum.accumulate(raw), self._highest)
        self._highest = int(highest[-1])
        for i in np.flatnonzero(steps < 0):
            for bits in (8, 16, 32):  # one that once counted further has more bits
                if highest[i] < 1 << bits and 0 < steps[i] + (1 << bits) <= min(
                    LONGEST_LOSS, 1 << (bits - 1)
                ):
                    wraps[i] = 1 << bits
                    break
        values = raw + self._wrapped + np.cumsum(wraps)
        self._wrapped += int(wraps.sum())
        self._raw = int(raw[-1])
        return values


class Timeline(ABC):
    """What becomes device_time_ns.

    Attributes:
        kinds: Columns that it needs.
    """

    kinds: dict[str, Kind]

    @abstractmethod
    def __call__(self, columns: Columns, count: int) -> np.ndarray:
        """Times of the next `count` samples [ns], shape (count,), int64."""


class StampedTime(Timeline):
    """A column of times.

    Args:
        column: Its name.
        unit: Of it; "clock" is a time of day, which may pass midnight, or a date with one.
        bits: Width of a counter that wraps, None for one that does not.
        tick_ns: Length of a unit, if it is none of the usual [ns].
        exact: Whether the column is read as whole numbers of 64 bits; None: where its unit is
            that of a counter or ns.
        rate: Of the samples [Hz], where it is stated and the column only shows the holes.

    Attributes:
        column: Its name.
        rate: See above.
        local: Whether it is a wall clock.
        counted_ns: Length of a unit if the column counts whole ones that may begin again [ns].
    """

    def __init__(
        self,
        column: str,
        unit: TimeUnit = "s",
        bits: int | None = None,
        tick_ns: float | None = None,
        exact: bool | None = None,
        rate: float | None = None,
    ):
        self.column, self.rate, self.local = column, rate, unit == "clock"
        self._bits, self._unit = bits, unit
        exact = (bits is not None or unit == "ns") if exact is None else exact
        self.kinds = {column: "clock" if self.local else "integer" if exact else "float"}
        self._tick_ns = tick_ns if tick_ns is not None else SECONDS[unit] * NANOSECONDS
        small = bits is None and self._tick_ns < NANOSECONDS
        self.counted_ns = round(self._tick_ns) if small else None
        self._unwrap = Unwrapper(bits) if bits is not None else None
        self._last, self._days, self._held = -np.inf, 0, 0.0

    def __call__(self, columns: Columns, count: int) -> np.ndarray:
        values = columns[self.column]
        known = np.isfinite(values)
        if not known.all() and self.rate is None:
            raise BadRowError("the time is missing here", int(np.argmin(known)))
        if not known.all():
            values = self._filled(values, known)
        if self._unwrap is not None:
            values = self._unwrap(np.asarray(values, dtype=np.int64))
        if self.local:
            values = self._past_midnight(values)
        with np.errstate(over="ignore"):
            size = np.abs(values.astype(float)) * self._tick_ns
        if np.any(size > LATEST_NS):
            at = int(np.argmax(size > LATEST_NS))
            raise BadRowError(
                f"a time of {values[at]:.10g} {self._unit} cannot be: it is more than "
                f"{LATEST_NS / YEAR_NS:.0f} years",
                at,
            )
        if values.dtype.kind in "iu" and float(self._tick_ns).is_integer():
            return np.asarray(values, dtype=np.int64) * np.int64(self._tick_ns)
        if size.size and size.max() > 1 << 53 and float(self._tick_ns).is_integer():
            whole = np.floor(values)  # of Unix times a product would lose the last digits
            part = np.round((values - whole) * self._tick_ns).astype(np.int64)
            return whole.astype(np.int64) * np.int64(self._tick_ns) + part
        return np.round(values * self._tick_ns).astype(np.int64)

    def _filled(self, values: np.ndarray, known: np.ndarray) -> np.ndarray:
        """With the time before in place of one that is missing."""
        last = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
        filled = np.where(last < 0, self._held, values[np.maximum(last, 0)])
        self._held = float(filled[-1])
        return np.asarray(filled, dtype=float)

    def _past_midnight(self, seconds: np.ndarray) -> np.ndarray:
        steps = np.diff(seconds, prepend=self._last)
        back = -DAY_S / 2
        if abs(seconds[0]) > 2 * DAY_S:  # it has a date, which a logger may have left as it was
            back = MINUTE_S - DAY_S
        days = self._days + np.cumsum((steps < back) & (steps >= -DAY_S))
        self._last, self._days = float(seconds[-1]), int(days[-1])
        return seconds + DAY_S * days


class RegularTime(Timeline):
    """No times at all: sample after sample at a rate.

    A counter that came with them keeps the place of lost ones.

    Args:
        rate: [Hz].
        counter: Column of the sample counter, or None.
    """

    def __init__(self, rate: float, counter: str | None = None):
        self.kinds = {} if counter is None else {counter: "integer"}
        self._rate, self._counter, self._count = rate, counter, 0
        self._unwrap = CounterUnwrapper()
        self._origin: int | None = None

    def __call__(self, columns: Columns, count: int) -> np.ndarray:
        if self._counter is None:
            index = np.arange(self._count, self._count + count)
        else:
            index = self._unwrap(columns[self._counter])
            if self._origin is None:
                self._origin = int(index[0])
            index = index - self._origin
        self._count += count
        time = np.round(index * (NANOSECONDS / self._rate))
        if np.any(np.abs(time) > LATEST_NS):
            at = int(np.argmax(np.abs(time) > LATEST_NS))
            raise BadRowError(f"the counter {self._counter} jumps by years of samples", at)
        return time.astype(np.int64)


class SpreadTime(Timeline):
    """Stamps of whole seconds, or minutes, that many samples share, spread by the sampling rate.

    Sample i lies 1/rate after sample i - 1, until that strays from its stamp: then samples are
    missing, and the time follows the stamp.

    Args:
        column: Stamps that end in a time of day.
        rate: [Hz].
        whole_s: What the stamps are whole numbers of [s].
    """

    SLACK_S = 1.5
    """The spread time may stray so far out of what its stamp says: stamps are written late, and
    rates are never exact.
    """

    def __init__(self, column: str, rate: float, whole_s: float = 1.0):
        self.kinds = {column: "clock"}
        self.gaps = 0
        self._column, self._rate, self._count = column, rate, 0
        self._clock, self._whole = StampedTime(column, "clock"), whole_s
        self._origin: float | None = None
        self._base: int | None = None

    def __call__(self, columns: Columns, count: int) -> np.ndarray:
        whole = self._clock(columns, count)
        self._base = int(whole[0]) if self._base is None else self._base
        stamps = (whole - self._base) / NANOSECONDS
        index = np.arange(self._count, self._count + count)
        if self._origin is None:
            self._origin = _best_origin(stamps, index / self._rate, self._whole)
        times = np.empty(count)
        start = 0
        while start < count:
            spread = self._origin + index[start:] / self._rate
            ahead = stamps[start:] - spread
            stray = np.flatnonzero((ahead > self.SLACK_S) | (ahead < -self._whole - self.SLACK_S))
            end = start + int(stray[0]) if len(stray) else count
            times[start:end] = spread[: end - start]
            if end < count:
                if ahead[end - start] < 0:
                    behind = (
                        f"the stamps fall {-ahead[end - start]:.1f} s behind a rate of "
                        f"{self._rate:g} Hz"
                    )
                    raise BadRowError(f"{behind}; state the true one with --rate", end)
                self.gaps += 1
                self._origin = stamps[end] - index[end] / self._rate
            start = end
        self._count += count
        return self._base + np.round(times * NANOSECONDS).astype(np.int64)


def _best_origin(stamps: np.ndarray, spread: np.ndarray, whole_s: float) -> float:
    """Time of the first sample [s].

    Within the first steady stretch, every sample lies in what its stamp says.
    """
    late = stamps - spread
    steady = np.abs(late - late[0]) < whole_s
    end = len(late) if steady.all() else int(np.argmin(steady))
    return float(np.max(late[: max(end, 1)]))


class BadRowError(InputError):
    """A row of the chunk at hand is at fault.

    Whoever knows the file turns it into `file:line: message`.
    """

    def __init__(self, message: str, row: int):
        self.row = row
        super().__init__(message)


def rate_of_stamps(stamps: np.ndarray, nominal: float, whole_s: float = 1.0) -> tuple[float, float]:
    """Sampling rate from stamps of whole seconds or minutes.

    Args:
        stamps: [s], shape (n,).
        nominal: The rate that is believed [Hz]; kept where the stamps do not deny it.
        whole_s: What the stamps are whole numbers of [s].

    Returns:
        The rate, by the seconds (minutes) without a pause, and how far it may be wrong [Hz];
        infinitely where there is no whole one.
    """
    changes = np.flatnonzero(np.diff(stamps) > 0) + 1
    whole = np.diff(stamps[changes]) == whole_s  # seconds without a pause
    if not whole.any():
        return nominal, np.inf
    counts = np.diff(changes)[whole]
    measured = float(counts.mean()) / whole_s
    doubt = 2.0 * max(1.0, 0.05 * measured) / int(whole.sum()) / whole_s
    return (nominal, doubt) if abs(measured - nominal) <= doubt else (measured, doubt)
