"""Madgwick's gradient-descent filter, compiled."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.gates import ACC_GATE, MAG_GATE
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import (
    GRAVITY,
    begin,
    field_deviates,
    length,
    to_earth,
    usable_force,
)

PAPER = "Madgwick, Harrison & Vaidyanathan, ICORR 2011"
REPORT = (
    "Madgwick, An efficient orientation filter for inertial and inertial/magnetic sensor "
    "arrays, 2010"
)
HALF = float(np.sqrt(0.5))
BIAS, RAW, UNIT = 0, 1, 2
"""What zeta does: it sums up a bias (report of 2010), or takes something off the rate of the same
sample: by the gradient as it is (the thesis's eq. 33), or by the unit gradient (the program that it
used).
"""
ZETA = Parameter(
    "zeta",
    0.0,
    "rad/s^2",
    "rate at which a gyroscope bias is removed; 0: none",
    f"off; {REPORT}, section on gains, gives sqrt(3/4) of the bias's rate of change",
    1e-5,
    0.05,
)
THESIS = "de Miguel Pueyo, thesis, Universidad Rey Juan Carlos, 2024"
VALENTI = "Valenti, Dryanovski & Xiao, Sensors 15(8), 2015"
BETA = "gain: rate at which the gyroscope's error is corrected"


@njit(cache=True)
def trust(size: float, low: float, high: float) -> float:
    """Part of the gain that is left where a force is not of gravity's size: all of it below the
    lower threshold, none above the higher one (Valenti, Dryanovski & Xiao, Sensors 15(8), 2015).

    Args:
        size: Of the force [m/s^2].
        low: Relative difference below which it is trusted [1].
        high: And from which on it is not [1].
    """
    # e = | |a| - g | / g, and the gain falls linearly between both thresholds
    off = abs(size - GRAVITY) / GRAVITY
    if not off > low:  # nor of a force that is not known
        return 1.0
    return max((high - off) / (high - low), 0.0) if high > low else 0.0


@njit(cache=True)
def madgwick(
    readings: Readings,
    p: np.ndarray,
    state: np.ndarray,
    use_mag: bool,
    zeta_form: int,
    adaptive: bool = False,
) -> np.ndarray:
    """Madgwick's update: the rate of change of q by the gyroscope, less beta times the unit
    gradient of the misfit.

    Equations are those of the 2010 report, whose earth has north along x. The field's part is
    computed in that earth: off the unit sphere the misfit is not the same function of q in another
    one, and its gradient is what is scaled to one.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): beta [rad/s], zeta [rad/s^2], gate of the accelerometer
            [m/s^2], gate of the magnetometer; of an adaptive beta its two thresholds [1].
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, bias, field of
            reference.
        use_mag: Whether to use the magnetometer.
        zeta_form: What zeta does: `BIAS`, `RAW` or `UNIT`.
        adaptive: Whether beta is less, the more the force differs from gravity's size.
    """
    # Longer than a screen: one sample's update, in the order of the report's equations.
    gyr, acc, mag, dt = readings
    zeta = p[1]
    n = gyr.shape[0]
    out = np.empty((n, 4))
    for i in range(n):
        if state[0] == 0.0:
            begin(state, acc[i], mag[i], use_mag, out[i])
            continue
        w, x, y, z = state[1], state[2], state[3], state[4]
        sw = sx = sy = sz = 0.0
        a = length(acc[i])
        beta = p[0] * (trust(a, p[4], p[5]) if adaptive else 1.0)
        if usable_force(a, p[2]):
            # misfit of the upward direction in the sensor, f: eq. 25
            f1 = 2.0 * (x * z - w * y) - acc[i, 0] / a
            f2 = 2.0 * (w * x + y * z) - acc[i, 1] / a
            f3 = 1.0 - 2.0 * (x * x + y * y) - acc[i, 2] / a
            # its gradient, J' f: eq. 26
            sw = -2.0 * y * f1 + 2.0 * x * f2
            sx = 2.0 * z * f1 + 2.0 * w * f2 - 4.0 * x * f3
            sy = -2.0 * w * f1 + 2.0 * z * f2 - 4.0 * y * f3
            sz = 2.0 * x * f1 + 2.0 * y * f2
        m = length(mag[i]) if use_mag else 0.0
        if m > 0.0 and not field_deviates((w, x, y, z), mag[i], p[3], state[8:10]):
            mx, my, mz = mag[i, 0] / m, mag[i, 1] / m, mag[i, 2] / m
            hx, hy, bz = to_earth(w, x, y, z, mx, my, mz)
            # the field in the earth, (b, 0, bz): eqs 45, 46
            b = np.sqrt(hx * hx + hy * hy)
            # q turned by a right angle about the vertical, to north along x
            w1, x1, y1, z1 = HALF * (w + z), HALF * (x + y), HALF * (y - x), HALF * (z - w)
            # misfit of the field in the sensor: eq. 29
            g1 = b * (1.0 - 2.0 * (y1 * y1 + z1 * z1)) + 2.0 * bz * (x1 * z1 - w1 * y1) - mx
            g2 = 2.0 * b * (x1 * y1 - w1 * z1) + 2.0 * bz * (w1 * x1 + y1 * z1) - my
            g3 = 2.0 * b * (w1 * y1 + x1 * z1) + bz * (1.0 - 2.0 * (x1 * x1 + y1 * y1)) - mz
            # its gradient, J' f: eq. 30
            tw = -2.0 * bz * y1 * g1 + 2.0 * (bz * x1 - b * z1) * g2 + 2.0 * b * y1 * g3
            tx = (
                2.0 * bz * z1 * g1
                + 2.0 * (b * y1 + bz * w1) * g2
                + (2.0 * b * z1 - 4.0 * bz * x1) * g3
            )
            ty = (
                -(4.0 * b * y1 + 2.0 * bz * w1) * g1
                + 2.0 * (b * x1 + bz * z1) * g2
                + (2.0 * b * w1 - 4.0 * bz * y1) * g3
            )
            tz = (
                (2.0 * bz * x1 - 4.0 * b * z1) * g1
                + 2.0 * (bz * y1 - b * w1) * g2
                + 2.0 * b * x1 * g3
            )
            # turned back to the bench's earth, and added to that of gravity: eqs 31, 32
            sw, sx, sy, sz = (
                sw + HALF * (tw - tz),
                sx + HALF * (tx - ty),
                sy + HALF * (tx + ty),
                sz + HALF * (tw + tz),
            )
        step = np.sqrt(sw * sw + sx * sx + sy * sy + sz * sz)
        g0, gx, gy, gz = 0.0, gyr[i, 0], gyr[i, 1], gyr[i, 2]
        if step > 0.0:
            sw, sx, sy, sz = sw / step, sx / step, sy / step, sz / step  # eq. 44
            if zeta > 0.0:
                # error of the rate, 2 q* s: eq. 47
                ex = 2.0 * (w * sx - x * sw - y * sz + z * sy)
                ey = 2.0 * (w * sy + x * sz - y * sw - z * sx)
                ez = 2.0 * (w * sz - x * sy + y * sx - z * sw)
                if zeta_form != BIAS:  # a quaternion with a real part is taken off the rate
                    part = dt[i] * zeta * (step if zeta_form == RAW else 1.0)
                    g0 = -2.0 * part * (w * sw + x * sx + y * sy + z * sz)
                    gx, gy, gz = gx - part * ex, gy - part * ey, gz - part * ez
                else:  # eq. 48
                    state[5] += zeta * ex * dt[i]
                    state[6] += zeta * ey * dt[i]
                    state[7] += zeta * ez * dt[i]
        gx, gy, gz = gx - state[5], gy - state[6], gz - state[7]  # eq. 49
        # rate of change of q by the rate, less beta times the gradient, over a step: eqs 42, 43
        w2 = w + dt[i] * (0.5 * (w * g0 - x * gx - y * gy - z * gz) - beta * sw)
        x2 = x + dt[i] * (0.5 * (x * g0 + w * gx + y * gz - z * gy) - beta * sx)
        y2 = y + dt[i] * (0.5 * (y * g0 + w * gy - x * gz + z * gx) - beta * sy)
        z2 = z + dt[i] * (0.5 * (z * g0 + w * gz + x * gy - y * gx) - beta * sz)
        k = 1.0 / np.sqrt(w2 * w2 + x2 * x2 + y2 * y2 + z2 * z2)
        state[1], state[2], state[3], state[4] = w2 * k, x2 * k, y2 * k, z2 * k
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


class MadgwickImu(KernelFilter):
    """Madgwick's filter without magnetometer: arbitrary heading."""

    name, needs = "madgwick_imu", ("gyr", "acc")
    source = f"{PAPER}, eqs 12 to 33 with the accelerometer alone; bias: {REPORT}, eqs 47 to 49"
    PARAMETERS = (
        Parameter("beta", 0.033, "rad/s", BETA, f"{PAPER}, section V", 0.003, 0.5),
        ZETA,
        ACC_GATE,
    )
    layout = (("started", 1), ("q", 4), ("gyr_bias_rad_s", 3), ("field", 2))
    behaviour = (
        "Its correction has a fixed size: it trembles by beta times the interval, and "
        "large errors take long to go."
    )

    kernel, options = staticmethod(madgwick), (0, BIAS, 0)


class MadgwickMarg(KernelFilter):
    """Madgwick's filter with magnetometer."""

    name, needs = "madgwick_marg", ("gyr", "acc", "mag")
    source = f"{PAPER}, eqs 12 to 33; bias: {REPORT}, eqs 47 to 49"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        Parameter("beta", 0.041, "rad/s", BETA, f"{PAPER}, section V", 0.003, 0.5),
        ZETA,
        ACC_GATE,
        MAG_GATE,
    )
    layout = MadgwickImu.layout
    behaviour = (
        "As madgwick_imu; one gradient for gravity and field, so that a disturbed field "
        "tilts it, too."
    )

    kernel, options = staticmethod(madgwick), (1, BIAS, 0)


class MadgwickAdaptive(MadgwickMarg):
    """Madgwick's filter with a gain that is less, the more the force differs from gravity's."""

    name = "madgwick_adaptive"
    source = (
        f"{PAPER}, eqs 12 to 33, with the adaptive gain of Valenti, Dryanovski & Xiao, Sensors "
        "15(8), 2015"
    )
    PARAMETERS = (
        *MadgwickMarg.PARAMETERS,
        Parameter(
            "trust_all",
            0.1,
            "1",
            "relative difference of the force from gravity below which beta is whole",
            VALENTI,
            0.01,
            0.5,
        ),
        Parameter(
            "trust_none",
            0.2,
            "1",
            "and from which on beta is zero",
            VALENTI,
            0.02,
            1.0,
        ),
    )
    behaviour = (
        "As madgwick_marg where the sensor is not accelerated; elsewhere it follows the gyroscope, "
        "and the field no longer holds its heading either."
    )
    options = (1, BIAS, 1)


class MadgwickZetaAsPrinted(MadgwickMarg):
    """Madgwick's filter with a zeta that corrects the rate of the same sample, as the thesis prints
    it: by the gradient as it is.
    """

    name = "madgwick_zeta_as_printed"
    source = f"{THESIS}, eqs 22 to 37, as its text prints them"
    PARAMETERS = (
        Parameter("beta", 0.35, "rad/s", BETA, "the thesis's final results", 0.003, 0.5),
        Parameter(
            "zeta",
            0.07,
            "rad/s^2",
            "adds interval * zeta * size of the gradient to beta",
            "the thesis's final results",
            1e-3,
            1.0,
        ),
        ACC_GATE,
        MAG_GATE,
    )
    behaviour = (
        "Exactly madgwick_marg with beta + interval * zeta * size of the gradient and no bias: its "
        "zeta removes no drift."
    )
    options = (1, RAW, 0)


class MadgwickZetaUpstream(MadgwickZetaAsPrinted):
    """The same by the unit gradient, as the program has it that the thesis used."""

    name = "madgwick_zeta_upstream"
    source = f"github morgil/madgwick_py, which {THESIS} used"
    PARAMETERS = (
        MadgwickZetaAsPrinted.PARAMETERS[0],
        replace(MadgwickZetaAsPrinted.PARAMETERS[1], meaning="adds interval * zeta to beta"),
        ACC_GATE,
        MAG_GATE,
    )
    behaviour = (
        "Exactly madgwick_marg with beta + interval * zeta and no bias: its zeta removes no drift."
    )
    options = (1, UNIT, 0)
