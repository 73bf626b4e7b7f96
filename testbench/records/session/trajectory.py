"""A joint trajectory: knots with position, velocity and acceleration, joined by quintics.

Jerk-limited motion is a cubic between the switches of its jerk, and a quintic that meets value,
slope and curvature at both ends of a cubic is that cubic: with knots at the switches nothing is
lost. Between knots q, v and a are exact derivatives of one another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.frames import NANOSECONDS

TrueState = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""True angles [rad], rates [rad/s] and accelerations [rad/s^2] of joints at host times [ns], as of
`Trajectory.at`.
"""


@dataclass(frozen=True)
class Trajectory:
    """Knots of a joint trajectory.

    Attributes:
        time_ns: Strictly increasing, shape (k,), int64.
        q: Angles, shape (k, n_joints) [rad].
        v: Rates, shape (k, n_joints) [rad/s].
        a: Accelerations, shape (k, n_joints) [rad/s^2].
    """

    time_ns: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.time_ns[-1] - self.time_ns[0]) / NANOSECONDS

    def at(self, time_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State at times, held at rest before the first and after the last knot.

        Args:
            time_ns: Increasing, shape (n,), int64.

        Returns:
            Angles [rad], rates [rad/s] and accelerations [rad/s^2], each of shape (n, n_joints).
        """
        return hermite(
            self.time_ns, self.q, self.v, self.a, np.ascontiguousarray(time_ns, dtype=np.int64)
        )

    def moving(self) -> np.ndarray:
        """Which intervals between knots move at all, shape (k - 1,), bool."""
        still = (self.v == 0).all(axis=1) & (self.a == 0).all(axis=1)
        same = (self.q[1:] == self.q[:-1]).all(axis=1)
        return ~(still[1:] & still[:-1] & same)

    def sample_moving(self, interval_ns: int, size: int) -> Iterator[np.ndarray]:
        """Times on a regular grid where the trajectory moves, with every knot.

        Args:
            interval_ns: Of the grid.
            size: Of the chunks that they come in, but for the last.

        Yields:
            Shape (size,), int64 [ns].
        """
        first, last, moving = int(self.time_ns[0]), int(self.time_ns[-1]), self.moving()
        held = np.zeros(0, dtype=np.int64)
        for begin in range(first, last + 1, interval_ns * size):
            end = min(begin + interval_ns * size, last + 1)
            grid = np.arange(begin, end, interval_ns)
            index = np.minimum(
                np.searchsorted(self.time_ns, grid, side="right") - 1, len(moving) - 1
            )
            knots = self.time_ns[slice(*np.searchsorted(self.time_ns, [begin, end]))]
            held = np.concatenate([held, np.unique(np.concatenate([knots, grid[moving[index]]]))])
            while len(held) >= size:
                yield held[:size]
                held = held[size:]
        if len(held):
            yield held


@njit(cache=True)
def hermite(
    knots: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quintic Hermite interpolation with its first and second derivatives, for `Trajectory.at`.

    Args:
        knots: Strictly increasing times, shape (k,), int64 [ns].
        q: Angles at the knots, shape (k, m) [rad].
        v: Rates at the knots, shape (k, m) [rad/s].
        a: Accelerations at the knots, shape (k, m) [rad/s^2].
        at: Increasing times, shape (n,), int64 [ns].

    Returns:
        Angles [rad], rates [rad/s] and accelerations [rad/s^2], each of shape (n, m).
    """
    n, m, last = at.shape[0], q.shape[1], knots.shape[0] - 1
    qs = np.empty((n, m))
    vs = np.empty((n, m))
    accelerations = np.empty((n, m))
    k = (
        max(min(np.searchsorted(knots, at[0], side="right") - 1, last - 1), 0) if n else 0
    )  # far into hours of knots at once
    c3, c4, c5 = np.empty(m), np.empty(m), np.empty(m)
    known = -1  # interval whose coefficients these are
    for i in range(n):
        t = at[i]
        if k > 0 and t < knots[k]:
            k = 0
        while k < last - 1 and t >= knots[k + 1]:
            k += 1
        outside = t < knots[0] or t >= knots[last]
        if outside or last == 0:
            edge = last if t >= knots[last] else 0
            for j in range(m):
                qs[i, j] = q[edge, j]
                vs[i, j] = v[edge, j] if t == knots[edge] else 0.0
                accelerations[i, j] = a[edge, j] if t == knots[edge] else 0.0
            continue
        if k != known:
            h = (knots[k + 1] - knots[k]) * 1e-9
            for j in range(m):
                # What the parabola from the first knot's state lacks at the second, in q, v and a.
                dq = q[k + 1, j] - q[k, j] - v[k, j] * h - 0.5 * a[k, j] * h * h
                dv = (v[k + 1, j] - v[k, j] - a[k, j] * h) * h
                da = (a[k + 1, j] - a[k, j]) * h * h
                c3[j] = (10.0 * dq - 4.0 * dv + 0.5 * da) / h**3
                c4[j] = (-15.0 * dq + 7.0 * dv - da) / h**4
                c5[j] = (6.0 * dq - 3.0 * dv + 0.5 * da) / h**5
            known = k
        s = (t - knots[k]) * 1e-9
        for j in range(m):
            v0, a0, b3, b4, b5 = v[k, j], a[k, j], c3[j], c4[j], c5[j]
            qs[i, j] = q[k, j] + s * (v0 + s * (0.5 * a0 + s * (b3 + s * (b4 + s * b5))))
            vs[i, j] = v0 + s * (a0 + s * (3.0 * b3 + s * (4.0 * b4 + s * 5.0 * b5)))
            accelerations[i, j] = a0 + s * (6.0 * b3 + s * (12.0 * b4 + s * 20.0 * b5))
    return qs, vs, accelerations
