"""Rows that are missing from a file whose times are made by its rows, seen by what the rest jumps.

Where neither stamps nor a counter tell of a loss, the rows beside it stand together as if nothing
had been between them: gyroscope and accelerometer jump at once, between readings that go on
smoothly on either side. An impact does not look so, for it rings; nor does a spike, which comes
back. At rest, or while it turns evenly, nothing jumps, and a loss is not seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

EVEN_NS = 2
"""Times that are made by a rate are even to rounding [ns]."""
SIDE = 4
"""Rows on either side that a straight line is laid through, to either side of a jump."""
NEAR, FAR = 6, 24
"""Jumps are compared with those so many rows away, to either side."""
FACTOR = 4.0
"""A loss makes gyroscope and accelerometer jump by so many times what they do nearby."""
ALONE = 0.5
"""Steps from row to row beside it are smaller parts of it: an impact goes to and fro [1]."""
LEAST_RATE, LEAST_FORCE = np.radians(5.0), 0.3
"""And by so much at least [rad/s], [m/s^2]."""
LEAST_TURN = np.radians(1.0)
"""A loss in which a sensor turned by less does no harm [rad]."""
LEAST_SPEED = np.radians(10.0)
"""Where it turned more slowly, how long the loss was is not told [rad/s]."""
CARRIED = FAR + 2 * SIDE
"""Rows of a chunk that are looked at once more with the next."""


@dataclass(frozen=True)
class Jump:
    """Where rows seem to be missing.

    Attributes:
        time_ns: Of the row before it [ns].
        lost_s: How long they lasted, by how far gravity turned; 0 where that does not tell [s].
    """

    time_ns: int
    lost_s: float


class LostRows:
    """Looks for missing rows in samples that go by, as long as their times are perfectly even."""

    def __init__(self) -> None:
        self._even, self._step = True, 0
        self._held: ImuSamples | None = None
        self._done = np.iinfo(np.int64).min
        self._jumps: list[Jump] = []

    def watch(self, chunks: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
        """The chunks as they are, each looked at before it goes on."""
        for chunk in chunks:
            self._add(chunk)
            yield chunk

    def _add(self, chunk: ImuSamples) -> None:
        if not self._even or not len(chunk):
            return
        parts = [chunk] if self._held is None else [self._held, chunk]
        time, gyr, acc = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("host_time_ns", "gyr", "acc")
        )
        steps = np.diff(time)
        if len(steps):
            self._step = self._step or int(np.median(steps))
            self._even = bool(np.abs(steps - self._step).max() <= EVEN_NS)
        if not self._even:
            return
        self._held = chunk.rows(slice(max(len(chunk) - CARRIED, 0), None))
        self._look(time, gyr, acc)

    def _look(self, time: np.ndarray, gyr: np.ndarray, acc: np.ndarray) -> None:
        """Jumps among some rows, but for those before the last of them that was looked at."""
        with np.errstate(invalid="ignore"):  # infinite readings, of which others tell
            found = find_jumps(gyr, acc, self._step / NANOSECONDS)
        for row, lost_s in found:
            if int(time[row]) > self._done:
                self._jumps.append(Jump(int(time[row]), lost_s))
                self._done = int(time[row])

    def findings(self) -> list[Finding]:
        """What is said of them; nothing where there are none, or stamps tell of losses."""
        if not self._even or not self._jumps:
            return []
        known = float(sum(own.lost_s for own in self._jumps))
        how_long = f", for about {known:.2g} s in all by how far gravity turned" if known else ""
        return [
            finding(
                "time.rows_lost",
                count=len(self._jumps),
                at_s=self._jumps[0].time_ns / NANOSECONDS,
                about_s=known,
                how_long=how_long,
            )
        ]


def find_jumps(gyr: np.ndarray, acc: np.ndarray, step_s: float) -> list[tuple[int, float]]:
    """Rows after which others seem to be missing, and for how long [s]; 0 where nothing tells.

    Args:
        gyr: Even in time, shape (n, 3) [rad/s].
        acc: Shape (n, 3) [m/s^2].
        step_s: Between rows [s].
    """
    if len(gyr) < 2 * (SIDE + FAR) or not _may_jump(gyr, acc):
        return []
    rate, force = _jumps(gyr), _jumps(acc)
    sizes = rotation.lengths(rate), rotation.lengths(force)
    rows = np.flatnonzero((sizes[0] > LEAST_RATE) & (sizes[1] > LEAST_FORCE))
    found = []
    for at in rows.tolist():
        away = np.concatenate([np.arange(at - FAR, at - NEAR + 1), np.arange(at + NEAR, at + FAR)])
        away = away[(away >= 0) & (away < len(rate))]
        beside = np.arange(max(at - 2, 0), min(at + 3, len(rate)))
        if len(away) < FAR or not all(
            size[at] > FACTOR * np.max(size[away]) and size[at] >= np.max(size[beside])
            for size in sizes
        ):
            continue
        row = at + SIDE - 1
        if not (_is_alone(gyr, row) and _is_alone(acc, row)):
            continue
        lost_s = _lost_for(gyr, acc, row, force[at])
        speed = float(np.linalg.norm(gyr[row - 1 : row + 3].mean(axis=0)))
        if speed * max(lost_s, step_s) > LEAST_TURN:
            found.append((row, lost_s))
    return found


def _is_alone(readings: np.ndarray, row: int) -> bool:
    """Whether the step after a row is much larger than those beside it.

    Args:
        readings: Shape (n, 3).
        row: With as many rows on either side as a line is laid through.
    """
    steps = rotation.lengths(np.diff(readings[row - SIDE + 1 : row + SIDE + 1], axis=0))
    own = steps[SIDE - 1]
    return bool(np.delete(steps, SIDE - 1).max() < ALONE * own)


def _may_jump(gyr: np.ndarray, acc: np.ndarray) -> bool:
    """Whether any two rows differ by enough; most recordings at rates of hundreds have none."""
    far = np.ones(len(gyr) - 1, dtype=bool)
    for readings, least in ((gyr, LEAST_RATE), (acc, LEAST_FORCE)):
        change = np.zeros(len(far))
        for column in readings.T:
            np.fmax(change, np.abs(np.diff(column)), out=change)
        far &= change > least / 2
    return bool(far.any())


def _jumps(readings: np.ndarray) -> np.ndarray:
    """By how much the straight lines on either side of each place between two rows differ there,
    shape (n - 2 SIDE + 1, 3).
    """
    # the line through rows at 1/2, 3/2, ... from a place, at that place
    at = np.arange(SIDE) + 0.5
    weights = 1 / SIDE - (at - at.mean()) * at.mean() / np.sum((at - at.mean()) ** 2)
    count = len(readings) - 2 * SIDE + 1
    after = sum(weights[k] * readings[SIDE + k : SIDE + k + count] for k in range(SIDE))
    before = sum(weights[k] * readings[SIDE - 1 - k : SIDE - 1 - k + count] for k in range(SIDE))
    return np.asarray(after - before)


def _lost_for(gyr: np.ndarray, acc: np.ndarray, row: int, jump: np.ndarray) -> float:
    """How long a sensor turned unseen for gravity to have moved by a jump [s].

    In a frame that turns, a vector fixed in space changes by -omega x a dt.
    """
    near = slice(row - 1, row + 3)
    rate, force = gyr[near].mean(axis=0), acc[near].mean(axis=0)
    change = -np.cross(rate, force)
    if np.linalg.norm(rate) < LEAST_SPEED or not np.any(change):
        return 0.0
    return max(float(jump @ change / (change @ change)), 0.0)
