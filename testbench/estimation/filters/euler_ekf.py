"""The Euler-angle Kalman filters of Cabezuelo 2019, corrected, as its text and as its program.

Equations are those of the thesis: simple prediction 4.7, improved prediction 4.4 to 4.6. Its text
and the program in its annex differ, and its numbers were made by the program.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import GRAVITY, Three, length

CORRECTED, TEXT, LISTING = 0, 1, 2
"""Which print of the filter."""
LOCK = 1e-3
"""Cosine of pitch [1] below which roll and yaw are not told apart."""


@njit(cache=True)
def wrapped(angle: float) -> float:
    """An angle [rad] brought into [-pi, pi)."""
    # whole turns taken off
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


@njit(cache=True)
def put(out: np.ndarray, roll: float, pitch: float, yaw: float) -> None:
    """The quaternion q_earth_from_sensor of intrinsic ZYX angles.

    Args:
        out: Filled with the quaternion, shape (4,).
        roll: About x [rad].
        pitch: About y [rad].
        yaw: About z [rad].
    """
    cr, sr, cp, sp = np.cos(roll / 2), np.sin(roll / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    # q(z, yaw) q(y, pitch) q(x, roll), written out
    out[0] = cy * cp * cr + sy * sp * sr
    out[1] = cy * cp * sr - sy * sp * cr
    out[2] = cy * sp * cr + sy * cp * sr
    out[3] = sy * cp * cr - cy * sp * sr


@njit(cache=True)
def predicted(
    state: np.ndarray, g: np.ndarray, h: float, f: np.ndarray, simple: bool, version: int
) -> Three:
    """Roll, pitch and yaw [rad] a step later, and F, the derivative by those before.

    Args:
        state: As of `euler_ekf`, shape (s,).
        g: Angular rate, shape (3,) [rad/s].
        h: The step [s].
        f: Filled with F, shape (3, 3).
        simple: Whether each angle is the integral of its own axis.
        version: Which print.
    """
    roll, pitch, yaw = state[1], state[2], state[3]
    f[:, :] = 0.0
    f[0, 0], f[1, 1] = 1.0, 1.0
    if simple:
        f[2, 2] = 1.0 if version == CORRECTED else 0.0  # eq. 2.22 has diag(1, 1, 0)
        return roll + h * g[0], pitch + h * g[1], yaw + h * g[2]  # eq. 4.7
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    if version == CORRECTED and abs(cp) < LOCK:
        cp = LOCK if cp >= 0.0 else -LOCK
    tan, sec = sp / cp, 1.0 / cp
    along, across = g[1] * sr + g[2] * cr, g[1] * cr - g[2] * sr
    f[0, 0], f[0, 1] = 1.0 + h * across * tan, h * along * sec * sec
    f[1, 0] = -h * along
    f[2, 0], f[2, 1], f[2, 2] = h * across * sec, h * along * sec * tan, 1.0
    # eq. 4.4, in the text with cos(pitch) for cos(roll); eqs 4.5 and 4.6 below
    rolled = g[0] + along * tan
    if version == TEXT:
        rolled = g[0] + (g[1] * sr + g[2] * np.cos(pitch)) * tan
    return roll + h * rolled, pitch + h * across, yaw + h * along * sec


@njit(cache=True)
def innovation(
    ax: float, ay: float, az: float, roll: float, pitch: float, printed: bool
) -> tuple[float, float]:
    """Roll and pitch [rad] of a specific force [m/s^2], less the predicted ones."""
    level = np.sqrt(ay * ay + az * az)
    if printed:
        measured = np.arctan(ay / az) if az != 0.0 else np.copysign(0.5 * np.pi, ay)
        return measured - roll, np.arctan2(-ax, level) - pitch
    # a force along x says nothing of roll, and an innovation beyond half a turn goes the other way
    v0 = wrapped(np.arctan2(ay, az) - roll) if level > LOCK * abs(ax) else 0.0
    return v0, np.arctan2(-ax, level) - pitch


@njit(cache=True)
def correct(
    cov: np.ndarray, half: np.ndarray, f: np.ndarray, v0: float, v1: float, var0: float, var1: float
) -> Three:
    """What the innovation of roll and pitch adds to all three angles [rad]; P <- P - K S K'.

    Args:
        cov: P, shape (3, 3); updated.
        half: Space for K, shape (3, 3).
        f: Space for K S, shape (3, 3).
        v0: Innovation of roll [rad].
        v1: Innovation of pitch [rad].
        var0: Variance of the measured roll [rad^2].
        var1: Variance of the measured pitch [rad^2].
    """
    # S = H P H' + R, whose inverse is written out
    s00, s01, s11 = cov[0, 0] + var0, cov[0, 1], cov[1, 1] + var1
    det = s00 * s11 - s01 * s01
    for r in range(3):  # K = P H' S^-1, and K S
        half[r, 0] = (cov[r, 0] * s11 - cov[r, 1] * s01) / det
        half[r, 1] = (cov[r, 1] * s00 - cov[r, 0] * s01) / det
        f[r, 0], f[r, 1] = half[r, 0] * s00 + half[r, 1] * s01, half[r, 0] * s01 + half[r, 1] * s11
    for r in range(3):
        for c in range(3):
            cov[r, c] -= f[r, 0] * half[c, 0] + f[r, 1] * half[c, 1]
    return (
        half[0, 0] * v0 + half[0, 1] * v1,
        half[1, 0] * v0 + half[1, 1] * v1,
        half[2, 0] * v0 + half[2, 1] * v1,
    )


@njit(cache=True)
def propagate(cov: np.ndarray, half: np.ndarray, f: np.ndarray, noise: float) -> None:
    """P <- F P F' + noise I.

    Args:
        cov: P, shape (3, 3); updated.
        half: Space for F P, shape (3, 3).
        f: F, shape (3, 3).
        noise: Variance that each angle gains [rad^2].
    """
    # F P
    for r in range(3):
        for c in range(3):
            half[r, c] = f[r, 0] * cov[0, c] + f[r, 1] * cov[1, c] + f[r, 2] * cov[2, c]
    # (F P) F' + noise I
    for r in range(3):
        for c in range(3):
            cov[r, c] = half[r, 0] * f[c, 0] + half[r, 1] * f[c, 1] + half[r, 2] * f[c, 2]
        cov[r, r] += noise


@njit(cache=True)
def first(state: np.ndarray, acc: np.ndarray, p: np.ndarray, version: int) -> None:
    """Start at zero (program), or from the first force (text, eqs 2.17 to 2.19, and corrected).

    The publication starts with the process variance.

    Args:
        state: As of `euler_ekf`, shape (s,); filled.
        acc: Specific force, shape (3,) [m/s^2].
        p: Parameters as of `euler_ekf`, shape (k,).
        version: Which print.
    """
    if version == LISTING or (version == TEXT and length(acc) > 0.0):
        state[0], state[4], state[8], state[12] = 1.0, p[0] * p[0], p[0] * p[0], p[0] * p[0]
        if version == TEXT:
            state[1], state[2] = innovation(acc[0], acc[1], acc[2], 0.0, 0.0, True)
    elif version == CORRECTED and length(acc) > 0.0:
        state[0], state[4], state[8] = 1.0, p[1] * p[1], p[2] * p[2]
        # at rest the force is g (-sin pitch, sin roll cos pitch, cos roll cos pitch)
        state[1], state[2] = (
            np.arctan2(acc[1], acc[2]),
            np.arctan2(-acc[0], np.sqrt(acc[1] * acc[1] + acc[2] * acc[2])),
        )


@njit(cache=True)
def euler_ekf(
    readings: Readings,
    p: np.ndarray,
    state: np.ndarray,
    simple: bool,
    version: int,
) -> np.ndarray:
    """Kalman filter of roll, pitch and yaw; a force of gravity's size corrects roll and pitch.

    Text and program take roll from the arctangent of a ratio, do not wrap the innovation, and have
    a process variance per sample. The text starts from the first force, propagates P always, and
    has cos(pitch) for cos(roll) in eq. 4.4; the program starts at zero and keeps P still while the
    gate is closed. Corrected: starts from the first sample, takes roll from both signs, wraps,
    propagates P always, has a noise density, and keeps pitch within a right angle.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): process noise [rad] or [rad/sqrt(s)], sd of roll and of pitch
            [rad], gate [m/s^2].
        state: Kept from chunk to chunk and overwritten, shape (s,): started, roll, pitch, yaw, P
            (9).
        simple: Whether each angle is the integral of its own axis (eq. 4.7) instead of eqs 4.4 to
            4.6.
        version: Which print: `CORRECTED`, `TEXT` or `LISTING`.
    """
    gyr, acc, dt = readings.gyr, readings.acc, readings.dt
    out = np.empty((gyr.shape[0], 4))
    cov = state[4:13].reshape(3, 3)
    f, half = np.empty((3, 3)), np.empty((3, 3))
    for i in range(gyr.shape[0]):
        if state[0] == 0.0:
            first(state, acc[i], p, version)
            put(out[i], state[1], state[2], state[3])
            continue
        roll, pitch, yaw = predicted(state, gyr[i], dt[i], f, simple, version)
        if version == CORRECTED and abs(pitch) > 0.5 * np.pi:
            # over the top: the same orientation with a pitch within a right angle
            pitch, roll, yaw = (np.pi if pitch > 0.0 else -np.pi) - pitch, roll + np.pi, yaw + np.pi
        roll, pitch, yaw = wrapped(roll), wrapped(pitch), wrapped(yaw)
        a = length(acc[i])
        gated = abs(a - GRAVITY) < p[3] or (p[3] == 0.0 and a > 0.0)
        if gated or version != LISTING:
            propagate(cov, half, f, p[0] * p[0] * (dt[i] if version == CORRECTED else 1.0))
        if gated:
            v0, v1 = innovation(acc[i, 0], acc[i, 1], acc[i, 2], roll, pitch, version != CORRECTED)
            d0, d1, d2 = correct(cov, half, f, v0, v1, p[1] * p[1], p[2] * p[2])
            roll, pitch, yaw = roll + d0, pitch + d1, yaw + d2
        state[1], state[2], state[3] = roll, pitch, yaw
        put(out[i], roll, pitch, yaw)
    return out


THESIS = "Cabezuelo 2019: BNO055 at rest, long cable"
SOURCE = "Cabezuelo Gutiérrez, thesis, Universidad de Alcalá, 2019"
ROLL = Parameter(
    "roll_sd_rad",
    0.0014,
    "rad",
    "standard deviation of roll from the accelerometer",
    THESIS,
    1e-4,
    0.1,
    least=1e-9,
)
PITCH = Parameter(
    "pitch_sd_rad",
    0.0014,
    "rad",
    "standard deviation of pitch from the accelerometer",
    THESIS,
    1e-4,
    0.1,
    least=1e-9,
)
GATE = Parameter(
    "acc_gate_m_s2",
    0.1,
    "m/s^2",
    "the accelerometer corrects while its size is this near to gravity; 0: always",
    "Cabezuelo 2019, listing; its text has 1",
    0.05,
    5.0,
)
DENSITY = Parameter(
    "process_rad_sqrts",
    1.56e-3,
    "rad/sqrt(s)",
    "noise density of the angles",
    "Cabezuelo 2019: 1.56e-4 rad a sample, at 100 Hz",
    1e-4,
    0.1,
)
PER_SAMPLE = Parameter(
    "process_rad",
    1.56e-4,
    "rad",
    "standard deviation of the angles' step in a sample",
    "Cabezuelo 2019: BNO055",
    1e-5,
    0.01,
)
TEXT_GATE = replace(GATE, default=1.0, source="Cabezuelo 2019, text")
LISTING_GATE = replace(GATE, source="Cabezuelo 2019, listing")
LAYOUT = (("started", 1), ("roll_pitch_yaw_rad", 3), ("covariance", 9))


class EulerEkf(KernelFilter):
    """Euler-angle EKF with the improved prediction, corrected: arbitrary heading."""

    name, needs, source = (
        "euler_ekf",
        ("gyr", "acc"),
        f"{SOURCE}, eqs 2.9 to 2.25 and 4.4 to 4.6, errors corrected",
    )
    PARAMETERS = (DENSITY, ROLL, PITCH, GATE)
    layout = LAYOUT
    kernel, options = staticmethod(euler_ekf), (0, CORRECTED)
    behaviour = (
        "Yaw is never corrected; near a pitch of a right angle roll and yaw are lost to "
        "one another."
    )


class EulerEkfSimple(EulerEkf):
    """Euler-angle EKF with the simple prediction, otherwise corrected."""

    name = "euler_ekf_simple"
    source = f"{SOURCE}, eqs 2.9 to 2.25 and 4.7, errors corrected but for the prediction"
    options = (1, CORRECTED)
    behaviour = "Yaw drifts under coupled rotation even with a perfect gyroscope."
    known_faults = (
        "it takes each axis of the gyroscope for the rate of an Euler angle, which is "
        "right about one axis at a time only"
    )


class EulerEkfAsPrinted(EulerEkf):
    """Euler-angle EKF with the improved prediction, as the text of the publication prints it."""

    name = "euler_ekf_as_printed"
    source = f"{SOURCE}, eqs 2.9 to 2.25 and 4.4 to 4.6, as its text prints them"
    PARAMETERS = (PER_SAMPLE, ROLL, PITCH, TEXT_GATE)
    options = (0, TEXT)
    behaviour = "Works near level only; tuning depends on the sampling rate."
    known_faults = "it knows roll within a right angle only, and has a misprint in the rate of roll"


class EulerEkfListing(EulerEkfAsPrinted):
    """Euler-angle EKF with the improved prediction, as the publication's program has it."""

    name = "euler_ekf_listing"
    source = f"{SOURCE}, the program Euler_estimation in its annex"
    PARAMETERS = (PER_SAMPLE, ROLL, PITCH, LISTING_GATE)
    options = (0, LISTING)
    behaviour = "As euler_ekf_as_printed; its uncertainty stands still while the gate is closed."
    known_faults = "it starts at zero, and knows roll within a right angle only"


class EulerEkfSimpleAsPrinted(EulerEkfAsPrinted):
    """Euler-angle EKF with the simple prediction, as the text of the publication prints it."""

    name = "euler_ekf_simple_as_printed"
    source = f"{SOURCE}, eqs 2.9 to 2.25 and 4.7, as its text prints them"
    options = (1, TEXT)
    behaviour = "As euler_ekf_as_printed; yaw drifts under coupled rotation."
    known_faults = (
        "it knows roll within a right angle only, and takes rates of axes for rates of angles"
    )
