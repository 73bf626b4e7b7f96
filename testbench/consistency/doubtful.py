"""Doubtful samples: readings that a sensor cannot have measured, told by the samples alone.

They are gaps: no filter integrates them, no mean counts them. Each is refused for a reason that has
a name, so that a person can say that it is real.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from testbench.consistency.straight import straight_rows
from testbench.consistency.traits import (
    ABSURD,
    LONGEST_RUN,
    MOST,
    MOST_REPEATED,
    MOST_STRAIGHT,
    QUANTITIES,
    SELDOM_AXIS,
    TRIADS,
    QuantityTraits,
    Traits,
    beyond_rows,
    finite_rows,
    lengths_of,
    repeated_rows,
    zero_rows,
)
from testbench.consistency.wraps import LONGEST as LONGEST_WRAP
from testbench.consistency.wraps import may_wrap, wrapped_rows
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.session.manifest import FullScale
from testbench.records.session.samples import ImuSamples
from testbench.records.specs.exclusion import Exclusion

SATURATED, NOT_FINITE, BEYOND = "saturated", "not finite", "beyond any sensor"
ZEROS, STUCK, CLIPPED, SPIKE = "zeros", "stuck", "clipped", "spike"
STUCK_AXIS = "stuck axis"
STRAIGHT, WRAPPED = "straight", "wrapped"
NO_UNIT = "quaternion not of unit length"
EXCLUDED = "excluded: "
"""Before the reason that a person gives."""

BIT = {"gyr": 1, "acc": 2, "mag": 4, "device_q": 8}
"""Marks of the quantities that are unknown in a row."""
CLIPPED_RATE, OLD_FIELD = 16, 32
"""Marks of a rate at full scale, which is no measurement but a bound, and nearer to the truth than
what a straight line over it gives; and of a field that only repeats an earlier reading.
"""
NORM_TOLERANCE = 0.01
"""Quaternions further from unit length than this are refused [1]."""
AT_FULL_SCALE = 0.995
"""Part of a stated full scale from which on a reading counts as clipped: of 16 bits the highest
count is 32767 / 32768 of it.
"""
AT_EXTREME = 0.97
"""Part of its largest reading from which on a triad is taken for the one that is saturated, where a
status bit does not say which.
"""
LEAST_FULL_SCALE = {"gyr": np.radians(115.0), "acc": 1.8 * STANDARD_GRAVITY}
"""No sensor clips below [rad/s], [m/s^2]: the smallest ranges sold are +-125 deg/s and +-2 g, less
some per cent of offset and scale.
"""
PLATEAU = 3
"""So many readings in a row at the largest of a whole recording are clipped."""
SPIKE_SIZE = {"gyr": 4.0, "acc": 60.0, "mag": 150.0}
"""Least distance of a single reading from the mean of its neighbours that is a spike [rad/s],
[m/s^2], [uT]. A gyroscope of +-250 deg/s, the smallest range that is common, can be wrong by 4.4 at
most, which at 100 Hz is 2.5 deg.
"""
SPIKE_FACTOR = 15.0
"""And by so much it must exceed what the readings nearby do.

An impact rings, and sensors have a low pass: the sharpest heel strike of gaitmap's example, 137
m/s^2 in one reading at 204.8 Hz, exceeds them by 9.9.
"""
NEARBY = np.array([-7, -6, -5, -4, -3, -2, 2, 3, 4, 5, 6, 7])
FILLER_STEPS, FILLER_NEAR = 5.0, 5
"""A reading that is repeated is a filler if it is so many times further from both its neighbours
than any of so many before it were from one another.
"""
LEAST_AXIS_RUN, MOVES = 50, 10.0
"""One axis is stuck if it repeats a reading more often than this, while another goes through more
than so many of its counts.
"""
ALIVE = 0.1
"""A gyroscope that turns by this just before and just after does not read exactly 0 in all axes
between [rad/s].
"""


@dataclass(frozen=True)
class Belief:
    """What a person says of a sensor's samples.

    Attributes:
        has_noise: Whether the readings must differ at rest.
        keep: Kinds of doubtful samples that are real.
        exclude: Intervals to leave out.
        full_scale: Largest readings, where they are known.
    """

    has_noise: bool = True
    keep: frozenset[str] = frozenset()
    exclude: Sequence[Exclusion] = ()
    full_scale: FullScale = field(default_factory=FullScale)

    def range_of(self, key: str) -> float | None:
        """Full scale of a triad [m/s^2] or [rad/s], None where nobody states it."""
        return {"acc": self.full_scale.acc_m_s2, "gyr": self.full_scale.gyr_rad_s}.get(key)


@dataclass
class Doubts:
    """What is doubtful in some samples.

    Attributes:
        flags: Samples by reason, each of shape (n,), bool; only reasons that there are.
        unknown: Marks of what is unknown in each sample, shape (n,), uint8.
        quantities: Which quantities each reason is about.
    """

    flags: dict[str, np.ndarray]
    unknown: np.ndarray
    quantities: dict[str, set[str]]

    @staticmethod
    def none(count: int) -> Doubts:
        """Nothing doubtful in so many samples."""
        return Doubts({}, np.zeros(count, dtype=np.uint8), {})

    @property
    def flagged(self) -> np.ndarray:
        """Samples that are refused for any reason, shape (n,), bool."""
        return np.logical_or.reduce([*self.flags.values(), np.zeros(len(self.unknown), dtype=bool)])

    def add(self, reason: str, rows: np.ndarray, *keys: str, mark: int | None = None) -> None:
        """Doubt some rows.

        Args:
            reason: Why.
            rows: Their indices, shape (k,), or a mask, shape (n,), bool.
            *keys: Quantities that are unknown there.
            mark: In place of theirs.
        """
        own = self.flags.setdefault(reason, np.zeros(len(self.unknown), dtype=bool))
        own[rows] = True
        self.unknown[rows] |= sum(BIT[key] for key in keys) if mark is None else mark
        self.quantities.setdefault(reason, set()).update(keys)


class Gates:
    """The gates of one recording.

    Args:
        traits: Of the whole of it.
        belief: What a person says.
    """

    def __init__(self, traits: Traits, belief: Belief):
        self._traits, self._belief = traits, belief
        self.dead, self._frozen = traits.dead, traits.frozen and STUCK not in belief.keep
        self.dead_axes = traits.dead_axes if STUCK not in belief.keep else {}
        self.twin_axes = traits.twin_axes if STUCK not in belief.keep else {}
        if STUCK in belief.keep:
            self.dead = {key for key in self.dead if traits.of[key].all_zero}
        if ZEROS in belief.keep:
            self.dead = {key for key in self.dead if not traits.of[key].all_zero}
        self._present = [
            key for key in QUANTITIES if traits.of[key].present and key not in self.dead
        ]
        self._triads = [key for key in self._present if key in TRIADS]
        self._runs = self._longest_runs() if traits.has_noise else {}
        self._axis_runs = self._longest_axis_runs() if traits.has_noise else {}
        self._clips = {key: self._plateaus(traits.of[key]) for key in self._triads}
        self._lines = self._longest_lines() if traits.has_noise else {}
        self._wraps = self._axes_that_wrap()

    def _longest_runs(self) -> dict[str, int]:
        """Longest honest run of repetitions of the triads whose noise shows [rows]."""
        found = {}
        for key in self._triads:
            own = self._traits.of[key]
            repeats = own.repeats
            if repeats < MOST_REPEATED:
                found[key] = own.longest_run(repeats)
        return found

    def _longest_lines(self) -> dict[str, int]:
        """Longest honest run of readings on a line of the triads whose noise shows [rows]."""
        return {
            key: self._traits.of[key].longest_line
            for key in (self._triads if STRAIGHT not in self._belief.keep else ())
            if self._traits.of[key].line_chance < MOST_STRAIGHT
        }

    def _longest_axis_runs(self) -> dict[tuple[str, int], int]:
        """Longest honest run of repetitions of the axes whose noise shows [rows]."""
        found = {}
        for key in self._triads if STUCK not in self._belief.keep else ():
            own = self._traits.of[key]
            for axis, repeats in enumerate(own.axis_repeats):
                if repeats < SELDOM_AXIS:
                    longest = max(own.longest_run(float(repeats)), LEAST_AXIS_RUN)
                    found[key, axis] = longest * own.repeated.period
        return found

    def _axes_that_wrap(self) -> list[tuple[str, int]]:
        """Axes that may have run over the ends of their registers."""
        found = []
        for key in self._triads if WRAPPED not in self._belief.keep else ():
            own, least = self._traits.of[key], LEAST_FULL_SCALE.get(key, np.inf)
            for axis, (low, high) in enumerate(zip(own.low, own.high, strict=True)):
                if may_wrap(float(low), float(high), float(own.change[axis]), least):
                    found.append((key, axis))
        return found

    def _plateaus(self, own: QuantityTraits) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest readings that are clipped ones, shape (3,) each, infinite if none."""
        none = np.full(3, np.inf)
        least = LEAST_FULL_SCALE.get(own.key)
        stated = self._belief.range_of(own.key)
        if stated is not None:
            return -none, none
        if least is None or own.key not in self._runs or CLIPPED in self._belief.keep:
            return -none, none
        enough = max(PLATEAU, 2 * own.repeated.quantile(0.95) + 1)
        low = np.where((own.low < -least) & (own.low_run >= enough), own.low, -np.inf)
        return low, np.where((own.high > least) & (own.high_run >= enough), own.high, np.inf)

    def measures(self, key: str) -> bool:
        """Whether a quantity was measured at all."""
        return key in self._present

    @property
    def margin(self) -> int:
        """Neighbouring rows that matter on each side."""
        kinds = (self._runs, self._axis_runs, self._lines)
        runs = [run + 1 for kind in kinds for run in kind.values()]
        holes = [self._longest_hole(key) + 1 for key in self._present]
        holes += [LONGEST_WRAP] if self._wraps else []
        return min(max([int(NEARBY.max()) + 2, *runs, *holes]), LONGEST_RUN)

    def _longest_hole(self, key: str) -> int:
        """Rows in a row without a reading that are its lower rate and no fault."""
        period = self._traits.of[key].missing.period
        return 3 * period if period > 1 else 0

    @property
    def suspects(self) -> bool:
        """Whether any sample may be refused that a finding tells of: else nothing needs to be gone
        through again. What repeats over the end of a chunk counts as two runs here.
        """
        if self._frozen or self._wraps:
            return True
        for key in self._triads:
            own, (low, high) = self._traits.of[key], self._clips[key]
            widest = float((own.high - own.low).max())
            if own.zero or own.beyond or widest > SPIKE_SIZE[key]:
                return True
            if np.isfinite(low).any() or np.isfinite(high).any():
                return True
            if own.repeated.longest > self._runs.get(key, LONGEST_RUN):
                return True
            if own.straight.longest > self._lines.get(key, LONGEST_RUN):
                return True
        return any(
            self._traits.of[key].axis_run[axis] >= longest
            for (key, axis), longest in self._axis_runs.items()
        )

    @property
    def may_leave_range(self) -> bool:
        """Whether any reading may be one that a sensor gives beyond its range."""
        clipped = any(np.isfinite(ends).any() for ends in self._clips.values())
        stated = any(self._belief.range_of(key) is not None for key in self._triads)
        return bool(self._wraps) or clipped or stated or self._traits.saturated

    def slower(self) -> dict[str, float]:
        """Triads whose readings are new in one of several rows only, and in how many [rows]."""
        found: dict[str, float] = {}
        for key in () if self._frozen else self._triads:
            for runs in (self._traits.of[key].repeated, self._traits.of[key].missing):
                if runs.period > 1:
                    found[key] = runs.rows / max(runs.rows - runs.old, 1)
        return found

    def resampled(self) -> dict[str, float]:
        """Triads of which all but one of several readings lie on straight lines, and of how many
        [rows].
        """
        runs = {key: self._traits.of[key].straight for key in self._lines}
        return {
            key: own.rows / max(own.rows - own.old, 1)
            for key, own in runs.items()
            if own.period > 1
        }

    def doubt(self, samples: ImuSamples) -> Doubts:
        """What is doubtful; see `margin`.

        Args:
            samples: All, or a chunk with its neighbours.
        """
        doubts = Doubts.none(len(samples))
        for key in self.dead:
            doubts.unknown |= BIT[key]
        for key in self._present:
            self._unreadable(doubts, key, getattr(samples, key))
        for key in self._triads:
            self._clipped(doubts, key, getattr(samples, key))
        for key, axis in self._wraps:
            own = self._traits.of[key]
            column = getattr(samples, key)[:, axis]
            rows = wrapped_rows(column, float(own.low[axis]), float(own.high[axis]))
            if len(rows):
                doubts.add(WRAPPED, rows, key)
        self._marked(doubts, samples)
        self._zeros(doubts, samples)
        self._repeated(doubts, samples)
        self._straight(doubts, samples)
        self._axes(doubts, samples)
        for key in self._triads:
            self._spikes(doubts, key, getattr(samples, key))
        self._excluded(doubts, samples)
        return doubts

    def _unreadable(self, doubts: Doubts, key: str, array: np.ndarray) -> None:
        """What is not finite, no unit quaternion, or beyond what any sensor reads."""
        finite = finite_rows(array)
        if not finite.all():
            missing = np.flatnonzero(~finite)
            doubts.unknown[missing] |= BIT[key]
            long = _in_runs_over(missing, self._longest_hole(key))
            if len(long):
                doubts.add(NOT_FINITE, long, key)
        if key == "device_q":
            squares = np.einsum("ij,ij->i", array, array)
            off = np.abs(np.sqrt(squares) - 1) > NORM_TOLERANCE
            if off.any():
                doubts.add(NO_UNIT, off, key)
            return
        own = self._traits.of[key]
        rows = beyond_rows(array, MOST[key]) if own.beyond else np.zeros(0, dtype=int)
        if own.beyond > own.count / 2:  # its unit is another one, and only absurd numbers are none
            rows = rows[(np.abs(array[rows]) > ABSURD).any(axis=1)]
        if len(rows):
            doubts.add(BEYOND, rows, key)

    def _zeros(self, doubts: Doubts, samples: ImuSamples) -> None:
        """Rows of exactly 0.

        No force and no field are ever exactly 0; a rate is at rest, of a coarse gyroscope, but not
        while another triad reads 0, nor in the midst of a turn.
        """
        if ZEROS in self._belief.keep:
            return
        other = np.zeros(len(samples), dtype=bool)
        for key in self._triads:
            if key == "gyr" or not self._traits.of[key].zero:
                continue
            rows = zero_rows(getattr(samples, key))
            if len(rows):
                other[rows] = True
                doubts.add(ZEROS, rows, key)
        if "gyr" not in self._triads or not self._traits.of["gyr"].zero:
            return
        rows = zero_rows(samples.gyr)
        dropped = other[rows]
        if "gyr" in self._runs and len(rows):
            dropped |= _between_turns(samples.gyr, rows)
            dropped |= np.isin(rows, _in_runs_over(rows, self._runs["gyr"]), assume_unique=True)
        if dropped.any():
            doubts.add(ZEROS, rows[dropped], "gyr")

    def _repeated(self, doubts: Doubts, samples: ImuSamples) -> None:
        """Rows that repeat the ones before them for longer than noise can; old readings of a
        magnetometer that is slower than the rest.
        """
        if self._frozen:
            doubts.add(STUCK, np.ones(len(samples), dtype=bool), *self._triads)
            return
        own = self._traits.of["mag"]
        slow = "mag" in self._triads and own.repeated.period > 1
        wanted = [key for key in self._runs if STUCK not in self._belief.keep]
        repeats = {key: repeated_rows(getattr(samples, key)) for key in wanted}
        if slow and samples.mag is not None:
            rows = repeats["mag"] if "mag" in repeats else repeated_rows(samples.mag)
            doubts.unknown[rows] |= OLD_FIELD
        stuck = [(key, _in_runs_over(rows, self._runs[key] - 1)) for key, rows in repeats.items()]
        for key, rows in stuck:
            fillers = _fillers(getattr(samples, key), rows)
            if ZEROS in doubts.flags:
                fillers = fillers[~doubts.flags[ZEROS][fillers]]
            if len(fillers):
                _clear(doubts.flags, CLIPPED, fillers)
                doubts.add(STUCK, fillers, key)
        told = [doubts.flags[kind] for kind in (ZEROS, CLIPPED, SATURATED) if kind in doubts.flags]
        for key, rows in stuck:
            for flag in told:
                rows = rows[~flag[rows]]
            if len(rows):
                doubts.add(STUCK, rows, key)
                self._whole_board(doubts, samples, rows)

    def _axes(self, doubts: Doubts, samples: ImuSamples) -> None:
        """Rows in which one axis repeats for longer than its noise can, and others go on."""
        told = _any_of(doubts, (ZEROS, STUCK, CLIPPED, SATURATED, BEYOND, STRAIGHT))
        for (key, axis), longest in self._axis_runs.items():
            array, traits = getattr(samples, key), self._traits.of[key]
            column = array[:, axis]
            rows = np.flatnonzero(column[1:] == column[:-1]) + 1
            rows = _in_runs_over(rows, longest - 1)
            lengths = lengths_of(rows)
            first = np.cumsum(lengths) - lengths
            for begin, length in zip(rows[first], lengths, strict=True):
                own = slice(begin - 1, begin + length)
                # a run that is told in part is of that fault, and of readings that equal it
                if told[own].any() or self._is_plateau(traits, axis, float(column[begin])):
                    continue
                if (np.ptp(array[own], axis=0) > MOVES * traits.quantum).any():
                    doubts.add(STUCK_AXIS, np.arange(begin, begin + length), key)

    def _straight(self, doubts: Doubts, samples: ImuSamples) -> None:
        """Rows on straight lines for longer than noise can, and what of other triads is, too, as
        long as these rows last.
        """
        # what stands still in one axis, at the end of a range, leaves too little to noise
        told = _any_of(doubts, (ZEROS, STUCK, CLIPPED, SATURATED, BEYOND))
        found = {}
        for key, longest in self._lines.items():
            rows = straight_rows(getattr(samples, key), self._traits.of[key].line_tolerance)
            found[key] = _in_runs_over(rows[~told[rows]], longest)
        every = np.unique(np.concatenate([*found.values(), np.zeros(0, dtype=np.int64)]))
        if not len(every):
            return
        for key in self._triads:
            rows = found.get(key, every[:0])
            others = np.setdiff1d(every, rows, assume_unique=True)
            if len(others):
                own = self._traits.of[key]
                on = straight_rows(getattr(samples, key), own.line_tolerance)
                whole = np.isin(others, on, assume_unique=True)
                lengths = lengths_of(others)
                first = np.cumsum(lengths) - lengths
                together = np.logical_and.reduceat(whole, first)
                rows = np.union1d(rows, others[np.repeat(together, lengths)])
            if len(rows):
                doubts.add(STRAIGHT, rows, key)

    @staticmethod
    def _is_plateau(own: QuantityTraits, axis: int, value: float) -> bool:
        """Whether a reading may be a clipped one: the largest that a range leaves."""
        extreme = value in (own.low[axis], own.high[axis])
        return extreme and abs(value) >= LEAST_FULL_SCALE.get(own.key, np.inf)

    def _whole_board(self, doubts: Doubts, samples: ImuSamples, rows: np.ndarray) -> None:
        """Where everything repeats while one triad is stuck, all of it is stuck."""
        same = np.ones(len(rows), dtype=bool)
        for key in self._triads:
            array = getattr(samples, key)
            same &= (array[rows] == array[rows - 1]).all(axis=1)
        if same.any():
            doubts.add(STUCK, rows[same], *self._triads)

    def _clipped(self, doubts: Doubts, key: str, array: np.ndarray) -> None:
        """Readings at a stated full scale, or at a plateau."""
        stated, own = self._belief.range_of(key), self._traits.of[key]
        mark = CLIPPED_RATE if key == "gyr" else None
        if stated is not None:
            if max(float(own.high.max()), float(-own.low.min())) >= AT_FULL_SCALE * stated:
                rows = (np.abs(array) >= AT_FULL_SCALE * stated).any(axis=1)
                doubts.add(SATURATED, rows, key, mark=mark)
            return
        low, high = self._clips[key]
        for axis in np.flatnonzero(np.isfinite(low) | np.isfinite(high)):
            column = array[:, axis]
            rows = (column <= low[axis]) | (column >= high[axis])
            if rows.any():
                doubts.add(CLIPPED, rows, key, mark=mark)

    def _spikes(self, doubts: Doubts, key: str, array: np.ndarray) -> None:
        """Single readings far from both neighbours, among readings that are not."""
        own, size = self._traits.of[key], SPIKE_SIZE[key]
        if SPIKE in self._belief.keep or own.beyond > own.count / 2:
            return
        if own.repeated.period > 1 or not float((own.high - own.low).max()) > size:
            return
        bad = np.flatnonzero(doubts.unknown & BIT[key])
        if len(bad):
            array = array.copy()
            array[bad] = np.nan
        jump = np.abs(array[1:-1] - 0.5 * (array[2:] + array[:-2]))
        jump = np.fmax(np.fmax(jump[:, 0], jump[:, 1]), jump[:, 2])
        rows = np.flatnonzero(jump > size)
        if not len(rows):
            return
        around = rows[:, None] + NEARBY
        inside = (around >= 0) & (around < len(jump))
        nearby = jump[np.clip(around, 0, len(jump) - 1)]
        # up to seven rows to either side; of those that are unknown nothing is said
        most = np.fmax.reduce(np.where(inside, nearby, 0.0), axis=1, initial=0.0)
        enough = (inside & np.isfinite(nearby)).sum(axis=1) >= len(NEARBY) // 2
        alone = enough & (jump[rows] > SPIKE_FACTOR * most)
        beside = np.fmax(jump[np.maximum(rows - 1, 0)], jump[np.minimum(rows + 1, len(jump) - 1)])
        alone &= jump[rows] >= beside
        if alone.any():
            doubts.add(SPIKE, rows[alone] + 1, key)

    def _marked(self, doubts: Doubts, samples: ImuSamples) -> None:
        """What the sensor itself marks as saturated, of the triad that is at its largest."""
        marked = np.flatnonzero(samples.saturated)
        if not len(marked):
            return
        found = np.zeros(len(marked), dtype=bool)
        for key in self._triads:
            own, readings = self._traits.of[key], getattr(samples, key)[marked]
            extreme = (readings >= AT_EXTREME * np.abs(own.high)) | (
                readings <= -AT_EXTREME * np.abs(own.low)
            )
            here = extreme.any(axis=1)
            if key != "mag":
                here &= (np.abs(readings) > LEAST_FULL_SCALE[key]).any(axis=1)
            found |= here
            mark = CLIPPED_RATE if key == "gyr" else None
            if here.any():
                doubts.add(SATURATED, marked[here], key, mark=mark)
        if not found.all():
            doubts.add(SATURATED, marked[~found], mark=CLIPPED_RATE)

    def _excluded(self, doubts: Doubts, samples: ImuSamples) -> None:
        """What a person takes out."""
        for exclusion in self._belief.exclude:
            begin, end = exclusion.from_s * NANOSECONDS, exclusion.to_s * NANOSECONDS
            rows = (samples.host_time_ns >= begin) & (samples.host_time_ns <= end)
            if rows.any():
                doubts.add(EXCLUDED + exclusion.reason, rows, *self._present)


def doubts_on(samples: ImuSamples, belief: Belief) -> Doubts:
    """What is doubtful in a whole recording.

    Args:
        samples: As recorded.
        belief: What a person says of them.
    """
    return Gates(Traits(belief.has_noise).add(samples), belief).doubt(samples)


def without(samples: ImuSamples, unknown: np.ndarray, for_filters: bool = False) -> ImuSamples:
    """Samples whose unknown quantities are NaN.

    Args:
        samples: As recorded.
        unknown: Marks as in `Doubts`, shape (n,).
        for_filters: Whether they are for a filter, which takes a clipped rate as it is, and no
            field that only repeats an earlier one.
    """
    if not unknown.any():
        return samples
    marks = dict(BIT)
    if for_filters:
        marks["mag"] |= OLD_FIELD
    else:
        marks["gyr"] |= CLIPPED_RATE
    changed = {}
    for key, mark in marks.items():
        array = getattr(samples, key)
        rows = np.flatnonzero(unknown & mark)
        if array is not None and len(rows):
            changed[key] = array.copy()
            changed[key][rows] = np.nan
    return replace(samples, **changed)


def _fillers(array: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows of runs whose reading stands far off the ones before and after, with the first of each:
    a number that the logger put in, such as -1, and none that was measured.

    Args:
        array: Shape (n, 3).
        rows: That repeat the one before, increasing, shape (k,).
    """
    lengths = lengths_of(rows)
    first = rows[np.cumsum(lengths) - lengths] - 1
    inside = (first >= FILLER_NEAR) & (first + lengths + 1 < len(array))
    first, lengths = first[inside], lengths[inside]
    near = array[first[:, None] - np.arange(1, FILLER_NEAR + 1)]
    usual = np.abs(np.diff(near, axis=1)).max(axis=(1, 2), initial=0.0)
    into = np.abs(array[first] - array[first - 1]).max(axis=1)
    out = np.abs(array[first + lengths + 1] - array[first]).max(axis=1)
    with np.errstate(invalid="ignore"):
        odd = np.minimum(into, out) > FILLER_STEPS * usual
    return np.concatenate(
        [np.arange(a, a + n + 1) for a, n in zip(first[odd], lengths[odd], strict=True)]
        or [np.zeros(0, dtype=np.int64)]
    )


def _any_of(doubts: Doubts, reasons: Sequence[str]) -> np.ndarray:
    """Samples that are doubted for any of some reasons, shape (n,), bool."""
    found = np.zeros(len(doubts.unknown), dtype=bool)
    for reason in reasons:
        found |= doubts.flags.get(reason, False)
    return found


def _clear(flags: dict[str, np.ndarray], reason: str, rows: np.ndarray) -> None:
    """Take back a reason for some rows."""
    if reason in flags:
        flags[reason][rows] = False
        if not flags[reason].any():
            del flags[reason]


def _in_runs_over(rows: np.ndarray, longest: int) -> np.ndarray:
    """Those numbers that stand in runs of consecutive ones longer than this.

    Args:
        rows: Increasing, shape (k,).
        longest: Length of a run that is none of them.
    """
    if longest < 1 or not len(rows):
        return rows
    lengths = lengths_of(rows)
    return rows[np.repeat(lengths > longest, lengths)]


def _between_turns(gyr: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Which rows of zeros stand between rates that are far from 0, shape (k,), bool.

    Args:
        gyr: Shape (n, 3) [rad/s].
        rows: Of zeros, increasing, shape (k,).
    """
    lengths = lengths_of(rows)
    ends = np.cumsum(lengths) - 1
    first, last = rows[ends - lengths + 1], rows[ends]
    before, after = first - 1, last + 1
    inside = (before >= 0) & (after < len(gyr))
    before, after = np.maximum(before, 0), np.minimum(after, len(gyr) - 1)
    alive = [np.abs(gyr[beside]).max(axis=1) > ALIVE for beside in (before, after)]
    return np.asarray(np.repeat(inside & alive[0] & alive[1], lengths))
