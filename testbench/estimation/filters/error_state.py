"""The error-state Kalman filters that MATLAB calls imufilter (6 axes) and ahrsfilter (9 axes)."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import (
    GRAVITY,
    backwards,
    begin,
    factorise,
    forwards,
    length,
    to_earth,
    to_sensor,
    turned,
)


@njit(cache=True)
def weigh(
    state: np.ndarray,
    p: np.ndarray,
    k: float,
    g: np.ndarray,
    z: np.ndarray,
    s: np.ndarray,
    y: np.ndarray,
    used: int,
) -> None:
    """The factor of S = H P H' + R into s, and S^-1 z into y; g holds [g x] above [m x], shape (6,
    3).
    """
    for r in range(used):
        for c in range(r + 1):
            s[r, c] = 0.0
            for j in range(3):
                s[r, c] += (
                    g[r, j]
                    * g[c, j]
                    * (state[11 + j] - 2.0 * k * state[23 + j] + k * k * state[14 + j])
                )
        s[r, r] += state[17 + r] + k * k * (p[1] + p[2]) + (p[0] + p[3] if r < 3 else p[5] + p[6])
        y[r] = z[r]
    factorise(s, used)
    forwards(s, y, used, 0)
    backwards(s, y, used)


@njit(cache=True)
def choose(
    state: np.ndarray,
    p: np.ndarray,
    k: float,
    g: np.ndarray,
    z: np.ndarray,
    s: np.ndarray,
    y: np.ndarray,
    used: int,
) -> int:
    """Weigh what can be used: the number of rows, 0 if the force is not a number.

    The field is left out where it is not a number, or disturbed by more than twice its size.
    """
    if not np.isfinite(z[0] + z[1] + z[2]):
        return 0
    if used == 6 and np.isfinite(z[3] + z[4] + z[5]):
        weigh(state, p, k, g, z, s, y, 6)
        disturbance2 = 0.0
        for j in range(3):
            disturbance2 += (state[20 + j] * y[3 + j]) ** 2
        if disturbance2 <= 4.0 * (state[26] * state[26] + state[27] * state[27]):
            return 6
    weigh(state, p, k, g, z, s, y, 3)
    return 3


@njit(cache=True)
def renew(
    state: np.ndarray,
    p: np.ndarray,
    k: float,
    g: np.ndarray,
    s: np.ndarray,
    y: np.ndarray,
    e: np.ndarray,
    b: np.ndarray,
    used: int,
) -> None:
    """The error e = K z, shape (12,), and Q for the next sample from the diagonal of P+ = P - K H
    P.

    The columns of H P are those of g times a number for turn and offset, and those of the identity
    for acceleration and disturbance, so that the diagonal of P H' S^-1 H P needs forward
    substitution only.
    """
    for j in range(3):
        turn, offset = state[11 + j] - k * state[23 + j], state[23 + j] - k * state[14 + j]
        along = 0.0
        for r in range(used):
            b[r] = g[r, j]
            along += g[r, j] * y[r]
        length2 = forwards(s, b, used, 0)
        e[j], e[3 + j] = turn * along, offset * along
        drifting = state[14 + j] - offset * offset * length2 + p[2]
        state[11 + j] += k * k * (drifting + p[1]) - turn * turn * length2
        state[14 + j], state[23 + j] = drifting, -k * drifting
        for part in range(2 if p.shape[0] > 5 else 1):
            row, at = 3 * part + j, 17 + 3 * part + j
            e[6 + row], loss = 0.0, 0.0
            if row < used:
                b[:] = 0.0
                b[row] = 1.0
                e[6 + row] = state[at] * y[row] if part == 0 else -state[at] * y[row]
                loss = state[at] * state[at] * forwards(s, b, used, row)
            state[at] = p[4 + 3 * part] ** 2 * (state[at] - loss) + p[3 + 3 * part]


@njit(cache=True)
def first_variances(state: np.ndarray, mag: np.ndarray, p: np.ndarray, use_mag: bool) -> None:
    """MATLAB's InitialProcessNoise, and the field of the first sample, with the strength that p
    asks for.
    """
    for j in range(3):
        state[11 + j], state[14 + j], state[17 + j], state[20 + j] = (
            6.092348396e-6,
            7.6154354947e-5,
            9.62361e-3,
            0.6,
        )
    if use_mag:
        _, hy, hz = to_earth(state[1], state[2], state[3], state[4], mag[0], mag[1], mag[2])
        scale = p[8] / length(mag) if p[8] > 0.0 else 1.0
        state[26], state[27] = hy * scale, hz * scale


@njit(cache=True)
def error_state(readings: Readings, p: np.ndarray, state: np.ndarray, use_mag: bool) -> np.ndarray:
    """Error-state filter of orientation, gyroscope offset, linear acceleration and magnetic
    disturbance.

    The error is folded into the estimate after each sample, so that its prediction is zero and P- =
    Q, which is rebuilt from the diagonal of P+ (NXP AN5023, 2016; MATLAB's description of imufilter
    and ahrsfilter). With g, m the expected gravity and field in the sensor, k the interval and x =
    (turn, offset, acceleration, disturbance):

        z = [g - (acc - a); m - mag] = [[g x, -k g x, I, 0], [m x, -k m x, 0, -I]] x

    Args:
        readings: Of the sensor.
        p: Parameters, shape (k,): variances of accelerometer, gyroscope, offset drift, linear
            acceleration, decay of that; of magnetometer, disturbance, decay of that, and strength
            of the field [uT].
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, offset,
            acceleration, diagonal of Q (turn, offset, acceleration, disturbance), its turn-offset
            part, field (north, up).
        use_mag: Whether to use the magnetometer.
    """
    gyr, acc, mag, dt = readings.gyr, readings.acc, readings.mag, readings.dt
    n = gyr.shape[0]
    out = np.empty((n, 4))
    s, g, e = np.empty((6, 6)), np.zeros((6, 3)), np.zeros(12)
    b, y, z = np.empty(6), np.empty(6), np.empty(6)
    for i in range(n):
        if state[0] == 0.0:
            if begin(state, acc[i], mag[i], use_mag, out[i]):
                first_variances(state, mag[i], p, use_mag)
            continue
        k = dt[i]
        rx, ry, rz = (
            k * (gyr[i, 0] - state[5]),
            k * (gyr[i, 1] - state[6]),
            k * (gyr[i, 2] - state[7]),
        )
        qw, qx, qy, qz = turned(state[1], state[2], state[3], state[4], rx, ry, rz)
        x1, y1, z1 = to_sensor(qw, qx, qy, qz, 0.0, 0.0, GRAVITY)
        x2, y2, z2 = to_sensor(qw, qx, qy, qz, 0.0, state[26], state[27])
        g[0, 1], g[0, 2], g[1, 0], g[1, 2], g[2, 0], g[2, 1] = -z1, y1, z1, -x1, -y1, x1
        g[3, 1], g[3, 2], g[4, 0], g[4, 2], g[5, 0], g[5, 1] = -z2, y2, z2, -x2, -y2, x2
        z[0], z[1], z[2] = x1 - acc[i, 0], y1 - acc[i, 1], z1 - acc[i, 2]
        z[3], z[4], z[5] = x2 - mag[i, 0], y2 - mag[i, 1], z2 - mag[i, 2]
        for j in range(3):
            z[j] += p[4] * state[8 + j]
        used = choose(state, p, k, g, z, s, y, 6 if use_mag else 3)
        renew(state, p, k, g, s, y, e, b, used)
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


def _variance(
    name: str, default: float, unit: str, meaning: str, low: float, high: float, least: float = 0.0
) -> Parameter:
    return Parameter(name, default, unit, f"variance of {meaning}", MATLAB, low, high, "log", least)


def _decay(name: str, what: str) -> Parameter:
    return Parameter(
        name,
        0.5,
        "1",
        f"what is left of {what} a sample later",
        MATLAB,
        0.0,
        0.99,
        "linear",
        0.0,
        1.0,
    )


PARAMETERS = (
    _variance("acc_var_m2_s4", 1.9247e-4, "(m/s^2)^2", "the accelerometer's noise", 1e-6, 0.1),
    _variance("gyr_var_rad2_s2", 9.1385e-5, "(rad/s)^2", "the gyroscope's noise", 1e-8, 1e-2),
    _variance(
        "gyr_drift_var_rad2_s2",
        3.0462e-13,
        "(rad/s)^2",
        "the step of its offset in a sample",
        1e-16,
        1e-7,
    ),
    _variance(
        "linear_acc_var_m2_s4", 9.6236e-3, "(m/s^2)^2", "linear acceleration", 1e-4, 100.0, 1e-12
    ),
    _decay("linear_acc_decay", "linear acceleration"),
)
STRENGTH = "strength of the earth's field; 0: that of the first sample"
MAG_PARAMETERS = (
    _variance("mag_var_uT2", 0.1, "uT^2", "the magnetometer's noise", 1e-3, 10.0),
    _variance("mag_disturbance_var_uT2", 0.5, "uT^2", "magnetic disturbance", 1e-2, 1e3, 1e-12),
    _decay("mag_disturbance_decay", "a disturbance"),
    Parameter("field_uT", 0.0, "uT", STRENGTH, "in place of MATLAB's 50 uT", 20.0, 70.0, "linear"),
)
SOURCE = (
    "MathWorks, imufilter and ahrsfilter, 2018; after NXP AN5023, 2016; Castellanos Alonso "
    "2023, section on imufilter"
)


class ImuFilter(KernelFilter):
    """Error-state Kalman filter of accelerometer and gyroscope: arbitrary heading."""

    name, needs, source, PARAMETERS = "imufilter", ("gyr", "acc"), SOURCE, PARAMETERS
    layout = (
        ("started", 1),
        ("q", 4),
        ("gyr_bias_rad_s", 3),
        ("linear_acc_m_s2", 3),
        ("variance", 12),
        ("turn_offset", 3),
        ("field_uT", 2),
    )
    kernel, options = staticmethod(error_state), (False,)
    behaviour = (
        "Only the diagonal of P+ is kept; its variances are per sample, so that they depend on the "
        "rate. With its defaults a "
        "move of the arm passes for an offset about the vertical of up to 1 deg/s, which then "
        "stays: linear_acc_var_m2_s4 of 1 "
        "ends that."
    )


class AhrsFilter(KernelFilter):
    """Error-state Kalman filter of accelerometer, gyroscope and magnetometer."""

    name, needs, source = "ahrsfilter", ("gyr", "acc", "mag"), SOURCE
    PARAMETERS = (*PARAMETERS, *MAG_PARAMETERS)
    layout = ImuFilter.layout
    kernel, options = staticmethod(error_state), (True,)
    behaviour = (
        "As imufilter; learns the dip, starting from the first sample's; drops the field "
        "while disturbed by twice its size."
    )
