"""A truth and a gyroscope side by side: how far both turn between two instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.estimation.signals.rates import LOST_S, WIDEST
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.windows import moving_mean

SMOOTHED_S = 0.25
SLACK_S = 0.02
"""By so much the truth may come earlier or later anywhere: filters delay, and clocks wander [s]."""
LONGEST_LAG_S, LAG_SPAN_S, LAG_SPANS = 0.3, 0.2, 2_000
"""A truth may come so late from beginning to end, by turns over so long, so many of them [s, s, 1].
"""
LEAST_STEP = np.radians(8.0)
"""A truth that turns by so much more than the gyroscope has stepped [rad]."""
ANY_TURN = 1e3
"""What a sensor may have turned by while it gave no samples [rad]."""


@dataclass(frozen=True)
class Turning:
    """How a gyroscope turned.

    Attributes:
        time_ns: Of its samples, shape (n,).
        q: Orientation against that at the first sample, by the gyroscope alone, shape (n, 4).
        path: Angle passed through since then, shape (n,) [rad].
        slow_path: The same of what it turns for a while, noise left out, shape (n,) [rad].
        coning: By how much axes that change between samples may have made it wrong since then,
            shape (n,) [rad].
    """

    time_ns: np.ndarray
    q: np.ndarray
    path: np.ndarray
    slow_path: np.ndarray
    coning: np.ndarray

    @staticmethod
    def of(rate: np.ndarray, time_ns: np.ndarray) -> Turning:
        """The integral of rates.

        Turns about axes that change add a twelfth of the product of those that follow one another
        (Savage, J. Guidance, Control, and Dynamics 21, 1998, eq. 33), of one sign or the other by
        how a sensor samples.

        Args:
            rate: Without the reading at rest, shape (n, 3) [rad/s].
            time_ns: Of the samples, shape (n,) [ns].
        """
        seconds = np.diff(time_ns, prepend=time_ns[:1]) / NANOSECONDS
        lost = (seconds > LOST_S) | _turns_in_a_hole(rate, seconds)
        seconds = np.where(lost, 0.0, seconds)
        turns = rate * seconds[:, None]
        smooth = moving_mean(rate, max(round(SMOOTHED_S / max(float(np.median(seconds)), 1e-6)), 1))
        return Turning(
            time_ns,
            _chained(rotation.from_rotation_vector(turns)),
            np.cumsum(rotation.lengths(rate) * seconds + np.where(lost, ANY_TURN, 0.0)),
            np.cumsum(rotation.lengths(smooth) * seconds),
            np.cumsum(np.append(0.0, rotation.lengths(np.cross(turns[:-1], turns[1:])) / 12)),
        )

    def at(self, time_ns: np.ndarray) -> np.ndarray:
        """Orientations at times, shape (m, 4).

        Args:
            time_ns: Shape (m,) [ns].
        """
        inside = np.clip(time_ns, self.time_ns[0], self.time_ns[-1])
        return rotation.interpolate(self.time_ns, self.q, inside)

    def path_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Path at times, shape (m,) [rad].

        Args:
            time_ns: Shape (m,) [ns].
        """
        return np.asarray(np.interp(time_ns, self.time_ns, self.path))


def _turns_in_a_hole(rate: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Whether it turns too far between two samples for nobody to ask how, shape (n,), bool.

    Readings that were clipped, or lost amid fast motion, tell no turn.

    Args:
        rate: Shape (n, 3) [rad/s].
        seconds: Before each sample, shape (n,) [s].
    """
    speed = rotation.lengths(rate)
    fastest = np.maximum(speed, np.append(speed[:1], speed[:-1]))
    usual = float(np.median(seconds))
    return np.asarray((seconds > WIDEST * usual) & (fastest * seconds > LEAST_STEP))


@dataclass(frozen=True)
class Compared:
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
    def of(time_ns: np.ndarray, q: np.ndarray, turning: Turning) -> Compared:
        """Side by side, whatever the delay between the two is.

        Args:
            time_ns: Of the truth, shape (m,) [ns].
            q: The truth, shape (m, 4).
            turning: Of the gyroscope.
        """
        lags = np.round(NANOSECONDS * np.array([-SLACK_S, 0.0, SLACK_S])).astype(np.int64)
        lags += _lag(time_ns, q, turning)
        turned = np.stack([turning.at(time_ns + lag) for lag in lags])
        return Compared(time_ns, q, turned, turning.path_at(time_ns + lags[1]))

    def differences(self, i: np.ndarray | slice, j: np.ndarray | slice) -> np.ndarray:
        """How differently both turn, for the three delays, shape (3, k) [rad].

        Args:
            i: Rows that the turns begin at, shape (k,).
            j: Those where they end, shape (k,).
        """
        true = angle_between(self.q[i], self.q[j])
        return np.abs(true - angle_between(self.turned[:, i], self.turned[:, j]))


def _lag(time_ns: np.ndarray, q: np.ndarray, turning: Turning) -> int:
    """How late the gyroscope turns after the truth, all in all [ns].

    A truth that comes late is not one that steps.

    Args:
        time_ns: Of the truth, shape (m,) [ns].
        q: The truth, shape (m, 4).
        turning: Of the gyroscope.
    """
    usual = max(median_interval(time_ns), 1.0) if len(time_ns) > 1 else 1.0
    apart = max(round(LAG_SPAN_S * NANOSECONDS / usual), 1)
    i = np.arange(0, len(time_ns) - apart, max((len(time_ns) - apart) // LAG_SPANS, 1))
    if len(i) < 2:
        return 0
    true = angle_between(q[i], q[i + apart])
    lags = np.arange(-LONGEST_LAG_S, LONGEST_LAG_S + SLACK_S / 2, SLACK_S) * NANOSECONDS
    lags = np.round(lags).astype(np.int64)
    begin, end = time_ns[i], time_ns[i + apart]
    apart_by = [
        float(np.mean(np.minimum(np.abs(true - turned), LEAST_STEP)))
        for turned in (
            angle_between(turning.at(begin + own), turning.at(end + own)) for own in lags
        )
    ]
    return int(lags[int(np.argmin(apart_by))])


def angle_between(first: np.ndarray, then: np.ndarray) -> np.ndarray:
    """Angles of the rotations from some orientations to others, shape (..., k) [rad].

    Args:
        first: Those that the rotations begin at, shape (..., k, 4).
        then: Where they end, shape (..., k, 4).
    """
    return np.asarray(rotation.angle(rotation.multiply(rotation.conjugate(first), then)))


@njit(cache=True)
def _chained(turns: np.ndarray) -> np.ndarray:
    """Products of rotations, each with all before it, shape (n, 4)."""
    result = np.empty((len(turns), 4))
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for i in range(len(turns)):
        # q_i = q_{i-1} turn_i, scaled to unit length
        w, x, y, z = rotation.product(
            (w, x, y, z), (turns[i, 0], turns[i, 1], turns[i, 2], turns[i, 3])
        )
        w, x, y, z = rotation.unit(w, x, y, z)
        result[i, 0], result[i, 1], result[i, 2], result[i, 3] = w, x, y, z
    return result
