"""Stamps as loggers and radios write them, made the instants at which the samples were taken.

A logger may write a row twice, a radio one stamp for all samples of a packet, a clock may stand
still for a while. What is usual in a file is told by its first `HEAD` rows; all else is decided
within a few stamps, so that pieces of a file give the same as the whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from testbench.formats.tables.order import HOUR_NS, Habit, Order, goes_back
from testbench.formats.tables.rows import Rows
from testbench.formats.tables.timeline import BadRowError
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

HEAD = 8192
"""Rows that tell what is usual."""
LONGEST_RUN = 200_000
"""Rows with one stamp; a clock that stands still for more has stopped."""
MOSTLY = 0.5
"""Stamps come in groups where more than this part of the samples shares its stamp with others."""
GAP = 1.75
"""A packet later than so many of its usual intervals has a hole before it."""
SQUEEZED = 0.2
"""Samples nearer than this part of the usual interval were not taken so: the clock stood still."""
STANDS = 5
"""Samples with one stamp beyond which that is asked."""


def habit_of(rows: Rows) -> Habit | None:
    """What is usual among rows; None where the time stands still, or there are fewer than three.

    Args:
        rows: The first ones, as they are in the file.
    """
    if len(rows) < 3:
        return None
    equal = np.flatnonzero(np.diff(rows.time) == 0) + 1
    fresh = np.ones(len(rows), dtype=bool)
    fresh[equal[rows.alike(equal, equal - 1)]] = False
    time = rows.time[fresh]
    sizes = _sizes(time)
    if sizes[sizes > 1].sum() > MOSTLY * len(time):
        time = rows.time  # a sensor at rest may well repeat a value within a packet
        sizes = _sizes(time)
    begins = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    whole = max(len(begins) - 1, 2)  # the last packet may go on beyond these rows
    steps = np.diff(time[begins[:whole]])
    later = sizes[1:whole][steps > 0] if len(sizes) > 2 else sizes.max(keepdims=True)
    steps = steps[steps > 0]
    if not len(steps):
        return None
    if sizes[sizes > 1].sum() <= MOSTLY * len(time):
        return Habit(float(np.median(steps)))
    each = steps / later
    regular = np.abs(each / np.median(each) - 1) < GAP - 1
    step = steps[regular].sum() / later[regular].sum()
    return Habit(float(step), max(int(np.median(later)), 1))


def _sizes(time: np.ndarray) -> np.ndarray:
    """Of the runs of equal stamps."""
    edges = np.flatnonzero(np.diff(time) != 0) + 1
    return np.diff(np.concatenate([[0], edges, [len(time)]]))


@dataclass
class Shared:
    """Samples that had the stamp of others.

    Attributes:
        repeated: Rows that were dropped.
        packets: Stamps of several samples.
        samples: That had the stamp of the one before.
        most: Samples at one stamp.
        first_repeated_ns: Where the first row that was dropped was, since the beginning [ns].
        first_shared_ns: Likewise of the first sample that had the stamp of another [ns].
    """

    repeated: int = 0
    packets: int = 0
    samples: int = 0
    most: int = 1
    first_repeated_ns: int = 0
    first_shared_ns: int = 0


class Mender:
    """Mends the stamps of one pass through a file.

    Args:
        order: Puts them in order first.
    """

    def __init__(self, order: Order):
        self._order = order
        self.habit: Habit | None = None
        self._shared = Shared()
        self._last: int | None = None  # the stamp before the rows that are held
        self._zero = self._stale = 0

    def __call__(self, pieces: Iterable[Rows]) -> Iterator[Rows]:
        """The pieces, mended.

        Args:
            pieces: In the order of the file.

        Raises:
            BadRowError: What cannot be mended; its row is that of the file.
        """
        held: Rows | None = None
        known = False
        for piece in pieces:
            piece.time = piece.time + self._order.offset_ns
            held = piece if held is None else held.with_more(piece)
            if not known and len(held) < HEAD:
                continue
            if not known:
                known, held = True, self._look(held)
            out, held = self._advance(held, end=False)
            if len(out):
                yield out
        if held is not None and len(held):
            if not known:
                held = self._look(held)
            out, _ = self._advance(held, end=True)
            if len(out):
                yield out

    def findings(self) -> list[Finding]:
        """What is to be said of the pass, once it is over."""
        shared, order = self._shared, self._order
        result = [finding("time.stale", count=self._stale)] if self._stale else []
        result += order.log.findings()
        repeated = shared.repeated + order.repeats
        if repeated:
            first = [shared.first_repeated_ns] if shared.repeated else []
            first += [order.log.first_ns["repeated"]] if order.repeats else []
            result.append(finding("time.repeated", count=repeated, at_s=min(first) / NANOSECONDS))
        if self.habit is not None and self.habit.group > 1 and shared.packets:
            result.append(
                finding(
                    "time.grouped",
                    group=self.habit.group,
                    most=shared.most,
                    groups=shared.packets,
                    rate_hz=NANOSECONDS / self.habit.step_ns,
                )
            )
        elif shared.samples:
            result.append(
                finding(
                    "time.shared",
                    count=shared.samples,
                    at_s=shared.first_shared_ns / NANOSECONDS,
                )
            )
        return result

    def _look(self, held: Rows) -> Rows:
        """Find what is usual, and drop first rows that are left over from another recording."""
        self.habit = habit_of(held.take(slice(0, HEAD)))
        if self.habit is not None and len(held) > 4 * STANDS:
            far = np.diff(held.time[: STANDS + 1]) > max(HOUR_NS, 1000 * self.habit.step_ns)
            self._stale = int(np.flatnonzero(far)[-1]) + 1 if far.any() else 0
            held = held.take(slice(self._stale, None))
        self._zero = int(held.time[0])
        return held

    def _advance(self, held: Rows, end: bool) -> tuple[Rows, Rows]:
        """What is settled of the rows that are held, and the rest."""
        if self.habit is None:
            back = np.diff(held.time, prepend=held.time[0] if self._last is None else self._last)
            if np.any(back < 0) and not self._order.lenient:
                at = int(np.argmax(back < 0))
                raise goes_back(int(held.time[at] - back[at]), held, at)
            self._last = int(held.time[-1])
            return held, held.take(slice(0, 0))
        held, settled = self._order(held, self.habit, end)
        cut, following = (len(held), None) if end else _cut(held.time, settled)
        if not cut:
            if len(held) <= LONGEST_RUN:
                return held.take(slice(0, 0)), held
            if not self._order.lenient:
                raise self._stopped(held.time[0], len(held), int(held.number[0]))
            cut, following = len(held), None
        ready, rest = held.take(slice(0, cut)), held.take(slice(cut, None))
        ready = self._without_repeats(ready)
        last = int(ready.time[-1])
        if self._last is None or np.any(np.diff(ready.time, prepend=self._last) == 0):
            ready.time = self._spread(ready, following)
        self._last = last
        return ready, rest

    def _without_repeats(self, rows: Rows) -> Rows:
        """Without rows that repeat another one's stamp and values."""
        assert self.habit is not None
        equal = np.flatnonzero(np.diff(rows.time) == 0) + 1
        same = equal[rows.alike(equal, equal - 1)]
        if self.habit.group > 1 and len(same):
            same = self._beyond_packets(rows, same)
        if not len(same):
            return rows
        if not self._shared.repeated:
            self._shared.first_repeated_ns = int(rows.time[same[0]]) - self._zero
        self._shared.repeated += len(same)
        keep = np.ones(len(rows), dtype=bool)
        keep[same] = False
        return rows.take(keep)

    def _beyond_packets(self, rows: Rows, same: np.ndarray) -> np.ndarray:
        """Those of the repeated rows that make a packet larger than usual.

        A sensor at rest may well give the same values twice in a packet.
        """
        assert self.habit is not None
        run = np.cumsum(np.diff(rows.time, prepend=rows.time[0]) != 0)
        spare = np.maximum(np.bincount(run) - self.habit.group, 0)
        of = run[same]
        first = np.searchsorted(of, of)  # of the repeated rows of the same packet
        return same[np.arange(len(same)) - first < spare[of]]

    def _spread(self, rows: Rows, following: tuple[int, int] | None) -> np.ndarray:
        """Instants of samples that share stamps, shape (n,), int64 [ns].

        Sample i of the n of a packet lies (n - 1 - i) intervals before its stamp; the interval is
        the n-th part of the time since the stamp before, and the usual one after a hole. Of a
        clock that stood still and then made up for it the stamp is that of the first sample.
        """
        assert self.habit is not None
        step, group = self.habit.step_ns, self.habit.group
        sizes = _sizes(rows.time)
        begins = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        stamps = rows.time[begins]
        before = np.full(len(sizes), np.nan)
        before[1:] = np.diff(stamps)
        after = np.full(len(sizes), np.nan)
        after[:-1] = before[1:]
        next_sizes = np.append(sizes[1:], 1).astype(float)
        if self._last is not None:
            before[0] = stamps[0] - self._last
        if following is not None:
            after[-1], next_sizes[-1] = following[0] - stamps[-1], following[1]
        usual = sizes * step
        interval = before / sizes
        late = np.nan_to_num(before + after - usual - next_sizes * step, nan=np.inf)
        hole = (before > GAP * usual) & ((group == 1) | (late > (GAP - 1) * group * step))
        interval[hole | np.isnan(before)] = step
        back = np.full(len(sizes), True)
        if group == 1:
            caught_up = np.abs(after - usual) <= 0.25 * usual + 0.5 * step
            on_time = ~(np.abs(before - step) > 0.75 * step)
            back = ~((sizes > 1) & caught_up & on_time)
            ends = np.isnan(after) & (sizes > 1) & (before < 0.5 * usual)
            back &= ~ends
            interval = np.where(back, interval, np.where(ends, step, after / sizes))
        stands = back & (sizes > STANDS * group) & (interval < SQUEEZED * step)
        if stands.any() and not self._order.lenient:
            which = int(np.argmax(stands))
            at = int(rows.number[begins[which]])
            raise self._stopped(int(stamps[which]), int(sizes[which]), at)
        self._count(sizes, stamps)
        place = np.arange(len(rows)) - np.repeat(begins, sizes)
        place = np.where(np.repeat(back, sizes), place - np.repeat(sizes - 1, sizes), place)
        time = rows.time + np.round(place * np.repeat(interval, sizes)).astype(np.int64)
        packet = group * step
        cut_off = following is None and sizes[-1] < group
        if cut_off and abs(before[-1] - packet) < 0.25 * packet:  # of a packet that goes on
            index = np.arange(1, sizes[-1] + 1)
            time[begins[-1] :] = stamps[-1] - int(before[-1]) + np.round(index * step)
        return time

    def _count(self, sizes: np.ndarray, stamps: np.ndarray) -> None:
        several = sizes > 1
        if not several.any():
            return
        if not self._shared.packets:
            self._shared.first_shared_ns = int(stamps[np.argmax(several)]) - self._zero
        self._shared.packets += int(several.sum())
        self._shared.samples += int((sizes[several] - 1).sum())
        self._shared.most = max(self._shared.most, int(sizes.max()))

    def _stopped(self, stamp: int, count: int, row: int) -> BadRowError:
        seconds = (stamp - self._zero) / NANOSECONDS
        return BadRowError(
            f"the time stands still from here for {count} samples, {seconds:.3f} s after the first "
            "one; if they were taken at a steady rate, state it with --rate HZ, else cut the file",
            row,
        )


def _cut(time: np.ndarray, settled: int) -> tuple[int, tuple[int, int] | None]:
    """How many rows may go, with two whole stamps behind them; stamp and size of the next."""
    edges = np.flatnonzero(np.diff(time) != 0) + 1
    fitting = int(np.searchsorted(edges[:-2], settled, side="right")) if len(edges) > 2 else 0
    if not fitting:
        return 0, None
    cut = int(edges[fitting - 1])
    return cut, (int(time[cut]), int(edges[fitting] - cut))
