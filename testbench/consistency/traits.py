"""Traits of a sensor's readings: what must be known of a whole recording before a single sample can
be doubted, learned chunk by chunk.

A reading that repeats is a lie only of a triad whose noise cannot repeat. How large the noise is
shows in differences of high order: those of white noise grow with the order, those of a motion
shrink.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from testbench.consistency.straight import chance_of, straight_rows, tolerance_of
from testbench.consistency.wraps import largest_change
from testbench.frames import STANDARD_GRAVITY
from testbench.records.session.samples import ImuSamples

TRIADS = ("gyr", "acc", "mag")
QUANTITIES = (*TRIADS, "device_q")
MOST = {"gyr": np.radians(4000.0), "acc": 200 * STANDARD_GRAVITY, "mag": 5000.0}
"""Beyond these no sensor of motion reads [rad/s], [m/s^2], [uT]: +-4000 deg/s (TDK ICM-20649, ST
LSM6DSV), +-200 g (Analog Devices ADXL375), +-4912 uT (AKM AK8963), by their data sheets.
"""
ABSURD = 1e9
"""Beyond this a number is no reading in any unit; the mean of any with one is not used, either."""
BLOCK, BLOCKS, MOST_BLOCKS = 64, 32, 512
"""Rows of a block that tells the noise, blocks of a chunk, and of a recording."""
ENOUGH_BLOCKS, FURTHER_BLOCKS = 64, 8
"""Once so many are known, a chunk adds fewer."""
WHITE = 1.4
"""The median of fourth differences over that of third ones, above which they are noise: 1.87 for
white noise, sqrt(70 / 20), and at most 1 for a motion that is sampled six times a period.
"""
FOURTH = 0.6745 * np.sqrt(70.0)
"""Median magnitude of the fourth difference of white noise of standard deviation 1: a normal's
median magnitude, and the square sum of the coefficients 1, 4, 6, 4, 1.
"""
MOST_REPEATED = 0.1
"""A triad whose noise repeats a reading more often than this may stand still for long."""
SELDOM_AXIS, FEWEST_OF_AXIS = 0.5, 100
"""An axis whose noise repeats a reading more often than this may stand still for long; and so many
readings, at least, tell that one stands still.
"""
RARE = 1e-3
"""Runs of repetitions that noise alone gives in a recording are to be rarer than this."""
SHORTEST_RUN = 5
"""This many identical readings in a row, at least, are stuck."""
SHORTEST_LINE = 4
"""This many readings in a row, at least, on a straight line were put in for lost ones; fewer are as
good as what a filter would put there.
"""
MOST_STRAIGHT = 0.3
"""A triad whose noise sets more of its readings on lines by itself is too coarse to be asked."""
LONGEST_RUN = 4096
NO_ROWS = np.zeros(0, dtype=int)
SELDOM = 0.3
"""Where more than this of the rows bring nothing new of a quantity, it may be slower than the
others.
"""


class RunLengths:
    """Lengths of the runs of rows that bring nothing new, as a histogram."""

    def __init__(self) -> None:
        self._counts = np.zeros(LONGEST_RUN + 1, dtype=np.int64)
        self.rows = self.old = 0

    def add(self, old: np.ndarray, rows: int) -> None:
        """Count the next rows.

        Args:
            old: Indices of the rows that bring nothing new, increasing, shape (k,).
            rows: How many rows there are.
        """
        self.rows, self.old = self.rows + rows, self.old + len(old)
        if not len(old):
            self._counts[1] += rows
            return
        lengths = 1 + lengths_of(old)
        self._counts += np.bincount(np.minimum(lengths, LONGEST_RUN), minlength=LONGEST_RUN + 1)
        self._counts[1] += max(rows - len(old) - len(lengths), 0)

    def quantile(self, part: float) -> int:
        """Rows from one new reading to the next that so many runs do not exceed."""
        total = np.cumsum(self._counts)
        return max(int(np.searchsorted(total, part * total[-1])), 1) if total[-1] else 1

    @property
    def longest(self) -> int:
        """Rows from one new reading to the next, at most."""
        return int(np.flatnonzero(self._counts)[-1]) if self._counts.any() else 0

    @property
    def period(self) -> int:
        """Longest usual distance of new readings where they come at a lower rate; else 1 [rows]."""
        if self.old <= SELDOM * self.rows:
            return 1
        middle, long = self.quantile(0.5), self.quantile(0.95)
        return long if middle >= 2 and long <= 2 * middle + 1 else 1


def lengths_of(rows: np.ndarray) -> np.ndarray:
    """Lengths of the runs of consecutive numbers, shape (m,).

    Args:
        rows: Increasing, shape (k,).
    """
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    starts = np.flatnonzero(np.diff(rows, prepend=rows[0] - 2) != 1)
    return np.diff(np.append(starts, len(rows)))


def longest_of(rows: np.ndarray) -> int:
    """Length of the longest run of consecutive numbers, 0 if there are none.

    Args:
        rows: Increasing, shape (k,).
    """
    if len(rows) and not (rows[1:] - rows[:-1] == 1).any():
        return 1
    return int(lengths_of(rows).max(initial=0))


@dataclass
class QuantityTraits:
    """What is known of one quantity.

    Attributes:
        key: Which it is, of `QUANTITIES`.
        repeated: Runs of identical readings.
        missing: Runs of rows without a reading.
        straight: Runs of readings on a straight line between others.
        zero: Rows that read exactly 0 in every axis.
        beyond: Rows beyond what any sensor reads.
        low: Smallest reading of each axis, shape (k,).
        high: Largest reading of each axis, shape (k,).
        low_run: Longest run of rows at the smallest reading, shape (k,).
        high_run: Longest run of rows at the largest reading, shape (k,).
        axis_run: Longest run of repetitions of each axis, shape (k,).
        change: Largest change of each axis from a row to the next, shape (k,).
        twins: Pairs of axes that read the same in every row.
    """

    key: str
    repeated: RunLengths = field(default_factory=RunLengths)
    missing: RunLengths = field(default_factory=RunLengths)
    straight: RunLengths = field(default_factory=RunLengths)
    zero: int = 0
    beyond: int = 0
    low: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))
    high: np.ndarray = field(default_factory=lambda: np.full(3, -np.inf))
    low_run: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    high_run: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    axis_run: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    change: np.ndarray = field(default_factory=lambda: np.zeros(3))
    twins: list[tuple[int, int]] = field(default_factory=lambda: [(0, 1), (0, 2), (1, 2)])
    _noise: list[np.ndarray] = field(default_factory=list)
    _waiting: list[np.ndarray] = field(default_factory=list)
    _quantum: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))
    _last: np.ndarray | None = None

    def add(self, array: np.ndarray) -> None:
        """Take note of the next readings.

        Args:
            array: Shape (n, k).
        """
        rows = len(array)
        if not rows:
            return
        low, high = _ends(array)
        whole = bool(np.isfinite([low, high]).all())
        missing = NO_ROWS if whole else np.flatnonzero(~finite_rows(array))
        self.missing.add(missing, rows)
        held = np.flatnonzero(array[1:, 0] == array[:-1, 0])
        self.repeated.add(repeated_rows(array, self._last, held), rows - len(missing))
        self._last = array[-1:].copy()
        if self.key == "device_q" or len(missing) == rows:
            return
        known = array
        if not whole:
            known = np.delete(array, missing, axis=0)
            low, high = _ends(known)
        self.zero += len(zero_rows(known)) if low[0] <= 0 <= high[0] else 0
        if max(high.max(), -low.min()) > MOST[self.key]:
            beyond = beyond_rows(known, MOST[self.key])
            self.beyond += len(beyond)
            known = np.delete(known, beyond, axis=0)
            if not len(known):
                return
            low, high = _ends(known)
        self.twins = [
            pair for pair in self.twins if np.array_equal(known[:, pair[0]], known[:, pair[1]])
        ]
        self._extremes(known, low, high, held if known is array else None)
        self._blocks(known, self.repeated.period)
        self._lines(known)

    def _extremes(
        self, array: np.ndarray, low: np.ndarray, high: np.ndarray, first: np.ndarray | None
    ) -> None:
        """Note the ends of the readings, and for how long they stay there or anywhere.

        Args:
            array: Shape (n, k).
            low: Smallest reading of each axis, shape (k,).
            high: Largest, shape (k,).
            first: Rows whose first axis reads as in the row after, where that is known.
        """
        for k, column in enumerate(array.T):
            held = first if k == 0 else None
            if held is None:
                held = np.flatnonzero(column[1:] == column[:-1])
            self.axis_run[k] = max(int(self.axis_run[k]), longest_of(held))
            self.change[k] = max(float(self.change[k]), largest_change(column))
        for extreme, own, runs, beats in (
            (low, self.low, self.low_run, low < self.low),
            (high, self.high, self.high_run, high > self.high),
        ):
            runs[beats] = 0
            own[beats] = extreme[beats]
            for axis in np.flatnonzero(extreme == own):
                runs[axis] = max(
                    int(runs[axis]), longest_of(np.flatnonzero(array[:, axis] == own[axis]))
                )

    def _blocks(self, array: np.ndarray, period: int) -> None:
        """Noise of some blocks of rows, by axis; of new readings only where they come seldom."""
        if period > 1:
            array = np.delete(array[: BLOCKS * BLOCK * period], _old(array, period), axis=0)
        if len(array) < 8:
            return
        size = min(BLOCK, len(array))
        enough = sum(map(len, self._noise)) >= ENOUGH_BLOCKS
        wanted = FURTHER_BLOCKS if enough else BLOCKS
        begins = np.unique(np.linspace(0, len(array) - size, wanted).astype(int))
        if self._waiting and self._waiting[0].shape[1] != size:
            self._measure()
        self._waiting.append(array[begins[:, None] + np.arange(size)])
        if not enough or sum(map(len, self._waiting)) >= ENOUGH_BLOCKS:
            self._measure()

    def _measure(self) -> None:
        """Tell the noise of the blocks that wait: of many at once, for that takes hardly longer."""
        if not self._waiting:
            return
        blocks, self._waiting = np.concatenate(self._waiting), []
        first = np.abs(np.diff(blocks, axis=1))
        changes = first.max(axis=(1, 2)) > 0
        first, blocks = first[changes], blocks[changes]
        if not len(blocks):
            return
        first[first == 0] = np.inf
        self._quantum = np.minimum(self._quantum, first.min(axis=(0, 1)))
        third = np.diff(blocks, 3, axis=1)
        fourth = np.median(np.abs(np.diff(third, axis=1)), axis=1)
        is_noise = fourth > WHITE * np.median(np.abs(third), axis=1)
        # several runs of repetitions within a block are those of a coarse reading, not a dropout
        same = (first == np.inf).all(axis=2)
        runs = same[:, 0] + (same[:, 1:] & ~same[:, :-1]).sum(axis=1)
        still = (fourth == 0) & (runs >= 3)[:, None]
        self._noise.append(np.where(is_noise | still, fourth / FOURTH, np.nan))
        if sum(map(len, self._noise)) > MOST_BLOCKS:
            self._noise = [np.concatenate(self._noise)[::2]]

    def _lines(self, known: np.ndarray) -> None:
        """Readings on straight lines, once noise shows that does not lie on them by itself."""
        noise = self.noise
        if chance_of(noise, self._quantum) < MOST_STRAIGHT:
            rows = straight_rows(known, tolerance_of(noise, self._quantum))
            self.straight.add(rows, len(known))

    @property
    def present(self) -> bool:
        """Whether there is any reading."""
        return self.missing.rows > self.missing.old

    @property
    def count(self) -> int:
        """Rows with a reading."""
        return self.missing.rows - self.missing.old

    @property
    def all_zero(self) -> bool:
        """Whether it reads exactly 0 throughout: the file lacks it and says so by zeros."""
        return self.present and self.zero == self.count

    @property
    def constant(self) -> bool:
        """Whether it never changes."""
        return self.count > 1 and bool((self.low == self.high).all())

    @property
    def repeats(self) -> float:
        """How probably its noise repeats a reading in all axes; 1 where no noise is seen."""
        return float(np.prod(self.axis_repeats))

    @property
    def axis_repeats(self) -> np.ndarray:
        """How probably the noise of each axis repeats its reading, shape (k,); 1 where none is
        seen.

        Two readings of normal noise of standard deviation s round to the same multiple of q with
        a probability of about q / (2 s sqrt(pi)).
        """
        found = np.ones(len(self.low))
        noise = self.noise
        seen = (noise > 0) & np.isfinite(self._quantum)
        found[seen] = self._quantum[seen] / (2 * noise[seen] * np.sqrt(np.pi))
        return np.asarray(np.minimum(found, 1.0))

    @property
    def noise(self) -> np.ndarray:
        """Standard deviation of each axis where it is quiet, shape (k,); 0 where none is seen."""
        self._measure()
        found = np.zeros(len(self.low))
        if not self._noise:
            return found
        noise = np.concatenate(self._noise)
        seen = np.isfinite(noise)
        for axis in range(noise.shape[1]):
            own = noise[seen[:, axis], axis]
            found[axis] = float(np.quantile(own, 0.25)) if len(own) else 0.0
        return found

    @property
    def line_tolerance(self) -> np.ndarray:
        """Largest second difference of each axis on a straight line, shape (k,)."""
        return tolerance_of(self.noise, self._quantum)

    @property
    def line_chance(self) -> float:
        """How probably its noise sets a reading on a straight line in all axes."""
        return chance_of(self.noise, self._quantum)

    @property
    def longest_line(self) -> int:
        """Readings in a row on a line that noise, or a lower rate, may give [rows]."""
        by_noise = np.log(max(self.count, 2) / RARE) / -np.log(max(self.line_chance, 1e-12))
        lower = 3 * self.straight.period if self.straight.period > 1 else 0
        return max(SHORTEST_LINE - 1, lower, int(np.ceil(by_noise)))

    @property
    def quantum(self) -> np.ndarray:
        """Smallest change of each axis, infinite where none was seen, shape (k,)."""
        self._measure()
        return self._quantum

    @property
    def dead_axes(self) -> list[int]:
        """Axes that never change while the noise of another shows."""
        same = self.low == self.high
        lively = self.axis_repeats[~same] < SELDOM_AXIS
        if self.count < FEWEST_OF_AXIS or not same.any() or not lively.any():
            return []
        return [int(axis) for axis in np.flatnonzero(same)]

    @property
    def twin_axes(self) -> list[int]:
        """Axes that read the same as another in every row, though their noise shows."""
        if self.count < FEWEST_OF_AXIS:
            return []
        noisy = self.axis_repeats < SELDOM_AXIS
        return sorted({axis for pair in self.twins for axis in pair if noisy[list(pair)].all()})

    def longest_run(self, repeats: float) -> int:
        """Readings in a row that noise of such a probability of repetition may give."""
        by_noise = 1 + 1.5 * np.log(max(self.count, 2) / RARE) / -np.log(max(repeats, 1e-12))
        usual = self.repeated.quantile(0.95)
        return max(SHORTEST_RUN, 3 * usual + 1 if usual > 1 else 0, int(np.ceil(by_noise))) - 1


class Traits:
    """What is known of all quantities of a recording.

    Args:
        has_noise: False for a model without noise, which no repetition can be held against.

    Attributes:
        has_noise: See above.
        of: By quantity.
        saturated: Whether the sensor itself marks any sample as saturated.
    """

    def __init__(self, has_noise: bool = True):
        self.has_noise, self.saturated = has_noise, False
        self.of = {key: QuantityTraits(key) for key in QUANTITIES}

    def add(self, samples: ImuSamples) -> Traits:
        """Take note of the next samples."""
        self.saturated = self.saturated or bool(samples.saturated.any())
        for key, own in self.of.items():
            array = getattr(samples, key)
            if array is not None:
                own.add(array)
        return self

    @property
    def dead(self) -> set[str]:
        """Triads that never measured anything: a force or a field of 0 throughout, or any that is
        the same throughout while the noise of another shows.
        """
        present = [own for key, own in self.of.items() if key in TRIADS and own.present]
        noisy = self.has_noise and any(own.repeats < MOST_REPEATED for own in present)
        return {
            own.key
            for own in present
            if own.constant and (noisy or (own.all_zero and own.key != "gyr"))
        } | {*self.dead_axes, *self.twin_axes}

    @property
    def dead_axes(self) -> dict[str, list[int]]:
        """Triads of which some axes, not all, never measured anything; they are not used."""
        found = {key: self.of[key].dead_axes for key in TRIADS if self.has_noise}
        return {key: axes for key, axes in found.items() if axes}

    @property
    def twin_axes(self) -> dict[str, list[int]]:
        """Triads of which some axes hold the same numbers; they are not used."""
        found = {key: self.of[key].twin_axes for key in TRIADS if self.has_noise}
        return {key: axes for key, axes in found.items() if axes}

    @property
    def frozen(self) -> bool:
        """Whether nothing ever changes, of a sensor whose readings must."""
        present = [own for key, own in self.of.items() if key in TRIADS and own.present]
        living = [own for own in present if own.key not in self.dead]
        enough = all(own.count > SHORTEST_RUN for own in living)
        return bool(self.has_noise and living and enough and all(own.constant for own in living))


def _ends(array: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest reading of each axis, shape (k,) each; one is not finite where any is
    not.

    Args:
        array: Shape (n, k).
    """
    with np.errstate(invalid="ignore"):
        # column by column: ten times as fast as along an axis of three
        low = np.array([column.min() for column in array.T])
        high = np.array([column.max() for column in array.T])
    return low, high


def finite_rows(array: np.ndarray) -> np.ndarray:
    """Rows that are finite throughout, shape (n,), bool; twice as fast as all(axis=1).

    Args:
        array: Shape (n, k).
    """
    finite = np.isfinite(array[:, 0])
    for column in array.T[1:]:
        finite &= np.isfinite(column)
    return finite


def _all_of(array: np.ndarray, rows: np.ndarray, value: np.ndarray | float) -> np.ndarray:
    """Those of some rows that equal a value in the further axes, too."""
    for axis in range(1, array.shape[1]):
        if not len(rows):
            break
        wanted = value[rows, axis] if isinstance(value, np.ndarray) else value
        rows = rows[array[rows, axis] == wanted]
    return rows


def zero_rows(array: np.ndarray) -> np.ndarray:
    """Rows that are exactly 0 in every axis, increasing.

    Args:
        array: Shape (n, k).
    """
    return _all_of(array, np.flatnonzero(array[:, 0] == 0), 0.0)


def repeated_rows(
    array: np.ndarray, before: np.ndarray | None = None, first: np.ndarray | None = None
) -> np.ndarray:
    """Rows that equal the one before them, increasing.

    Args:
        array: Shape (n, k).
        before: The row before the first, shape (1, k), or None.
        first: Rows whose first axis reads as in the row after, shape (m,); found if None.
    """
    if first is None:
        first = np.flatnonzero(array[1:, 0] == array[:-1, 0])
    rows = _all_of(array[1:], first, array[:-1]) + 1
    if before is not None and len(array) and bool((array[:1] == before).all()):
        rows = np.concatenate([[0], rows])
    return rows


def beyond_rows(array: np.ndarray, most: float) -> np.ndarray:
    """Rows with a reading beyond a limit, increasing; NaN is not beyond.

    Args:
        array: Shape (n, k).
        most: The limit.
    """
    if not len(array):
        return NO_ROWS
    largest, smallest = np.fmax.reduce(array, axis=None), np.fmin.reduce(array, axis=None)
    if not (largest > most or smallest < -most):
        return NO_ROWS
    return np.flatnonzero((np.abs(array) > most).any(axis=1) & finite_rows(array))


def _old(array: np.ndarray, period: int) -> np.ndarray:
    return repeated_rows(array[: BLOCKS * BLOCK * period])
