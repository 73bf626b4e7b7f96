"""What an inertial sensor on a chain of rotating joints reads, and its derivatives; compiled.

Angular rate and specific force in the sensor frame follow from the recursions of `chain`. Their
derivatives by the joints are closed: seen from the body that carries joint k, a change of q_k turns
all that lies beyond the joint rigidly about its axis. With o the joint, s the sensor, r = s - o,
omega and alpha the motion of that body, and r', r'' the velocity and acceleration of s relative to
it (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 2 and 4, for the kinematics of moving
frames):

    d omega / d q_k = omega x u          (in the sensor's axes, which turn too)
    d a / d q_k = alpha x (u x r) + omega x (omega x (u x r)) + 2 omega x (u x r') + u x r''
    d a / d v_k = 2 omega x (u x r) + 2 u x r'        d a / d a_k = u x r
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.model.chain import DW, A, Chain, P, Tip, U, V, W, reach, rest, turn


@njit(cache=True)
def _cross(x: np.ndarray, y: np.ndarray, out: np.ndarray) -> None:
    # x cross y
    out[0] = x[1] * y[2] - x[2] * y[1]
    out[1] = x[2] * y[0] - x[0] * y[2]
    out[2] = x[0] * y[1] - x[1] * y[0]


# One compiled loop that shares its work arrays: calls with slices would cost more than the sums.
@njit(cache=True)
def sensor_reading(
    chain: Chain,
    tip: Tip,
    gravity: np.ndarray,
    motion: np.ndarray,
    reading: np.ndarray,
    slopes: np.ndarray,
) -> None:
    """Reading of an ideal sensor, and its derivatives by the joints that carry it.

    Args:
        chain: Those joints.
        tip: The sensor in the frame of the last of them.
        gravity: In the world, shape (3,) [m/s^2].
        motion: Angles [rad], rates [rad/s] and accelerations [rad/s^2] of the joints, shape (3, m).
        reading: Filled with angular rate [rad/s] and specific force [m/s^2] in the sensor, shape
            (6,).
        slopes: Filled with the derivatives by angles, rates and accelerations, shape (3, 6, m);
            columns of other joints are left alone.
    """
    # Longer than a screen and of many branches: the walk and the derivatives share all vectors,
    # whose algebra is written out, since arrays made in the loops would take most of the time.
    count, columns = chain.columns.shape[0], chain.columns
    body, R, S = np.empty((7, 3)), np.empty((3, 3)), np.empty((3, 3))
    d, x, y = np.empty(3), np.empty(3), np.empty(3)
    # of each joint: axis, place, its velocity and acceleration, rate and its derivative before it
    at = np.empty((count, 6, 3))
    rest(body, R)
    for j in range(count):
        reach(body, R, S, chain.rotations[j], chain.offsets[j])
        at[j, 1:] = body[P : DW + 1]
        k = columns[j]
        turn(body, R, S, chain.axes[j], motion[0, k], motion[1, k], motion[2, k])
        at[j, 0] = body[U]
    reach(body, R, S, tip.rotation, tip.offset)
    p, pv, pa, w = body[P], body[V], body[A], body[W]
    f = pa - gravity
    by_q, by_v, by_a = slopes[0], slopes[1], slopes[2]
    for c in range(3):
        reading[c] = S[0, c] * w[0] + S[1, c] * w[1] + S[2, c] * w[2]
        reading[3 + c] = S[0, c] * f[0] + S[1, c] * f[1] + S[2, c] * f[2]
    rel_v, rel_a, ur, acc_q, acc_v, gyr_q = (
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )
    for j in range(count):
        column, axis, rate, spin_up = columns[j], at[j, 0], at[j, 4], at[j, 5]
        for r in range(3):  # r of the module's equations
            d[r] = p[r] - at[j, 1, r]
        _cross(rate, d, x)  # r' = v_s - v_o - omega x r
        for r in range(3):
            rel_v[r] = pv[r] - at[j, 2, r] - x[r]
        # r'' = a_s - a_o - alpha x r - omega x (omega x r) - 2 omega x r'
        _cross(rate, x, y)
        _cross(spin_up, d, x)
        for r in range(3):
            rel_a[r] = pa[r] - at[j, 3, r] - x[r] - y[r]
        _cross(rate, rel_v, x)
        for r in range(3):
            rel_a[r] -= 2.0 * x[r]
        _cross(axis, d, ur)  # d a / d a_k
        _cross(rate, axis, gyr_q)  # d omega / d q_k
        _cross(rate, ur, x)  # d a / d v_k
        _cross(axis, rel_v, y)
        for r in range(3):
            acc_v[r] = 2.0 * x[r] + 2.0 * y[r]
        _cross(rate, x, acc_q)  # d a / d q_k, with -u x f as the sensor's axes turn with the joint
        _cross(rate, y, x)
        _cross(spin_up, ur, y)
        for r in range(3):
            acc_q[r] += 2.0 * x[r] + y[r]
            d[r] = rel_a[r] - f[r]
        _cross(axis, d, x)
        for r in range(3):
            acc_q[r] += x[r]
        for c in range(3):
            by_q[c, column] = S[0, c] * gyr_q[0] + S[1, c] * gyr_q[1] + S[2, c] * gyr_q[2]
            by_v[c, column] = S[0, c] * axis[0] + S[1, c] * axis[1] + S[2, c] * axis[2]
            by_a[c, column] = 0.0
            by_q[3 + c, column] = S[0, c] * acc_q[0] + S[1, c] * acc_q[1] + S[2, c] * acc_q[2]
            by_v[3 + c, column] = S[0, c] * acc_v[0] + S[1, c] * acc_v[1] + S[2, c] * acc_v[2]
            by_a[3 + c, column] = S[0, c] * ur[0] + S[1, c] * ur[1] + S[2, c] * ur[2]
