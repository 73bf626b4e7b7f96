"""What an arm's measured angles and rates say of its accelerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.model.windows import savitzky_golay
from testbench.records.session.samples import ArmSamples

SMOOTHING_S = 0.1
"""Width of the cubic Savitzky-Golay window that differentiates the measured joint rates [s]."""


@dataclass(frozen=True)
class Smoothing:
    """How joint rates become accelerations: a cubic Savitzky-Golay filter.

    Attributes:
        window: Its width [samples].
        interval: Between samples [s].
    """

    window: int
    interval: float

    @staticmethod
    def of(time_ns: np.ndarray) -> Smoothing:
        """What suits a recording at a regular interval.

        Args:
            time_ns: Of its samples, increasing, shape (n,).
        """
        return Smoothing.at(
            len(time_ns),
            median_interval(time_ns) / NANOSECONDS if len(time_ns) > 1 else 0.0,
        )

    @staticmethod
    def at(n: int, interval: float) -> Smoothing:
        """What suits n samples at an interval [s]."""
        if n < 5:
            return Smoothing(0, 0.0)
        return Smoothing(
            min(max(2 * round(SMOOTHING_S / interval / 2) + 1, 5), n - 1 + n % 2), interval
        )

    def acceleration(self, v_measured: np.ndarray, rested: bool = False) -> np.ndarray:
        """Joint accelerations of measured rates.

        Args:
            v_measured: Shape (n, n_joints) [rad/s].
            rested: Whether the joints stood still before the first row. The window then reaches
                back into that rest; else the first rows are of a polynomial that knows only what
                follows, and are off where the arm starts at once.

        Returns:
            Shape (n, n_joints) [rad/s^2]; zeros where there are too few samples.
        """
        if self.window == 0:
            return np.zeros_like(v_measured)
        before = self.window // 2 if rested else 0
        v = np.pad(v_measured, ((before, 0), (0, 0)))
        found = savitzky_golay(v, self.window, 3, derivative=1, interval=self.interval)
        return np.asarray(found[before:])


def joint_acceleration(samples: ArmSamples) -> np.ndarray:
    """Joint accelerations, shape (n, n_joints) [rad/s^2], of rates measured regularly."""
    return Smoothing.of(samples.host_time_ns).acceleration(samples.v_measured)
