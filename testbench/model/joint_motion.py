"""What an arm's measured angles and rates say of its accelerations."""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from testbench.frames import NANOSECONDS
from testbench.records.samples import ArmSamples

SMOOTHING_S = 0.1
"""Width of the cubic Savitzky-Golay window that differentiates the measured joint rates [s]."""


def joint_acceleration(samples: ArmSamples) -> np.ndarray:
    """Joint accelerations [rad/s^2], shape (n, n_joints), from measured rates at a regular interval."""
    n = len(samples.host_time_ns)
    if n < 5:
        return np.zeros_like(samples.v_measured)
    interval = float(np.median(np.diff(samples.host_time_ns))) / NANOSECONDS
    window = min(max(2 * round(SMOOTHING_S / interval / 2) + 1, 5), n - 1 + n % 2)
    return np.asarray(savgol_filter(samples.v_measured, window, 3, deriv=1, delta=interval, axis=0))
