"""Rotations: unit quaternions w, x, y, z (Hamilton), vectorised over any leading axes.

`q_target_from_source` turns coordinates: x_target = rotate(q_target_from_source, x_source), and
multiply(q_a_from_b, q_b_from_c) is q_a_from_c. Euler angles are intrinsic, their sequence spelt in
upper case as in SciPy.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.model.kernel_cache import announce, forgive, take_turns

forgive()  # here, for nearly all that has kernels turns something
take_turns()
announce()

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
GIMBAL_LOCK = 1e-7
"""So near to its end the middle angle leaves only the sum or difference of the others [rad]."""

Parts = tuple[float, float, float, float]
"""w, x, y, z of one quaternion."""


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Hamilton product p q.

    Args:
        p: Left factor, shape (..., 4).
        q: Right factor, shape (..., 4), broadcast against the left.

    Returns:
        Shape (..., 4).
    """
    p, q = np.asarray(p, float), np.asarray(q, float)
    shape = np.broadcast_shapes(p.shape, q.shape)
    if p.ndim > 1 and q.ndim > 1 and p.shape != q.shape:
        p, q = np.broadcast_to(p, shape), np.broadcast_to(q, shape)
    return _products(
        np.ascontiguousarray(p).reshape(-1, 4), np.ascontiguousarray(q).reshape(-1, 4)
    ).reshape(shape)


@njit(cache=True)
def _products(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Hamilton products row by row; either factor may be a single row for all.

    Args:
        p: Left factors, shape (n, 4) or (1, 4).
        q: Right factors, shape (n, 4) or (1, 4).
    """
    n = max(len(p), len(q)) if len(p) and len(q) else 0
    products = np.empty((n, 4))
    for row in range(n):
        a, b = p[row if len(p) > 1 else 0], q[row if len(q) > 1 else 0]
        # p q, see `product`
        products[row, 0], products[row, 1], products[row, 2], products[row, 3] = product(
            (a[0], a[1], a[2], a[3]), (b[0], b[1], b[2], b[3])
        )
    return products


@njit(cache=True)
def product(p: Parts, q: Parts) -> Parts:
    """Hamilton product p q of one pair, for compiled loops."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    # (pw qw - pv . qv, pw qv + qw pv + pv x qv) (Solà, Quaternion kinematics for the error-state
    # Kalman filter, 2017, section 1.2.2)
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    """Inverse of unit quaternions.

    Args:
        q: Shape (..., 4).

    Returns:
        Shape (..., 4).
    """
    return np.asarray(q, float) * np.array([1.0, -1.0, -1.0, -1.0])


def normalise(q: np.ndarray) -> np.ndarray:
    """Quaternions scaled to unit length.

    Args:
        q: Shape (..., 4).

    Returns:
        Shape (..., 4).
    """
    q = np.asarray(q, float)
    return q / lengths(q)[..., None]


def lengths(v: np.ndarray) -> np.ndarray:
    """Lengths of vectors of few parts: as np.linalg.norm, in half its time.

    Args:
        v: Shape (..., k).

    Returns:
        Shape (...).
    """
    v = np.asarray(v, float)
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", v, v)))


def rotate(q_target_from_source: np.ndarray, x_source: np.ndarray) -> np.ndarray:
    """Coordinates of vectors in the target frame.

    Args:
        q_target_from_source: Shape (..., 4).
        x_source: The vectors in the source frame, shape (..., 3), in any unit.

    Returns:
        Shape (..., 3), in the unit of the vectors.
    """
    q = np.asarray(q_target_from_source, float)
    x = np.asarray(x_source, float)
    shape = np.broadcast_shapes(q.shape[:-1], x.shape[:-1])
    if q.ndim > 1 and x.ndim > 1 and q.shape[:-1] != x.shape[:-1]:
        q, x = np.broadcast_to(q, (*shape, 4)), np.broadcast_to(x, (*shape, 3))
    return _rotated(
        np.ascontiguousarray(q).reshape(-1, 4), np.ascontiguousarray(x).reshape(-1, 3)
    ).reshape(*shape, 3)


@njit(cache=True)
def _rotated(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Row by row, shapes (n, 4) and (n, 3), where either may be a single row for all.

    x + w t + v cross t with t = 2 v cross x.
    """
    n = max(len(q), len(x)) if len(q) and len(x) else 0
    result = np.empty((n, 3))
    for row in range(n):
        i, j = row if len(q) > 1 else 0, row if len(x) > 1 else 0
        w, a, b, c = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        # t = 2 v x x
        t0 = 2.0 * (b * x[j, 2] - c * x[j, 1])
        t1 = 2.0 * (c * x[j, 0] - a * x[j, 2])
        t2 = 2.0 * (a * x[j, 1] - b * x[j, 0])
        # x + w t + v x t
        result[row, 0] = x[j, 0] + w * t0 + (b * t2 - c * t1)
        result[row, 1] = x[j, 1] + w * t1 + (c * t0 - a * t2)
        result[row, 2] = x[j, 2] + w * t2 + (a * t1 - b * t0)
    return result


def to_matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrices of quaternions.

    Args:
        q: Shape (..., 4).

    Returns:
        Shape (..., 3, 3).
    """
    q = np.asarray(q, float)
    return _matrices(np.ascontiguousarray(q).reshape(-1, 4)).reshape(*q.shape[:-1], 3, 3)


@njit(cache=True)
def _matrices(q: np.ndarray) -> np.ndarray:
    """Row by row, shape (n, 4) to (n, 3, 3)."""
    matrices = np.empty((len(q), 3, 3))
    for row in range(len(q)):
        w, x, y, z = unit(q[row, 0], q[row, 1], q[row, 2], q[row, 3])
        R = matrices[row]
        # w^2 - |v|^2 on the diagonal plus 2 v_i v_j, and 2 w [v x] (Solà, Quaternion kinematics for
        # the error-state Kalman filter, 2017, section 2)
        R[0, 0] = x * x - y * y - z * z + w * w
        R[0, 1] = 2.0 * (x * y - z * w)
        R[0, 2] = 2.0 * (x * z + y * w)
        R[1, 0] = 2.0 * (x * y + z * w)
        R[1, 1] = -(x * x) + y * y - z * z + w * w
        R[1, 2] = 2.0 * (y * z - x * w)
        R[2, 0] = 2.0 * (x * z - y * w)
        R[2, 1] = 2.0 * (y * z + x * w)
        R[2, 2] = -(x * x) - y * y + z * z + w * w
    return matrices


@njit(cache=True)
def unit(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """A quaternion scaled to unit length, for compiled loops."""
    # q / |q|
    length = np.sqrt(x * x + y * y + z * z + w * w)
    return w / length, x / length, y / length, z / length


def from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Quaternions of rotation matrices, with w >= 0.

    Args:
        matrix: Shape (..., 3, 3).

    Returns:
        Shape (..., 4).

    Raises:
        ValueError: One is left-handed or singular; of one that is not quite orthogonal the nearest
            rotation is taken.
    """
    matrix = np.asarray(matrix, float)
    rows = np.ascontiguousarray(matrix).reshape(-1, 3, 3)
    q, orthogonal = _quaternions(rows)
    if not orthogonal:
        from scipy.spatial.transform import Rotation

        q = Rotation.from_matrix(rows).as_quat(canonical=True, scalar_first=True)
    return q.reshape(*matrix.shape[:-2], 4)


@njit(cache=True)
def _quaternions(matrices: np.ndarray) -> tuple[np.ndarray, bool]:
    """Row by row, shape (n, 3, 3) to (n, 4), and whether all of them are rotations to 1e-12.

    The largest part of the quaternion is found first, so that nothing is divided by a small number
    (Markley, J. Guidance, Control, and Dynamics 31, 2008, eqs 24 and 25).
    """
    result = np.empty((len(matrices), 4))
    for row in range(len(matrices)):
        R = matrices[row]
        for i in range(3):
            for j in range(3):
                product_of_rows = R[i, 0] * R[j, 0] + R[i, 1] * R[j, 1] + R[i, 2] * R[j, 2]
                if not abs(product_of_rows - (1.0 if i == j else 0.0)) <= 1e-12:
                    return result, False
        if (
            R[0, 0] * (R[1, 1] * R[2, 2] - R[1, 2] * R[2, 1])
            - R[0, 1] * (R[1, 0] * R[2, 2] - R[1, 2] * R[2, 0])
            + R[0, 2] * (R[1, 0] * R[2, 1] - R[1, 1] * R[2, 0])
            < 0
        ):
            return result, False
        trace = R[0, 0] + R[1, 1] + R[2, 2]
        if trace > max(R[0, 0], R[1, 1], R[2, 2]):
            w, x = 1.0 + trace, R[2, 1] - R[1, 2]
            y, z = R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
        elif R[0, 0] >= max(R[1, 1], R[2, 2]):
            w, x = R[2, 1] - R[1, 2], 1.0 - trace + 2.0 * R[0, 0]
            y, z = R[1, 0] + R[0, 1], R[2, 0] + R[0, 2]
        elif R[1, 1] >= R[2, 2]:
            w, x = R[0, 2] - R[2, 0], R[1, 0] + R[0, 1]
            y, z = 1.0 - trace + 2.0 * R[1, 1], R[2, 1] + R[1, 2]
        else:
            w, x = R[1, 0] - R[0, 1], R[2, 0] + R[0, 2]
            y, z = R[2, 1] + R[1, 2], 1.0 - trace + 2.0 * R[2, 2]
        w, x, y, z = unit(w, x, y, z)
        first = w if w != 0.0 else x if x != 0.0 else y if y != 0.0 else z
        if first < 0.0:  # of half a turn either sign has w = 0: the next part decides
            w, x, y, z = -w, -x, -y, -z
        result[row, 0], result[row, 1], result[row, 2], result[row, 3] = w, x, y, z
    return result, True


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation R that maximises trace(R' matrix): Wahba's problem (Markley 1988).

    Args:
        matrix: Shape (..., 3, 3).

    Returns:
        Shape (..., 3, 3).
    """
    u, _, vt = np.linalg.svd(matrix)
    u[..., :, 2] *= np.linalg.det(u @ vt)[..., None]
    return np.asarray(u @ vt)


def from_rotation_vector(vector: np.ndarray) -> np.ndarray:
    """Quaternions of rotation vectors.

    Args:
        vector: Shape (..., 3) [rad].

    Returns:
        Shape (..., 4).
    """
    vector = np.asarray(vector, float)
    return _from_vectors(np.ascontiguousarray(vector).reshape(-1, 3)).reshape(*vector.shape[:-1], 4)


@njit(cache=True)
def _from_vectors(vector: np.ndarray) -> np.ndarray:
    """Row by row, shape (n, 3) to (n, 4)."""
    q = np.empty((len(vector), 4))
    for row in range(len(vector)):
        x, y, z = vector[row, 0], vector[row, 1], vector[row, 2]
        angle = np.sqrt(x * x + y * y + z * z)
        if angle <= 1e-3:  # sin(angle / 2) / angle by its series, exact to rounding
            square = angle * angle
            scale = 0.5 - square / 48.0 + square * square / 3840.0
        else:
            scale = np.sin(angle / 2.0) / angle
        q[row, 0] = np.cos(angle / 2.0)
        q[row, 1], q[row, 2], q[row, 3] = scale * x, scale * y, scale * z
    return q


def to_rotation_vector(q: np.ndarray) -> np.ndarray:
    """Rotation vectors of length up to pi, exact for small angles.

    Args:
        q: Shape (..., 4), of either sign.

    Returns:
        Shape (..., 3) [rad].
    """
    q = np.asarray(q, float)
    return _rotation_vectors(np.ascontiguousarray(q).reshape(-1, 4)).reshape(*q.shape[:-1], 3)


@njit(cache=True)
def _rotation_vectors(q: np.ndarray) -> np.ndarray:
    """Row by row, shapes (n, 4) to (n, 3)."""
    vector = np.empty((len(q), 3))
    for row in range(len(q)):
        # 2 log q, see `_vector`
        vector[row, 0], vector[row, 1], vector[row, 2] = _vector(
            q[row, 0], q[row, 1], q[row, 2], q[row, 3]
        )
    return vector


def turn_between(q_from: np.ndarray, q_to: np.ndarray) -> np.ndarray:
    """Rotation vectors, in the outer frame, of q_to conj(q_from), in one pass.

    Args:
        q_from: Before, shape (n, 4).
        q_to: After, shape (n, 4).

    Returns:
        Shape (n, 3) [rad].
    """
    return _turns(
        np.ascontiguousarray(q_from, dtype=float), np.ascontiguousarray(q_to, dtype=float)
    )


@njit(cache=True)
def _turns(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Row by row, shapes (n, 4) and (n, 4) to (n, 3)."""
    vector = np.empty((len(p), 3))
    for row in range(len(p)):
        # 2 log(q conj(p)), the turn from p to q in the frame that both are seen from
        w, x, y, z = product(
            (q[row, 0], q[row, 1], q[row, 2], q[row, 3]),
            (p[row, 0], -p[row, 1], -p[row, 2], -p[row, 3]),
        )
        vector[row, 0], vector[row, 1], vector[row, 2] = _vector(w, x, y, z)
    return vector


@njit(cache=True)
def _vector(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The rotation vector of one quaternion [rad]."""
    # q and -q are one rotation: that of at most half a turn
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    # 2 atan2(|v|, w) v / |v|, and its limit 2 v where v is too small to be scaled
    scale = 2.0 * np.arctan2(sine, w) / sine if sine > 1e-150 else 2.0
    return scale * x, scale * y, scale * z


def from_euler(sequence: str, angles: np.ndarray) -> np.ndarray:
    """Quaternions of intrinsic Euler angles.

    Args:
        sequence: Such as "ZXZ".
        angles: Shape (..., 3) [rad].

    Returns:
        Shape (..., 4).
    """
    angles = np.asarray(angles, float)
    axes = np.array(["XYZ".index(letter) for letter in sequence])
    q = _from_euler(axes, np.ascontiguousarray(angles).reshape(-1, 3))
    return q.reshape(*angles.shape[:-1], 4)


@njit(cache=True)
def _from_euler(axes: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Row by row, shape (n, 3) to (n, 4): q = q(axis 1) q(axis 2) q(axis 3).

    Each axis is fixed to the body that the rotations before it have moved.
    """
    q = np.empty((len(angles), 4))
    turn = np.empty(3)
    for row in range(len(angles)):
        w, x, y, z = 1.0, 0.0, 0.0, 0.0
        for i in range(3):
            half = angles[row, i] / 2.0
            turn[:] = 0.0
            turn[axes[i]] = np.sin(half)
            # q <- q (cos a / 2, axis sin a / 2): intrinsic turns multiply on the right
            w, x, y, z = product((w, x, y, z), (np.cos(half), turn[0], turn[1], turn[2]))
        q[row, 0], q[row, 1], q[row, 2], q[row, 3] = w, x, y, z
    return q


def to_euler(sequence: str, q: np.ndarray) -> np.ndarray:
    """Intrinsic Euler angles of rotations.

    The middle angle lies in [0, pi] for sequences such as ZXZ and in [-pi/2, pi/2] for sequences
    such as XYZ. In gimbal lock only the sum or difference of the outer angles exists; the third is
    then set to zero (see `gimbal_margin`).

    Args:
        sequence: Such as "ZXZ".
        q: Shape (..., 4).

    Returns:
        Shape (..., 3) [rad].
    """
    q = np.asarray(q, float)
    axes = np.array(["XYZ".index(letter) for letter in sequence])
    angles = _euler_angles(axes, np.ascontiguousarray(q).reshape(-1, 4))
    return angles.reshape(*q.shape[:-1], 3)


@njit(cache=True)
def _euler_angles(axes: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Row by row, shape (n, 4) to (n, 3).

    Bernardes & Viollet, PLoS ONE 17 (2022) e0276302, algorithm 1; their angles belong to rotations
    about fixed axes, which come in the opposite order.
    """
    k, j, i = axes
    symmetric = i == k
    if symmetric:
        k = 3 - i - j
    sign = (i - j) * (j - k) * (k - i) / 2.0  # +1 where i, j, k are even, -1 where odd
    angles = np.empty((len(q), 3))
    part = np.empty(4)
    for row in range(len(q)):
        part[3], part[0], part[1], part[2] = unit(q[row, 0], q[row, 1], q[row, 2], q[row, 3])
        if symmetric:
            a, b, c, d = part[3], part[i], part[j], part[k] * sign
        else:
            a, b = part[3] - part[j], part[i] + part[k] * sign
            c, d = part[j] + part[3], part[k] * sign - part[i]
        middle = 2.0 * np.arctan2(np.hypot(c, d), np.hypot(a, b))
        half_sum, half_difference = np.arctan2(b, a), np.arctan2(d, c)
        if abs(middle) <= GIMBAL_LOCK:
            first, third = 2.0 * half_sum, 0.0
        elif abs(middle - np.pi) <= GIMBAL_LOCK:
            first, third = 2.0 * half_difference, 0.0
        else:
            first, third = half_sum + half_difference, half_sum - half_difference
        if not symmetric:
            first *= sign
            middle -= np.pi / 2.0
        angles[row, 0], angles[row, 1], angles[row, 2] = first, middle, third
        for m in range(3):
            if angles[row, m] < -np.pi:
                angles[row, m] += 2.0 * np.pi
            elif angles[row, m] > np.pi:
                angles[row, m] -= 2.0 * np.pi
    return angles


def gimbal_margin(sequence: str, angles: np.ndarray) -> np.ndarray:
    """Distance of the middle angle from gimbal lock.

    Args:
        sequence: Such as "ZXZ".
        angles: Shape (..., 3) [rad].

    Returns:
        Shape (...) [rad].
    """
    middle = np.asarray(angles, float)[..., 1]
    if sequence[0] == sequence[2]:
        return np.minimum(np.abs(middle), np.abs(np.pi - np.abs(middle)))
    return np.abs(np.pi / 2 - np.abs(middle))


def from_heading(angle: float | np.ndarray) -> np.ndarray:
    """Rotations about the vertical (z).

    Args:
        angle: One, or of any shape (...) [rad].

    Returns:
        Shape (..., 4).
    """
    half = np.asarray(angle, float) / 2
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)


def angle(q: np.ndarray) -> np.ndarray:
    """Angle of rotations in [0, pi], exact for small angles.

    Args:
        q: Shape (..., 4), of either sign.

    Returns:
        Shape (...) [rad].
    """
    q = np.asarray(q, float)
    return np.asarray(2.0 * np.arctan2(lengths(q[..., 1:]), np.abs(q[..., 0])))


def heading_angle(q_world_error: np.ndarray) -> np.ndarray:
    """Signed angle in [-pi, pi) of the rotation about the vertical nearest to a rotation.

    Args:
        q_world_error: The rotation, in the world, shape (..., 4).

    Returns:
        Shape (...) [rad].
    """
    q = np.asarray(q_world_error, float)
    return np.asarray(wrap(2.0 * np.arctan2(q[..., 3], q[..., 0])))


def inclination_angle(q_world_error: np.ndarray) -> np.ndarray:
    """Angle that remains of a rotation once its heading is taken away (Laidig & Seel 2023, VQF).

    Args:
        q_world_error: The rotation, in the world, shape (..., 4).

    Returns:
        Shape (...) [rad].
    """
    q = np.asarray(q_world_error, float)
    level, upright = q[..., 1] ** 2 + q[..., 2] ** 2, q[..., 0] ** 2 + q[..., 3] ** 2
    return np.asarray(2.0 * np.arctan2(np.sqrt(level), np.sqrt(upright)))


def wrap(angle_rad: np.ndarray) -> np.ndarray:
    """Angles brought into [-pi, pi).

    Args:
        angle_rad: Of any shape.

    Returns:
        Of the same shape [rad].
    """
    return (np.asarray(angle_rad, float) + np.pi) % (2 * np.pi) - np.pi


def mean(q: np.ndarray) -> np.ndarray:
    """Mean of quaternions of either sign.

    It is the largest eigenvector of sum q q' (Markley et al. 2007).

    Args:
        q: Shape (n, 4).

    Returns:
        Shape (4,), with w >= 0.
    """
    q = np.asarray(q, float)
    _, vectors = np.linalg.eigh(q.T @ q)
    result = vectors[:, -1]
    return result if result[0] >= 0 else -result


def interpolate(times: np.ndarray, q: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Spherical linear interpolation, held at the ends.

    Args:
        times: Increasing, shape (n,).
        q: At those times, shape (n, 4), of either sign.
        at: Wanted times, shape (m,), same unit.

    Returns:
        Shape (m, 4).

    Raises:
        ValueError: There is nothing to interpolate between.
    """
    times, at = np.asarray(times), np.asarray(at)
    if not len(times):
        raise ValueError("no orientation to interpolate from")
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, max(len(times) - 2, 0))
    return _slerp(times, np.ascontiguousarray(q, dtype=float), at, index)


@njit(cache=True)
def _slerp(times: np.ndarray, q: np.ndarray, at: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Between orientation `index` and the following one, for each of the times, shape (m, 4)."""
    result = np.empty((len(at), 4))
    for row in range(len(at)):
        i = index[row]
        j = min(i + 1, len(times) - 1)
        span = times[j] - times[i]
        u = min(max((at[row] - times[i]) / (span if span > 0 else 1), 0.0), 1.0)
        dot = q[i, 0] * q[j, 0] + q[i, 1] * q[j, 1] + q[i, 2] * q[j, 2] + q[i, 3] * q[j, 3]
        # the shorter way round
        sign = -1.0 if dot < 0 else 1.0
        theta = np.arccos(min(abs(dot), 1.0))
        sin = np.sin(theta)
        a, b = 1 - u, u
        # sin((1 - u) theta) / sin theta, sin(u theta) / sin theta (Shoemake 1985); straight where
        # both are nearly one
        if sin >= 1e-6:
            a, b = np.sin((1 - u) * theta) / sin, np.sin(u * theta) / sin
        norm = 0.0
        for k in range(4):
            value = a * q[i, k] + b * sign * q[j, k]
            result[row, k] = value
            norm += value * value
        norm = np.sqrt(norm)
        for k in range(4):
            result[row, k] /= norm
    return result
