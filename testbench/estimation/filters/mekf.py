"""Multiplicative extended Kalman filter with gyroscope bias."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.gates import ACC_GATE, MAG_GATE
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import (
    GRAVITY,
    Three,
    begin,
    field_deviates,
    length,
    to_earth,
    to_sensor,
    turned,
    usable_force,
)


@njit(cache=True)
def correct(e: np.ndarray, cov: np.ndarray, v: np.ndarray, h: np.ndarray, var: float) -> None:
    """Correct the error by one direction, v = h + h x turn.

    One component after the other, all linearised at the prediction: as their noises are independent
    this is the update by all at once.

    Args:
        e: Error so far, turn [rad] and bias [rad/s], shape (6,); added to.
        cov: Its covariance, shape (6, 6); updated.
        v: Measured direction in the sensor, shape (3,).
        h: Expected direction in the sensor, shape (3,).
        var: Variance of a component of v.
    """
    ph = np.empty(6)
    for row in range(3):
        # row of H = [[h x], 0]
        if row == 0:
            h0, h1, h2 = 0.0, -h[2], h[1]
        elif row == 1:
            h0, h1, h2 = h[2], 0.0, -h[0]
        else:
            h0, h1, h2 = -h[1], h[0], 0.0
        # P H', the innovation's variance, and the gain times the innovation
        for j in range(6):
            ph[j] = cov[j, 0] * h0 + cov[j, 1] * h1 + cov[j, 2] * h2
        s = 1.0 / (h0 * ph[0] + h1 * ph[1] + h2 * ph[2] + var)
        gain = s * (v[row] - h[row] - h0 * e[0] - h1 * e[1] - h2 * e[2])
        for j in range(6):
            e[j] += ph[j] * gain
            for k in range(j + 1):
                cov[j, k] -= ph[j] * ph[k] * s
                cov[k, j] = cov[j, k]


@njit(cache=True)
def predict(
    cov: np.ndarray, half: np.ndarray, turn: Three, h: float, noise: float, walk: float
) -> None:
    """P <- F P F' + Q, with F = [[A, -h B], [0, I]] for a turn r of size s.

    A = I - (sin s / s) [r x] + (1 - cos s) / s^2 [r x]^2 is the turn itself (Crassidis & Junkins,
    Optimal Estimation of Dynamic Systems, 2004, eq. 7.59); its first two terms alone would let the
    covariance across r grow by s^2 a sample, and with it that of the heading, which nothing
    measures, until corrections of the tilt turned the heading. B = I - [r x] / 2.

    Args:
        cov: P, shape (6, 6); updated.
        half: Space for F P, shape (6, 6).
        turn: r, the turn in the interval [rad].
        h: The interval [s].
        noise: Noise density of the gyroscope [rad/s/sqrt(Hz)].
        walk: Random walk of its bias [rad/s^2/sqrt(Hz)].
    """
    rx, ry, rz = turn
    square = rx * rx + ry * ry + rz * rz
    size = np.sqrt(square)
    sine = np.sin(size) / size if size > 1e-6 else 1.0
    cosine = (1.0 - np.cos(size)) / square if size > 1e-6 else 0.5
    diagonal = 1.0 - cosine * square
    a00, a11, a22 = (
        diagonal + cosine * rx * rx,
        diagonal + cosine * ry * ry,
        diagonal + cosine * rz * rz,
    )
    xy, xz, yz = cosine * rx * ry, cosine * rx * rz, cosine * ry * rz
    a01, a10 = xy + sine * rz, xy - sine * rz
    a02, a20 = xz - sine * ry, xz + sine * ry
    a12, a21 = yz + sine * rx, yz - sine * rx
    for j in range(6):  # F P
        b0, b1, b2 = cov[3, j], cov[4, j], cov[5, j]
        half[0, j] = a00 * cov[0, j] + a01 * cov[1, j] + a02 * cov[2, j]
        half[1, j] = a10 * cov[0, j] + a11 * cov[1, j] + a12 * cov[2, j]
        half[2, j] = a20 * cov[0, j] + a21 * cov[1, j] + a22 * cov[2, j]
        half[0, j] -= h * (b0 + 0.5 * (rz * b1 - ry * b2))
        half[1, j] -= h * (b1 + 0.5 * (rx * b2 - rz * b0))
        half[2, j] -= h * (b2 + 0.5 * (ry * b0 - rx * b1))
        half[3, j], half[4, j], half[5, j] = b0, b1, b2
    for j in range(6):  # (F P) F'
        b0, b1, b2 = half[j, 3], half[j, 4], half[j, 5]
        cov[j, 0] = a00 * half[j, 0] + a01 * half[j, 1] + a02 * half[j, 2]
        cov[j, 1] = a10 * half[j, 0] + a11 * half[j, 1] + a12 * half[j, 2]
        cov[j, 2] = a20 * half[j, 0] + a21 * half[j, 1] + a22 * half[j, 2]
        cov[j, 0] -= h * (b0 + 0.5 * (rz * b1 - ry * b2))
        cov[j, 1] -= h * (b1 + 0.5 * (rx * b2 - rz * b0))
        cov[j, 2] -= h * (b2 + 0.5 * (ry * b0 - rx * b1))
        cov[j, 3], cov[j, 4], cov[j, 5] = b0, b1, b2
    for j in range(3):  # Q of white noise on rate and walk of the bias, Farrenkopf 1978
        cov[j, j] += noise * noise * h + walk * walk * h * h * h / 3.0
        cov[j, j + 3] -= 0.5 * walk * walk * h * h
        cov[j + 3, j] -= 0.5 * walk * walk * h * h
        cov[j + 3, j + 3] += walk * walk * h


@njit(cache=True)
def first_covariance(state: np.ndarray, cov: np.ndarray, p: np.ndarray, use_mag: bool) -> None:
    """Covariance at the start: P = a^2 (I - u u') + m^2 u u' for the turn, and that of p for the
    bias.

    u is the vertical in the sensor. The force gives the inclination, the field the heading; a and m
    are the standard deviations of their directions. Without a magnetometer the heading is a
    convention, and m that of the force.

    Args:
        state: As of `mekf`, shape (s,).
        cov: P, shape (6, 6); filled.
        p: Parameters as of `mekf`, shape (k,).
        use_mag: Whether to use the magnetometer.
    """
    # of an acceleration a, the tilt is off by a / g
    tilting = (p[3] / GRAVITY) ** 2
    heading = p[5] * p[5] if use_mag else tilting
    up = to_sensor(state[1], state[2], state[3], state[4], 0.0, 0.0, 1.0)
    for j in range(3):
        for k in range(3):
            # a^2 I + (m^2 - a^2) u u', the same as a^2 (I - u u') + m^2 u u'
            cov[j, k] = (heading - tilting) * up[j] * up[k]
        cov[j, j] += tilting
        cov[j + 3, j + 3] = p[2] * p[2]


@njit(cache=True)
def mekf(readings: Readings, p: np.ndarray, state: np.ndarray, use_mag: bool) -> np.ndarray:
    """MEKF: integrate the quaternion; the Kalman filter estimates its error and the bias.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): noise density [rad/s/sqrt(Hz)], bias walk [rad/s^2/sqrt(Hz)],
            first sd of the bias [rad/s], sd of the force [m/s^2], its gate [m/s^2], sd of the
            field's direction, its gate.
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, bias, covariance
            (36), direction of the field (north, up), field of reference.
        use_mag: Whether to use the magnetometer.
    """
    gyr, acc, mag, dt = readings
    n = gyr.shape[0]
    out = np.empty((n, 4))
    cov, half = state[8:44].reshape(6, 6), np.empty((6, 6))
    e, v, h = np.empty(6), np.empty(3), np.empty(3)
    for i in range(n):
        if state[0] == 0.0:
            if begin(state, acc[i], mag[i], use_mag, out[i]):
                first_covariance(state, cov, p, use_mag)
                if use_mag:  # the field's dip, kept for good
                    _, hy, hz = to_earth(
                        state[1], state[2], state[3], state[4], mag[i, 0], mag[i, 1], mag[i, 2]
                    )
                    state[44], state[45] = hy / length(mag[i]), hz / length(mag[i])
            continue
        # prediction, with the rate less the bias
        rx, ry, rz = (
            (gyr[i, 0] - state[5]) * dt[i],
            (gyr[i, 1] - state[6]) * dt[i],
            (gyr[i, 2] - state[7]) * dt[i],
        )
        w, x, y, z = turned(state[1], state[2], state[3], state[4], rx, ry, rz)
        predict(cov, half, (rx, ry, rz), dt[i], p[0], p[1])
        for j in range(6):
            e[j] = 0.0
        # corrections, both linearised at the prediction
        if usable_force(length(acc[i]), p[4]):
            h[0], h[1], h[2] = to_sensor(w, x, y, z, 0.0, 0.0, GRAVITY)
            correct(e, cov, acc[i], h, p[3] * p[3])
        m = length(mag[i]) if use_mag else 0.0
        if m > 0.0 and not field_deviates((w, x, y, z), mag[i], p[6], state[46:48]):
            h[0], h[1], h[2] = to_sensor(w, x, y, z, 0.0, state[44], state[45])
            for j in range(3):
                v[j] = mag[i, j] / m
            correct(e, cov, v, h, p[5] * p[5])
        # reset: the error goes into the quaternion and the bias, and is zero again. The covariance
        # keeps its axes in the earth, so that what gravity cannot show stays about the vertical
        # (Barrau & Bonnabel, IEEE Trans. Automatic Control 62(4), 2017, sections III and V)
        predict(cov, half, (e[0], e[1], e[2]), 0.0, 0.0, 0.0)
        state[1], state[2], state[3], state[4] = turned(w, x, y, z, e[0], e[1], e[2])
        state[5] += e[3]
        state[6] += e[4]
        state[7] += e[5]
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


SOURCE = (
    "Lefferts, Markley & Shuster, J. Guidance 5(5), 1982; Markley & Crassidis 2014, ch. 6; "
    "noise as Farrenkopf 1978"
)
MEMS = "typical of the small sensors the bench has presets for"
GYR = Parameter(
    "gyr_noise_rad_s_sqrthz",
    2e-3,
    "rad/s/sqrt(Hz)",
    "noise density of the gyroscope",
    MEMS,
    1e-4,
    0.05,
    least=1e-9,
)
WALK = Parameter(
    "bias_walk_rad_s2_sqrthz", 2e-5, "rad/s^2/sqrt(Hz)", "random walk of its bias", MEMS, 1e-7, 1e-2
)
BIAS = Parameter(
    "bias_sd_rad_s",
    0.01,
    "rad/s",
    "standard deviation of the bias at the start; 0: none",
    MEMS,
    1e-4,
    0.1,
)
ACC = Parameter(
    "acc_sd_m_s2",
    2.0,
    "m/s^2",
    "standard deviation of force less gravity, motion included",
    "an arm's accelerations",
    0.05,
    20.0,
    least=1e-9,
)
LASTING = Parameter(
    "acc_sd_m_s2",
    20.0,
    "m/s^2",
    "standard deviation of force less gravity, in one sample: of motion it lasts for many, which "
    "takes the place of a smaller one that would be forgotten at once",
    "BROAD (Laidig et al. 2021): with 2, motion passes for a bias",
    0.5,
    200.0,
    least=1e-9,
)
MAG = Parameter(
    "mag_sd",
    0.3,
    "1",
    "standard deviation of the field's direction, of a unit vector",
    "indoors",
    0.01,
    5,
    least=1e-9,
)


class MekfImu(KernelFilter):
    """MEKF without magnetometer: arbitrary heading."""

    name, needs, source = "mekf_imu", ("gyr", "acc"), SOURCE
    PARAMETERS = (GYR, WALK, BIAS, LASTING, ACC_GATE)
    layout = (
        ("started", 1),
        ("q", 4),
        ("gyr_bias_rad_s", 3),
        ("covariance", 36),
        ("field_direction", 2),
        ("field", 2),
    )
    kernel, options = staticmethod(mekf), (False,)
    behaviour = (
        "Finds the bias across the vertical only; about the vertical it keeps what it last knew, "
        "and the heading that the gyroscope gives."
    )


class Mekf(KernelFilter):
    """MEKF with magnetometer; the dip of the field is that of the first sample."""

    name, needs, source = "mekf", ("gyr", "acc", "mag"), SOURCE
    PARAMETERS = (GYR, WALK, BIAS, ACC, ACC_GATE, MAG, MAG_GATE)
    layout = MekfImu.layout
    kernel, options = staticmethod(mekf), (True,)
    behaviour = "Finds all three biases; a disturbed field that stays is taken for one."
