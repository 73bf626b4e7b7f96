"""Where a reference lost the body: it stands still while the gyroscope turns, or steps.

A system that tracks bodies by markers takes one body for another, or holds its last answer. Neither
is seen by the gyroscope, and how far it turns between two instants needs no frame: the angle of a
relative rotation is the same in every world and mounting. So the truth is cut where it turns by
what the gyroscope does not, and of the pieces those are kept that fit each other for longest.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from testbench.estimation.signals.rates import LOST_S, rest_reading
from testbench.estimation.signals.segmentation import intervals_of
from testbench.estimation.signals.truth_steps import BESIDE, Cut, cut_truth
from testbench.estimation.signals.truth_turning import Compared, Turning
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples, Truth

LEAST_FROZEN_S = 0.3
"""Shorter repetitions are those of a reference slower than its log [s]."""
LEAST_TURN, LEAST_RATE = np.radians(4.0), np.radians(3.0)
"""What the gyroscope must turn while the truth stands still [rad], and how fast [rad/s]."""
FROZEN, STEPPED = "the truth stands still", "the truth has stepped"
PARTED = "truth and gyroscope have parted"
AMBIGUOUS = "the truth turns too far between its orientations"
"""Why samples are left out whose truth was lost."""


@dataclass(frozen=True)
class Apart:
    """Pieces of a truth that fit one another and not the rest: those of another body, or world.

    Attributes:
        truth: Of these pieces alone.
        rows: Samples well within them, shape (n,), bool.
        reason: Why they were left out of the rest.
    """

    truth: Truth
    rows: np.ndarray
    reason: str = STEPPED


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
    turning = Turning.of(samples.gyr[read] - rest, sampled_ns)
    frozen = _frozen(rows, q, turning)
    lost = np.zeros(len(known), dtype=bool)
    for first, last in frozen:
        lost[first + 1 : last + 1] = True
    halted = lost.copy()
    stays = np.flatnonzero(~lost)
    times = rows[stays]
    cut = cut_truth(Compared.of(times, q[stays], turning))
    findings = _findings(rows, frozen, times, cut)
    turns = known[stays[cut.turns_with_the_sensor()]]
    lost[stays[cut.dropped]] = True
    if not lost.any():
        return TruthFaults(truth, truth, none, none)
    every = np.arange(len(truth.host_time_ns))
    return TruthFaults(
        only_rows(truth, np.setdiff1d(every, known[lost])),
        only_rows(truth, np.union1d(np.setdiff1d(every, known), turns)),
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


def only_rows(truth: Truth, rows: np.ndarray) -> Truth:
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
    if not long:
        return None
    cleaned = q.copy()
    rate = None if truth.rate is None else truth.rate.copy()
    for first, last in long:
        cleaned[first : last + 1] = np.nan
        if rate is not None:  # of a log of joints, by its angles: the step beside has a rate, too
            rate[max(first - BESIDE, 0) : last + 1 + BESIDE] = np.nan
    return replace(truth, q_world_from_sensor=cleaned, rate=rate)


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


def _frozen(rows: np.ndarray, q: np.ndarray, turning: Turning) -> list[tuple[int, int]]:
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


def _findings(
    rows: np.ndarray,
    frozen: list[tuple[int, int]],
    stays: np.ndarray,
    cut: Cut,
) -> list[Finding]:
    found = []
    if frozen:
        lasted = sum(int(rows[last] - rows[first]) for first, last in frozen) / NANOSECONDS
        at = float(rows[frozen[0][0]]) / NANOSECONDS
        found.append(finding("truth.frozen", stretches=len(frozen), lost_s=lasted, at_s=at))
    if cut.dropped.any():
        usual = median_interval(stays) / NANOSECONDS
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
