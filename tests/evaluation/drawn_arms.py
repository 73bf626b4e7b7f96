"""Arms whose zeros, twists and lengths are drawn as a robot file states them, by forward kinematics
of our own.

An arm of Universal Robots by its makers' Denavit-Hartenberg parameters (Universal Robots, DH
Parameters for calculations of kinematics and dynamics), with SciPy's rotations; nothing is shared
with testbench/model. Parallel axes have a second tilt, beta. Of a session only the measured joint
angles, the instants and the stated U are taken.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

ALPHA = np.array([np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0])
A = np.array([0, -0.24355, -0.2132, 0, 0, 0])
D = np.array([0.15185, 0, 0, 0.13105, 0.08535, 0.0921])
PARALLEL = [1, 2]
"""Links whose two axes are parallel, so that they may be tilted about y as well."""
WRIST_1, WRIST_3 = 3, 5
SEGMENT = Rotation.from_euler("X", 90, degrees=True)


@dataclass(frozen=True)
class Stated:
    """Standard uncertainties of the arms that a robot file speaks of, and how they are drawn.

    Attributes:
        zero: Of each joint's zero [deg].
        twist: Of each twist [deg].
        length: Of each length a [mm].
        offset: Of each offset d [mm].
        scale: By what all of them are really greater.
        freedom: Degrees of freedom of each of these numbers: it is itself off as a standard
            deviation of so many is (chi-square), for the whole arm alike; None for exact ones.
        law: "normal" or "rectangular".
    """

    zero: float
    twist: float
    length: float
    offset: float
    scale: float = 1.0
    freedom: float | None = None
    law: str = "normal"


@dataclass(frozen=True)
class Arms:
    """What arms are off by: zeros, alpha and beta [rad], a and d [m], shape (count, 6) each."""

    zeros: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    a: np.ndarray
    d: np.ndarray


NOMINAL = Arms(*np.zeros((5, 1, 6)))


def drawn(stated: Stated, count: int, rng: np.random.Generator) -> Arms:
    """Arms of those that a file speaks of.

    Args:
        stated: By the file.
        count: How many.
        rng: To draw from.
    """

    def draw(sd: float, columns: int = 6) -> np.ndarray:
        sds = np.full((count, 1), sd * stated.scale)
        if stated.freedom is not None:
            sds /= np.sqrt(rng.chisquare(stated.freedom, (count, 1)) / stated.freedom)
        if stated.law == "rectangular":
            return np.sqrt(3) * rng.uniform(-1, 1, (count, columns)) * sds
        return rng.standard_normal((count, columns)) * sds

    twists = np.radians(draw(stated.twist, 12))
    beta = np.zeros((count, 6))
    beta[:, PARALLEL] = twists[:, 6:][:, PARALLEL]
    zeros = np.radians(draw(stated.zero))
    a, d = 1e-3 * draw(stated.length), 1e-3 * draw(stated.offset)
    return Arms(zeros, twists[:, :6], beta, a, d)


def poses(q: np.ndarray, arms: Arms) -> tuple[list[Rotation], np.ndarray]:
    """Every link's orientation behind its joint, and the place of the flange, in the base.

    Args:
        q: Joint angles of each arm, shape (count or 1, m, 6) [rad].
        arms: What is off, of `count` arms.

    Returns:
        Six orientations of count * m instants each; places, shape (count * m, 3) [m].
    """
    count, m = max(len(q), len(arms.zeros)), q.shape[1]

    def each(values: np.ndarray) -> np.ndarray:
        return np.repeat(np.broadcast_to(values, (count, 6)), m, axis=0)

    q = np.broadcast_to(q + arms.zeros[:, None], (count, m, 6)).reshape(-1, 6)
    alpha, beta, a, d = each(arms.alpha), each(arms.beta), each(arms.a + A), each(arms.d + D)
    base, place = Rotation.from_quat(np.tile([0.0, 0, 0, 1], (len(q), 1))), np.zeros((len(q), 3))
    none = np.zeros(len(q))
    found = []
    for i in range(6):
        turned = base * Rotation.from_rotvec(np.column_stack([none, none, q[:, i]]))
        found.append(turned)
        place = place + turned.apply(np.column_stack([a[:, i], none, d[:, i]]))
        tilt = Rotation.from_rotvec(np.column_stack([alpha[:, i], beta[:, i], none]))
        base = turned * tilt * Rotation.from_rotvec([ALPHA[i], 0, 0])
    return found, place


def flexion(definition: str, links: list[Rotation]) -> np.ndarray:
    """Middle Euler angle of wrist 3 against wrist 1 as segments [deg], shape (n,).

    Args:
        definition: "YXZ", with its sign turned, or "ZXZ".
        links: Orientations, of `poses`.
    """
    between = SEGMENT.inv() * links[WRIST_1].inv() * links[WRIST_3] * SEGMENT
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # at gimbal lock the middle angle is known
        angle = between.as_euler(definition)[:, 1]
    return np.degrees(-angle if definition == "YXZ" else angle)


@dataclass(frozen=True)
class Judged:
    """What the encoders said in the judged instants of a step.

    Attributes:
        q: Joint angles, shape (m, 6) [rad].
        rate: Shape (m, 6) [rad/s].
    """

    q: np.ndarray
    rate: np.ndarray


def differences(
    step: Judged, arms: Arms, definition: str | None, late: np.ndarray, moved: np.ndarray
) -> np.ndarray:
    """What the truth of a step is off by: the angle by the encoders less the real one [deg].

    Args:
        step: That is judged.
        arms: As they really are.
        definition: Of the flexion; None where the angle of wrist 3 itself is the truth.
        late: How much later than believed the samples of both sensors were taken, shape (count, 2)
            [s], proximal first.
        moved: By what each joint stands beside its reading in this step, shape (count, 6) [rad].

    Returns:
        Shape (count, m).
    """
    count, m = len(arms.zeros), len(step.q)
    q = step.q[None] + moved[:, None]
    proximal, distal = (q + step.rate[None] * late[:, i, None, None] for i in (0, 1))
    if definition is None:
        real = distal[:, :, WRIST_3] + arms.zeros[:, WRIST_3, None]
        return np.asarray(np.degrees(step.q[None, :, WRIST_3] - real))
    links = poses(proximal, arms)[0]
    links[WRIST_3] = poses(distal, arms)[0][WRIST_3]
    real = flexion(definition, links).reshape(count, m)
    said = flexion(definition, poses(step.q[None], NOMINAL)[0])
    return np.asarray((said - real + 180) % 360 - 180)
