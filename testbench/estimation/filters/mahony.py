"""Mahony's explicit complementary filter, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.gates import ACC_GATE, MAG_GATE
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import (
    begin,
    field_deviates,
    length,
    to_earth,
    to_sensor,
    up_in_sensor,
    usable_force,
)

PAPER = "Mahony, Hamel & Pflimlin, IEEE Trans. Automatic Control 53(5), 2008"


@njit(cache=True)
def mahony(readings: Readings, p: np.ndarray, state: np.ndarray, use_mag: bool) -> np.ndarray:
    """Mahony's explicit complementary filter, eqs 48a to 48c, with unit weights.

    The expected field has the measured one's dip. One explicit Euler step a sample.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): kp [rad/s], ki [rad/s^2], gate of the accelerometer [m/s^2],
            gate of the magnetometer.
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, bias, field of
            reference.
        use_mag: Whether to use the magnetometer.
    """
    gyr, acc, mag, dt = readings
    kp, ki = p[0], p[1]
    n = gyr.shape[0]
    out = np.empty((n, 4))
    for i in range(n):
        if state[0] == 0.0:
            begin(state, acc[i], mag[i], use_mag, out[i])
            continue
        w, x, y, z = state[1], state[2], state[3], state[4]
        ex = ey = ez = 0.0
        a = length(acc[i])
        if usable_force(a, p[2]):
            ux, uy, uz = up_in_sensor(w, x, y, z)
            ax, ay, az = acc[i, 0] / a, acc[i, 1] / a, acc[i, 2] / a
            # error: measured x expected vertical, the first term of the sum in eqs 48
            ex, ey, ez = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
        m = length(mag[i]) if use_mag else 0.0
        if m > 0.0 and not field_deviates((w, x, y, z), mag[i], p[3], state[8:10]):
            mx, my, mz = mag[i, 0] / m, mag[i, 1] / m, mag[i, 2] / m
            hx, hy, hz = to_earth(w, x, y, z, mx, my, mz)
            vx, vy, vz = to_sensor(w, x, y, z, 0.0, np.sqrt(hx * hx + hy * hy), hz)
            # plus measured x expected field, the second term
            ex, ey, ez = ex + my * vz - mz * vy, ey + mz * vx - mx * vz, ez + mx * vy - my * vx
        # bias: its rate of change is -ki times the error
        state[5] -= ki * ex * dt[i]
        state[6] -= ki * ey * dt[i]
        state[7] -= ki * ez * dt[i]
        # rate of change of q: q (rate - bias + kp error) / 2, over a step
        h = 0.5 * dt[i]
        gx = h * (gyr[i, 0] - state[5] + kp * ex)
        gy = h * (gyr[i, 1] - state[6] + kp * ey)
        gz = h * (gyr[i, 2] - state[7] + kp * ez)
        w2 = w - x * gx - y * gy - z * gz
        x2 = x + w * gx + y * gz - z * gy
        y2 = y + w * gy - x * gz + z * gx
        z2 = z + w * gz + x * gy - y * gx
        k = 1.0 / np.sqrt(w2 * w2 + x2 * x2 + y2 * y2 + z2 * z2)
        state[1], state[2], state[3], state[4] = w2 * k, x2 * k, y2 * k, z2 * k
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


BROAD = "Laidig et al., Data 6(7):72, 2021: best of one set for all trials of BROAD"
KP = Parameter("kp", 0.74, "rad/s", "proportional gain", BROAD, 0.05, 10.0)
KI = Parameter(
    "ki",
    0.0012,
    "rad/s^2",
    "integral gain, which finds the gyroscope's bias; 0: none",
    BROAD,
    1e-4,
    0.5,
)


class MahonyImu(KernelFilter):
    """Mahony's filter without magnetometer: arbitrary heading."""

    name, needs, source = "mahony_imu", ("gyr", "acc"), PAPER
    PARAMETERS = (KP, KI, ACC_GATE)
    layout = (("started", 1), ("q", 4), ("gyr_bias_rad_s", 3), ("field", 2))
    kernel, options = staticmethod(mahony), (False,)
    behaviour = (
        "Follows slow accelerations of the sensor; its bias about the vertical is not observable."
    )


class MahonyMarg(KernelFilter):
    """Mahony's filter with magnetometer."""

    name, needs, source = "mahony_marg", ("gyr", "acc", "mag"), PAPER
    PARAMETERS = (KP, KI, ACC_GATE, MAG_GATE)
    layout = MahonyImu.layout
    kernel, options = staticmethod(mahony), (True,)
    behaviour = "As mahony_imu; a steep field corrects heading weakly and a disturbed one tilts it."
