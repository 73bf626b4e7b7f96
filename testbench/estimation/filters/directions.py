"""Orientation from the directions of gravity and field in one sample: no gyroscope, no memory.

The vertical and north are those of `maths.with_north`: that is the ecompass, and TRIAD with gravity
for its first vector (Shuster & Oh, J. Guidance and Control 4(1), 1981).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.filters.base import Parameter, switch
from testbench.estimation.filters.kernel_filter import KernelFilter, Readings
from testbench.estimation.filters.maths import length, levelled, with_north

LAYOUT = (("started", 1), ("q", 4), ("dip_cos_sin", 2))
"""An unusable sample repeats the orientation before it; the dip is that of the first sample."""


@njit(cache=True)
def tilts(
    readings: Readings,
    p: np.ndarray,
    state: np.ndarray,
) -> np.ndarray:
    """The least rotation that turns each specific force upwards.

    Args:
        readings: Samples of the sensor.
        p: Unused, shape (0,).
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, unused.
    """
    acc = readings.acc
    out = np.empty((acc.shape[0], 4))
    if state[0] == 0.0:
        state[0], state[1] = 1.0, 1.0
    for i in range(acc.shape[0]):
        a = length(acc[i])
        if a > 0.0:
            # specific force at rest points upwards
            state[1], state[2], state[3], state[4] = levelled(
                acc[i, 0] / a, acc[i, 1] / a, acc[i, 2] / a
            )
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


@njit(cache=True)
def triads(
    readings: Readings,
    p: np.ndarray,
    state: np.ndarray,
) -> np.ndarray:
    """TRIAD: the first vector is met exactly, the second as well as that allows.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): empty, or whether the field is the first vector.
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, cosine and sine of
            the dip.
    """
    acc, mag = readings.acc, readings.mag
    field_first = p.shape[0] > 0 and p[0] > 0.5
    out = np.empty((acc.shape[0], 4))
    for i in range(acc.shape[0]):
        a, m = length(acc[i]), length(mag[i])
        if a > 0.0 and m > 0.0:
            ax, ay, az = acc[i, 0] / a, acc[i, 1] / a, acc[i, 2] / a
            mx, my, mz = mag[i, 0] / m, mag[i, 1] / m, mag[i, 2] / m
            if state[0] == 0.0:  # the dip below the horizon, for good
                s = -(ax * mx + ay * my + az * mz)
                state[0], state[1] = 1.0, 1.0
                state[5], state[6] = np.sqrt(max(0.0, 1.0 - s * s)), s
            if field_first:
                # gravity's direction across the field; upwards is then in the plane of both, at
                # the expected angle to the field
                d = ax * mx + ay * my + az * mz
                px, py, pz = ax - d * mx, ay - d * my, az - d * mz
                k = np.sqrt(px * px + py * py + pz * pz)
                if k > 0.0:
                    c, s = state[5] / k, -state[6]
                    ax, ay, az = s * mx + c * px, s * my + c * py, s * mz + c * pz
            w, x, y, z, ok = with_north(ax, ay, az, mx, my, mz)
            if ok:
                state[1], state[2], state[3], state[4] = w, x, y, z
        elif state[0] == 0.0:
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = 1.0, 0.0, 0.0, 0.0
            continue
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


@njit(cache=True)
def minor(k: np.ndarray, row: int, column: int) -> float:
    """Cofactor of a matrix.

    Args:
        k: The matrix, shape (4, 4).
        row: Row that is left out.
        column: Column that is left out.
    """
    r0, r1, r2 = (1 if row < 1 else 0), (2 if row < 2 else 1), (3 if row < 3 else 2)
    c0, c1, c2 = (1 if column < 1 else 0), (2 if column < 2 else 1), (3 if column < 3 else 2)
    # (-1)^(row + column) times the determinant of what is left, along its first row
    value = (
        k[r0, c0] * (k[r1, c1] * k[r2, c2] - k[r1, c2] * k[r2, c1])
        - k[r0, c1] * (k[r1, c0] * k[r2, c2] - k[r1, c2] * k[r2, c0])
        + k[r0, c2] * (k[r1, c0] * k[r2, c1] - k[r1, c1] * k[r2, c0])
    )
    return value if (row + column) % 2 == 0 else -value


@njit(cache=True)
def quests(
    readings: Readings,
    p: np.ndarray,
    state: np.ndarray,
) -> np.ndarray:
    """QUEST for two vectors: the eigenvector of Davenport's matrix K to its largest eigenvalue.

    Shuster & Oh 1981. The eigenvector is the largest column of the adjugate of K - lambda, which
    has no singular angle.

    Args:
        readings: Samples of the sensor.
        p: Parameters, shape (k,): weight of the field, that of gravity being the rest of 1.
        state: Kept from chunk to chunk and overwritten, shape (s,): started, q, cosine and sine of
            the dip.
    """
    # Longer than a screen: one matrix and its eigenvector, element by element.
    acc, mag = readings.acc, readings.mag
    wm = p[0]
    wa = 1.0 - wm
    out = np.empty((acc.shape[0], 4))
    k = np.empty((4, 4))
    for i in range(acc.shape[0]):
        a, m = length(acc[i]), length(mag[i])
        if a > 0.0 and m > 0.0:
            ax, ay, az = acc[i, 0] / a, acc[i, 1] / a, acc[i, 2] / a
            mx, my, mz = mag[i, 0] / m, mag[i, 1] / m, mag[i, 2] / m
            dot = ax * mx + ay * my + az * mz
            if state[0] == 0.0:  # the dip below the horizon, for good
                state[0], state[1] = 1.0, 1.0
                state[5], state[6] = np.sqrt(max(0.0, 1.0 - dot * dot)), -dot
            north, up = state[5], -state[6]
            # B = sum of weight * earth vector * sensor vector'; earth vectors (0, 0, 1) and (0,
            # north, up)
            b10, b11, b12 = wm * north * mx, wm * north * my, wm * north * mz
            b20, b21, b22 = wa * ax + wm * up * mx, wa * ay + wm * up * my, wa * az + wm * up * mz
            # the largest eigenvalue: eq. 72
            across = np.sqrt(max(0.0, 1.0 - dot * dot)) * north
            largest = np.sqrt(wa * wa + wm * wm + 2.0 * wa * wm * (dot * up + across))
            trace = b11 + b22
            # K, which maximises q' K q = trace(R B'), with q = (w, x, y, z) of R_earth_from_sensor
            k[0, 0], k[0, 1], k[0, 2], k[0, 3] = trace, b21 - b12, -b20, b10
            k[1, 1], k[1, 2], k[1, 3] = -trace, b10, b20
            k[2, 2], k[2, 3] = b11 - b22, b12 + b21
            k[3, 3] = b22 - b11
            for r in range(4):  # K - lambda, symmetric
                k[r, r] -= largest
                for c in range(r):
                    k[r, c] = k[c, r]
            # the largest column of its adjugate
            best, size = 0, -1.0
            for c in range(4):
                diagonal = abs(minor(k, c, c))
                if diagonal > size:
                    best, size = c, diagonal
            w, x, y, z = minor(k, 0, best), minor(k, 1, best), minor(k, 2, best), minor(k, 3, best)
            norm = np.sqrt(w * w + x * x + y * y + z * z)
            if norm > 1e-12:
                state[1], state[2], state[3], state[4] = w / norm, x / norm, y / norm, z / norm
        elif state[0] == 0.0:
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = 1.0, 0.0, 0.0, 0.0
            continue
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = state[1], state[2], state[3], state[4]
    return out


class Tilt(KernelFilter):
    """Inclination from the accelerometer alone: heading arbitrary and not followed."""

    name, needs, sampling = "tilt", ("acc",), "memoryless"
    source = "the least rotation that turns the specific force upwards"
    layout, kernel = LAYOUT, staticmethod(tilts)
    behaviour = "Right at rest; every acceleration tilts it. Says nothing of heading."


class Ecompass(KernelFilter):
    """Up from the accelerometer, north from what the magnetometer sees across it."""

    name, needs, sampling = "ecompass", ("acc", "mag"), "memoryless"
    source = (
        "Castellanos Alonso, thesis, Universidad de Oviedo, 2023: R = [(a x m) x a, a x m, "
        "a], here with the columns of ENU"
    )
    layout, kernel = LAYOUT, staticmethod(triads)
    behaviour = (
        "Every disturbance of the field is an error of heading; every acceleration tilts "
        "it and turns its heading."
    )


class Triad(KernelFilter):
    """TRIAD with gravity first, which is ecompass, or with the field first."""

    name, needs, sampling = "triad", ("acc", "mag"), "memoryless"
    source = "Black, AIAA Journal 2(7), 1964"
    PARAMETERS = (
        switch(
            "field_first",
            False,
            "1: the field is met exactly, at the dip of the first sample",
            "gravity is the better known of the two",
        ),
    )
    layout, kernel = LAYOUT, staticmethod(triads)
    behaviour = "Gravity first: the same as ecompass. Field first: a disturbed field tilts it."


class Quest(KernelFilter):
    """QUEST: the rotation that fits gravity and field best, by their weights."""

    name, needs, sampling = "quest", ("acc", "mag"), "memoryless"
    source = "Shuster & Oh, J. Guidance and Control 4(1), 1981"
    PARAMETERS = (
        Parameter(
            "mag_weight",
            0.5,
            "1",
            "weight of the field; gravity has the rest of 1",
            "equal weights",
            0.05,
            0.95,
            "linear",
            0.01,
            0.99,
        ),
    )
    layout, kernel = LAYOUT, staticmethod(quests)
    behaviour = (
        "Shares a misfit of the angle between gravity and field out by weight; the dip is "
        "that of the first sample."
    )
