"""The error-state Kalman filters that MATLAB calls imufilter (6 axes) and ahrsfilter (9 axes)."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.kernel_filter import KernelFilter
from testbench.estimation.filters.maths import GRAVITY, begin, length, solve_in_place, to_earth, to_sensor, turned


@njit(cache=True)
def skew(v: np.ndarray, row: int, column: int) -> float:
    """An entry of the matrix [v x]."""
    if row == column:
        return 0.0
    third = 3 - row - column
    return v[third] if (column + 1) % 3 == row else -v[third]


@njit(cache=True)
def build(state: np.ndarray, p: np.ndarray, k: float, cross: np.ndarray, s: np.ndarray, b: np.ndarray, used: int) -> None:
    """S = H P H' + R, shape (used, used), and H P', shape (used, 12): turn, offset, acceleration, disturbance."""
    rate = k * k * (p[1] + p[2])
    for r in range(used):
        for j in range(3):
            c = skew(cross[r // 3], r % 3, j)
            b[r, j] = c * (state[11 + j] - k * state[23 + j])
            b[r, 3 + j] = c * (state[23 + j] - k * state[14 + j])
            b[r, 6 + j] = b[r, 9 + j] = 0.0
        b[r, 6 + r] = state[17 + r] if r < 3 else -state[17 + r]
    for r in range(used):
        for c in range(used):
            s[r, c] = 0.0
            for j in range(3):
                s[r, c] += skew(cross[r // 3], r % 3, j) * (b[c, j] - k * b[c, 3 + j])
        s[r, r] += state[17 + r] + rate + (p[0] + p[3] if r < 3 else p[5] + p[6])


@njit(cache=True)
def solve(
    state: np.ndarray, p: np.ndarray, k: float, cross: np.ndarray, z: np.ndarray, hp: np.ndarray, s: np.ndarray, b: np.ndarray,
    used: int,
) -> int:  # fmt: skip
    """Put S^-1 [H P', z] into b, shape (6, 13), and H P' into hp; the number of rows used, 0 if the force is not a number.

    The field is left out where it is not a number, or disturbed by twice its size or more.
    """
    if not np.isfinite(z[0] + z[1] + z[2]):
        return 0
    if used == 6 and not np.isfinite(z[3] + z[4] + z[5]):
        used = 3
    while True:
        build(state, p, k, cross, s, b, used)
        for r in range(used):
            for j in range(12):
                hp[r, j] = b[r, j]
            b[r, 12] = z[r]
        solve_in_place(s, b, used, 13)
        if used == 3:
            return used
        disturbance2 = 0.0
        for j in range(3):
            disturbance2 += (state[20 + j] * b[3 + j, 12]) ** 2
        if disturbance2 <= 4.0 * (cross[1, 0] ** 2 + cross[1, 1] ** 2 + cross[1, 2] ** 2):
            return used
        used = 3


@njit(cache=True)
def renew(state: np.ndarray, p: np.ndarray, k: float, hp: np.ndarray, b: np.ndarray, e: np.ndarray, used: int) -> None:
    """The error e = K z, shape (12,), and Q for the next sample from the diagonal of P+ = P - K H P."""
    loss = np.zeros(12)
    for j in range(12):
        e[j] = 0.0
        for r in range(used):
            e[j] += hp[r, j] * b[r, 12]
            loss[j] += hp[r, j] * b[r, j]
    for j in range(3):
        offset = state[14 + j] - loss[3 + j] + p[2]
        state[11 + j] += k * k * (offset + p[1]) - loss[j]
        state[14 + j] = offset
        state[23 + j] = -k * offset
        state[17 + j] = p[4] * p[4] * (state[17 + j] - loss[6 + j]) + p[3]
        if p.shape[0] > 5:
            state[20 + j] = p[7] * p[7] * (state[20 + j] - loss[9 + j]) + p[6]


@njit(cache=True)
def first_variances(state: np.ndarray, mag: np.ndarray, p: np.ndarray, use_mag: bool) -> None:
    """MATLAB's InitialProcessNoise, and the field of the first sample, with the strength that p asks for."""
    for j in range(3):
        state[11 + j], state[14 + j], state[17 + j], state[20 + j] = 6.092348396e-6, 7.6154354947e-5, 9.62361e-3, 0.6
    if use_mag:
        _, hy, hz = to_earth(state[1], state[2], state[3], state[4], mag[0], mag[1], mag[2])
        scale = p[8] / length(mag) if p[8] > 0.0 else 1.0
        state[26], state[27] = hy * scale, hz * scale


@njit(cache=True)
def error_state(
    gyr: np.ndarray, acc: np.ndarray, mag: np.ndarray, dt: np.ndarray, p: np.ndarray, state: np.ndarray, use_mag: bool
) -> np.ndarray:
    """Error-state filter of orientation, gyroscope offset, linear acceleration and magnetic disturbance.

    The error is folded into the estimate after each sample, so that its prediction is zero and P- = Q, which is rebuilt from
    the diagonal of P+ (NXP AN5023, 2016; MATLAB's description of imufilter and ahrsfilter). With g, m the expected gravity and
    field in the sensor, k the interval and x = (turn, offset, acceleration, disturbance):

        z = [g - (acc - a); m - mag] = [[g x, -k g x, I, 0], [m x, -k m x, 0, -I]] x

    Args:
        p: Variances of accelerometer, gyroscope, offset drift, linear acceleration, decay of that; of magnetometer,
        disturbance, decay of that, and strength of the field [uT]. state: started, q, offset, acceleration, diagonal of Q
        (turn, offset, acceleration, disturbance), its turn-offset part, field (north, up). use_mag: Whether to use the
        magnetometer.
    """
    n = gyr.shape[0]
    out = np.empty((n, 4))
    s, b, hp = np.empty((6, 6)), np.empty((6, 13)), np.empty((6, 12))
    cross, z, e = np.zeros((2, 3)), np.zeros(6), np.empty(12)
    for i in range(n):
        if state[0] == 0.0:
            if begin(state, acc[i], mag[i], use_mag, out[i]):
                first_variances(state, mag[i], p, use_mag)
            continue
        k = dt[i]
        rx, ry, rz = k * (gyr[i, 0] - state[5]), k * (gyr[i, 1] - state[6]), k * (gyr[i, 2] - state[7])
        qw, qx, qy, qz = turned(state[1], state[2], state[3], state[4], rx, ry, rz)
        cross[0, 0], cross[0, 1], cross[0, 2] = to_sensor(qw, qx, qy, qz, 0.0, 0.0, GRAVITY)
        cross[1, 0], cross[1, 1], cross[1, 2] = to_sensor(qw, qx, qy, qz, 0.0, state[26], state[27])
        for j in range(3):
            z[j] = cross[0, j] - acc[i, j] + p[4] * state[8 + j]
            z[3 + j] = cross[1, j] - mag[i, j]
        used = solve(state, p, k, cross, z, hp, s, b, 6 if use_mag else 3)
        renew(state, p, k, hp, b, e, used)
        state[1], state[2], state[3], state[4] = turned(qw, qx, qy, qz, -e[0], -e[1], -e[2])
        for j in range(3):
            state[5 + j] -= e[3 + j]
            state[8 + j] = p[4] * state[8 + j] - e[6 + j]
            out[i, 1 + j] = state[2 + j]
        out[i, 0] = state[1]
        if used == 6:  # learn the dip from the disturbance, at the same strength
            _, hy, hz = to_earth(state[1], state[2], state[3], state[4], e[9], e[10], e[11])
            north, up = state[26] + hy, state[27] + hz
            strength2 = state[26] * state[26] + state[27] * state[27]
            if north > 0.0:
                scale = np.sqrt(strength2 / (north * north + up * up))
                state[26], state[27] = north * scale, up * scale
    return out


MATLAB = "MATLAB's default (MathWorks, imufilter and ahrsfilter)"


def _variance(name: str, default: float, unit: str, meaning: str, low: float, high: float, least: float = 0.0) -> Parameter:
    return Parameter(name, default, unit, f"variance of {meaning}", MATLAB, low, high, "log", least)


def _decay(name: str, what: str) -> Parameter:
    return Parameter(name, 0.5, "1", f"what is left of {what} a sample later", MATLAB, 0.0, 0.99, "linear", 0.0, 1.0)


PARAMETERS = (
    _variance("acc_var_m2_s4", 1.9247e-4, "(m/s^2)^2", "the accelerometer's noise", 1e-6, 0.1),
    _variance("gyr_var_rad2_s2", 9.1385e-5, "(rad/s)^2", "the gyroscope's noise", 1e-8, 1e-2),
    _variance("gyr_drift_var_rad2_s2", 3.0462e-13, "(rad/s)^2", "the step of its offset in a sample", 1e-16, 1e-7),
    _variance("linear_acc_var_m2_s4", 9.6236e-3, "(m/s^2)^2", "linear acceleration", 1e-4, 100.0, 1e-12),
    _decay("linear_acc_decay", "linear acceleration"),
)
STRENGTH = "strength of the earth's field; 0: that of the first sample"
MAG_PARAMETERS = (
    _variance("mag_var_uT2", 0.1, "uT^2", "the magnetometer's noise", 1e-3, 10.0),
    _variance("mag_disturbance_var_uT2", 0.5, "uT^2", "magnetic disturbance", 1e-2, 1e3, 1e-12),
    _decay("mag_disturbance_decay", "a disturbance"),
    Parameter("field_uT", 0.0, "uT", STRENGTH, "in place of MATLAB's 50 uT", 20.0, 70.0, "linear"),
)
SOURCE = "MathWorks, imufilter and ahrsfilter, 2018; after NXP AN5023, 2016; Castellanos Alonso 2023, section on imufilter"


class ImuFilter(KernelFilter):
    """Error-state Kalman filter of accelerometer and gyroscope: arbitrary heading."""

    name, needs, source, PARAMETERS = "imufilter", ("gyr", "acc"), SOURCE, PARAMETERS
    layout = (
        ("started", 1), ("q", 4), ("gyr_bias_rad_s", 3), ("linear_acc_m_s2", 3), ("variance", 12), ("turn_offset", 3),
        ("field_uT", 2),
    )  # fmt: skip
    kernel, options = staticmethod(error_state), (False,)
    behaviour = "Only the diagonal of P+ is kept; its variances are per sample, so that they depend on the rate."


class AhrsFilter(KernelFilter):
    """Error-state Kalman filter of accelerometer, gyroscope and magnetometer."""

    name, needs, source = "ahrsfilter", ("gyr", "acc", "mag"), SOURCE
    PARAMETERS = (*PARAMETERS, *MAG_PARAMETERS)
    layout = ImuFilter.layout
    kernel, options = staticmethod(error_state), (True,)
    behaviour = (
        "As imufilter; learns the dip, starting from the first sample's; drops the field while disturbed by twice its size."
    )
