"""Integration of the gyroscope alone."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import integrated, started


@njit(cache=True)
def integrate(
    readings: Readings,
    p: np.ndarray,
    state: np.ndarray,
) -> np.ndarray:
    """Integrate the rate; the first sample's specific force, if there is one, gives the start.

    Args:
        readings: Samples of the sensor.
        p: Unused, shape (0,).
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q.
    """
    gyr, acc, mag, dt = readings
    n = gyr.shape[0]
    out = np.empty((n, 4))
    for i in range(n):
        if state[0] == 0.0:
            if not started(state, acc[i], mag[i], False):
                state[0], state[1] = 1.0, 1.0
        else:  # q exp(rate dt / 2)
            state[1], state[2], state[3], state[4] = integrated(state, gyr[i], dt[i])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


class Gyro(KernelFilter):
    """The gyroscope's rate integrated by the exponential map, which a filter has to better."""

    name, needs = "gyro", ("gyr",)
    source = (
        "exponential map of SO(3), e.g. Markley & Crassidis, Fundamentals of Spacecraft "
        "Attitude Determination, 2014, ch. 3"
    )
    layout = (("started", 1), ("q", 4))
    kernel = staticmethod(integrate)
    behaviour = (
        "Starts level by the first accelerometer sample if there is one; then drifts by "
        "the integral of its bias."
    )
