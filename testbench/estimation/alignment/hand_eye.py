"""World and mounting together from orientations: q_world_from_body X = Z q_earth_from_sensor.

That is often written AX = ZB.
Maximising sum (z' M_i x)^2, with M_i x = conj-product of the pair, is blind to the signs of the
quaternions. The best rank-one approximation starts it, alternating eigenvectors finish it. Its
information matrix says which rotation the motion cannot show: with a single axis of motion, turning
the world and the mounting about that axis cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from testbench.estimation.alignment.shown_mounting import ShownMounting
from testbench.model import rotation

MOST_PAIRS = 5_000


@dataclass(frozen=True)
class HandEye(ShownMounting):
    """World and mounting that reconcile two series of orientations; observability is that of the
    motion.

    Attributes:
        q_world_from_earth: Shape (4,).
        residual: RMS angle that is left [rad].
        world_sd: Standard uncertainty of the world about each axis, shape (3,) [rad].
        mounting_sd: Standard uncertainty of the mounting about each axis, shape (3,) [rad].
        mounting_covariance: Of a small rotation about the axes of the sensor, shape (3, 3) [rad^2].
    """

    MISSING: ClassVar[str] = "the motion is nearly all about one axis"
    ADVICE: ClassVar[str] = "add rotations of 30 deg or more about an axis across it"
    q_world_from_earth: np.ndarray
    residual: float
    world_sd: np.ndarray
    mounting_sd: np.ndarray
    mounting_covariance: np.ndarray


def solve_hand_eye(
    q_world_from_body: np.ndarray, q_earth_from_sensor: np.ndarray, independent: float | None = None
) -> HandEye:
    """Solve for X = q_body_from_sensor and Z = q_world_from_earth.

    Args:
        q_world_from_body: By the arm, of any signs, shape (n, 4), n >= 3.
        q_earth_from_sensor: By the filter, at the same instants, of any signs, shape (n, 4).
        independent: How many of the pairs count as independent for the uncertainties; all if None.

    Raises:
        ValueError: Fewer than three pairs.
    """
    if len(q_world_from_body) < 3:
        raise ValueError(
            f"a mounting needs at least 3 pairs of orientations, not {len(q_world_from_body)}"
        )
    pick = (
        np.linspace(0, len(q_world_from_body) - 1, min(len(q_world_from_body), MOST_PAIRS))
        .round()
        .astype(int)
    )
    body, sensor = q_world_from_body[pick], q_earth_from_sensor[pick]
    # q_body x conj(q_sensor) = z, so z' (L(body) R(conj sensor)) x is the cosine of half the angle
    # that is left
    M = _left(body) @ _right(rotation.conjugate(sensor))
    flat = M.reshape(len(M), 16)
    _, vectors = np.linalg.eigh(flat.T @ flat)
    u, _, vt = np.linalg.svd(vectors[:, -1].reshape(4, 4))
    z, x = u[:, 0], vt[0]
    for _ in range(50):  # alternately the best z for x and the best x for z
        previous = x
        z = _principal(M @ x)
        x = _principal(np.einsum("nji,j->ni", M, z))
        if 1 - abs(previous @ x) < 1e-15:
            break
    error = rotation.multiply(
        rotation.conjugate(rotation.multiply(np.broadcast_to(z, body.shape), sensor)),
        rotation.multiply(body, x),
    )
    residual = float(np.sqrt(np.mean(rotation.angle(error) ** 2)))
    return _with_uncertainty(z, x, residual, sensor, float(independent or len(pick)))


def _with_uncertainty(
    z: np.ndarray, x: np.ndarray, residual: float, sensor: np.ndarray, independent: float
) -> HandEye:
    """The solution with its information: of small rotations each pair sees dx - R' dz.

    dx is that of the sensor (right), dz that of the earth (left).
    """
    R_sensor_from_earth = np.swapaxes(rotation.to_matrix(sensor), 1, 2)
    mean = R_sensor_from_earth.mean(axis=0)
    information = np.block([[np.eye(3), -mean], [-mean.T, np.eye(3)]])
    values, vectors = np.linalg.eigh(information)
    observability = float(np.sqrt(max(values[0], 0.0)))
    covariance = (residual**2 / 3 / independent) * np.linalg.pinv(information, rcond=1e-12)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0))
    blind = vectors[:3, 0]
    norm = np.linalg.norm(blind)
    blind = blind / norm if norm > 0 else blind
    blind = blind * (1 if blind[np.argmax(np.abs(blind))] > 0 else -1)
    return HandEye(
        x,
        observability,
        blind,
        q_world_from_earth=z,
        residual=residual,
        world_sd=sd[3:],
        mounting_sd=sd[:3],
        mounting_covariance=covariance[:3, :3],
    )


def _principal(rows: np.ndarray) -> np.ndarray:
    """Unit vector that maximises the sum of squared products with the rows, (n, 4) to (4,)."""
    return np.asarray(np.linalg.eigh(rows.T @ rows)[1][:, -1])


def _left(q: np.ndarray) -> np.ndarray:
    """Matrices L with L(q) p = q p, shape (n, 4, 4)."""
    w, x, y, z = q.T
    return np.stack([w, -x, -y, -z, x, w, -z, y, y, z, w, -x, z, -y, x, w], axis=-1).reshape(
        -1, 4, 4
    )


def _right(q: np.ndarray) -> np.ndarray:
    """Matrices R with R(q) p = p q, shape (n, 4, 4)."""
    w, x, y, z = q.T
    return np.stack([w, -x, -y, -z, x, w, z, -y, y, -z, w, x, z, y, -x, w], axis=-1).reshape(
        -1, 4, 4
    )
