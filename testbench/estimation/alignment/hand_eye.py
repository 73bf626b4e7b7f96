"""World and mounting together from orientations: q_world_from_body X = Z q_earth_from_sensor.

That is often written AX = ZB.
Maximising sum (z' M_i x)^2, with M_i x = conj-product of the pair, is blind to the signs of the
quaternions. The best rank-one approximation starts it, alternating eigenvectors finish it. Its
information matrix says which rotation the motion cannot show: with a single axis of motion,
turning the world and the mounting about that axis cancel. What it cannot show is held by a prior,
and nothing else: the rotation is moved along the blind directions to where the world is level, if
its vertical is known, else to where the mounting is nearest to the one that is believed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from testbench.estimation.alignment.shown_mounting import REFUSED, ShownMounting
from testbench.model import rotation

MOST_PAIRS = 5_000
BLIND_SD = np.radians(5.0)
"""A direction of less motion than `REFUSED` is believed if its standard uncertainty is below this
[rad].
"""
LEAST_LEAN = 0.2
"""An axis nearer to the vertical than this does not tilt the world when it is turned about [1]."""


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
        covariance: Of that and of a small rotation of the earth about its own axes, without the
            blind directions, shape (6, 6) [rad^2].
        blind: The directions that the motion does not show, shape (k, 6), k from 0 to 3.
        held_by: What holds those: "mounting", "vertical", or "".
    """

    MISSING: ClassVar[str] = "the motion is nearly all about one axis"
    ADVICE: ClassVar[str] = "add rotations of 30 deg or more about an axis across it"
    q_world_from_earth: np.ndarray
    residual: float
    world_sd: np.ndarray
    mounting_sd: np.ndarray
    mounting_covariance: np.ndarray
    covariance: np.ndarray
    blind: np.ndarray
    held_by: Literal["", "mounting", "vertical"] = ""

    @property
    def trusted(self) -> bool:
        """Whether all angles were shown."""
        return not len(self.blind)


def solve_hand_eye(
    q_world_from_body: np.ndarray,
    q_earth_from_sensor: np.ndarray,
    independent: float | None = None,
    up_known: bool = False,
) -> HandEye:
    """Solve for X = q_body_from_sensor and Z = q_world_from_earth.

    Args:
        q_world_from_body: By the arm, of any signs, shape (n, 4), n >= 3.
        q_earth_from_sensor: By the filter, at the same instants, of any signs, shape (n, 4).
        independent: How many of the pairs count as independent for the uncertainties; all if None.
        up_known: Whether the z axis of the world is known to point up, as that of the earth does.

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
    found = _with_uncertainty(z, x, residual, (body, sensor), float(independent or len(pick)))
    return found if found.trusted else _held(found, up_known)


def _with_uncertainty(
    z: np.ndarray,
    x: np.ndarray,
    residual: float,
    pairs: tuple[np.ndarray, np.ndarray],
    independent: float,
) -> HandEye:
    """The solution with its information: of small rotations each pair sees dx - R' dz.

    dx is that of the sensor (right), dz that of the earth (left). The motion is that of the truth,
    brought to the sensor, or of the sensor, whichever shows less: what a filter drifts by is no
    motion.
    """
    body, sensor = pairs
    moved = rotation.multiply(rotation.multiply(rotation.conjugate(z), body), x)
    chosen: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    for q in (sensor, moved):
        mean = np.swapaxes(rotation.to_matrix(q), 1, 2).mean(axis=0)
        information = np.block([[np.eye(3), -mean], [-mean.T, np.eye(3)]])
        values, vectors = np.linalg.eigh(information)
        if chosen is None or values[0] < chosen[1][0]:
            chosen = information, values, vectors
    assert chosen is not None
    information, values, vectors = chosen
    observability = float(np.sqrt(max(values[0], 0.0)))
    # Noise and drift of what is compared look like motion about every axis.
    shown = np.sqrt(np.maximum(values - residual**2, 0.0))
    sd_of = residual / np.sqrt(3 * independent) / np.maximum(shown, 1e-12)
    blind_rows = (np.sqrt(np.maximum(values, 0.0)) < REFUSED) & (sd_of > BLIND_SD)
    blind_rows |= values < 1e-10
    blind_rows[3:] = False
    inverse = np.where(blind_rows, 0.0, 1 / np.maximum(values, 1e-12))
    covariance = (residual**2 / 3 / independent) * (vectors * inverse) @ vectors.T
    sd = np.sqrt(np.maximum(np.diag(covariance), 0))
    axis = vectors[:3, 0]
    norm = np.linalg.norm(axis)
    axis = axis / norm if norm > 0 else axis
    axis = axis * (1 if axis[np.argmax(np.abs(axis))] > 0 else -1)
    return HandEye(
        x,
        observability,
        axis,
        q_world_from_earth=z,
        residual=residual,
        world_sd=sd[3:],
        mounting_sd=sd[:3],
        mounting_covariance=covariance[:3, :3],
        covariance=covariance,
        blind=vectors[:, blind_rows].T,
    )


def _held(found: HandEye, up_known: bool) -> HandEye:
    """The solution moved along its blind directions to where a prior holds it."""
    x, z = found.q_body_from_sensor, found.q_world_from_earth
    if len(found.blind) == 1:
        # one angle: the mounting turns about an axis of the sensor, the world about its image
        sensor_axis, earth_axis = (_unit(part) for part in np.split(found.blind[0], 2))
        lean = np.linalg.norm(np.cross(rotation.rotate(z, earth_axis), [0.0, 0.0, 1.0]))
        by_vertical = up_known and float(lean) > LEAST_LEAN
        if by_vertical:
            angle = _levelling(z, earth_axis)
        else:
            angle = -2 * float(np.arctan2(float(x[1:] @ sensor_axis), float(x[0])))
        x = rotation.multiply(x, rotation.from_rotation_vector(angle * sensor_axis))
        z = rotation.multiply(z, rotation.from_rotation_vector(angle * earth_axis))
        return replace(
            found,
            q_body_from_sensor=x,
            q_world_from_earth=z,
            held_by="vertical" if by_vertical else "mounting",
        )
    for _ in range(30):  # several: the smallest mounting within reach, step by step
        own = rotation.to_rotation_vector(x)
        weights = np.linalg.lstsq(found.blind[:, :3].T, -own, rcond=None)[0]
        step = weights @ found.blind
        x = rotation.multiply(x, rotation.from_rotation_vector(step[:3]))
        z = rotation.multiply(z, rotation.from_rotation_vector(step[3:]))
    return replace(found, q_body_from_sensor=x, q_world_from_earth=z, held_by="mounting")


def _levelling(q_world_from_earth: np.ndarray, axis: np.ndarray) -> float:
    """By how much the earth must turn about an axis of its own for its vertical to be nearest to
    the world's [rad].
    """
    up_in_earth = rotation.rotate(rotation.conjugate(q_world_from_earth), np.array([0, 0, 1.0]))
    along = axis * float(up_in_earth @ axis)
    level, side = up_in_earth - along, np.cross(up_in_earth, axis)
    z = np.array([0.0, 0.0, 1.0])
    return float(np.arctan2(float(side @ z), float(level @ z)))


def _unit(vector: np.ndarray) -> np.ndarray:
    norm = float(np.linalg.norm(vector))
    return vector / norm if norm > 0 else vector


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
