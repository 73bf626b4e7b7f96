"""Fusion: Madgwick's revised AHRS algorithm, compiled."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import Three, begin, length, to_sensor, up_in_sensor

PACKAGE = "default or example of the package imufusion"
SOURCE = (
    "Madgwick, PhD thesis, University of Bristol, 2014, chapter 7, as the package imufusion "
    "1.3 has it"
)
STARTUP_GAIN, STARTUP_S = 10.0, 3.0
"""The gain begins here and is ramped down to its own value in this time [1/s, s]; meanwhile nothing
is rejected.
"""
RANGE_SHARE = 0.98
"""A rate above this share of the gyroscope's range starts the filter anew."""
FORGIVEN = 9.0
"""An accepted sample makes up for this many rejected ones."""


@njit(cache=True)
def _feedback(sx: float, sy: float, sz: float, rx: float, ry: float, rz: float) -> Three:
    """Half the cross product of a measured s and an expected r, both unit vectors; of length 1
    where they differ by more than 90 deg.
    """
    # s x r, of length sin(angle)
    x, y, z = sy * rz - sz * ry, sz * rx - sx * rz, sx * ry - sy * rx
    k = 0.5
    if sx * rx + sy * ry + sz * rz < 0.0:
        # beyond 90 deg the sine falls again: its direction at full length
        size = np.sqrt(x * x + y * y + z * z)
        k = 1.0 / size if size > 0.0 else 0.0
    return k * x, k * y, k * z


@njit(cache=True)
def _accepted(
    feedback2: float,
    threshold: float,
    timeout: float,
    startup: bool,
    dt: float,
    recovery: np.ndarray,
) -> bool:
    """Whether a measurement counts.

    Args:
        feedback2: Squared length of its feedback.
        threshold: Angle beyond which it is rejected [rad]; 0: never.
        timeout: Longest time to reject [s]; 0: never.
        startup: Whether the filter starts up: nothing is rejected meanwhile.
        dt: Interval before the sample [s].
        recovery: For how long it was rejected of late, and how long that is borne, shape (2,) [s];
            updated.
    """
    accepted = True
    # the feedback is half a sine: beyond that of the threshold it is rejected
    if (
        startup
        or not threshold > 0.0
        or not timeout > 0.0
        or feedback2 <= (0.5 * np.sin(threshold)) ** 2
    ):
        recovery[0] -= FORGIVEN * dt
    else:
        recovery[0] += dt
        accepted = False
    # rejected for as long as the timeout: accepted until it is made up for
    if recovery[0] > recovery[1] + 0.5 * dt:
        recovery[1] = 0.0
        accepted = True
    else:
        recovery[1] = timeout
    recovery[0] = min(max(recovery[0], 0.0), timeout)
    return accepted


@njit(cache=True)
def fusion(readings: Readings, p: np.ndarray, state: np.ndarray, use_mag: bool) -> np.ndarray:
    """Rate plus gain times the sum of measured x expected vertical and west.

    One explicit Euler step a sample.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): gain, threshold of the vertical [deg], longest time to reject
            [s], range of the gyroscope [deg/s], and with a magnetometer threshold of the heading
            [deg].
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, time since start
            [s], rejected and borne times of the vertical and of the heading [s].
        use_mag: Whether to use the magnetometer; without one the heading is held at zero while
            starting up.
    """
    # Longer than a screen: one sample's update, whose parts share the state of the start-up.
    gyr, acc, mag, dt = readings
    near_vertical, timeout, fastest = np.radians(p[1]), p[2], RANGE_SHARE * np.radians(p[3])
    near_heading = np.radians(p[4]) if use_mag else 0.0
    n = gyr.shape[0]
    out = np.empty((n, 4))
    for i in range(n):
        if state[0] == 0.0:
            begin(state, acc[i], mag[i], use_mag, out[i])
            state[7] = state[9] = timeout
            continue
        w, x, y, z = state[1], state[2], state[3], state[4]
        gx, gy, gz = gyr[i, 0], gyr[i, 1], gyr[i, 2]
        if fastest > 0.0 and max(abs(gx), abs(gy), abs(gz)) > fastest:
            # the rate was clipped: start anew
            state[5] = state[6] = state[8] = 0.0
            state[7] = state[9] = timeout
        state[5] += dt[i]
        # the gain is ramped down while starting up
        startup = state[5] < STARTUP_S - 0.5 * dt[i] and p[0] < STARTUP_GAIN
        gain = STARTUP_GAIN - (STARTUP_GAIN - p[0]) * state[5] / STARTUP_S if startup else p[0]
        ux, uy, uz = up_in_sensor(w, x, y, z)
        fx = fy = fz = 0.0
        a = length(acc[i])
        if a > 0.0:
            # feedback of the vertical
            ex, ey, ez = _feedback(acc[i, 0] / a, acc[i, 1] / a, acc[i, 2] / a, ux, uy, uz)
            if _accepted(
                ex * ex + ey * ey + ez * ez, near_vertical, timeout, startup, dt[i], state[6:8]
            ):
                fx, fy, fz = ex, ey, ez
        if use_mag and length(mag[i]) > 0.0:
            # west as measured, up x field, against the expected one
            mx, my, mz = (
                uy * mag[i, 2] - uz * mag[i, 1],
                uz * mag[i, 0] - ux * mag[i, 2],
                ux * mag[i, 1] - uy * mag[i, 0],
            )
            m = np.sqrt(mx * mx + my * my + mz * mz)
            wx, wy, wz = to_sensor(w, x, y, z, -1.0, 0.0, 0.0)
            if m > 0.0:
                ex, ey, ez = _feedback(mx / m, my / m, mz / m, wx, wy, wz)
                if _accepted(
                    ex * ex + ey * ey + ez * ez, near_heading, timeout, startup, dt[i], state[8:10]
                ):
                    fx, fy, fz = fx + ex, fy + ey, fz + ez
        # rate of change of q: q (rate / 2 + gain feedback), over a step
        hx, hy, hz = (
            (0.5 * gx + gain * fx) * dt[i],
            (0.5 * gy + gain * fy) * dt[i],
            (0.5 * gz + gain * fz) * dt[i],
        )
        w2 = w - x * hx - y * hy - z * hz
        x2 = x + w * hx + y * hz - z * hy
        y2 = y + w * hy - x * hz + z * hx
        z2 = z + w * hz + x * hy - y * hx
        if startup and not use_mag:
            # turn back about the vertical to heading zero
            half = 0.5 * np.arctan2(
                w2 * z2 + x2 * y2, 0.5 * (w2 * w2 + x2 * x2 - y2 * y2 - z2 * z2)
            )
            c, s = np.cos(half), -np.sin(half)
            w2, x2, y2, z2 = c * w2 - s * z2, c * x2 - s * y2, c * y2 + s * x2, c * z2 + s * w2
        k = 1.0 / np.sqrt(w2 * w2 + x2 * x2 + y2 * y2 + z2 * z2)
        state[1], state[2], state[3], state[4] = w2 * k, x2 * k, y2 * k, z2 * k
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


GAIN = Parameter("gain", 0.5, "1", "of the feedback", PACKAGE, 0.05, 5.0)
ACC = Parameter(
    "acceleration_rejection_deg",
    10.0,
    "deg",
    "force that far from the expected vertical is ignored; 0: never",
    PACKAGE,
    1.0,
    90.0,
    "linear",
    0.0,
    90.0,
)
MAG = Parameter(
    "magnetic_rejection_deg",
    10.0,
    "deg",
    "heading that far from the expected one is ignored; 0: never",
    PACKAGE,
    1.0,
    90.0,
    "linear",
    0.0,
    90.0,
)
TIMEOUT = Parameter("rejection_timeout_s", 5.0, "s", "longest time to ignore", PACKAGE, 0.5, 60.0)
RANGE = Parameter(
    "gyroscope_range_deg_s",
    0.0,
    "deg/s",
    "rates at 98 % of it restart the filter; 0: never",
    "off",
    125.0,
    2000.0,
    "linear",
)


class Fusion(KernelFilter):
    """x-io Fusion without magnetometer: arbitrary heading."""

    name, source = "fusion", SOURCE
    needs: ClassVar[tuple[str, ...]] = ("gyr", "acc")
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (GAIN, ACC, TIMEOUT, RANGE)
    layout = (
        ("started", 1),
        ("q", 4),
        ("running_s", 1),
        ("acceleration_recovery_s", 2),
        ("magnetic_recovery_s", 2),
    )
    kernel, options = staticmethod(fusion), (False,)
    behaviour = (
        "Its gain is ramped down over the first 3 s, and its heading held at zero meanwhile: what "
        "turns about the vertical before is lost."
    )


class Fusion9D(Fusion):
    """x-io Fusion with magnetometer."""

    name, needs = "fusion_9d", ("gyr", "acc", "mag")
    PARAMETERS = (*Fusion.PARAMETERS, MAG)
    kernel, options = staticmethod(fusion), (True,)
    behaviour = "Its gain is ramped down over the first 3 s."
