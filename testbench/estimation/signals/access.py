"""A sensor's samples, all at once or, where hours of them would not fit in memory, in chunks.

A long recording is gone through three times in chunks: once to learn what must be known of the
whole, once for the quality gates and the timing, once for the filters, which go on from chunk to
chunk. Of n samples the last is kept, so that the memory of a session is bounded whatever its
length; nothing that is computed is decimated before.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from testbench.consistency import Consistency
from testbench.consistency.doubtful import BIT, CLIPPED_RATE, Belief, Gates, without
from testbench.consistency.looked import Up
from testbench.consistency.refused import PIECE
from testbench.consistency.traits import Traits, finite_rows
from testbench.estimation.filters import OrientationFilter, UniformSamples
from testbench.estimation.filters.base import FilterState, RecursiveFilter
from testbench.estimation.signals.mean_turning import MeanTurning
from testbench.estimation.signals.quality import AFTER_GAP, Inspection, Quality, findings_on
from testbench.estimation.signals.restarts import Carried, Stretches
from testbench.estimation.signals.timing import (
    STRETCH,
    IntervalAudit,
    arrival_jitter,
    asynchrony,
    audit_timing,
    usual_interval,
)
from testbench.estimation.signals.uniform import MOST_FILLING, bridges_of, fill_gaps, fill_rows
from testbench.frames import NANOSECONDS
from testbench.model.windows import moving_mean
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import ClockFit, TimingAudit
from testbench.records.session.samples import ImuSamples
from testbench.records.session.sensor_file import SensorFile

MOST_KEPT = 400_000
"""Estimates kept of a sensor; a recording with more samples is estimated in chunks, and one
in every n is kept.
"""
MOST_KEPT_IN_ALL = 1_600_000
"""Likewise of all sensors of a session together."""
MOST_AT_ONCE = 4_000_000
"""A filter that needs the whole recording still gets so many samples of a sensor at once: about 0.5
GB.
"""
OF_EACH_PIECE = 4_096
"""Intervals of each piece that tell the usual one."""

Correct = Callable[[UniformSamples], UniformSamples]
Change = Callable[[ImuSamples], ImuSamples]


def _unchanged(samples: ImuSamples) -> ImuSamples:
    return samples


def open_samples(
    raw: SensorFile, together: int, belief: Belief | None = None, stored: Change | None = None
) -> SampleAccess:
    """Access to a sensor's samples, in the way their number asks for.

    Args:
        raw: The samples.
        together: Samples of all sensors of the recording.
        belief: What a person says of them.
        stored: A stored calibration, applied to all that is read.
    """
    change = stored or _unchanged
    every = max(-(-raw.count // MOST_KEPT), -(-together // MOST_KEPT_IN_ALL), 1)
    if every == 1:
        return WholeRecording(raw, belief, change)
    return PiecewiseRecording(raw, every, belief, change)


class SampleAccess(ABC):
    """A sensor's samples.

    Attributes:
        samples: Those that estimates are kept at; NaN for what no gate lets pass.
        turned: The same with rates that are means over all samples since the one before, so that
            they tell how the sensor turned in between.
        measured: Whether each has a rate that was measured, shape (n,), bool.
        every: One of how many that is.
        lost: Samples of the recording between which nobody knows how the sensor turned, the last
            before and the first after, at which filters begin anew, shape (k, 2).
    """

    samples: ImuSamples
    turned: ImuSamples
    measured: np.ndarray
    every: int
    lost: np.ndarray
    _consistency: Consistency
    _gates: Gates

    @property
    def stretch(self) -> np.ndarray:
        """In which stretch between gaps that no rate bridges each kept sample is, from 0, shape
        (n,).
        """
        kept = self.every * np.arange(1, len(self.samples) + 1) - 1
        return np.searchsorted(self.lost[:, 1], kept, side="right")

    @property
    def _holes(self) -> np.ndarray:
        """`lost`, but for a sensor that does not feel where up is, whose filters go on."""
        return self.lost if self._gates.measures("acc") else self.lost[:0]

    def let_go(self) -> None:
        """Forget the samples; filters can be run all the same."""
        self.samples = self.turned = self.samples.rows(slice(0))

    def contradictions(self, up: Up) -> list[Finding]:
        """What the quantities say of one another, as they were read: no stored calibration is in
        them, and no sample that a gate refuses.

        Args:
            up: What is known of the vertical beside them.
        """
        return self._consistency.findings(up)

    @abstractmethod
    def regular(self, clock: ClockFit) -> tuple[UniformSamples, np.ndarray]:
        """The kept samples on a regular grid, and the row of each in it."""

    @abstractmethod
    def quality(self, static: np.ndarray) -> Quality:
        """What the gates find.

        Args:
            static: Whether each kept sample is at rest, shape (n,), bool.
        """

    @abstractmethod
    def timing(self, nominal_rate: float | None, rate_age: float) -> TimingAudit:
        """Audit of the time stamps; see `audit_timing`."""

    @abstractmethod
    def refuses(self, kind: OrientationFilter) -> str | None:
        """Why a filter cannot run over this recording, or None."""

    @abstractmethod
    def orientations(
        self, filters: Mapping[str, OrientationFilter], clock: ClockFit, correct: Correct
    ) -> Iterator[tuple[str, np.ndarray]]:
        """q_earth_from_sensor of each filter at the kept samples, shape (n, 4), one filter after
        the other, in any order.

        Args:
            filters: By name.
            clock: Gives the true interval.
            correct: Calibration, applied to what the filters get.
        """


class WholeRecording(SampleAccess):
    """All samples at once."""

    def __init__(self, raw: SensorFile, belief: Belief | None = None, change: Change = _unchanged):
        samples, belief = raw.read(), belief or Belief()
        self._gates = Gates(Traits(belief.has_noise).add(samples), belief)
        doubts, inspection = self._gates.doubt(samples), Inspection(self._gates)
        self._flags = inspection.flags(samples, doubts, slice(None))
        self._findings, self._numbers = inspection.findings(), inspection.counts
        self.lost = np.array(inspection.lost, dtype=np.int64).reshape(-1, 2)
        self.measured, self.every = _measured(self._gates, doubts.unknown), 1
        sound = without(samples, doubts.unknown)
        self._consistency = Consistency()
        self._consistency.look(sound)
        self.samples = self.turned = change(sound)
        self._given = change(without(samples, doubts.unknown, for_filters=True))
        self._regular: tuple[ClockFit, tuple[UniformSamples, np.ndarray]] | None = None

    def regular(self, clock: ClockFit) -> tuple[UniformSamples, np.ndarray]:
        """See SampleAccess."""
        if self._regular is None or self._regular[0] != clock:
            bridges = bridges_of(_interval(self._given), self._gates.slower())
            self._regular = clock, fill_gaps(self._given, clock, bridges)
        return self._regular[1]

    def quality(self, static: np.ndarray) -> Quality:
        """See SampleAccess."""
        found = [*self._findings, *findings_on(self.samples, static)]
        return Quality(self._flags, found, self._numbers)

    def timing(self, nominal_rate: float | None, rate_age: float) -> TimingAudit:
        """See SampleAccess."""
        return audit_timing(self.samples, nominal_rate, rate_age)

    def refuses(self, kind: OrientationFilter) -> str | None:
        """See SampleAccess."""
        return None

    def orientations(
        self, filters: Mapping[str, OrientationFilter], clock: ClockFit, correct: Correct
    ) -> Iterator[tuple[str, np.ndarray]]:
        """See SampleAccess."""
        uniform, rows = self.regular(clock)
        whole = stretches = Stretches([(uniform, rows)]).corrected(correct)
        if len(self._holes):
            bridges = bridges_of(_interval(self._given), self._gates.slower())
            stretches = Stretches.cut(self._given, self._holes, clock, bridges).corrected(correct)
        for name, kind in filters.items():
            yield name, (whole if kind.sampling == "memoryless" else stretches).run(kind)


class PiecewiseRecording(SampleAccess):
    """Samples in pieces; of `every` of them the last is kept."""

    def __init__(
        self,
        raw: SensorFile,
        every: int,
        belief: Belief | None = None,
        change: Change = _unchanged,
    ):
        self._file, self.every, self._change = raw, every, change
        self._count, belief = self._file.count, belief or Belief()
        traits = Traits(belief.has_noise)
        steps, ordered = [], True
        first = last = None
        for piece in self._file.batches(PIECE):
            traits.add(piece)
            steps.append(np.diff(piece.device_time_ns[:OF_EACH_PIECE]))
            ordered &= bool((np.diff(piece.counter) > 0).all()) and (
                last is None or piece.counter[0] > last.counter[-1]
            )
            first, last = first or piece, piece
        assert first is not None
        assert last is not None
        rows = int(last.counter[-1] - first.counter[0]) + 1
        self._counted = (
            ordered and rows <= MOST_FILLING * self._count
        )  # else the counter is not trusted
        self._grid = rows if self._counted else self._count
        self._span = float(last.device_time_ns[-1] - first.device_time_ns[0]) / NANOSECONDS
        self._usual = usual_interval(np.concatenate(steps))
        self._gates = Gates(traits, belief)
        self._bridges = bridges_of(self._usual, self._gates.slower())
        self._margin = max(self._gates.margin, *(1 + rows for rows in self._bridges.values()))
        self._inspect()

    def _inspect(self) -> None:
        """Put all samples through the gates, and keep one of so many; a kept sample is flagged if
        any of those it stands for is.
        """
        inspection, self._consistency = Inspection(self._gates), Consistency()
        self._unknown = np.zeros(self._count, dtype=np.uint8)
        self._flags: dict[str, np.ndarray] = {}
        kept: list[ImuSamples] = []
        turning = MeanTurning(self.every)
        done, number = 0, self._count // self.every
        for piece, own in self._pieces():
            doubts = self._gates.doubt(piece)
            flags = inspection.flags(piece, doubts, own)
            count = len(flags[AFTER_GAP])
            self._unknown[done : done + count] = doubts.unknown[own]
            for reason, flag in flags.items():
                rows = (done + np.flatnonzero(flag)) // self.every
                own_flags = self._flags.setdefault(reason, np.zeros(number, dtype=bool))
                own_flags[rows[rows < number]] = True
            last = np.arange(self.every - 1 - done % self.every, count, self.every)
            sound = without(piece, doubts.unknown)
            self._consistency.look(sound.rows(own))
            turning.add(self._change(sound.rows(own)).gyr)
            kept.append(sound.rows(own.start + last))
            done += count
        self._findings, self._numbers = inspection.findings(), inspection.counts
        self.lost = np.array(inspection.lost, dtype=np.int64).reshape(-1, 2)
        self.samples = self._change(_joined(kept))
        self.turned = replace(self.samples, gyr=turning.rates())
        self.measured = _measured(self._gates, self._unknown[self.every - 1 :: self.every])

    def regular(self, clock: ClockFit) -> tuple[UniformSamples, np.ndarray]:
        """See SampleAccess; the time that lost packets leave open is spread over the rest, which
        only rests are told by.
        """
        return fill_gaps(replace(self.samples, counter=np.arange(len(self.samples))), clock)

    def quality(self, static: np.ndarray) -> Quality:
        """See SampleAccess."""
        found = [*self._findings, *findings_on(self.samples, static)]
        return Quality(self._flags, found, self._numbers)

    def timing(self, nominal_rate: float | None, rate_age: float) -> TimingAudit:
        """See SampleAccess."""
        intervals = IntervalAudit(self._usual)
        for columns in self._file.tables(PIECE, ["device_time_ns", "counter"]):
            intervals.add(columns["device_time_ns"], columns["counter"])
        turning = np.nan_to_num(np.linalg.norm(self.samples.gyr, axis=1))
        middle = int(np.argmax(moving_mean(turning, max(STRETCH // self.every, 1)))) * self.every
        begin = min(max(middle - STRETCH // 2, 0), max(self._count - STRETCH, 0))
        stretch = self._change(self._file.read(begin, begin + STRETCH))
        lag = asynchrony(stretch, self._usual).later_by(rate_age)
        return intervals.audit(nominal_rate, arrival_jitter(self.samples), lag)

    def refuses(self, kind: OrientationFilter) -> str | None:
        """See SampleAccess."""
        if not isinstance(kind, RecursiveFilter) and self._count > MOST_AT_ONCE:
            return (
                f"it needs all {self._count} samples at once; recordings of more than "
                f"{MOST_AT_ONCE} go through in pieces"
            )
        return None

    # Longer than a screen: rows of the file, of the grid and of what is kept, piece by piece.
    def orientations(
        self, filters: Mapping[str, OrientationFilter], clock: ClockFit, correct: Correct
    ) -> Iterator[tuple[str, np.ndarray]]:
        """See SampleAccess."""
        at_once = {
            name: kind for name, kind in filters.items() if not isinstance(kind, RecursiveFilter)
        }
        for name, kind in at_once.items():
            samples = without(self._file.read(), self._unknown, for_filters=True)
            samples = self._change(samples)
            stretches = Stretches.cut(samples, self._holes, clock, self._bridges)
            yield name, stretches.corrected(correct).run(kind)[self.every - 1 :: self.every]
        running = {
            name: _Running(kind, self._count // self.every)
            for name, kind in filters.items()
            if isinstance(kind, RecursiveFilter)
        }
        interval = self._span / max(self._grid - 1, 1) / (1 + 1e-6 * clock.drift_ppm)
        done, origin = 0, None
        held: dict[str, np.ndarray] = {}
        for raw, counted in self._pieces():
            first = done - counted.start
            unknown = self._unknown[first : first + len(raw)]
            piece = self._change(without(raw, unknown, for_filters=True))
            piece = _held(piece, held)
            row = piece.counter if self._counted else np.arange(len(piece)) + done - counted.start
            origin = int(row[counted.start]) if origin is None else origin
            begin = int(row[counted.start - 1]) + 1 if counted.start else origin
            number = len(row[counted])
            end = int(row[counted][-1]) + 1
            wanted = (
                self.every
                * np.arange(-(-(done + 1) // self.every), (done + number) // self.every + 1)
                - 1
            )
            wanted_rows = row[counted.start + wanted - done]
            ends = counted.start == 0, counted.stop is None
            holes = _in_rows(self._holes, row[counted], done, (begin, end))
            for start, stop, what in _segments(begin, end, holes):
                here = (wanted_rows >= start) & (wanted_rows < stop)
                kept = (wanted[here] + 1) // self.every - 1
                if what == "hole":
                    for own in running.values():
                        own.hold(kept)
                    continue
                before = int(start > origin and what == "on")
                grid = np.arange(start - before, stop)
                corrected = correct(fill_rows(piece, row, grid, interval, self._bridges, ends))
                given = corrected if not before else _without_first(corrected)
                for own in running.values():
                    own.advance(given, what == "anew", kept, wanted_rows[here] - start)
            done += number
        for name in list(running):
            yield name, running.pop(name).found

    def _pieces(self) -> Iterator[tuple[ImuSamples, slice]]:
        """Pieces with a few neighbours at either end, and which of their samples are the piece
        itself.
        """
        return self._file.pieces(PIECE, self._margin)


class _Running:
    """A filter that goes through a recording chunk by chunk.

    Args:
        kind: The filter.
        count: Orientations that are kept.

    Attributes:
        found: q_earth_from_sensor at the kept samples, shape (n, 4).
    """

    def __init__(self, kind: RecursiveFilter, count: int):
        self._kind, self._carried = kind, Carried(kind)
        self._state: FilterState | None = None
        self.found = np.empty((count, 4))

    def advance(
        self, given: UniformSamples, anew: bool, kept: np.ndarray, rows: np.ndarray
    ) -> None:
        """Go on by a chunk.

        Args:
            given: The chunk.
            anew: Whether the filter begins anew with it.
            kept: Which of the kept samples are in it, shape (k,).
            rows: And where, shape (k,).
        """
        q, self._state = self._kind.advance(given, None if anew else self._state)
        self.found[kept] = self._carried(q, given, anew)[rows]

    def hold(self, kept: np.ndarray) -> None:
        """Keep the last orientation over a hole.

        Args:
            kept: Which of the kept samples are in it, shape (k,).
        """
        self.found[kept] = self._carried.last


def _in_rows(
    holes: np.ndarray, row: np.ndarray, done: int, ends: tuple[int, int]
) -> list[tuple[int, int, bool]]:
    """The holes that reach into a piece, in rows of the grid: the first, the one after the last,
    and whether it ends there.

    Args:
        holes: Samples before and after each, shape (k, 2).
        row: Of the samples of the piece, shape (n,).
        done: Samples before it.
        ends: First row of the piece, and the one after its last.
    """
    found = []
    for last, first in holes[(holes[:, 1] >= done) & (holes[:, 0] < done + len(row))].tolist():
        closes = first < done + len(row)
        begin = int(row[last - done]) + 1 if last >= done else ends[0]
        found.append((begin, int(row[first - done]) if closes else ends[1], closes))
    return found


def _segments(
    begin: int, end: int, holes: list[tuple[int, int, bool]]
) -> Iterator[tuple[int, int, Literal["on", "anew", "hole"]]]:
    """Rows in parts that fit in memory: first, one after the last, and what filters do there.

    Args:
        begin: First row.
        end: One after the last.
        holes: As `_in_rows` gives them.
    """
    what: Literal["on", "anew"] = "on"
    for first, after, closes in [*holes, (end, end, False)]:
        for start in range(begin, first, PIECE):
            yield start, min(start + PIECE, first), what
            what = "on"
        if first < after:
            yield first, after, "hole"
        begin, what = after, "anew" if closes else "on"


def _measured(gates: Gates, unknown: np.ndarray) -> np.ndarray:
    """Rows whose rate was measured, by the gyroscope or else by the device, shape (n,), bool.

    Args:
        gates: Of the recording.
        unknown: Marks of what is unknown, shape (n,).
    """
    if gates.measures("gyr"):
        return (unknown & (BIT["gyr"] | CLIPPED_RATE)) == 0
    return (unknown & BIT["device_q"]) == 0


def _interval(samples: ImuSamples) -> float:
    """The usual interval between samples [s]; 0 where there is none."""
    return float(np.nan_to_num(usual_interval(np.diff(samples.device_time_ns))))


def _joined(parts: list[ImuSamples]) -> ImuSamples:
    keys = [key for key, column in vars(parts[0]).items() if column is not None]
    return ImuSamples.from_groups(
        {key: np.concatenate([getattr(part, key) for part in parts]) for key in keys}
    )


def _held(piece: ImuSamples, last: dict[str, np.ndarray]) -> ImuSamples:
    """The piece with its rate and the device's orientation as they last were, where none of it has
    any: minutes without a reading.

    Args:
        piece: Of samples.
        last: Readings of the pieces before, by quantity, shape (1, k) each; is brought up to date.
    """
    changed = {}
    for key in ("gyr", "device_q"):
        array = getattr(piece, key)
        if array is None:
            continue
        known = np.flatnonzero(finite_rows(array))
        if len(known):
            last[key] = array[known[-1:]]
        elif key in last:
            changed[key] = np.repeat(last[key], len(piece), axis=0)
    return replace(piece, **changed)


def _without_first(samples: UniformSamples) -> UniformSamples:
    mag, q = samples.mag, samples.device_q
    return UniformSamples(
        samples.interval,
        samples.gyr[1:],
        samples.acc[1:],
        None if mag is None else mag[1:],
        None if q is None else q[1:],
    )
