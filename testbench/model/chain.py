"""Kinematics of one frame of a chain of rotating joints, compiled.

Pose, angular velocity and classical acceleration: the recursions of a rigid body carried by
rotating axes (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 4), written in the world
frame. Pinocchio, which gives the joints' placements, is the oracle of the tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Joints(NamedTuple):
    """A chain of k rotating joints, from the base outwards.

    Attributes:
        rotations: Rotation of each joint's frame in the previous one at zero angle, shape
            (k, 3, 3).
        offsets: Origin of each joint's frame in the previous one, shape (k, 3) [m].
        axes: Joint axes in the joint frames, unit vectors, shape (k, 3).
        columns: Column of q, v and a that belongs to each joint, shape (k,).
    """

    rotations: np.ndarray
    offsets: np.ndarray
    axes: np.ndarray
    columns: np.ndarray


class Tip(NamedTuple):
    """A frame that the last joint of a chain carries, or several, one a row.

    Attributes:
        rotation: Rotation of the frame in the last joint's, shape (3, 3), or (l, 3, 3) of l frames.
        offset: Origin of the frame in the last joint's, shape (3,) or (l, 3) [m].
    """

    rotation: np.ndarray
    offset: np.ndarray


@njit(cache=True)
def chain_motion(
    joints: Joints, tip: Tip, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Motion of the tip of a chain.

    Args:
        joints: The chain.
        tip: The frame at its end.
        q: Joint angles, shape (n, m) [rad].
        v: Joint rates, shape (n, m) [rad/s].
        a: Joint accelerations, shape (n, m) [rad/s^2].

    Returns:
        Position (n, 3) [m], rotation world from tip (n, 3, 3), linear velocity (n, 3) [m/s],
        angular velocity (n, 3) [rad/s], classical linear acceleration (n, 3) [m/s^2] and angular
        acceleration (n, 3) [rad/s^2], all in the world frame.
    """
    # Longer than a screen and of many branches: one walk along the chain, vector algebra written
    # out, since arrays made in the loop would take most of the time.
    rotations, offsets, axes, columns = joints
    n, k = q.shape[0], rotations.shape[0]
    position = np.empty((n, 3))
    rotation = np.empty((n, 3, 3))
    velocity = np.empty((n, 3))
    rate = np.empty((n, 3))
    acceleration = np.empty((n, 3))
    rate_derivative = np.empty((n, 3))
    R = np.empty((3, 3))
    S = np.empty((3, 3))
    T = np.empty((3, 3))
    d = np.empty(3)
    u = np.empty(3)
    p = np.empty(3)
    pv = np.empty(3)
    pa = np.empty(3)
    w = np.empty(3)
    dw = np.empty(3)
    for i in range(n):
        for r in range(3):
            p[r] = pv[r] = pa[r] = w[r] = dw[r] = 0.0
            for c in range(3):
                R[r, c] = 1.0 if r == c else 0.0
        for j in range(k + 1):
            offset = offsets[j] if j < k else tip.offset
            fixed = rotations[j] if j < k else tip.rotation
            for r in range(3):  # d: offset to the next joint, in the world
                d[r] = R[r, 0] * offset[0] + R[r, 1] * offset[1] + R[r, 2] * offset[2]
            # a += alpha x d + omega x (omega x d) and v += omega x d of a point fixed to the body
            cx = w[1] * d[2] - w[2] * d[1]
            cy = w[2] * d[0] - w[0] * d[2]
            cz = w[0] * d[1] - w[1] * d[0]
            pa[0] += dw[1] * d[2] - dw[2] * d[1] + w[1] * cz - w[2] * cy
            pa[1] += dw[2] * d[0] - dw[0] * d[2] + w[2] * cx - w[0] * cz
            pa[2] += dw[0] * d[1] - dw[1] * d[0] + w[0] * cy - w[1] * cx
            pv[0] += cx
            pv[1] += cy
            pv[2] += cz
            for r in range(3):
                p[r] += d[r]
            _product(R, fixed, S)
            if j == k:
                for r in range(3):
                    for c in range(3):
                        R[r, c] = S[r, c]
                break
            axis = axes[j]
            for r in range(3):  # u: the joint's axis in the world
                u[r] = S[r, 0] * axis[0] + S[r, 1] * axis[1] + S[r, 2] * axis[2]
            # alpha += u q'' + (omega x u) q', then omega += u q'
            rate_j, acceleration_j = v[i, columns[j]], a[i, columns[j]]
            dw[0] += u[0] * acceleration_j + (w[1] * u[2] - w[2] * u[1]) * rate_j
            dw[1] += u[1] * acceleration_j + (w[2] * u[0] - w[0] * u[2]) * rate_j
            dw[2] += u[2] * acceleration_j + (w[0] * u[1] - w[1] * u[0]) * rate_j
            for r in range(3):
                w[r] += u[r] * rate_j
            _turn(axis, q[i, columns[j]], T)
            _product(S, T, R)
        for r in range(3):
            position[i, r] = p[r]
            velocity[i, r] = pv[r]
            acceleration[i, r] = pa[r]
            rate[i, r] = w[r]
            rate_derivative[i, r] = dw[r]
            for c in range(3):
                rotation[i, r, c] = R[r, c]
    return position, rotation, velocity, rate, acceleration, rate_derivative


@njit(cache=True)
def link_poses(
    joints: Joints, carriers: np.ndarray, tips: Tip, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poses of several frames along a chain of k rotating joints, in one walk.

    Args:
        joints: The chain.
        carriers: How many joints carry each frame, shape (l,), from 0 to k.
        tips: The l frames, each in the last joint that carries it.
        q: Joint angles, shape (n, m) [rad].

    Returns:
        Position (n, l, 3) and rotation world from frame (n, l, 3, 3), as `chain_motion` gives them.
    """
    rotations, offsets, axes, columns = joints
    tip_rotations, tip_offsets = tips
    n, k, frames = q.shape[0], rotations.shape[0], carriers.shape[0]
    positions = np.empty((n, frames, 3))
    turned = np.empty((n, frames, 3, 3))
    R, S, T, p = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(n):
        p[:] = 0.0
        for r in range(3):
            for c in range(3):
                R[r, c] = 1.0 if r == c else 0.0
        for j in range(k + 1):
            for frame in range(frames):
                if carriers[frame] == j:
                    offset = tip_offsets[frame]
                    for r in range(3):
                        shift = R[r, 0] * offset[0] + R[r, 1] * offset[1] + R[r, 2] * offset[2]
                        positions[i, frame, r] = p[r] + shift
                    _product(R, tip_rotations[frame], turned[i, frame])
            if j == k:
                break
            offset = offsets[j]
            for r in range(3):
                p[r] += R[r, 0] * offset[0] + R[r, 1] * offset[1] + R[r, 2] * offset[2]
            _product(R, rotations[j], S)
            _turn(axes[j], q[i, columns[j]], T)
            _product(S, T, R)
    return positions, turned


@njit(cache=True)
def _product(A: np.ndarray, B: np.ndarray, AB: np.ndarray) -> None:
    """The product of two matrices into a third, shapes (3, 3)."""
    for r in range(3):
        for c in range(3):
            AB[r, c] = A[r, 0] * B[0, c] + A[r, 1] * B[1, c] + A[r, 2] * B[2, c]


@njit(cache=True)
def _turn(axis: np.ndarray, angle: float, T: np.ndarray) -> None:
    """The rotation by an angle [rad] about a unit axis, shape (3,), into T, shape (3, 3)."""
    # Rodrigues: cos I + (1 - cos) u u' + sin [u x]
    sine, cosine = np.sin(angle), np.cos(angle)
    rest = 1.0 - cosine
    x, y, z = axis[0], axis[1], axis[2]
    T[0, 0] = cosine + x * x * rest
    T[0, 1] = x * y * rest - z * sine
    T[0, 2] = x * z * rest + y * sine
    T[1, 0] = y * x * rest + z * sine
    T[1, 1] = cosine + y * y * rest
    T[1, 2] = y * z * rest - x * sine
    T[2, 0] = z * x * rest - y * sine
    T[2, 1] = z * y * rest + x * sine
    T[2, 2] = cosine + z * z * rest
