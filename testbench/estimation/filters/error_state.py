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
    s: np.ndarray,
    y: np.ndarray,
    used: int,
) -> None:
    """Factorise the innovation's covariance S = H P H' + R, and replace y by S^-1 y.

    Args:
        state: As of `error_state`, shape (s,).
        p: Parameters as of `error_state`, shape (k,).
        k: The interval [s].
        g: [g x] above [m x], of the expected gravity and field in the sensor, shape (6, 3).
        s: Filled with the Cholesky factor of S, shape (6, 6).
        y: The innovation, shape (6,).
        used: Rows that count, 3 or 6.
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
        # P of acceleration or disturbance, and R: noise of the reading and of the rate meanwhile
        s[r, r] += state[17 + r] + k * k * (p[1] + p[2]) + (p[0] + p[3] if r < 3 else p[5] + p[6])
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
) -> int:
    """Weigh what can be used of a sample.

    The field is left out where it is not a number, or disturbed by more than twice its size.

    Args:
        state: As of `error_state`, shape (s,).
        p: Parameters as of `error_state`, shape (k,).
        k: The interval [s].
        g: As of `weigh`, shape (6, 3).
        z: Innovation, expected less measured gravity and field, shape (6,).
        s: Filled as by `weigh`, shape (6, 6).
        y: Filled with S^-1 z, shape (6,).

    Returns:
        Rows that count: 6, 3, or 0 if the force is not a number.
    """
    if not np.isfinite(z[0] + z[1] + z[2]):
        return 0
    if np.isfinite(z[3] + z[4] + z[5]):
        for r in range(6):
            y[r] = z[r]
        weigh(state, p, k, g, s, y, 6)
        disturbance2 = 0.0
        for j in range(3):  # the disturbance that this sample tells, of K z
            disturbance2 += (state[20 + j] * y[3 + j]) ** 2
        if disturbance2 <= 4.0 * (state[26] * state[26] + state[27] * state[27]):
            return 6
    for r in range(3):
        y[r] = z[r]
    weigh(state, p, k, g, s, y, 3)
    return 3


@njit(cache=True)
def estimate(
    state: np.ndarray, k: float, g: np.ndarray, y: np.ndarray, e: np.ndarray, used: int
) -> None:
    """The error e = K z = P H' S^-1 z.

    Args:
        state: As of `error_state`, shape (s,).
        k: The interval [s].
        g: As of `weigh`, shape (6, 3).
        y: S^-1 z, shape (6,).
        e: Filled with turn, offset, acceleration and disturbance, shape (12,).
        used: Rows that count.
    """
    for j in range(3):
        # g' S^-1 z; H has g for the turn and -k g for the offset, so that P H' has what follows
        along = 0.0
        for r in range(used):
            along += g[r, j] * y[r]
        e[j] = (state[11 + j] - k * state[23 + j]) * along
        e[3 + j] = (state[23 + j] - k * state[14 + j]) * along
    for row in range(6):
        e[6 + row] = 0.0
        if row < used:
            # H has 1 for the acceleration, -1 for the disturbance
            e[6 + row] = state[17 + row] * y[row] if row < 3 else -state[17 + row] * y[row]


@njit(cache=True)
def renew(
    state: np.ndarray,
    p: np.ndarray,
    k: float,
    g: np.ndarray,
    s: np.ndarray,
    b: np.ndarray,
    used: int,
) -> None:
    """Q for the next sample, from the diagonal of P+ = P - K H P.

    The columns of H P are those of g times a number for turn and offset, and those of the identity
    for acceleration and disturbance, so that the diagonal of P H' S^-1 H P needs forward
    substitution only.

    Args:
        state: As of `error_state`, shape (s,); its Q is replaced.
        p: Parameters as of `error_state`, shape (k,).
        k: The interval [s].
        g: As of `weigh`, shape (6, 3).
        s: The Cholesky factor of S, shape (6, 6).
        b: Space for a column of H P, shape (6,).
        used: Rows that count.
    """
    for j in range(3):
        turn, offset = state[11 + j] - k * state[23 + j], state[23 + j] - k * state[14 + j]
        for r in range(used):
            b[r] = g[r, j]
        length2 = forwards(s, b, used, 0)  # diagonal of g' S^-1 g
        # P+ of the offset and its drift; Q of turn and offset, and what the two share
        drifting = state[14 + j] - offset * offset * length2 + p[2]
        state[11 + j] += k * k * (drifting + p[1]) - turn * turn * length2
        state[14 + j], state[23 + j] = drifting, -k * drifting
        for part in range(2 if p.shape[0] > 5 else 1):
            row, at = 3 * part + j, 17 + 3 * part + j
            loss = 0.0
            if row < used:
                b[:] = 0.0
                b[row] = 1.0
                loss = state[at] * state[at] * forwards(s, b, used, row)
            # what is left of acceleration or disturbance a sample later, and what is new of it
            state[at] = p[4 + 3 * part] ** 2 * (state[at] - loss) + p[3 + 3 * part]


@njit(cache=True)
def first_variances(state: np.ndarray, mag: np.ndarray, p: np.ndarray, use_mag: bool) -> None:
    """MATLAB's InitialProcessNoise, and the field of the first sample.

    Args:
        state: As of `error_state`, shape (s,), with the first orientation.
        mag: Magnetic field, shape (3,) [uT].
        p: Parameters as of `error_state`, shape (k,), with the strength of the field to assume.
        use_mag: Whether to use the magnetometer.
    """
    for j in range(3):
        # turn [rad^2], offset [rad^2/s^2], acceleration [m^2/s^4], disturbance [uT^2]
        state[11 + j], state[14 + j], state[17 + j], state[20 + j] = (
            6.092348396e-6,
            7.6154354947e-5,
            9.62361e-3,
            0.6,
        )
    if use_mag:
        # the field of reference has no east component
        _, hy, hz = to_earth(state[1], state[2], state[3], state[4], mag[0], mag[1], mag[2])
        scale = p[8] / length(mag) if p[8] > 0.0 else 1.0
        state[26], state[27] = hy * scale, hz * scale


@njit(cache=True)
def error_state(readings: Readings, p: np.ndarray, state: np.ndarray, use_mag: bool) -> np.ndarray:
    """Error-state filter: orientation, gyroscope offset, linear acceleration, disturbance.

    The error is folded into the estimate after each sample, so that its prediction is zero and P- =
    Q, which is rebuilt from the diagonal of P+ (NXP AN5023, 2016; MATLAB's description of imufilter
    and ahrsfilter). With g, m the expected gravity and field in the sensor, k the interval and x =
    (turn, offset, acceleration, disturbance):

        z = [g - (acc - a); m - mag] = [[g x, -k g x, I, 0], [m x, -k m x, 0, -I]] x

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): variances of accelerometer [m^2/s^4], gyroscope and offset drift
            [rad^2/s^2], linear acceleration [m^2/s^4], decay of that; with a magnetometer variances
            of it and of the disturbance [uT^2], decay of that, strength of the field [uT].
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, offset,
            acceleration, diagonal of Q (turn, offset, acceleration, disturbance), its turn-offset
            part, field (north, up).
        use_mag: Whether to use the magnetometer.
    """
    # Longer than a screen: one sample's prediction, innovation and correction.
    gyr, acc, mag, dt = readings
    n = gyr.shape[0]
    out = np.empty((n, 4))
    s, g, e = np.empty((6, 6)), np.zeros((6, 3)), np.zeros(12)
    b, y, z = np.empty(6), np.empty(6), np.empty(6)
    for i in range(n):
        if state[0] == 0.0:
            if begin(state, acc[i], mag[i], use_mag, out[i]):
                first_variances(state, mag[i], p, use_mag)
            continue
        # prediction by the gyroscope less its offset
        k = dt[i]
        rx, ry, rz = (
            k * (gyr[i, 0] - state[5]),
            k * (gyr[i, 1] - state[6]),
            k * (gyr[i, 2] - state[7]),
        )
        qw, qx, qy, qz = turned(state[1], state[2], state[3], state[4], rx, ry, rz)
        # expected gravity and field in the sensor, and [g x] above [m x]
        x1, y1, z1 = to_sensor(qw, qx, qy, qz, 0.0, 0.0, GRAVITY)
        x2, y2, z2 = to_sensor(qw, qx, qy, qz, 0.0, state[26], state[27])
        g[0, 1], g[0, 2], g[1, 0], g[1, 2], g[2, 0], g[2, 1] = -z1, y1, z1, -x1, -y1, x1
        g[3, 1], g[3, 2], g[4, 0], g[4, 2], g[5, 0], g[5, 1] = -z2, y2, z2, -x2, -y2, x2
        # the innovation; the force less the linear acceleration that is left of the last sample's
        z[0], z[1], z[2] = x1 - acc[i, 0], y1 - acc[i, 1], z1 - acc[i, 2]
        z[3], z[4], z[5] = x2 - mag[i, 0], y2 - mag[i, 1], z2 - mag[i, 2]
        for j in range(3):
            z[j] += p[4] * state[8 + j]
        if not use_mag:
            z[3] = np.nan
        used = choose(state, p, k, g, z, s, y)
        estimate(state, k, g, y, e, used)
        renew(state, p, k, g, s, b, used)
        # the error is folded into the estimate
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
        "rate. With linear_acc_var_m2_s4 at MATLAB's default a move of the arm passes for an "
        "offset about the vertical of up to 1 deg/s, which then stays; at 1 it does not."
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
