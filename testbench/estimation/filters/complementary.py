"""Complementary filters: the integrated gyroscope, corrected in tilt and then in heading."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.gates import ACC_GATE, MAG_GATE
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import (
    begin,
    field_deviates,
    integrated,
    length,
    to_earth,
    usable_force,
)


@njit(cache=True)
def complementary(
    readings: Readings, p: np.ndarray, state: np.ndarray, use_mag: bool
) -> np.ndarray:
    """Integrate, then correct by part of the angle to the measured vertical and to north.

    Both corrections are in the earth frame and one after the other, as Valenti et al. 2015 have
    them, so that the field never tilts. The part is 1 - exp(-dt / tau).

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): tau of the accelerometer [s], its gate [m/s^2], tau of the
            magnetometer [s], its gate.
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, field of reference.
        use_mag: Whether to use the magnetometer.
    """
    gyr, acc, mag, dt = readings
    n = gyr.shape[0]
    out = np.empty((n, 4))
    for i in range(n):
        if state[0] == 0.0:
            begin(state, acc[i], mag[i], use_mag, out[i])
            continue
        # prediction by the gyroscope
        w, x, y, z = integrated(state, gyr[i], dt[i])
        a = length(acc[i])
        if usable_force(a, p[1]):
            # the measured vertical in the earth: sine s of its tilt, about the axis (uy, -ux, 0)
            ux, uy, uz = to_earth(w, x, y, z, acc[i, 0] / a, acc[i, 1] / a, acc[i, 2] / a)
            s = np.sqrt(ux * ux + uy * uy)
            if s > 0.0:
                # part of the tilt, as a turn of the earth frame
                half = 0.5 * (1.0 - np.exp(-dt[i] / p[0])) * np.arctan2(s, uz)
                c, k = np.cos(half), np.sin(half) / s
                dx, dy = k * uy, -k * ux
                w, x, y, z = (
                    c * w - dx * x - dy * y,
                    c * x + dx * w + dy * z,
                    c * y + dy * w - dx * z,
                    c * z + dx * y - dy * x,
                )
        m = length(mag[i]) if use_mag else 0.0
        if m > 0.0 and not field_deviates((w, x, y, z), mag[i], p[3], state[5:7]):
            # part of the angle to measured north, about the vertical
            hx, hy, _ = to_earth(w, x, y, z, mag[i, 0], mag[i, 1], mag[i, 2])
            half = 0.5 * (1.0 - np.exp(-dt[i] / p[2])) * np.arctan2(hx, hy)
            c, s = np.cos(half), np.sin(half)
            w, x, y, z = c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
        k = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
        state[1], state[2], state[3], state[4] = w * k, x * k, y * k, z * k
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


SOURCE = (
    "Valenti, Dryanovski & Xiao, Sensors 15(8), 2015: tilt, then heading; angles instead of "
    "interpolated quaternions"
)
VQF_DEFAULT = "the time constant that Laidig & Seel 2023 chose for VQF"
TAU_ACC = Parameter(
    "tau_acc_s",
    3.0,
    "s",
    "time constant of the accelerometer's correction",
    VQF_DEFAULT,
    0.1,
    30.0,
    least=1e-3,
)
TAU_MAG = Parameter(
    "tau_mag_s",
    9.0,
    "s",
    "time constant of the magnetometer's correction",
    VQF_DEFAULT,
    0.1,
    90.0,
    least=1e-3,
)


class Complementary(KernelFilter):
    """Complementary filter without magnetometer: arbitrary heading."""

    name, needs, source = "complementary", ("gyr", "acc"), SOURCE
    PARAMETERS = (TAU_ACC, ACC_GATE)
    layout = (("started", 1), ("q", 4), ("field", 2))
    kernel, options = staticmethod(complementary), (False,)
    behaviour = "No bias: a gyroscope bias b leaves an inclination error of b times tau."


class ComplementaryMarg(KernelFilter):
    """Complementary filter with magnetometer; the field corrects the heading only."""

    name, needs, source = "complementary_marg", ("gyr", "acc", "mag"), SOURCE
    PARAMETERS = (TAU_ACC, ACC_GATE, TAU_MAG, MAG_GATE)
    layout = Complementary.layout
    kernel, options = staticmethod(complementary), (True,)
    behaviour = "As complementary; a disturbed field cannot tilt it."
