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
STEP_WITHIN_S = 0.2
"""A step that a reference smooths takes no longer [s]."""
LEAST_GAP_S = 0.1
"""Over a longer gap of the truth it is asked whether both sides fit [s]."""
SCALE = 0.03
"""Part of its path by which a gyroscope's turn may be wrong [1]."""
DRIFT = np.radians(0.1)
"""Speed at which its turn goes wrong [rad/s]."""
LOOSEST = np.radians(25.0)
"""Pieces that cannot be compared better than this are not compared [rad]."""
ANY_TURN = 1e3
"""What a sensor may have turned by while it gave no samples [rad]."""
COMPARED_S, INSTANTS = 0.5, 5
"""Pieces are compared at so many instants of so long an end of each [s]."""
LEAST_ROWS = 3
"""Pieces of fewer rows are single jumps, which the evaluation leaves out and counts."""


@dataclass(frozen=True)
class TruthFaults:
    """What was found.

    Attributes:
        truth: With its lost rows unknown.
        frozen: Samples while the truth stood still, shape (n,), bool.
        stepped: Samples of pieces that do not fit the rest, shape (n,), bool.
        findings: In words.
    """

    truth: Truth
    frozen: np.ndarray
    stepped: np.ndarray
    findings: list[Finding] = field(default_factory=list)


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
    def of(gyr: np.ndarray, time_ns: np.ndarray) -> _Turning:
        rate = gyr - rest_reading(gyr)
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


def find_faults(samples: ImuSamples, time_ns: np.ndarray, truth: Truth) -> TruthFaults:
    """Look for parts in which the truth is not that of the sensor.

    Args:
        samples: All of a recording.
        time_ns: Their instants on the host's clock, increasing, shape (n,) [ns].
        truth: Orientations by a reference.
    """
    none = np.zeros(len(time_ns), dtype=bool)
    known = np.flatnonzero(np.isfinite(truth.q_world_from_sensor).all(axis=1))
    read = np.isfinite(samples.gyr).all(axis=1)  # a rate that was not read is as one not sampled
    if read.sum() < 2 or (np.diff(time_ns) <= 0).any():
        return TruthFaults(truth, none, none)
    sampled_ns = time_ns[read]
    known = known[(truth.host_time_ns[known] >= sampled_ns[0])]
    known = known[(truth.host_time_ns[known] <= sampled_ns[-1])]
    if len(known) < 10:
        return TruthFaults(truth, none, none)
    turning = _Turning.of(samples.gyr[read], sampled_ns)
    rows, q = truth.host_time_ns[known], truth.q_world_from_sensor[known]
    frozen = _frozen(rows, q, turning)
    lost = np.zeros(len(known), dtype=bool)
    for first, last in frozen:
        lost[first + 1 : last + 1] = True
    stays = np.flatnonzero(~lost)
    dropped, angle, begins = _dropped(rows[stays], q[stays], turning)
    findings = _findings(rows, frozen, rows[stays], dropped, (angle, begins))
    lost[stays[dropped]] = True
    if not lost.any():
        return TruthFaults(truth, none, none)
    cleaned = truth.q_world_from_sensor.copy()
    cleaned[known[lost]] = np.nan
    rate = None if truth.rate is None else truth.rate.copy()
    if rate is not None:
        rate[known[lost]] = np.nan
    halted = np.zeros(len(known), dtype=bool)
    for first, last in frozen:
        halted[first + 1 : last + 1] = True
    return TruthFaults(
        replace(truth, q_world_from_sensor=cleaned, rate=rate),
        _samples_of(time_ns, rows, halted),
        _samples_of(time_ns, rows, lost & ~halted),
        findings,
    )


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
        begin_ns = rows[first - 2] if first > 1 else rows[0] - 1
        end_ns = rows[end + 1] if end + 1 < len(rows) else rows[-1] + 1
        marked |= (time_ns > begin_ns) & (time_ns < end_ns)
    return marked


def _frozen(rows: np.ndarray, q: np.ndarray, turning: _Turning) -> list[tuple[int, int]]:
    """First and last row of stretches in which the truth repeats itself while the sensor turns."""
    same = np.concatenate([(q[1:] == q[:-1]).all(axis=1), [False]])
    path = np.interp(rows, turning.time_ns, turning.slow_path)
    steps = np.diff(turning.time_ns, prepend=turning.time_ns[:1])
    steps = np.where(steps > LOST_S * NANOSECONDS, 0, steps)
    sampled = np.interp(rows, turning.time_ns, np.cumsum(steps))
    found = []
    for first, last in intervals_of(same, 1):
        seconds = (rows[last] - rows[first]) / NANOSECONDS
        turned = path[last] - path[first]
        seconds = min(seconds, float(sampled[last] - sampled[first]) / NANOSECONDS)
        if seconds >= LEAST_FROZEN_S and turned > max(LEAST_TURN, LEAST_RATE * seconds):
            found.append((first, last))
    return found


def _dropped(
    rows: np.ndarray, q: np.ndarray, turning: _Turning
) -> tuple[np.ndarray, float, list[int]]:
    """Rows of pieces that do not fit the rest, shape (m,), bool; the largest step [rad]; the rows
    that steps come before.
    """
    dropped = np.zeros(len(rows), dtype=bool)
    if len(rows) < 10:
        return dropped, 0.0, []
    cut, within = _steps(rows, q, turning)
    usual = float(np.median(np.diff(rows)))
    gaps = np.diff(rows) > max(LEAST_GAP_S * NANOSECONDS, 2.5 * usual)
    borders = np.flatnonzero(cut | gaps) + 1
    if not len(borders):
        return dropped, 0.0, []
    edges = np.concatenate([[0], borders, [len(rows)]])
    pieces = [(int(a), int(b)) for a, b in pairwise(edges) if not within[a:b].all()]
    classes = _classes(pieces, rows, q, turning)
    lengths: dict[int, float] = {}
    for (first, end), own in zip(pieces, classes, strict=True):
        lengths[own] = lengths.get(own, 0.0) + float(rows[end - 1] - rows[first]) + usual
    main = max(lengths, key=lengths.__getitem__)
    odd = [piece for piece, own in zip(pieces, classes, strict=True) if own != main]
    if all(end - first < LEAST_ROWS for first, end in odd):
        return dropped, 0.0, []
    for first, end in odd:
        dropped[first:end] = True
    dropped |= within
    size = max(
        (_misfit(rows, q, turning, a, b)[0] for a, b in pairwise(pieces)),
        default=0.0,
    )
    changes = [
        first
        for (first, _), own, before in zip(pieces[1:], classes[1:], classes, strict=False)
        if own != before
    ]
    return dropped, size, changes


def _steps(rows: np.ndarray, q: np.ndarray, turning: _Turning) -> tuple[np.ndarray, np.ndarray]:
    """Where the truth steps: between which rows, shape (m - 1,), and rows within a smoothed step,
    shape (m,), bool.
    """
    path = turning.path_at(rows)
    within = np.zeros(len(rows), dtype=bool)
    steps = np.zeros(len(rows) - 1, dtype=bool)
    usual = max(float(np.median(np.diff(rows))), 1.0)
    for apart in sorted({1, max(round(STEP_WITHIN_S * NANOSECONDS / usual), 1)}):
        if apart >= len(rows):
            continue
        angle = rotation.angle(rotation.multiply(rotation.conjugate(q[:-apart]), q[apart:]))
        close = rows[apart:] - rows[:-apart] <= 2.5 * apart * usual
        far = close & (angle - 1.2 * (path[apart:] - path[:-apart]) > LEAST_STEP)
        if apart == 1:
            steps |= far
            continue
        sharp = np.concatenate([[0], np.cumsum(steps)])
        for i in np.flatnonzero(far):
            if sharp[i + apart] == sharp[i]:  # no sharp step explains it
                within[i + 1 : i + apart] = True
    smooth = within[1:] != within[:-1]
    return steps | smooth, within


def _classes(
    pieces: list[tuple[int, int]], rows: np.ndarray, q: np.ndarray, turning: _Turning
) -> list[int]:
    """Which pieces fit each other: a number for each."""
    classes: list[int] = []
    latest: dict[int, tuple[int, int]] = {}
    for piece in pieces:
        fitting = None
        for own, other in sorted(latest.items(), key=lambda item: -item[1][1]):
            misfit, allowed = _misfit(rows, q, turning, other, piece)
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
    rows: np.ndarray,
    q: np.ndarray,
    turning: _Turning,
    before: tuple[int, int],
    after: tuple[int, int],
) -> tuple[float, float]:
    """How differently truth and gyroscope turn from the end of one piece to the beginning of
    another, and what the gyroscope may be wrong by [rad].
    """
    near = COMPARED_S * NANOSECONDS
    first = max(before[0], int(np.searchsorted(rows, rows[before[1] - 1] - near)))
    end = min(after[1], int(np.searchsorted(rows, rows[after[0]] + near, side="right")))
    i = np.unique(np.linspace(first, before[1] - 1, INSTANTS).round().astype(int))
    j = np.unique(np.linspace(after[0], end - 1, INSTANTS).round().astype(int))
    i, j = (grid.ravel() for grid in np.meshgrid(i, j))
    q_gyr_i, q_gyr_j = turning.at(rows[i]), turning.at(rows[j])
    true = rotation.angle(rotation.multiply(rotation.conjugate(q[i]), q[j]))
    turned = rotation.angle(rotation.multiply(rotation.conjugate(q_gyr_i), q_gyr_j))
    span = float(rows[after[0]] - rows[before[1] - 1]) / NANOSECONDS
    whole = turning.path_at(rows[j]) - turning.path_at(rows[i])
    allowed = LEAST_STEP + SCALE * float(whole.max()) + DRIFT * span
    return float(np.max(np.abs(true - turned))), allowed


def _findings(
    rows: np.ndarray,
    frozen: list[tuple[int, int]],
    stays: np.ndarray,
    dropped: np.ndarray,
    steps: tuple[float, list[int]],
) -> list[Finding]:
    angle, begins = steps
    found = []
    if frozen:
        lasted = sum(int(rows[last] - rows[first]) for first, last in frozen) / NANOSECONDS
        at = float(rows[frozen[0][0]]) / NANOSECONDS
        found.append(finding("truth.frozen", stretches=len(frozen), lost_s=lasted, at_s=at))
    if dropped.any():
        usual = float(np.median(np.diff(stays))) / NANOSECONDS
        at = float(stays[begins[0] if begins else int(np.argmax(dropped))]) / NANOSECONDS
        found.append(
            finding(
                "truth.stepped",
                steps=max(len(begins), 1),
                angle_deg=float(np.degrees(angle)),
                at_s=at,
                lost_s=float(dropped.sum()) * usual,
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
