"""Compiled arithmetic that the kernels share: quaternions w x y z, vectors as three numbers, no
arrays made in loops.

Numba inlines these into the kernels and stores the result on disk; after a change here the kernels'
stored code is only made anew once their own files are touched too, or the __pycache__ folder is
gone.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.frames import STANDARD_GRAVITY

GRAVITY = STANDARD_GRAVITY
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


@njit(cache=True)
def turned(w: float, x: float, y: float, z: float, rx: float, ry: float, rz: float) -> Four:
    """The quaternion q exp(r / 2) after a turn by the rotation vector r [rad] in the sensor."""
    # q exp(r / 2) = q (cos |r|/2, r/|r| sin |r|/2)
    angle2 = rx * rx + ry * ry + rz * rz
    if angle2 > 1e-8:
        angle = np.sqrt(angle2)
        c, s = np.cos(0.5 * angle), np.sin(0.5 * angle) / angle
    else:  # the first two terms of both series
        c, s = 1.0 - angle2 / 8.0, 0.5 - angle2 / 48.0
    dx, dy, dz = s * rx, s * ry, s * rz
    nw = w * c - x * dx - y * dy - z * dz
    nx = w * dx + x * c + y * dz - z * dy
    ny = w * dy - x * dz + y * c + z * dx
    nz = w * dz + x * dy - y * dx + z * c
    k = 1.0 / np.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    return nw * k, nx * k, ny * k, nz * k


@njit(cache=True)
def integrated(state: np.ndarray, rate: np.ndarray, dt: float) -> Four:
    """The quaternion of a state after a turn by its rate over an interval.

    Args:
        state: Of the filter, started and q and more, shape (s,), s >= 5.
        rate: Angular rate, shape (3,) [rad/s].
        dt: The interval [s].
    """
    # q <- q exp(w dt / 2), the rate constant over the interval
    rx, ry, rz = rate[0] * dt, rate[1] * dt, rate[2] * dt
    return turned(state[1], state[2], state[3], state[4], rx, ry, rz)


@njit(cache=True)
def to_earth(w: float, x: float, y: float, z: float, vx: float, vy: float, vz: float) -> Three:
    """A vector of the sensor frame seen in the earth frame: R v."""
    # v + w t + u x t with t = 2 u x v, u the vector part of q
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


@njit(cache=True)
def up_in_sensor(w: float, x: float, y: float, z: float) -> Three:
    """The upward unit vector seen in the sensor frame: the third row of R."""
    # R' (0, 0, 1)
    return 2.0 * (x * z - w * y), 2.0 * (w * x + y * z), w * w - x * x - y * y + z * z


@njit(cache=True)
def levelled(ax: float, ay: float, az: float) -> Four:
    """q_earth_from_sensor of least rotation that turns the unit vector a upwards."""
    if az < -1.0 + 1e-12:  # upside down: half a turn about any level axis
        return 0.0, 1.0, 0.0, 0.0
    # (1 + a . up, a x up) scaled to unit length: half of the angle between them
    w = np.sqrt((1.0 + az) / 2.0)
    return w, ay / (2.0 * w), -ax / (2.0 * w), 0.0


@njit(cache=True)
def to_sensor(w: float, x: float, y: float, z: float, vx: float, vy: float, vz: float) -> Three:
    """A vector of the earth frame seen in the sensor frame: R' v."""
    # R' v turns by the conjugate of q
    return to_earth(w, -x, -y, -z, vx, vy, vz)


@njit(cache=True)
def tilt(acc: np.ndarray) -> np.ndarray:
    """q_earth_from_sensor of least rotation that turns a specific force upwards.

    Args:
        acc: Specific force, shape (3,) [m/s^2].

    Returns:
        Shape (4,); the identity without a force.
    """
    norm = np.sqrt(acc[0] ** 2 + acc[1] ** 2 + acc[2] ** 2)
    if not norm > 0.0:
        return np.array([1.0, 0.0, 0.0, 0.0])
    # the unit vector that is upwards
    return np.array(levelled(acc[0] / norm, acc[1] / norm, acc[2] / norm))


@njit(cache=True)
def length(v: np.ndarray) -> float:
    """Length of a vector; NaN if it holds one.

    Args:
        v: Shape (3,).
    """
    # sqrt(v' v)
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@njit(cache=True)
def usable_force(a: float, gate: float) -> bool:
    """Whether a specific force is near enough to gravity to correct by.

    Args:
        a: Its size [m/s^2].
        gate: Largest difference from standard gravity [m/s^2]; 0 takes any force but none.
    """
    # | |a| - g | <= gate: what is not gravity is acceleration
    return a > 0.0 and (not gate > 0.0 or abs(a - GRAVITY) <= gate)


@njit(cache=True)
def with_north(
    ax: float, ay: float, az: float, mx: float, my: float, mz: float
) -> tuple[float, float, float, float, bool]:
    """q_enu_from_sensor that turns a upwards and the horizontal part of m northwards.

    The columns of R_sensor_from_enu are m x a, a x (m x a), a, scaled to unit length.

    Returns:
        The quaternion, and whether m has a horizontal part.
    """
    ex, ey, ez = my * az - mz * ay, mz * ax - mx * az, mx * ay - my * ax
    e = np.sqrt(ex * ex + ey * ey + ez * ez)
    if not e > 1e-9 * np.sqrt(mx * mx + my * my + mz * mz):
        return 1.0, 0.0, 0.0, 0.0, False
    ex, ey, ez = ex / e, ey / e, ez / e
    nx, ny, nz = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex
    # rows of R_enu_from_sensor are east, north, up; by the largest component (Shepperd 1978)
    trace = ex + ny + az
    if trace >= ex and trace >= ny and trace >= az:
        w, x, y, z = 1.0 + trace, ay - nz, ez - ax, nx - ey
    elif ex >= ny and ex >= az:
        w, x, y, z = ay - nz, 1.0 + ex - ny - az, ey + nx, ez + ax
    elif ny >= az:
        w, x, y, z = ez - ax, ey + nx, 1.0 - ex + ny - az, nz + ay
    else:
        w, x, y, z = nx - ey, ez + ax, nz + ay, 1.0 - ex - ny + az
    k = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    return w * k, x * k, y * k, z * k, True


@njit(cache=True)
def started(state: np.ndarray, acc: np.ndarray, mag: np.ndarray, use_mag: bool) -> bool:
    """Start from the first usable sample, and say whether this is one.

    Args:
        state: Of the filter, shape (s,); state[0] becomes 1 and state[1:5] the quaternion.
        acc: Specific force, shape (3,) [m/s^2].
        mag: Magnetic field, shape (3,) [uT].
        use_mag: Whether the heading comes from the magnetometer; else it is arbitrary.
    """
    a = np.sqrt(acc[0] ** 2 + acc[1] ** 2 + acc[2] ** 2)
    if not a > 0.0:
        return False
    if use_mag:
        m = np.sqrt(mag[0] ** 2 + mag[1] ** 2 + mag[2] ** 2)
        if not m > 0.0:
            return False
        w, x, y, z, ok = with_north(
            acc[0] / a, acc[1] / a, acc[2] / a, mag[0] / m, mag[1] / m, mag[2] / m
        )
        if not ok:
            return False
    else:
        # no heading is known: none is turned
        w, x, y, z = levelled(acc[0] / a, acc[1] / a, acc[2] / a)
    state[0] = 1.0
    state[1], state[2], state[3], state[4] = w, x, y, z
    return True


@njit(cache=True)
def begin(
    state: np.ndarray, acc: np.ndarray, mag: np.ndarray, use_mag: bool, out: np.ndarray
) -> bool:
    """Start if this sample allows it; the orientation is the identity until then.

    Args:
        state: Of the filter, shape (s,), as for `started`.
        acc: Specific force, shape (3,) [m/s^2].
        mag: Magnetic field, shape (3,) [uT].
        use_mag: Whether to use the magnetometer.
        out: Filled with the orientation, shape (4,).
    """
    begun = started(state, acc, mag, use_mag)
    # until it has begun, the identity
    out[0] = 1.0
    out[1] = out[2] = out[3] = 0.0
    if begun:
        out[0], out[1], out[2], out[3] = state[1], state[2], state[3], state[4]
    return begun


@njit(cache=True)
def field_deviates(q: Four, mag: np.ndarray, gate: float, reference: np.ndarray) -> bool:
    """Whether the field differs from that of reference by too much.

    Compared are the horizontal and the vertical part, so that both strength and dip count.

    Args:
        q: Orientation, q_earth_from_sensor.
        mag: Magnetic field in the sensor, shape (3,) [uT].
        gate: Largest difference, as a fraction of the reference; 0: no field differs by too much.
        reference: Horizontal and vertical part, shape (2,) [uT]; zeros are replaced by those of
            this sample.
    """
    if not gate > 0.0:
        return False
    hx, hy, hz = to_earth(q[0], q[1], q[2], q[3], mag[0], mag[1], mag[2])
    # horizontal and vertical part of R m
    h = np.sqrt(hx * hx + hy * hy)
    if reference[0] == 0.0 and reference[1] == 0.0:
        reference[0], reference[1] = h, hz
        return False
    size2 = reference[0] ** 2 + reference[1] ** 2
    return (h - reference[0]) ** 2 + (hz - reference[1]) ** 2 > gate * gate * size2


@njit(cache=True)
def factorise(s: np.ndarray, n: int) -> None:
    """Replace the lower triangle of a symmetric positive S by its Cholesky factor L, S = L L'.

    Args:
        s: The matrix, shape (k, k) with k >= n.
        n: Rows and columns that count.
    """
    for j in range(n):
        # l_jj = sqrt(s_jj - sum l_jk^2), l_ij = (s_ij - sum l_ik l_jk) / l_jj, column by column
        # (Golub & Van Loan, Matrix Computations, 4th ed. 2013, section 4.2)
        d = s[j, j]
        for k in range(j):
            d -= s[j, k] * s[j, k]
        d = np.sqrt(d)
        s[j, j] = d
        for i in range(j + 1, n):
            t = s[i, j]
            for k in range(j):
                t -= s[i, k] * s[j, k]
            s[i, j] = t / d


@njit(cache=True)
def forwards(s: np.ndarray, b: np.ndarray, n: int, first: int) -> float:
    """Replace b by L^-1 b.

    Args:
        s: L as `factorise` leaves it, shape (k, k) with k >= n.
        b: Shape (k,).
        n: Rows that count.
        first: Row before which b is zero.

    Returns:
        The squared length of the result, b' S^-1 b.
    """
    length2 = 0.0
    for i in range(first, n):
        # b_i = (b_i - sum l_ik b_k) / l_ii
        t = b[i]
        for k in range(first, i):
            t -= s[i, k] * b[k]
        b[i] = t / s[i, i]
        length2 += b[i] * b[i]
    return length2


@njit(cache=True)
def backwards(s: np.ndarray, b: np.ndarray, n: int) -> None:
    """Replace b by L'^-1 b.

    Args:
        s: L as `factorise` leaves it, shape (k, k) with k >= n.
        b: Shape (k,).
        n: Rows that count.
    """
    for i in range(n - 1, -1, -1):
        # b_i = (b_i - sum l_ki b_k) / l_ii
        t = b[i]
        for k in range(i + 1, n):
            t -= s[k, i] * b[k]
        b[i] = t / s[i, i]
