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

from testbench.model.chain import Joints, Tip


@njit(cache=True)
def _cross(x: np.ndarray, y: np.ndarray, out: np.ndarray) -> None:
    out[0] = x[1] * y[2] - x[2] * y[1]
    out[1] = x[2] * y[0] - x[0] * y[2]
    out[2] = x[0] * y[1] - x[1] * y[0]


@njit(cache=True)
def sensor_reading(  # noqa: C901
    joints: Joints,
    count: int,
    tip: Tip,
    gravity: np.ndarray,
    motion: np.ndarray,
    reading: np.ndarray,
    slopes: np.ndarray,
) -> None:
    """Reading of an ideal sensor, and its derivatives by the joints that carry it.

    Args:
        joints: The chain, as for `chain.chain_motion`; its arrays may be longer than it is.
        count: Joints of the chain.
        tip: The sensor in the last joint's frame.
        gravity: In the world, shape (3,) [m/s^2].
        motion: Angles [rad], rates [rad/s] and accelerations [rad/s^2] of the joints, shape (3, m).
        reading: Filled with angular rate [rad/s] and specific force [m/s^2] in the sensor, shape
            (6,).
        slopes: Filled with the derivatives of the reading by angles, rates and accelerations, shape
            (3, 6, m); columns of joints that do not carry the sensor are left alone.
    """
    # Longer than a screen and of many branches: a walk along the chain and one over its joints,
    # which share all of their vectors; algebra written out, as arrays made here would cost most.
    rotations, offsets, axes, columns = joints
    q, v, a = motion[0], motion[1], motion[2]
    by_q, by_v, by_a = slopes[0], slopes[1], slopes[2]
    R = np.eye(3)
    S, T = np.empty((3, 3)), np.empty((3, 3))
    d, u, x, y = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    p, pv, pa, w, dw = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    # of each joint: axis, place, velocity and acceleration; rate of the body before it and its
    # derivative
    at = np.empty((count, 6, 3))
    for j in range(count + 1):
        for r in range(3):
            offset = offsets[j] if j < count else tip.offset
            d[r] = R[r, 0] * offset[0] + R[r, 1] * offset[1] + R[r, 2] * offset[2]
        # the recursions of `chain`: p, v and a of a point fixed to the body at distance d
        _cross(w, d, x)
        _cross(w, x, y)
        pa += y
        _cross(dw, d, y)
        pa += y
        pv += x
        p += d
        fixed = rotations[j] if j < count else tip.rotation
        for r in range(3):
            for c in range(3):
                S[r, c] = R[r, 0] * fixed[0, c] + R[r, 1] * fixed[1, c] + R[r, 2] * fixed[2, c]
        if j == count:
            break
        axis, column = axes[j], columns[j]
        for r in range(3):
            u[r] = S[r, 0] * axis[0] + S[r, 1] * axis[1] + S[r, 2] * axis[2]
        at[j, 0], at[j, 1], at[j, 2], at[j, 3], at[j, 4], at[j, 5] = u, p, pv, pa, w, dw
        _cross(w, u, x)  # alpha += u q'' + (omega x u) q', then omega += u q'
        for r in range(3):
            dw[r] += u[r] * a[column] + x[r] * v[column]
            w[r] += u[r] * v[column]
        # the joint's rotation (Rodrigues), and the frame beyond it
        sine, cosine = np.sin(q[column]), np.cos(q[column])
        for r in range(3):
            for c in range(3):
                T[r, c] = axis[r] * axis[c] * (1.0 - cosine)
            T[r, r] += cosine
        T[0, 1] -= axis[2] * sine
        T[1, 0] += axis[2] * sine
        T[0, 2] += axis[1] * sine
        T[2, 0] -= axis[1] * sine
        T[1, 2] -= axis[0] * sine
        T[2, 1] += axis[0] * sine
        for r in range(3):
            for c in range(3):
                R[r, c] = S[r, 0] * T[0, c] + S[r, 1] * T[1, c] + S[r, 2] * T[2, c]
    f = pa - gravity  # S now holds the sensor's axes in the world
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
