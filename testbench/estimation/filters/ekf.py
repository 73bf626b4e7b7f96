"""Extended Kalman filter whose state is the quaternion itself."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.gates import ACC_GATE, MAG_GATE
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import (
    Three,
    begin,
    field_deviates,
    length,
    to_earth,
    usable_force,
)


@njit(cache=True)
def correct(
    q: np.ndarray, dq: np.ndarray, cov: np.ndarray, v: np.ndarray, r: np.ndarray, var: float
) -> None:
    """Correct by one direction, v = R' r, one component after the other.

    With uncorrelated components this is the update by all at once, as long as all are linearised at
    the predicted q.

    Args:
        q: Predicted quaternion, shape (4,).
        dq: Correction so far, shape (4,); added to.
        cov: Covariance of q, shape (4, 4); updated.
        v: Measured direction in the sensor, shape (3,).
        r: Expected direction in the earth, shape (3,).
        var: Variance of a component of v.
    """
    w, x, y, z = q
    # elements of dh/dq / 2 of h = R' r: Sabatini 2011, eq. 21, for a general r
    a = r[0] * w + r[1] * z - r[2] * y
    b = r[0] * x + r[1] * y + r[2] * z
    c = -r[0] * y + r[1] * x - r[2] * w
    d = -r[0] * z + r[1] * w + r[2] * x
    # h itself, the rows of R' times r
    hx = r[0] * (w * w + x * x - y * y - z * z) + 2.0 * (
        r[1] * (x * y + w * z) + r[2] * (x * z - w * y)
    )
    hy = r[1] * (w * w - x * x + y * y - z * z) + 2.0 * (
        r[0] * (x * y - w * z) + r[2] * (y * z + w * x)
    )
    hz = r[2] * (w * w - x * x - y * y + z * z) + 2.0 * (
        r[0] * (x * z + w * y) + r[1] * (y * z - w * x)
    )
    for row in range(3):
        if row == 0:
            h0, h1, h2, h3, residual = 2.0 * a, 2.0 * b, 2.0 * c, 2.0 * d, v[0] - hx
        elif row == 1:
            h0, h1, h2, h3, residual = 2.0 * d, -2.0 * c, 2.0 * b, -2.0 * a, v[1] - hy
        else:
            h0, h1, h2, h3, residual = -2.0 * c, -2.0 * d, 2.0 * a, 2.0 * b, v[2] - hz
        residual -= h0 * dq[0] + h1 * dq[1] + h2 * dq[2] + h3 * dq[3]  # at dq, not at zero
        # P H', the innovation's variance, and the gain times the innovation
        p0 = cov[0, 0] * h0 + cov[0, 1] * h1 + cov[0, 2] * h2 + cov[0, 3] * h3
        p1 = cov[1, 0] * h0 + cov[1, 1] * h1 + cov[1, 2] * h2 + cov[1, 3] * h3
        p2 = cov[2, 0] * h0 + cov[2, 1] * h1 + cov[2, 2] * h2 + cov[2, 3] * h3
        p3 = cov[3, 0] * h0 + cov[3, 1] * h1 + cov[3, 2] * h2 + cov[3, 3] * h3
        s = 1.0 / (h0 * p0 + h1 * p1 + h2 * p2 + h3 * p3 + var)
        gain = residual * s
        dq[0] += p0 * gain
        dq[1] += p1 * gain
        dq[2] += p2 * gain
        dq[3] += p3 * gain
        ph = (p0, p1, p2, p3)
        for i in range(4):
            for j in range(i + 1):
                cov[i, j] -= ph[i] * ph[j] * s
                cov[j, i] = cov[i, j]


@njit(cache=True)
def predict(
    state: np.ndarray, q: np.ndarray, cov: np.ndarray, half: np.ndarray, turn: Three, noise: float
) -> None:
    """F q, scaled to unit length, and P <- F P F' + Q, with F to first order in the turn.

    Args:
        state: As of `ekf`, shape (s,), with the quaternion before the turn.
        q: Filled with the quaternion after it, shape (4,).
        cov: P, shape (4, 4); updated.
        half: Space for F P, shape (4, 4).
        turn: The turn in the interval [rad].
        noise: Its standard deviation [rad].
    """
    w, x, y, z = state[1], state[2], state[3], state[4]
    gx, gy, gz = 0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]
    # F q = q + q r / 2
    q[0] = w - gx * x - gy * y - gz * z
    q[1] = x + gx * w + gz * y - gy * z
    q[2] = y + gy * w - gz * x + gx * z
    q[3] = z + gz * w + gy * x - gx * y
    k = 1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for j in range(4):
        q[j] *= k
        # F P
        half[0, j] = cov[0, j] - gx * cov[1, j] - gy * cov[2, j] - gz * cov[3, j]
        half[1, j] = cov[1, j] + gx * cov[0, j] + gz * cov[2, j] - gy * cov[3, j]
        half[2, j] = cov[2, j] + gy * cov[0, j] - gz * cov[1, j] + gx * cov[3, j]
        half[3, j] = cov[3, j] + gz * cov[0, j] + gy * cov[1, j] - gx * cov[2, j]
    # (F P) F' + Q, with Q = noise^2 W W' and W W' = (I - q q') / 4 of a unit q
    variance = 0.25 * noise * noise
    for j in range(4):
        qj = state[1 + j] * variance
        cov[j, 0] = half[j, 0] - gx * half[j, 1] - gy * half[j, 2] - gz * half[j, 3] - qj * w
        cov[j, 1] = half[j, 1] + gx * half[j, 0] + gz * half[j, 2] - gy * half[j, 3] - qj * x
        cov[j, 2] = half[j, 2] + gy * half[j, 0] - gz * half[j, 1] + gx * half[j, 3] - qj * y
        cov[j, 3] = half[j, 3] + gz * half[j, 0] + gy * half[j, 1] - gx * half[j, 2] - qj * z
        cov[j, j] += variance


@njit(cache=True)
def ekf(readings: Readings, p: np.ndarray, state: np.ndarray, use_mag: bool) -> np.ndarray:
    """Quaternion EKF: rates as input, directions of gravity and field as measurements.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): standard deviation of the rate [rad/s], that of the force's
            direction [1], gate of the force [m/s^2], standard deviation of the field's direction
            [1], gate of the field.
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, covariance (16),
            direction of the field in the earth frame (north, up), field of reference.
        use_mag: Whether to use the magnetometer.
    """
    # Longer than a screen and of many branches: one sample's prediction and two gated corrections.
    gyr, acc, mag, dt = readings
    n = gyr.shape[0]
    out = np.empty((n, 4))
    cov = state[5:21].reshape(4, 4)
    half = np.empty((4, 4))
    q, dq, v, r = np.empty(4), np.empty(4), np.empty(3), np.zeros(3)
    for i in range(n):
        if state[0] == 0.0:
            if begin(state, acc[i], mag[i], use_mag, out[i]):
                for j in range(4):
                    cov[j, j] = 1.0
                if use_mag:  # the field's dip, kept for good
                    _, hy, hz = to_earth(
                        state[1], state[2], state[3], state[4], mag[i, 0], mag[i, 1], mag[i, 2]
                    )
                    state[21], state[22] = hy / length(mag[i]), hz / length(mag[i])
            continue
        turn = gyr[i, 0] * dt[i], gyr[i, 1] * dt[i], gyr[i, 2] * dt[i]
        predict(state, q, cov, half, turn, p[0] * dt[i])
        dq[:] = 0.0
        a = length(acc[i])
        if usable_force(a, p[2]):
            for j in range(3):
                v[j], r[j] = acc[i, j] / a, 0.0
            r[2] = 1.0
            correct(q, dq, cov, v, r, p[1] * p[1])
        m = length(mag[i]) if use_mag else 0.0
        if m > 0.0 and not field_deviates((q[0], q[1], q[2], q[3]), mag[i], p[4], state[23:25]):
            for j in range(3):
                v[j] = mag[i, j] / m
            r[0], r[1], r[2] = 0.0, state[21], state[22]
            correct(q, dq, cov, v, r, p[3] * p[3])
        for j in range(4):  # both corrections, and back to unit length
            q[j] += dq[j]
        k = 1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for j in range(4):
            state[1 + j] = q[j] * k
            out[i, j] = state[1 + j]
    return out


SOURCE = "Sabatini, Sensors 11(2), 2011, reduced to the quaternion; package ahrs: EKF"
AHRS = "package ahrs"
GYR = Parameter(
    "gyr_sd_rad_s",
    0.3,
    "rad/s",
    "standard deviation of the rate in a sample",
    AHRS,
    1e-3,
    1.0,
    least=1e-9,
)
ACC = Parameter(
    "acc_sd",
    0.5,
    "1",
    "standard deviation of the direction of the force, of a unit vector",
    AHRS,
    0.01,
    5,
    least=1e-9,
)
MAG = Parameter(
    "mag_sd",
    0.8,
    "1",
    "standard deviation of the direction of the field, of a unit vector",
    AHRS,
    0.01,
    5,
    least=1e-9,
)


class EkfImu(KernelFilter):
    """Quaternion EKF without magnetometer: arbitrary heading."""

    name, needs, source = "ekf_imu", ("gyr", "acc"), SOURCE
    PARAMETERS = (GYR, ACC, ACC_GATE)
    layout = (("started", 1), ("q", 4), ("covariance", 16), ("field_direction", 2), ("field", 2))
    kernel, options = staticmethod(ekf), (False,)
    behaviour = "No bias; only the ratio of the standard deviations counts once it has settled."


class Ekf(KernelFilter):
    """Quaternion EKF with magnetometer; the dip of the field is that of the first sample."""

    name, needs, source = "ekf", ("gyr", "acc", "mag"), SOURCE
    PARAMETERS = (GYR, ACC, ACC_GATE, MAG, MAG_GATE)
    layout = EkfImu.layout
    kernel, options = staticmethod(ekf), (True,)
    behaviour = (
        "As ekf_imu; a disturbed field tilts it, too, and a wrong dip in the first sample stays."
    )
