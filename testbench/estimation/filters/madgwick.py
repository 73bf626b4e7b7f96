"""Madgwick's gradient-descent filter, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import OrientationFilter, Run, UniformSamples


class MadgwickImu(OrientationFilter):
    """Madgwick's filter without magnetometer: arbitrary heading, no gyroscope bias state."""

    name, needs = "madgwick_imu", ("gyr", "acc")
    source = "Madgwick, Harrison & Vaidyanathan, ICORR 2011, eqs 12 to 33 with the accelerometer alone; beta from its section V"
    parameters = {"beta": 0.033}

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        return self.begin(samples.interval)(samples)

    def begin(self, interval: float) -> Run:
        """See OrientationFilter."""
        last: np.ndarray | None = None

        def run(samples: UniformSamples) -> np.ndarray:
            nonlocal last
            gyr, acc = np.ascontiguousarray(samples.gyr, float), np.ascontiguousarray(samples.acc, float)
            q = madgwick_imu(gyr, acc, interval, self.parameters["beta"], tilt(acc[0]) if last is None else last)
            last = q[-1].copy() if len(q) else last
            return q

        return run


@njit(cache=True)
def tilt(acc: np.ndarray) -> np.ndarray:
    """q_earth_from_sensor of least rotation that turns a specific force, shape (3,), upwards."""
    norm = np.sqrt(acc[0] ** 2 + acc[1] ** 2 + acc[2] ** 2)
    q = np.array([1.0, 0.0, 0.0, 0.0])
    if norm == 0.0:
        return q
    x, y, z = acc / norm
    if z < -1.0 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    w = np.sqrt((1.0 + z) / 2.0)
    q[0], q[1], q[2] = w, y / (2.0 * w), -x / (2.0 * w)
    return q


@njit(cache=True)
def madgwick_imu(gyr: np.ndarray, acc: np.ndarray, interval: float, beta: float, start: np.ndarray) -> np.ndarray:
    """Madgwick's update with gyroscope and accelerometer.

    Args:
        gyr: Shape (n, 3) [rad/s]. acc: Shape (n, 3), any unit. interval: [s]. beta: Gain [rad/s]. start: First
        q_earth_from_sensor, before the first sample, shape (4,).

    Returns:
        q_earth_from_sensor after each sample, shape (n, 4).
    """
    n = gyr.shape[0]
    out = np.empty((n, 4))
    w, x, y, z = start
    for i in range(n):
        gx, gy, gz = gyr[i]
        dw = 0.5 * (-x * gx - y * gy - z * gz)
        dx = 0.5 * (w * gx + y * gz - z * gy)
        dy = 0.5 * (w * gy - x * gz + z * gx)
        dz = 0.5 * (w * gz + x * gy - y * gx)
        norm = np.sqrt(acc[i, 0] ** 2 + acc[i, 1] ** 2 + acc[i, 2] ** 2)
        if norm > 0.0:
            # residual of the upward direction in the sensor frame, and J' f
            f1 = 2.0 * (x * z - w * y) - acc[i, 0] / norm
            f2 = 2.0 * (w * x + y * z) - acc[i, 1] / norm
            f3 = 1.0 - 2.0 * (x * x + y * y) - acc[i, 2] / norm
            sw = -2.0 * y * f1 + 2.0 * x * f2
            sx = 2.0 * z * f1 + 2.0 * w * f2 - 4.0 * x * f3
            sy = -2.0 * w * f1 + 2.0 * z * f2 - 4.0 * y * f3
            sz = 2.0 * x * f1 + 2.0 * y * f2
            step = np.sqrt(sw * sw + sx * sx + sy * sy + sz * sz)
            if step > 0.0:
                dw -= beta * sw / step
                dx -= beta * sx / step
                dy -= beta * sy / step
                dz -= beta * sz / step
        w += dw * interval
        x += dx * interval
        y += dy * interval
        z += dz * interval
        length = np.sqrt(w * w + x * x + y * y + z * z)
        w /= length
        x /= length
        y /= length
        z /= length
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = w, x, y, z
    return out
