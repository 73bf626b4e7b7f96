"""Where a reference lost the body: it stands still while the gyroscope turns, or steps.

A system that tracks bodies by markers takes one body for another, or holds its last answer. Neither
is seen by the gyroscope, and how far it turns between two instants needs no frame: the angle of a
relative rotation is the same in every world and mounting. So the truth is cut where it turns by
what the gyroscope does not, and of the pieces those are kept that fit each other for longest.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numba import njit

from testbench.estimation.signals.rates import LOST_S, rest_reading
from testbench.estimation.signals.segmentation import intervals_of
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.windows import moving_mean
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples, Truth

LEAST_FROZEN_S = 0.3
"""Shorter repetitions are those of a reference slower than its log [s]."""
LEAST_TURN, LEAST_RATE = np.radians(4.0), np.radians(3.0)
"""What the gyroscope must turn while the truth stands still [rad], and how fast [rad/s]."""
SMOOTHED_S = 0.25
LEAST_STEP = np.radians(8.0)
"""A truth that turns by so much more than the gyroscope has stepped [rad]."""
STEP_WITHIN_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Over so long it is asked whether the truth turns as far as the gyroscope does: steps may be
smoothed, or filled in [s].
"""
SLACK_S = 0.02
"""By so much the truth may come earlier or later anywhere: filters delay, and clocks wander [s]."""
LONGEST_LAG_S, LAG_SPAN_S, LAG_SPANS = 0.3, 0.2, 2_000
"""A truth may come so late from beginning to end, by turns over so long, so many of them [s, s, 1].
"""
LEAST_GAP_S = 0.1
"""Over a longer gap of the truth it is asked whether both sides fit, and steps that are closer are
one [s].
"""
SCALE = 0.03
"""Part of its path by which a gyroscope's turn may be wrong [1]."""
DRIFT = np.radians(0.1)
"""Speed at which its turn goes wrong [rad/s]."""
LOOSEST = np.radians(25.0)
"""Pieces that cannot be compared better than this are not compared [rad]."""
ANY_TURN = 1e3
"""What a sensor may have turned by while it gave no samples [rad]."""
LASTING_S, LEAST_LASTING = 3.0, 0.45
"""Where less of the motion lies in pieces that last so long, truth and gyroscope differ everywhere:
axes, range or scale of the one are wrong, and no smoothed step is the cause [s, 1].
"""
COMPARED_S, INSTANTS = 0.5, 5
"""Pieces are compared at so many instants of so long an end of each [s]."""
MOST_CLASSES = 8
"""A piece is compared with the latest of so many kinds, so that the time does not grow with the
square of their number.
"""
BESIDE = 2
"""Rows on either side of a step that are left out with it: whoever looks for jumps leaves one."""
LEAST_ROWS = 3
"""Pieces of fewer rows are single jumps, which the evaluation leaves out and counts."""


@dataclass(frozen=True)
class Apart:
    """Pieces of a truth that fit one another and not the rest: those of another body, or world.

    Attributes:
        truth: Of these pieces alone.
        rows: Samples well within them, shape (n,), bool.
    """

    truth: Truth
    rows: np.ndarray


@dataclass(frozen=True)
class TruthFaults:
    """What was found.

    Attributes:
        truth: With its lost rows unknown.
        rates: With those rows unknown by which it does not turn as fast as the sensor: where it
            stood still, and beside its steps. How fast it turns depends on no frame.
        frozen: Samples while the truth stood still, shape (n,), bool.
        stepped: Samples of pieces that do not fit the rest, shape (n,), bool.
        findings: In words.
        apart: What those pieces hold.
    """

    truth: Truth
    rates: Truth
    frozen: np.ndarray
    stepped: np.ndarray
    findings: list[Finding] = field(default_factory=list)
    apart: list[Apart] = field(default_factory=list)


@dataclass(frozen=True)
class _Cut:
    """A truth cut where it steps.

    Attributes:
        dropped: Rows of pieces that do not fit the rest, shape (m,), bool.
        angle: Of the largest step [rad].
        begins: Rows that steps come before.
        others: First row and the one after the last of the pieces that are dropped, those that fit
            one another together.
    """

    dropped: np.ndarray
    angle: float = 0.0
    begins: list[int] = field(default_factory=list)
    others: list[list[tuple[int, int]]] = field(default_factory=list)

    def turns_with_the_sensor(self) -> np.ndarray:
        """Rows of all pieces but those beside a step, shape (m,), bool."""
        inner = ~self.dropped
        for first, end in (piece for pieces in self.others for piece in pieces):
            inner[first:end] = True
        for first in self.begins:
            inner[max(first - BESIDE, 0) : first + BESIDE] = False
        return inner


@dataclass(frozen=True)
class _Turning:
    """How a gyroscope turned.

    Attributes:
        time_ns: Of its samples, shape (n,).
        q: Orientation against that at the first sample, by the gyroscope alone, shape (n, 4).
        path: Angle passed through since then, shape (n,) [rad].
        slow_path: The same of what it turns for a while, noise left out, shape (n,) [rad].
    """

    time_ns: np.ndarray
    q: np.ndarray
    path: np.ndarray
    slow_path: np.ndarray

    @staticmethod
    def of(rate: np.ndarray, time_ns: np.ndarray) -> _Turning:
        seconds = np.diff(time_ns, prepend=time_ns[:1]) / NANOSECONDS
        lost = seconds > LOST_S
        seconds = np.where(lost, 0.0, seconds)
        turns = rate * seconds[:, None]
        smooth = moving_mean(rate, max(round(SMOOTHED_S / max(float(np.median(seconds)), 1e-6)), 1))
        return _Turning(
            time_ns,
            _chained(rotation.from_rotation_vector(turns)),
            np.cumsum(rotation.lengths(rate) * seconds + np.where(lost, ANY_TURN, 0.0)),
            np.cumsum(rotation.lengths(smooth) * seconds),
        )

    def at(self, time_ns: np.ndarray) -> np.ndarray:
        """Orientations at times, shape (m, 4)."""
        inside = np.clip(time_ns, self.time_ns[0], self.time_ns[-1])
        return rotation.interpolate(self.time_ns, self.q, inside)

    def path_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Path at times, shape (m,) [rad]."""
        return np.asarray(np.interp(time_ns, self.time_ns, self.path))


@dataclass(frozen=True)
class _Compared:
    """Truth and gyroscope side by side, at the rows of the truth.

    Attributes:
        time_ns: Shape (m,) [ns].
        q: The truth, shape (m, 4).
        turned: Orientation by the gyroscope alone, earlier, then, and later, shape (3, m, 4).
        path: Angle passed through by it, shape (m,) [rad].
    """

    time_ns: np.ndarray
    q: np.ndarray
    turned: np.ndarray
    path: np.ndarray

    @staticmethod
    def of(time_ns: np.ndarray, q: np.ndarray, turning: _Turning) -> _Compared:
        """Side by side, whatever the delay between the two is.

        Args:
            time_ns: Of the truth, shape (m,) [ns].
            q: The truth, shape (m, 4).
            turning: Of the gyroscope.
        """
        lags = np.round(NANOSECONDS * np.array([-SLACK_S, 0.0, SLACK_S])).astype(np.int64)
        lags += _lag(time_ns, q, turning)
        turned = np.stack([turning.at(time_ns + lag) for lag in lags])
        return _Compared(time_ns, q, turned, turning.path_at(time_ns + lags[1]))

    def differences(self, i: np.ndarray | slice, j: np.ndarray | slice) -> np.ndarray:
        """How differently both turn from rows i to rows j, for the three delays, shape (3, k)
        [rad].
        """
        true = _angle_between(self.q[i], self.q[j])
        return np.abs(true - _angle_between(self.turned[:, i], self.turned[:, j]))


def find_faults(samples: ImuSamples, time_ns: np.ndarray, truth: Truth) -> TruthFaults:
    """Look for parts in which the truth is not that of the sensor.

    Args:
        samples: Of a recording, with rates that tell how the sensor turned between them.
        time_ns: Their instants on the host's clock, increasing, shape (n,) [ns].
        truth: Orientations by a reference.
    """
    none = np.zeros(len(time_ns), dtype=bool)
    known = np.flatnonzero(np.isfinite(truth.q_world_from_sensor).all(axis=1))
    read = np.isfinite(samples.gyr).all(axis=1)  # a rate that was not read is as one not sampled
    if read.sum() < 2 or (np.diff(time_ns) <= 0).any():
        return TruthFaults(truth, truth, none, none)
    sampled_ns = time_ns[read]
    known = known[(truth.host_time_ns[known] >= sampled_ns[0])]
    known = known[(truth.host_time_ns[known] <= sampled_ns[-1])]
    if len(known) < 10:
        return TruthFaults(truth, truth, none, none)
    rows, q = truth.host_time_ns[known], truth.q_world_from_sensor[known]
    rest = rest_reading(samples.gyr[read], lambda ends: _truth_stays(rows, q, sampled_ns, ends))
    turning = _Turning.of(samples.gyr[read] - rest, sampled_ns)
    frozen = _frozen(rows, q, turning)
    lost = np.zeros(len(known), dtype=bool)
    for first, last in frozen:
        lost[first + 1 : last + 1] = True
    halted = lost.copy()
    stays = np.flatnonzero(~lost)
    times = rows[stays]
    cut = _cut(_Compared.of(times, q[stays], turning))
    findings = _findings(rows, frozen, times, cut)
    turns = known[stays[cut.turns_with_the_sensor()]]
    lost[stays[cut.dropped]] = True
    if not lost.any():
        return TruthFaults(truth, truth, none, none)
    every = np.arange(len(truth.host_time_ns))
    return TruthFaults(
        _only(truth, np.setdiff1d(every, known[lost])),
        _only(truth, np.union1d(np.setdiff1d(every, known), turns)),
        _samples_of(time_ns, rows, halted),
        _samples_of(time_ns, rows, lost & ~halted),
        findings,
        [_apart(time_ns, times, q[stays], pieces) for pieces in cut.others],
    )


def _apart(
    time_ns: np.ndarray, rows: np.ndarray, q: np.ndarray, pieces: list[tuple[int, int]]
) -> Apart:
    """What pieces that fit one another hold.

    Args:
        time_ns: Of the samples, increasing, shape (n,) [ns].
        rows: Times of the truth, shape (m,) [ns].
        q: The truth, shape (m, 4).
        pieces: First row and the one after the last of each.
    """
    own = np.concatenate([np.arange(first, end) for first, end in pieces])
    inner = np.zeros(len(time_ns), dtype=bool)
    for first, end in pieces:  # as much is left out beside its ends as beside those of the rest
        if end - first > 2 * BESIDE:
            inner[_between(time_ns, *rows[[first + BESIDE - 1, end - BESIDE]])] = True
    return Apart(Truth(rows[own], q[own]), inner)


def _only(truth: Truth, rows: np.ndarray) -> Truth:
    """A truth of which some rows alone are known.

    Args:
        truth: To take them from.
        rows: Their numbers, shape (k,).
    """
    cleaned = np.full_like(truth.q_world_from_sensor, np.nan)
    cleaned[rows] = truth.q_world_from_sensor[rows]
    rate = None if truth.rate is None else np.full_like(truth.rate, np.nan)
    if rate is not None and truth.rate is not None:
        rate[rows] = truth.rate[rows]
    return replace(truth, q_world_from_sensor=cleaned, rate=rate)


def _truth_stays(rows: np.ndarray, q: np.ndarray, time_ns: np.ndarray, ends: np.ndarray) -> bool:
    """Whether the truth hardly turns while the gyroscope reads the same.

    Args:
        rows: Times of the truth, increasing, shape (m,) [ns].
        q: Its orientations, shape (m, 4).
        time_ns: Of the samples, shape (n,) [ns].
        ends: First and last sample of each stretch, shape (k, 2).
    """
    fresh = np.concatenate([[True], np.diff(rows) > 0])
    times = np.clip(time_ns[ends], rows[0], rows[-1])
    begin, end = (rotation.interpolate(rows[fresh], q[fresh], column) for column in times.T)
    seconds = np.maximum(np.diff(times, axis=1)[:, 0] / NANOSECONDS, 1e-3)
    turned = rotation.angle(rotation.multiply(rotation.conjugate(begin), end)) / seconds
    return bool(np.median(turned) < LEAST_RATE)


def without_repetitions(truth: Truth) -> Truth | None:
    """A truth without the rows in which it stood still; None where it never did for long.

    What follows a lost part is a jump, and both hide the motion that is common to sensor and truth.

    Args:
        truth: Orientations by a reference.
    """
    q, time = truth.q_world_from_sensor, truth.host_time_ns
    same = np.concatenate([(q[1:] == q[:-1]).all(axis=1), [False]])
    long = [
        (first, last)
        for first, last in intervals_of(same, 1)
        if time[last] - time[first] >= LEAST_FROZEN_S * NANOSECONDS
    ]
    if not long or truth.rate is not None:
        return None
    cleaned = q.copy()
    for first, last in long:
        cleaned[first : last + 1] = np.nan
    return replace(truth, q_world_from_sensor=cleaned)


def _samples_of(time_ns: np.ndarray, rows: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Samples between the second rows on either side of the lost ones, shape (n,), bool.

    Whoever looks for jumps leaves out a row on either side of one, too.

    Args:
        time_ns: Of the samples, shape (n,) [ns].
        rows: Times of the truth, shape (m,) [ns].
        lost: Which of its rows are lost, shape (m,), bool.
    """
    marked = np.zeros(len(time_ns), dtype=bool)
    for first, end in intervals_of(lost, 1):
        begin_ns = rows[first - BESIDE] if first >= BESIDE else time_ns[0] - 1
        end_ns = rows[end + BESIDE - 1] if end + BESIDE - 1 < len(rows) else time_ns[-1] + 1
        marked[_between(time_ns, begin_ns, end_ns)] = True
    return marked


def _between(time_ns: np.ndarray, begin_ns: int, end_ns: int) -> slice:
    """The instants strictly between two.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        begin_ns: The one before them [ns].
        end_ns: The one after them [ns].
    """
    first = int(np.searchsorted(time_ns, begin_ns, side="right"))
    return slice(first, int(np.searchsorted(time_ns, end_ns, side="left")))


def _frozen(rows: np.ndarray, q: np.ndarray, turning: _Turning) -> list[tuple[int, int]]:
    """First and last row of stretches in which the truth repeats itself while the sensor turns."""
    same = np.concatenate([(q[1:] == q[:-1]).all(axis=1), [False]])
    path = np.interp(rows, turning.time_ns, turning.slow_path)
    steps = np.diff(turning.time_ns, prepend=turning.time_ns[:1])
    steps = np.where(steps > LOST_S * NANOSECONDS, 0, steps)
    sampled = np.interp(rows, turning.time_ns, np.cumsum(steps))
    first, last = intervals_of(same, 1).T
    seconds = (rows[last] - rows[first]) / NANOSECONDS
    turned = path[last] - path[first]
    seconds = np.minimum(seconds, (sampled[last] - sampled[first]) / NANOSECONDS)
    long = (seconds >= LEAST_FROZEN_S) & (turned > np.maximum(LEAST_TURN, LEAST_RATE * seconds))
    return list(zip(first[long].tolist(), last[long].tolist(), strict=True))


def _lag(time_ns: np.ndarray, q: np.ndarray, turning: _Turning) -> int:
    """How late the gyroscope turns after the truth, all in all [ns].

    A truth that comes late is not one that steps.

    Args:
        time_ns: Of the truth, shape (m,) [ns].
        q: The truth, shape (m, 4).
        turning: Of the gyroscope.
    """
    usual = max(float(np.median(np.diff(time_ns))), 1.0) if len(time_ns) > 1 else 1.0
    apart = max(round(LAG_SPAN_S * NANOSECONDS / usual), 1)
    i = np.arange(0, len(time_ns) - apart, max((len(time_ns) - apart) // LAG_SPANS, 1))
    if len(i) < 2:
        return 0
    true = _angle_between(q[i], q[i + apart])
    lags = np.arange(-LONGEST_LAG_S, LONGEST_LAG_S + SLACK_S / 2, SLACK_S) * NANOSECONDS
    lags = np.round(lags).astype(np.int64)
    begin, end = time_ns[i], time_ns[i + apart]
    apart_by = [
        float(np.mean(np.minimum(np.abs(true - turned), LEAST_STEP)))
        for turned in (
            _angle_between(turning.at(begin + own), turning.at(end + own)) for own in lags
        )
    ]
    return int(lags[int(np.argmin(apart_by))])


def _angle_between(first: np.ndarray, then: np.ndarray) -> np.ndarray:
    """Angles of the rotations from some orientations to others, shape (..., k) [rad].

    Args:
        first: Those that the rotations begin at, shape (..., k, 4).
        then: Where they end, shape (..., k, 4).
    """
    return np.asarray(rotation.angle(rotation.multiply(rotation.conjugate(first), then)))


def _cut(both: _Compared) -> _Cut:
    """Cut a truth where it steps, and drop the pieces that do not fit those that last longest."""
    rows = both.time_ns
    whole = _Cut(np.zeros(len(rows), dtype=bool))
    if len(rows) < 10:
        return whole
    steps, within = _steps(both)
    usual = float(np.median(np.diff(rows)))
    gaps = np.diff(rows) > max(LEAST_GAP_S * NANOSECONDS, 2.5 * usual)
    borders = np.flatnonzero(steps | gaps) + 1
    if not len(borders):
        return whole
    edges = np.concatenate([[0], borders, [len(rows)]])
    pieces = [(int(a), int(b)) for a, b in pairwise(edges) if not within[a:b].all()]
    if within.any() and _lasting(within, both) < LEAST_LASTING:
        return whole
    classes = _classes(pieces, both)
    lengths: dict[int, float] = {}
    for (first, end), own in zip(pieces, classes, strict=True):
        lengths[own] = lengths.get(own, 0.0) + float(rows[end - 1] - rows[first]) + usual
    main = max(lengths, key=lengths.__getitem__)
    others: dict[int, list[tuple[int, int]]] = {}
    for piece, own in zip(pieces, classes, strict=True):
        if own != main:
            others.setdefault(own, []).append(piece)
    odd = [piece for own in others.values() for piece in own]
    if all(end - first < LEAST_ROWS for first, end in odd):
        return whole
    dropped = within.copy()
    for first, end in odd:
        dropped[first:end] = True
    size = max((_misfit(both, a, b)[0] for a, b in pairwise(pieces)), default=0.0)
    changes = [
        first
        for (first, _), own, before in zip(pieces[1:], classes[1:], classes, strict=False)
        if own != before
    ]
    return _Cut(dropped, size, changes, list(others.values()))


def _steps(both: _Compared) -> tuple[np.ndarray, np.ndarray]:
    """Where the truth steps: between which rows, shape (m - 1,), and rows within a smoothed step,
    shape (m,), bool.

    Both angles of a relative rotation are compared, and either may be the larger: a step against
    the motion leaves the truth turning less. How far the gyroscope turned on its way counts for
    nothing but its error.
    """
    rows = both.time_ns
    within = np.zeros(len(rows), dtype=bool)
    steps = np.zeros(len(rows) - 1, dtype=bool)
    usual = max(float(np.median(np.diff(rows))), 1.0)
    spans = {max(round(seconds * NANOSECONDS / usual), 1) for seconds in STEP_WITHIN_S}
    for apart in sorted({1} | {span for span in spans if span < len(rows)}):
        span = rows[apart:] - rows[:-apart]
        wrong = SCALE * (both.path[apart:] - both.path[:-apart]) + DRIFT * span / NANOSECONDS
        differ = both.differences(slice(None, -apart), slice(apart, None)).min(axis=0)
        far = (differ > LEAST_STEP + wrong) & (span <= 2.5 * apart * usual)
        if apart == 1:
            steps = far
            for a, b in pairwise(np.flatnonzero(steps) + 1):
                if rows[b - 1] - rows[a] < LEAST_GAP_S * NANOSECONDS:  # one step, in several
                    within[a:b] = True
            continue
        known = np.concatenate([[0], np.cumsum(steps | within[1:])])
        for i in np.flatnonzero(far):
            if known[i + apart] == known[i]:  # nothing shorter explains it
                within[i + 1 : i + apart] = True
    smooth = within[1:] != within[:-1]
    return steps | smooth, within


def _lasting(within: np.ndarray, both: _Compared) -> float:
    """Part of the gyroscope's path that lies in pieces which last, [1].

    Args:
        within: Rows in which the two turn differently, shape (m,), bool.
        both: Truth and gyroscope.
    """
    path = np.concatenate([[0.0], np.cumsum(np.minimum(np.diff(both.path), np.pi))])
    first, last = intervals_of(~within, 1).T - [[0], [1]]
    seconds = (both.time_ns[last] - both.time_ns[first]) / NANOSECONDS
    lasts = seconds >= LASTING_S
    return float((path[last] - path[first])[lasts].sum()) / max(float(path[-1]), 1e-9)


def _classes(pieces: list[tuple[int, int]], both: _Compared) -> list[int]:
    """Which pieces fit each other: a number for each."""
    classes: list[int] = []
    latest: dict[int, tuple[int, int]] = {}
    for piece in pieces:
        fitting = None
        recent = sorted(latest.items(), key=lambda item: -item[1][1])[:MOST_CLASSES]
        for own, other in recent:
            misfit, allowed = _misfit(both, other, piece)
            follows = bool(classes) and own == classes[-1]
            if allowed > LOOSEST:
                if follows:  # nothing tells them apart
                    fitting = own
                    break
            elif misfit <= allowed:
                fitting = own
                break
        chosen = len(latest) if fitting is None else fitting
        classes.append(chosen)
        latest[chosen] = piece
    return classes


def _misfit(
    both: _Compared, before: tuple[int, int], after: tuple[int, int]
) -> tuple[float, float]:
    """How differently truth and gyroscope turn from the end of one piece to the beginning of
    another, and what the gyroscope may be wrong by [rad].
    """
    near, rows = round(COMPARED_S * NANOSECONDS), both.time_ns
    first = max(before[0], int(np.searchsorted(rows, rows[before[1] - 1] - near)))
    end = min(after[1], int(np.searchsorted(rows, rows[after[0]] + near, side="right")))
    i = np.unique(np.linspace(first, before[1] - 1, INSTANTS).round().astype(int))
    j = np.unique(np.linspace(after[0], end - 1, INSTANTS).round().astype(int))
    i, j = (grid.ravel() for grid in np.meshgrid(i, j))
    span = float(rows[after[0]] - rows[before[1] - 1]) / NANOSECONDS
    whole = both.path[j] - both.path[i]
    allowed = LEAST_STEP + SCALE * float(whole.max()) + DRIFT * span
    return float(both.differences(i, j).max(axis=1).min()), allowed


def _findings(
    rows: np.ndarray,
    frozen: list[tuple[int, int]],
    stays: np.ndarray,
    cut: _Cut,
) -> list[Finding]:
    found = []
    if frozen:
        lasted = sum(int(rows[last] - rows[first]) for first, last in frozen) / NANOSECONDS
        at = float(rows[frozen[0][0]]) / NANOSECONDS
        found.append(finding("truth.frozen", stretches=len(frozen), lost_s=lasted, at_s=at))
    if cut.dropped.any():
        usual = float(np.median(np.diff(stays))) / NANOSECONDS
        first = cut.begins[0] if cut.begins else int(np.argmax(cut.dropped))
        at = float(stays[first]) / NANOSECONDS
        found.append(
            finding(
                "truth.stepped",
                steps=max(len(cut.begins), 1),
                angle_deg=float(np.degrees(cut.angle)),
                at_s=at,
                lost_s=float(cut.dropped.sum()) * usual,
            )
        )
    return found


@njit(cache=True)
def _chained(turns: np.ndarray) -> np.ndarray:
    """Products of rotations, each with all before it, shape (n, 4)."""
    result = np.empty((len(turns), 4))
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for i in range(len(turns)):
        w, x, y, z = rotation.product(
            (w, x, y, z), (turns[i, 0], turns[i, 1], turns[i, 2], turns[i, 3])
        )
        w, x, y, z = rotation.unit(w, x, y, z)
        result[i, 0], result[i, 1], result[i, 2], result[i, 3] = w, x, y, z
    return result
