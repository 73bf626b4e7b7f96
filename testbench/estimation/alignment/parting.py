"""Stretches in which a truth and a gyroscope part, though both turn alike elsewhere.

Steps that are too small to show in single turns are looked for first, and slow partings in what
lies between them. A body that slips under its markers, a reference that drifts, a gyroscope that
was clipped before a low pass, or disturbed: none of them jumps, and each puts an error into all
that is judged from there on. Seen by rates alone it is nobody's fault in particular: both are
named. What lasts from beginning to end is not told from a bias.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.alignment.axes import true_rates
from testbench.estimation.alignment.sharp_steps import Differences, find_step
from testbench.estimation.alignment.slipped_mounting import (
    LEAST,
    LEAST_SIDE_S,
    SWAPPED_S,
    find_changed_map,
    find_swap,
)
from testbench.estimation.signals.segmentation import detect_static, intervals_of
from testbench.estimation.signals.truth_turning import Turning
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.truth import truth_at
from testbench.model.windows import moving_mean
from testbench.records.session.samples import ImuSamples, Truth

OVER_S = 0.05
"""Rates are compared as means over so long [s]."""
FEWEST = 100
"""Intervals that a fit of rates to rates needs: twelve numbers in each axis' equations."""
MOST_TURN = np.radians(30.0)
"""Over an interval in which a body turns further, a mean rate is no turn any more [rad]: what axes
that change leave is of second order, 4 % of it.
"""
ROUNDS, KEPT = 3, 0.8
"""The fit is made so many times, again to the part of the intervals that fitted best [1]."""
BLOCK_S = 2.0
"""The bias is told from sums over so long, in which what either is late by averages out [s]."""
SPANS_S = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
"""Over so long it is asked whether both part, and over twice the last again and again, as far as a
recording lasts [s].
"""
SETTLED_S = 1.0
"""What either is late by, or rings, has gone after so long [s]."""
DRIFT = np.radians(0.1)
"""What a bias may wander by [rad/s]: a tenth of a degree per second is the g-sensitivity and the
warming of a consumer part (TDK ICM-20948, DS-000189: 0.1 deg/s/g typical of its kind).
"""
NONLINEAR = 0.003
"""Part of its path by which a gyroscope's turn is wrong beyond any linear map [1]: data sheets give
0.1 to 0.2 % of full scale (TDK MPU-6050, PS-MPU-6000A-00, 6.1: 0.2 %).
"""
USUAL, QUIET = 3.0, 0.3
"""A change counts that is so many times the median one over the shortest span, where errors walk at
random: times the root of the span; and as many times that which so many over the same span stay
below, so that a drift may last for half of a recording.
"""
USUAL_BIAS = np.radians(2.0)
"""What a map of rates may leave of a bias [rad/s]."""
EXPLAINED = 0.5
"""A drift is parted from a bias where that leaves less than so much of the squares [1]: where a
body hardly turns, both together explain any error.
"""
LONGEST_SLIP_S = 40.0
"""A body slips within so long, or step by step [s]."""
BESIDE_S = 10.0
"""Both are looked at from so long before a stretch until as long after it [s]."""
TOGETHER, LEAST_TOGETHER = 0.15, np.radians(1.5)
"""They part, or meet, where they are so much of the whole parting from their mean, or so far [1,
rad].
"""
FLAT = 0.3
"""Of a steady drift, neighbouring quarters of what looks alike differ by half of what counts as
that; where all do by this part of it, nothing is alike [1].
"""
AT_REST = np.radians(0.5)
"""What a bias at rest differs by from that in motion [rad/s]."""
FEWEST_RESTS, REST_S = 3, 1.0
"""So many rests of so long tell what a gyroscope reads at rest [1, s]."""
LEAST_PART_S = 20.0
"""What is left beside a parting is asked again if it lasts longer [s]."""
MOST_PARTINGS, MOST_STEPS = 5, 30


@dataclass(frozen=True)
class Parting:
    """A stretch in which both part.

    Attributes:
        angle: How far [rad].
        begin_ns: On the host's clock.
        end_ns: Likewise.
        sharp: Whether it is a step.
    """

    angle: float
    begin_ns: int
    end_ns: int
    sharp: bool = False


@dataclass(frozen=True)
class _Intervals:
    """Truth and gyroscope over intervals of one width.

    Attributes:
        time_ns: Middle of each on the host's clock, increasing, shape (n,) [ns].
        rate: True mean rate in the body, shape (n, 3) [rad/s].
        design: What the gyroscope reads on the mean, and 1, shape (n, 4) [rad/s].
        q: The truth in the middle of each, shape (n, 4).
        rows: Sample in the middle of each, shape (n,).
        samples: Readings of all samples, and 1, shape (m, 4) [rad/s].
        samples_ns: Their instants, shape (m,) [ns].
        width: Of an interval [s].
        rest: What it reads at rest, and 1, shape (4,) [rad/s]; NaN where it does not rest.
        rest_sd: By how much that differs from rest to rest [rad/s].
    """

    time_ns: np.ndarray
    rate: np.ndarray
    design: np.ndarray
    q: np.ndarray
    rows: np.ndarray
    samples: np.ndarray
    samples_ns: np.ndarray
    width: float
    rest: np.ndarray
    rest_sd: float

    @staticmethod
    def of(samples: ImuSamples, time_ns: np.ndarray, truth: Truth) -> _Intervals | None:
        """Those at which both are known; None where these are too few."""
        known = np.isfinite(samples.gyr).all(axis=1)
        if known.sum() < FEWEST:
            return None
        step = median_interval(time_ns) / NANOSECONDS
        count = max(round(OVER_S / max(step, 1e-6)) // 2 * 2 + 1, 1)
        gyr = np.where(known[:, None], samples.gyr, 0.0)
        mean, whole = moving_mean(gyr, count), moving_mean(known, count) > 0.999
        rows = np.arange(count // 2, len(gyr), count)
        rate, sound = true_rates(replace(truth, rate=None), time_ns[rows], count * step)
        q = truth_at(truth, time_ns[rows])
        half = count // 2
        spans = time_ns[np.minimum(rows + half, len(gyr) - 1)] - time_ns[rows - half]
        sound &= spans < (count + 0.5) * step * NANOSECONDS  # no hole without rows within
        sound &= whole[rows] & np.isfinite(q[:, 0])
        if sound.sum() < FEWEST:
            return None
        rows = rows[sound]
        return _Intervals(
            time_ns[rows],
            rate[sound],
            _with_one(mean[rows]),
            q[sound],
            rows,
            _with_one(gyr),
            time_ns,
            count * step,
            *_read_at_rest(samples.gyr, step),
        )

    def between(self, first: int, end: int) -> _Intervals:
        """Those from one to another."""
        part = slice(first, end)
        return replace(
            self,
            time_ns=self.time_ns[part],
            rate=self.rate[part],
            design=self.design[part],
            q=self.q[part],
            rows=self.rows[part],
        )

    def apart(
        self, fitted: np.ndarray, where: slice = slice(None)
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """How far both are from one another, by a map of the rates.

        Args:
            fitted: Makes true rates of readings and 1, shape (4, 3).
            where: Intervals at which that holds, but for a bias.

        Returns:
            Sum of what turns the gyroscope's world to the truth's, shape (n, 3) [rad], and the path
            that the gyroscope has turned, with what its sampling may be wrong by put to it, shape
            (n,) [rad]; whether the world of the truth drifts throughout.
        """
        rate = self.samples @ fitted
        turned = Turning.of(rate, self.samples_ns)
        middle = _in_the_middle(turned, rate, self.rows)
        apart = rotation.multiply(self.q, rotation.conjugate(middle))
        changes = rotation.multiply(apart[1:], rotation.conjugate(apart[:-1]))
        changes = rotation.to_rotation_vector(changes)
        changes[np.diff(self.time_ns) > 1.5 * self.width * NANOSECONDS] = 0.0
        body = rotation.to_matrix(self.q[1:])
        known = -self.rest @ fitted, max(self.rest_sd, AT_REST)
        if not np.isfinite(self.rest).all():
            known = np.zeros(3), USUAL_BIAS
        bias, drifts = _bias(changes[where], body[where], self.width, known)
        changes -= body @ bias * self.width
        wrong = turned.coning + _unresolved(turned, rate)
        path = turned.slow_path[self.rows] + wrong[self.rows] / NONLINEAR
        return np.concatenate([np.zeros((1, 3)), np.cumsum(changes, axis=0)]), path, drifts


def _in_the_middle(turned: Turning, rate: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Orientations at the instants that mean rates are of, shape (k, 4); `Turning` has them at the
    ends of the intervals.

    Args:
        turned: By rates.
        rate: These, shape (n, 3) [rad/s].
        rows: Of them, shape (k,).
    """
    half = median_interval(turned.time_ns) / NANOSECONDS / 2
    back = rotation.from_rotation_vector(-half * rate[rows])
    return rotation.multiply(turned.q[rows], back)


def _unresolved(turned: Turning, rate: np.ndarray) -> np.ndarray:
    """How far a gyroscope's turn may be wrong since the beginning for what its rate does between
    its samples, shape (n,) [rad].

    By every second sample it would turn otherwise: of a rule of second order by three times what
    all of them are wrong by (Richardson, Phil. Trans. R. Soc. A 210, 1911), of which half is
    allowed.

    Args:
        turned: By all samples.
        rate: These, shape (n, 3) [rad/s].
    """
    odd = np.arange(1, len(rate), 2)
    nothing = np.zeros(len(rate))
    if len(odd) < FEWEST:
        return nothing
    half = Turning.of(rate[odd - 1], turned.time_ns[odd - 1])
    # the end of an interval of two is the middle of its second sample's
    apart = rotation.multiply(_in_the_middle(turned, rate, odd), rotation.conjugate(half.q))
    changes = rotation.multiply(apart[1:], rotation.conjugate(apart[:-1]))
    changes = rotation.to_rotation_vector(changes)
    seconds = np.diff(turned.time_ns[odd]) / NANOSECONDS
    size = max(round(SETTLED_S / max(float(np.median(seconds)), 1e-6)) // 2 * 2 + 1, 1)
    steady = rotation.lengths(moving_mean(changes, size, "held"))
    so_far = np.concatenate([[0.0], np.cumsum(steady)]) / 2
    return np.asarray(np.interp(np.arange(len(rate)), odd, so_far))


def _read_at_rest(gyr: np.ndarray, step: float) -> tuple[np.ndarray, float]:
    """What a gyroscope reads at rest, and 1, shape (4,), and by how much that differs [rad/s].

    Args:
        gyr: Shape (n, 3) [rad/s].
        step: Between samples [s].
    """
    runs = intervals_of(detect_static(gyr, step), max(round(REST_S / step), 1))
    read = np.array([gyr[begin:end].mean(axis=0) for begin, end in runs])
    if len(read) < FEWEST_RESTS:
        return np.full(4, np.nan), np.inf
    usual = np.median(read, axis=0)
    return np.append(usual, 1.0), float(np.median(rotation.lengths(read - usual)))


def _with_one(gyr: np.ndarray) -> np.ndarray:
    """Readings, and 1 for their bias, shape (n, 4)."""
    return np.column_stack([gyr, np.ones(len(gyr))])


def find_partings(samples: ImuSamples, time_ns: np.ndarray, truth: Truth) -> list[Parting]:
    """All stretches in which truth and gyroscope part, in the order of time.

    The truth's rate in the body is fitted by a linear map of what the gyroscope reads, which takes
    mounting, scale, cross-axis errors and bias; what that turns is held against the truth. Over
    each span both must turn alike. Where two maps fit far better than one, the body slipped.

    Args:
        samples: Of the sensor, with mean rates.
        time_ns: Instants that its rates are of, increasing, shape (n,) [ns].
        truth: Without its steps.
    """
    whole = _Intervals.of(samples, time_ns, truth)
    if whole is None:
        return []
    found, waiting = _steps(whole, median_interval(truth.host_time_ns) / NANOSECONDS)
    slow = 0
    while waiting and slow < MOST_PARTINGS:
        own = waiting.pop()
        parting = _most(own)
        if parting is None:
            continue
        found.append(parting)
        slow += 1
        parts = _beside(own, parting)
        waiting += [part for part in parts if len(part.rows) * part.width > LEAST_PART_S]
    return sorted(found, key=lambda own: own.begin_ns)


def _beside(own: _Intervals, parting: Parting) -> tuple[_Intervals, _Intervals]:
    """What lies before a parting, and what after it."""
    first, end = np.searchsorted(own.time_ns, [parting.begin_ns, parting.end_ns + 1])
    return own.between(0, int(first)), own.between(int(end), len(own.rows))


def _steps(whole: _Intervals, truth_s: float) -> tuple[list[Parting], list[_Intervals]]:
    """Stretches in which both part at once, and what lies beside them.

    On either side of a step another map may hold, which shows the next one better.

    Args:
        whole: Truth and gyroscope.
        truth_s: Between two rows of the truth [s].
    """
    found: list[Parting] = []
    sound, waiting = [], [whole]
    while waiting:
        own = waiting.pop()
        step = _step(own, truth_s) if len(found) < MOST_STEPS else None
        if step is None:
            sound.append(own)
            continue
        found.append(step)
        waiting += _beside(own, step)
    return found, sound


def _step(both: _Intervals, truth_s: float) -> Parting | None:
    """The most prominent step: of the world, or of the body, which shows in the map of rates."""
    fitted = _fitted(both)
    if fitted is None:
        return None
    apart, path, _ = both.apart(fitted)
    rate = rotation.rotate(both.q, both.rate)
    step = find_step(Differences(apart, rate, path, NONLINEAR, both.time_ns, both.width, truth_s))
    if step is not None:
        begin_ns, end_ns = both.time_ns[[step.before, step.after]]
        return Parting(step.angle, int(begin_ns), int(end_ns), True)
    told = _slow(both)[:, None]
    swap = find_swap(both.rate * told, both.design * told, fitted, both.width)
    if swap is None:
        return None
    beside = round(max(SWAPPED_S, truth_s) / both.width)
    last = len(both.time_ns) - 1
    begin_ns, end_ns = both.time_ns[[max(swap.at - beside, 0), min(swap.at + beside, last)]]
    return Parting(swap.angle, int(begin_ns), int(end_ns), True)


def _slow(both: _Intervals) -> np.ndarray:
    """Intervals in which a mean rate is the turn, shape (n,), bool."""
    return np.asarray(rotation.lengths(both.rate) * both.width < MOST_TURN)


def _fitted(both: _Intervals) -> np.ndarray | None:
    """The map that makes true rates of readings and 1, shape (4, 3); None where too little tells
    it.
    """
    if len(both.rows) < FEWEST:
        return None
    slow = _slow(both)
    return None if slow.sum() < FEWEST else _map(both.rate[slow], both.design[slow])


def _most(both: _Intervals) -> Parting | None:
    """The stretch in which both part most."""
    fitted = _fitted(both)
    if fitted is None:
        return None
    told = _slow(both)[:, None]
    slip = find_changed_map(both.rate * told, both.design * told, fitted, both.width)
    if slip is not None:
        before = both.apart(slip.before, slice(slip.at))[0]
        after = both.apart(slip.after, slice(slip.at, None))[0]
        at, reach = int(both.time_ns[slip.at]), round(LONGEST_SLIP_S / 2 * NANOSECONDS)
        return _between(both, (before, after), Parting(slip.angle, at - reach, at + reach))
    apart, path, drifts = both.apart(fitted)
    found = _widest(apart, path, both.time_ns, both.width, drifts)
    return None if found is None else _between(both, (apart, apart), found)


def _between(both: _Intervals, sides: tuple[np.ndarray, np.ndarray], about: Parting) -> Parting:
    """The same parting from where both cease to turn alike to where they do so again.

    Args:
        both: Truth and gyroscope.
        sides: How far they are from one another by what holds before it, and after it, shape (n, 3)
            each [rad].
        about: Where it lies, or more.
    """
    time, reach = both.time_ns, round(BESIDE_S * NANOSECONDS)
    settled = max(round(SETTLED_S / both.width) // 2 * 2 + 1, 1)
    most = max(TOGETHER * about.angle, LEAST_TOGETHER)
    first = int(np.searchsorted(time, about.begin_ns - reach))
    last = int(np.searchsorted(time, about.end_ns + reach, side="right"))
    before, after = (moving_mean(own, settled, "held")[first:last] for own in sides)
    begin, end = first + _alike(before, most), last - 1 - _alike(after[::-1], most)
    begin, end = min(begin, end), max(begin, end)
    # of an even parting, as much lies before and after as that it takes to be seen
    unseen = round((end - begin) * TOGETHER / (1 - 2 * TOGETHER))
    begin, end = max(begin - unseen, 0), min(end + unseen, len(time) - 1)
    # nothing that lies beyond tells what was there
    close = round(LEAST_SIDE_S / both.width)
    begin, end = 0 if begin < close else begin, len(time) - 1 if end >= len(time) - close else end
    return replace(about, begin_ns=int(time[begin]), end_ns=int(time[end]))


def _alike(apart: np.ndarray, most: float) -> int:
    """For how many intervals from the first on both stay together.

    Args:
        apart: How far they are from one another, shape (n, 3) [rad].
        most: That counts as together [rad].
    """
    counts = np.arange(1, len(apart) + 1)[:, None]
    mean = np.cumsum(apart, axis=0) / counts
    far = rotation.lengths(apart - mean) > most
    count = int(np.argmax(far)) if far.any() else len(apart) - 1
    # what drifts from the first on leaves its mean by `most` after as much as twice that
    means = np.array([own.mean(axis=0) for own in np.array_split(apart[: max(count, 4)], 4)])
    along = (means[3] - means[0]) / max(float(np.linalg.norm(means[3] - means[0])), 1e-12)
    return 0 if float((np.diff(means, axis=0) @ along).min()) > FLAT * most else count


def _bias(
    changes: np.ndarray, body: np.ndarray, width: float, known: tuple[np.ndarray, float]
) -> tuple[np.ndarray, bool]:
    """The bias that the fit of rates left, shape (3,) [rad/s], and whether the truth drifts.

    Args:
        changes: Of both worlds against one another, shape (n, 3) [rad].
        body: How the sensor's body lies in the world, shape (n, 3, 3).
        width: Of an interval [s].
        known: What it is about, shape (3,), and to what standard deviation [rad/s].
    """
    block = max(round(BLOCK_S / width), 1)
    starts = np.arange(0, len(changes) - block + 1, block)
    if not len(starts):
        return np.zeros(3), False
    summed = np.add.reduceat(changes, starts, axis=0)
    turned = np.add.reduceat(body, starts, axis=0) * width
    lasted = np.diff(np.append(starts, len(changes))) * width
    alone, left = _trimmed(turned, summed, *known)
    # beside the bias a drift of the truth's own world, which a person who turns tells from it
    both = np.concatenate([turned, lasted[:, None, None] * np.eye(3)], axis=2)
    about = np.append(known[0], np.zeros(3))
    with_drift, less = _trimmed(both, summed, about, np.repeat([known[1], DRIFT], 3))
    if less < EXPLAINED * left:
        return with_drift[:3], True

    def quietest(bias: np.ndarray) -> float:
        return float(np.quantile(rotation.lengths(summed - turned @ bias), QUIET / 2))

    # what drifts for half of a recording leaves the other half as it is
    middle = len(summed) // 2
    halves = [_trimmed(turned[part], summed[part], *known)[0] for part in _halves(middle)]
    best = min(halves, key=quietest)
    return (best if quietest(best) < EXPLAINED * quietest(alone) else alone), False


def _halves(middle: int) -> tuple[slice, slice]:
    return slice(max(middle, 1)), slice(middle, None)


def _trimmed(
    design: np.ndarray, summed: np.ndarray, about: np.ndarray, sd: np.ndarray | float
) -> tuple[np.ndarray, float]:
    """What explains sums that are not all sound, and the usual square of what it leaves.

    Args:
        design: Shape (n, 3, k).
        summed: Shape (n, 3).
        about: What it is expected to be, shape (k,).
        sd: Standard deviation of that, shape (k,) or one.
    """
    kept = np.ones(len(summed), dtype=bool)
    found, width = about, design.shape[2]
    for _ in range(ROUNDS):
        size = rotation.lengths(summed - design @ found)
        prior = max(float(np.median(size)), 1e-9) / np.sqrt(3) / sd * np.ones(width)
        rows = np.concatenate([design[kept].reshape(-1, width), np.diag(prior)])
        wanted = np.append(summed[kept].ravel(), prior * about)
        found = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        size = rotation.lengths(summed - design @ found)
        kept = size <= np.quantile(size, KEPT)
    return found, float(np.median(size) ** 2)


def _map(rate: np.ndarray, design: np.ndarray) -> np.ndarray:
    """The linear map that makes true rates of readings and 1, shape (4, 3).

    Args:
        rate: In the body, shape (n, 3) [rad/s].
        design: What the gyroscope reads, and 1, shape (n, 4) [rad/s].
    """
    kept = np.ones(len(design), dtype=bool)
    fitted: np.ndarray = np.zeros((4, 3))
    for _ in range(ROUNDS):
        fitted = np.linalg.lstsq(design[kept], rate[kept], rcond=1e-3)[0]
        size = rotation.lengths(rate - design @ fitted)
        kept = size <= np.quantile(size, KEPT)
    return np.asarray(fitted)


def _widest(
    apart: np.ndarray, path: np.ndarray, time_ns: np.ndarray, width: float, drifts: bool
) -> Parting | None:
    """The change that stands out most, over the shortest span that holds most of it.

    Args:
        apart: How far both are from one another, shape (n, 3) [rad].
        path: That the gyroscope has turned since the beginning, shape (n,) [rad].
        time_ns: Increasing, shape (n,) [ns].
        width: Of an interval [s].
        drifts: Whether both part throughout, so that what is usual tells no error.
    """
    settled = max(round(SETTLED_S / width) // 2 * 2 + 1, 1)
    smooth = moving_mean(apart, settled, "held")
    best: Parting | None = None
    usual, spans = 0.0, list(SPANS_S)
    while spans[-1] < len(smooth) * width:
        spans.append(2 * spans[-1])
    for seconds in spans:
        span = min(round(seconds / width) + settled, len(smooth) - 1)
        if span < settled:
            break
        change = rotation.lengths(smooth[span:] - smooth[:-span])
        lasted = (time_ns[span:] - time_ns[:-span]) / NANOSECONDS
        change[lasted > 1.2 * span * width + 1.0] = 0.0  # a gap lies in between
        allowed = LEAST + DRIFT * seconds + NONLINEAR * (path[span:] - path[:-span])
        usual = usual or float(np.median(change))  # over the shortest span
        walked = usual * np.sqrt(seconds / spans[0])
        least = walked if drifts else max(walked, float(np.quantile(change, QUIET)))
        allowed = np.maximum(allowed, USUAL * least)
        change[change < allowed] = 0.0
        at = int(np.argmax(change))
        if not change[at] > 0:
            continue
        if best is None or change[at] > 1.25 * best.angle:
            inner = settled // 2
            begin, end = time_ns[at + inner], time_ns[at + span - inner]
            best = Parting(float(change[at]), int(begin), int(end))
    return best
