"""Kinematics of frames on a chain of rotating joints, compiled.

Pose, angular velocity and classical acceleration: the recursions of a rigid body carried by
rotating axes (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 4), written in the world
frame. Pinocchio, which gives the joints' placements, is the oracle of the tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Chain(NamedTuple):
    """The rotating joints that carry a frame, k of them from the world outwards.

    Attributes:
        rotations: Rotation of each joint's frame in the previous one at zero angle, shape
            (k, 3, 3).
        offsets: Origin of each joint's frame in the previous one, shape (k, 3) [m].
        axes: Joint axes in the joint frames, unit vectors, shape (k, 3).
        columns: Column of joint angles, rates and accelerations that belongs to each joint,
            shape (k,).
    """

    rotations: np.ndarray
    offsets: np.ndarray
    axes: np.ndarray
    columns: np.ndarray


class Tip(NamedTuple):
    """A frame in that of the last joint which carries it.

    Attributes:
        rotation: Shape (3, 3).
        offset: Its origin, shape (3,) [m].
    """

    rotation: np.ndarray
    offset: np.ndarray


U, P, V, A, W, DW, D = range(7)
"""Rows of what is known of a body while a walk goes along the chain, shape (7, 3), in the world:
axis of the joint that was passed last; place [m], velocity and acceleration of the origin of the
frame that was reached; angular velocity [rad/s] and its derivative by time; distance of that origin
from the joint [m].
"""


@njit(cache=True, inline="always")
def rest(body: np.ndarray, R: np.ndarray) -> None:
    """Begin a walk: in the world's frame, which does not move.

    Args:
        body: Overwritten, shape (7, 3).
        R: Overwritten, shape (3, 3).
    """
    body[:] = 0.0
    # R = 1
    for r in range(3):
        for c in range(3):
            R[r, c] = 1.0 if r == c else 0.0


@njit(cache=True, inline="always")
def reach(
    body: np.ndarray, R: np.ndarray, S: np.ndarray, rotation: np.ndarray, offset: np.ndarray
) -> None:
    """Go to a frame that is fixed to the body.

    Args:
        body: As it moves, shape (7, 3); place, velocity and acceleration become those of the frame.
        R: World from body, shape (3, 3).
        S: World from the frame, overwritten, shape (3, 3).
        rotation: Of the frame in the body, shape (3, 3).
        offset: Of its origin in the body, shape (3,) [m].
    """
    for r in range(3):
        body[D, r] = R[r, 0] * offset[0] + R[r, 1] * offset[1] + R[r, 2] * offset[2]
    dx, dy, dz = body[D, 0], body[D, 1], body[D, 2]
    wx, wy, wz = body[W, 0], body[W, 1], body[W, 2]
    # of a point fixed to the body at distance d: v = w x d, a = dw x d + w x (w x d)
    # (Featherstone 2008, ch. 4)
    cx = wy * dz - wz * dy
    cy = wz * dx - wx * dz
    cz = wx * dy - wy * dx
    body[A, 0] += body[DW, 1] * dz - body[DW, 2] * dy + wy * cz - wz * cy
    body[A, 1] += body[DW, 2] * dx - body[DW, 0] * dz + wz * cx - wx * cz
    body[A, 2] += body[DW, 0] * dy - body[DW, 1] * dx + wx * cy - wy * cx
    body[V, 0] += cx
    body[V, 1] += cy
    body[V, 2] += cz
    for r in range(3):
        body[P, r] += body[D, r]
    _product(R, rotation, S)


@njit(cache=True, inline="always")
def turn(
    body: np.ndarray,
    R: np.ndarray,
    S: np.ndarray,
    axis: np.ndarray,
    q: float,
    v: float,
    a: float,
) -> None:
    """Go past a joint to the body that it carries.

    Args:
        body: As it moves before the joint, shape (7, 3); axis and angular velocity become those
            beyond it.
        R: World from the body beyond, overwritten, shape (3, 3).
        S: World from the joint's frame, shape (3, 3).
        axis: Of the joint, in its frame, shape (3,).
        q: Its angle [rad].
        v: Its rate [rad/s].
        a: Its acceleration [rad/s^2].
    """
    for r in range(3):
        body[U, r] = S[r, 0] * axis[0] + S[r, 1] * axis[1] + S[r, 2] * axis[2]
    ux, uy, uz = body[U, 0], body[U, 1], body[U, 2]
    wx, wy, wz = body[W, 0], body[W, 1], body[W, 2]
    # dw' = dw + u a + (w x u) v,  w' = w + u v (the same, of a rotating joint)
    body[DW, 0] += ux * a + (wy * uz - wz * uy) * v
    body[DW, 1] += uy * a + (wz * ux - wx * uz) * v
    body[DW, 2] += uz * a + (wx * uy - wy * ux) * v
    for r in range(3):
        body[W, r] += body[U, r] * v
    _turned(S, axis, q, R)


@njit(cache=True)
def chain_motion(
    chain: Chain, tip: Tip, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Motion of the tip of a chain.

    Args:
        chain: Its joints.
        tip: The frame that is asked for.
        q: Joint angles, shape (n, m) [rad].
        v: Joint rates, shape (n, m) [rad/s].
        a: Joint accelerations, shape (n, m) [rad/s^2].

    Returns:
        Position (n, 3) [m], rotation world from tip (n, 3, 3), linear velocity (n, 3) [m/s],
        angular velocity (n, 3) [rad/s], classical linear acceleration (n, 3) [m/s^2] and angular
        acceleration (n, 3) [rad/s^2], all in the world frame.
    """
    n = q.shape[0]
    position = np.empty((n, 3))
    rotation = np.empty((n, 3, 3))
    velocity = np.empty((n, 3))
    rate = np.empty((n, 3))
    acceleration = np.empty((n, 3))
    rate_derivative = np.empty((n, 3))
    rotations, offsets, axes, columns = chain
    tip_rotation, tip_offset = tip
    body, R, S = np.empty((7, 3)), np.empty((3, 3)), np.empty((3, 3))
    for i in range(n):
        rest(body, R)
        for j in range(rotations.shape[0]):
            k = columns[j]
            # to the joint along the body before it, then about its axis (Featherstone 2008, ch. 4)
            reach(body, R, S, rotations[j], offsets[j])
            turn(body, R, S, axes[j], q[i, k], v[i, k], a[i, k])
        reach(body, R, S, tip_rotation, tip_offset)
        for r in range(3):
            position[i, r] = body[P, r]
            velocity[i, r] = body[V, r]
            acceleration[i, r] = body[A, r]
            rate[i, r] = body[W, r]
            rate_derivative[i, r] = body[DW, r]
            for c in range(3):
                rotation[i, r, c] = S[r, c]
    return position, rotation, velocity, rate, acceleration, rate_derivative


@njit(cache=True)
def link_poses(
    chain: Chain,
    carriers: np.ndarray,
    tip_rotations: np.ndarray,
    tip_offsets: np.ndarray,
    q: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Poses of several frames along a chain of k rotating joints, in one walk.

    Args:
        chain: Its joints.
        carriers: How many joints carry each frame, shape (l,), from 0 to k.
        tip_rotations: Placement of each frame in the last joint that carries it, shape (l, 3, 3).
        tip_offsets: Placement of each frame in the last joint that carries it, shape (l, 3) [m].
        q: Joint angles, shape (n, m) [rad].

    Returns:
        Position (n, l, 3) and rotation world from frame (n, l, 3, 3), as `chain_motion` gives them.
    """
    rotations, offsets, axes, columns = chain
    n, k, frames = q.shape[0], rotations.shape[0], carriers.shape[0]
    positions = np.empty((n, frames, 3))
    turned = np.empty((n, frames, 3, 3))
    R, S, p = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
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
                        # p + R offset
                        shift = R[r, 0] * offset[0] + R[r, 1] * offset[1] + R[r, 2] * offset[2]
                        positions[i, frame, r] = p[r] + shift
                    _product(R, tip_rotations[frame], turned[i, frame])
            if j == k:
                break
            offset = offsets[j]
            for r in range(3):
                # p <- p + R offset, R <- R R_joint exp(axis q)
                p[r] += R[r, 0] * offset[0] + R[r, 1] * offset[1] + R[r, 2] * offset[2]
            _product(R, rotations[j], S)
            _turned(S, axes[j], q[i, columns[j]], R)
    return positions, turned


@njit(cache=True, inline="always")
def _product(A: np.ndarray, B: np.ndarray, AB: np.ndarray) -> None:
    """The product of two matrices into a third, shapes (3, 3)."""
    for r in range(3):
        for c in range(3):
            # (AB)_rc = sum A_rk B_kc
            AB[r, c] = A[r, 0] * B[0, c] + A[r, 1] * B[1, c] + A[r, 2] * B[2, c]


@njit(cache=True, inline="always")
def _turned(S: np.ndarray, axis: np.ndarray, angle: float, R: np.ndarray) -> None:
    """S T into R, where T is the rotation about a unit axis by an angle (Rodrigues).

    Args:
        S: Shape (3, 3).
        axis: Shape (3,).
        angle: [rad].
        R: Overwritten, shape (3, 3).
    """
    # T = cos 1 + (1 - cos) u u' + sin [u x], entry by entry
    sine, cosine = np.sin(angle), np.cos(angle)
    rest = 1.0 - cosine
    x, y, z = axis[0], axis[1], axis[2]
    xx, xy, xz = cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine
    yx, yy, yz = y * x * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine
    zx, zy, zz = z * x * rest - y * sine, z * y * rest + x * sine, cosine + z * z * rest
    for r in range(3):
        a, b, c = S[r, 0], S[r, 1], S[r, 2]
        R[r, 0] = a * xx + b * yx + c * zx
        R[r, 1] = a * xy + b * yy + c * zy
        R[r, 2] = a * xz + b * yz + c * zz
