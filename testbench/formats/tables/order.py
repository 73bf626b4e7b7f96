"""Times that go back: what a logger's fault, a counter that wraps or a clock that was set explains.

What none of them explains is a recording that began again, and is refused with its line. All is
decided within `WINDOW` rows, so that pieces of a file give the same as the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from testbench.formats.tables.rows import Rows
from testbench.formats.tables.timeline import BadRowError
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

WINDOW = 512
"""Rows to either side of a step back among which its explanation is looked for."""
SEARCHED = 8192
"""Steps that are looked at together for one back."""
SHORT = 20
"""At most so many stamps in a row are a fault of the logger."""
FEW = 5
"""So many may be replaced even where samples are missing beside them."""
HOUR_NS = 3600 * NANOSECONDS
SLOWEST_NS = 300 * NANOSECONDS
"""Of stamps farther apart an hour more is not told from a hole."""
MOST_LOST = 20
"""Samples that may be missing where a counter of unknown width wraps; after more, it may as well
have begun again."""


@dataclass(frozen=True)
class Habit:
    """What is usual in a file.

    Attributes:
        step_ns: From sample to sample [ns].
        group: Samples that share a stamp, 1 for a stamp each.
    """

    step_ns: float
    group: int = 1


@dataclass
class OrderLog:
    """What was mended.

    Attributes:
        stamps: Faulty stamps that were replaced.
        places: In so many places.
        worst_ns: By which one of them was wrong [ns].
        moved: Rows that were put elsewhere.
        moves: In so many places.
        wraps: Of a counter.
        bits: Of that counter.
        hours: Findings on local times that jump by an hour.
        bridged: Restarts that were bridged because a rate was stated.
        first_ns: Time of the first of each kind since the beginning [ns].
    """

    stamps: int = 0
    places: int = 0
    worst_ns: float = 0.0
    moved: int = 0
    moves: int = 0
    wraps: int = 0
    bits: int = 0
    hours: list[Finding] = field(default_factory=list)
    bridged: int = 0
    first_ns: dict[str, int] = field(default_factory=dict)

    def findings(self) -> list[Finding]:
        """What is to be said of it."""
        result = list(self.hours)
        first = {key: value / NANOSECONDS for key, value in self.first_ns.items()}
        if self.stamps:
            result.append(
                finding(
                    "time.glitch",
                    count=self.stamps,
                    places=self.places,
                    worst_s=self.worst_ns / NANOSECONDS,
                    at_s=first["glitch"],
                )
            )
        if self.moved:
            result.append(
                finding(
                    "time.reordered", count=self.moved, places=self.moves, at_s=first["reordered"]
                )
            )
        if self.wraps:
            result.append(finding("time.wrapped", wraps=self.wraps, bits=self.bits))
        if self.bridged:
            result.append(finding("time.restart", count=self.bridged, at_s=first["restart"]))
        return result


@dataclass
class Order:
    """Puts times in order.

    Attributes:
        tick_ns: Length of a unit of the column if it counts whole ones, else None [ns].
        local: Whether the times are those of a wall clock, which daylight saving changes.
        lenient: Whether what is not explained is bridged, for the times are made by a rate.
        offset_ns: To be added to the times that are yet to come [ns].
        repeats: Rows that stood in the file before, in a block, and were dropped.
    """

    tick_ns: int | None = None
    local: bool = False
    lenient: bool = False
    offset_ns: int = 0
    repeats: int = 0
    log: OrderLog = field(default_factory=OrderLog)
    _zero: int | None = None

    def __call__(self, rows: Rows, habit: Habit, end: bool) -> tuple[Rows, int]:
        """Put rows in order.

        Args:
            rows: May be changed.
            habit: What is usual.
            end: Whether nothing follows.

        Returns:
            The rows, and how many of them are settled.

        Raises:
            BadRowError: The recording began again; its row is that of the file.
        """
        if self._zero is None:
            self._zero = int(rows.time[0])
        begin, at = 0, 1
        for _ in range(2 * len(rows) + 2):
            found = self._first_odd(rows.time, begin, habit)
            if found is None:
                return rows, len(rows) if end else max(len(rows) - WINDOW, 0)
            at = found
            if not end and at + WINDOW > len(rows):
                return rows, max(at - WINDOW, 0)
            rows = self._mended(rows, at, habit)
            begin = max(at - WINDOW, 0)
        raise goes_back(int(rows.time[at - 1]), rows, at)

    def _first_odd(self, time: np.ndarray, begin: int, habit: Habit) -> int | None:
        """The first row after `begin` whose time does not follow that before it; None if all do."""
        for first in range(begin, len(time), SEARCHED):  # in parts, for some files have many
            steps = np.diff(time[first : first + SEARCHED + 1])
            odd = steps < 0
            if self._by_wall_clock(habit):
                odd |= np.abs(steps - HOUR_NS - _apart(habit)) <= 1.5 * _apart(habit)
            if odd.any():
                return first + int(np.argmax(odd)) + 1
        return None

    def _by_wall_clock(self, habit: Habit) -> bool:
        """Whether an hour more or less is that of daylight saving."""
        return self.local and _apart(habit) < SLOWEST_NS

    def _note(self, kind: str, rows: Rows, at: int) -> None:
        before = int(rows.time[at - 1]) if at else int(rows.time[at])
        self.log.first_ns.setdefault(kind, before - (self._zero or 0))

    def _mended(self, rows: Rows, at: int, habit: Habit) -> Rows:
        by_hour = self._by_wall_clock(habit)
        if self._wraps(rows, at, habit) or (by_hour and self._hour(rows, at, habit)):
            return rows
        time = rows.time
        low, high = max(at - WINDOW, 0), min(at + WINDOW, len(rows))
        beyond = np.flatnonzero(time[at:high] > time[at - 1])
        stop = at + int(beyond[0]) if len(beyond) else len(rows) if high == len(rows) else None
        since = low + int(np.argmax(time[low:at] > time[at]))
        if stop is not None:
            again = self._stood_before(rows, low, at, stop)
            if again.all():
                self.repeats += stop - at
                self._note("repeated", rows, at)
                keep = np.ones(len(rows), dtype=bool)
                keep[at:stop] = False
                return rows.take(keep)
            if habit.group > 1 and self._replaced(rows, since, at, stop, habit):
                return rows
            order = self._fits_in(time, since, stop, habit)
            if order is not None:
                self.log.moved += int(np.sum(order != np.arange(len(order))))
                self.log.moves += 1
                self._note("reordered", rows, at)
                rows.put_in_order(since, order)
                return rows
        if self._replaced(rows, since, at, stop, habit):
            return rows
        if not self.lenient:
            raise goes_back(int(time[at - 1]), rows, at)
        self._note("restart", rows, at)
        self.log.bridged += 1
        self._shift(rows, at, int(time[at - 1] - time[at] + habit.step_ns))
        return rows

    def _shift(self, rows: Rows, at: int, by_ns: int) -> None:
        rows.time[at:] += by_ns
        self.offset_ns += by_ns

    def _wraps(self, rows: Rows, at: int, habit: Habit) -> bool:
        """A counter of whole units that begins again where one of so many bits does."""
        if self.tick_ns is None or rows.time[at] >= rows.time[at - 1]:
            return False
        before, after = (int(rows.time[i]) - self.offset_ns for i in (at - 1, at))
        for bits in (8, 16, 24, 32):
            span = self.tick_ns << bits
            step = after + span - before
            most = min(MOST_LOST * habit.step_ns, span / 8)
            if 0 <= after < span and before < span and 0 < step <= most:
                self.log.wraps += 1
                self.log.bits = bits
                self._shift(rows, at, span)
                return True
        return False

    def _hour(self, rows: Rows, at: int, habit: Habit) -> bool:
        """A wall clock that was set by an hour, to within a sample."""
        step = int(rows.time[at] - rows.time[at - 1])
        for hours in (1, -1):
            if abs(step - hours * HOUR_NS - _apart(habit)) <= 1.5 * _apart(habit):
                seconds = (int(rows.time[at - 1]) - (self._zero or 0)) / NANOSECONDS
                self.log.hours.append(finding("time.hour", hours=hours, at_s=seconds))
                self._shift(rows, at, -hours * HOUR_NS)
                return True
        return False

    @staticmethod
    def _stood_before(rows: Rows, low: int, at: int, stop: int) -> np.ndarray:
        """Which rows of [at, stop) stand before them with the same stamp and values."""
        time = rows.time
        index = np.arange(at, stop)
        fresh = np.diff(time[at:stop], prepend=time[at] - 1) != 0
        within = index - np.maximum.accumulate(np.where(fresh, index, 0))
        match = low + np.searchsorted(time[low:at], time[at:stop]) + within
        inside = match < at
        match = np.minimum(match, at - 1)
        return inside & (time[match] == time[at:stop]) & rows.alike(index, match)

    @staticmethod
    def _fits_in(time: np.ndarray, since: int, stop: int, habit: Habit) -> np.ndarray | None:
        """The order in which rows [since, stop) are as regular as the others, if there is one."""
        order = np.argsort(time[since:stop], kind="stable")
        ends = [time[since - 1 : since] if since else time[:0], time[stop : stop + 1]]
        steps = np.diff(np.concatenate([ends[0], time[since:stop][order], ends[1]]))
        if len(steps) < 2:
            return None
        least = 0.1 * habit.step_ns if habit.group == 1 else 0.0
        regular = (
            steps.min() >= least
            and steps.max() <= 1.9 * habit.step_ns * habit.group
            and 0.6 < steps.mean() / habit.step_ns < 1.4
        )
        return order if regular else None

    def _replaced(self, rows: Rows, since: int, at: int, stop: int | None, habit: Habit) -> bool:
        """Replace a few stamps that are too late before a step back, or too early after it."""
        time = rows.time
        late = _even(time, since - 1, at, at - since, habit)
        early = None
        if stop is not None:
            early = _even(time, at - 1, stop, stop - at, habit)
        candidates = [
            (len(values), begin, values)
            for begin, values in ((since, late), (at, early))
            if values is not None
        ]
        if not candidates:
            return False
        count, begin, values = min(candidates, key=lambda candidate: candidate[0])
        self._note("glitch", rows, max(begin, 1))
        wrong = np.abs(time[begin : begin + count] - values)
        self.log.stamps += count
        self.log.places += 1
        self.log.worst_ns = max(self.log.worst_ns, float(wrong.max()))
        time[begin : begin + count] = values
        if begin == 0:
            self._zero = int(time[0])
        return True


def goes_back(before_ns: int, rows: Rows, at: int) -> BadRowError:
    """The refusal of a recording that began again.

    Args:
        before_ns: The time before [ns].
        rows: Those at hand.
        at: The first that is too early.
    """
    before, after = before_ns / NANOSECONDS, rows.time[at] / NANOSECONDS
    return BadRowError(
        f"time goes back from {before:.6f} s to {after:.6f} s and does not return; samples must "
        "stand in the order of time: if the recording began again there, cut the file in two, or "
        "bridge it with --rate HZ",
        int(rows.number[at]),
    )


def _apart(habit: Habit) -> float:
    """Usual time from stamp to stamp [ns]."""
    return habit.step_ns * habit.group


def _even(time: np.ndarray, before: int, after: int, count: int, habit: Habit) -> np.ndarray | None:
    """Even stamps for `count` rows between two sound ones; None where they do not fit.

    Args:
        time: Shape (n,) [ns].
        before: Row of the sound stamp before them, -1 for none.
        after: Row of the sound stamp after them, n for none.
        count: Of stamps.
        habit: What is usual.
    """
    step = habit.step_ns
    index = np.arange(1, count + 1)
    if not 0 < count <= SHORT:
        return None
    if before < 0:
        return time[after] - np.round((count + 1 - index) * step).astype(np.int64)
    if after >= len(time):
        few = count <= FEW
        return time[before] + np.round(index * step).astype(np.int64) if few else None
    span = float(time[after] - time[before])
    if habit.group > 1 and time[before + 1] == time[after - 1] and span >= 0:
        same_packet = span < 0.5 * habit.group * step
        if same_packet or span < 2.5 * habit.group * step:
            between = time[after] if same_packet else time[before] + round(span / 2)
            return np.full(count, between)
    if span < 0.5 * (count + 1) * step:
        return None
    if span > 1.5 * (count + 1 + 2 * (habit.group - 1)) * step:
        few = count <= FEW
        return time[before] + np.round(index * step).astype(np.int64) if few else None
    return time[before] + np.round(index * (span / (count + 1))).astype(np.int64)
