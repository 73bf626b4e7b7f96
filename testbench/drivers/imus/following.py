"""The motion that an arm reports, as simulated sensors feel it: for rehearsals on a moving arm."""

from __future__ import annotations

import numpy as np

from testbench.exceptions import DriverError
from testbench.frames import NANOSECONDS
from testbench.model.windows import savitzky_golay
from testbench.records.session.samples import ArmSamples
from testbench.records.session.trajectory import Trajectory

KEPT_NS = 3 * NANOSECONDS
"""The motion stays known for so long [ns]."""
SMOOTHING_S = 0.1
"""Width of the cubic Savitzky-Golay window that smooths and differentiates what was reported [s];
its half is not known yet.
"""
KNOT_EVERY = 4
"""Samples between two knots of the motion: the polynomial between them follows 5 Hz, and noise
is not blown up.
"""


class ReportedMotion:
    """Angles, rates and accelerations at any recent time, from what an arm reported.

    Args:
        rate: Of the regular grid on which rates are differentiated [Hz].
    """

    def __init__(self, rate: float):
        self._interval = round(NANOSECONDS / rate)
        self._window = max(2 * round(SMOOTHING_S * rate / 2) + 1, 5)
        self._time = np.zeros(0, np.int64)
        self._q = self._v = np.zeros((0, 0))
        self._motion: Trajectory | None = None

    @property
    def known_until_ns(self) -> int:
        """Up to this host time the motion is known [ns]; 0 at first."""
        return 0 if self._motion is None else int(self._motion.time_ns[-1])

    def add(self, samples: ArmSamples) -> None:
        """Take what the arm reported since the last call."""
        if not len(samples.host_time_ns):
            return
        if not len(self._time):  # the arm rests until its first sample
            first = np.minimum(samples.host_time_ns[:1], 0)
            self._time, self._q, self._v = (
                first,
                samples.q_measured[:1],
                np.zeros_like(samples.v_measured[:1]),
            )
        later = samples.host_time_ns > self._time[-1]
        self._time = np.append(self._time, samples.host_time_ns[later])
        self._q = np.vstack([self._q, samples.q_measured[later]])
        self._v = np.vstack([self._v, samples.v_measured[later]])
        recent = self._time >= self._time[-1] - KEPT_NS
        self._time, self._q, self._v = self._time[recent], self._q[recent], self._v[recent]
        self._differentiate()

    def _differentiate(self) -> None:
        spacing = KNOT_EVERY * self._interval
        start = -(-int(self._time[0]) // spacing) * spacing  # the same knots at every call
        grid = np.arange(start, int(self._time[-1]) + 1, self._interval)
        if len(grid) <= self._window:
            return
        from scipy.interpolate import CubicHermiteSpline  # a third of a second to load

        curve = CubicHermiteSpline(self._time / NANOSECONDS, self._q, self._v)
        q, v = curve(grid / NANOSECONDS), curve(grid / NANOSECONDS, 1)
        a = savitzky_golay(v, self._window, 3, 1, self._interval / NANOSECONDS)
        # Encoders are noisy: unsmoothed angles 8 ms apart would make accelerations of 0.3 rad/s^2
        # between the knots.
        q, v = (savitzky_golay(array, self._window, 3) for array in (q, v))
        known = slice(None, -(self._window // 2), KNOT_EVERY)
        self._motion = Trajectory(grid[known], q[known], v[known], a[known])

    def state(self, time_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Motion of the joints at times that are known.

        Args:
            time_ns: Shape (n,) [ns].

        Returns:
            Joint angles [rad], rates [rad/s] and accelerations [rad/s^2], each of shape
            (n, n_joints).

        Raises:
            DriverError: Nothing is known yet.
        """
        if self._motion is None:
            raise DriverError("the arm has reported no motion yet")
        first, last = int(self._motion.time_ns[0]), int(self._motion.time_ns[-1]) - 1
        return self._motion.at(np.clip(time_ns, first, last))
