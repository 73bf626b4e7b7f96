"""Mounting from vectors that arm and sensor both know: angular rates and gravity, no filter.

Wahba's problem by SVD (Markley, Attitude determination using vector observations and the singular
value decomposition, 1988); the two kinds of vectors weigh in by what each leaves unexplained.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from testbench.estimation.alignment.shown_mounting import ShownMounting
from testbench.model import rotation

ROUNDS = 4


@dataclass(frozen=True)
class VectorMounting(ShownMounting):
    """How a sensor sits in the body; observability is that of the axis which is shown least.

    Attributes:
        sd: Standard uncertainty about each axis of the sensor, shape (3,) [rad].
    """

    MISSING: ClassVar[str] = "rates and gravity all lie along one axis"
    ADVICE: ClassVar[str] = "add turns or rests about an axis across it"
    sd: np.ndarray


def mounting_from_vectors(groups: list[tuple[np.ndarray, np.ndarray, float]]) -> VectorMounting:
    """Solve v_body = R v_sensor for all pairs at once.

    Args:
        groups: Of each kind of vector the pairs in the body and in the sensor, shape (n, 3) each,
            in a unit of its own, and how many of them count as independent.

    Raises:
        ValueError: No pair at all.
    """
    groups = [group for group in groups if len(group[0])]
    if not groups:
        raise ValueError("a mounting needs at least one pair of vectors")
    scatter = [max(float(np.sqrt(np.mean(body**2))), 1e-12) for body, _, _ in groups]
    R = np.eye(3)
    for _ in range(ROUNDS):
        profile = sum(
            (
                body.T @ sensor * (count / len(body) / sd**2)
                for (body, sensor, count), sd in zip(groups, scatter, strict=True)
            ),
            np.zeros((3, 3)),
        )
        R = rotation.nearest_rotation(profile)
        left = [body - sensor @ R.T for body, sensor, _ in groups]
        scatter = [
            max(float(np.sqrt(np.mean(rest**2))), 1e-9 * float(np.sqrt(np.mean(body**2)) or 1.0))
            for rest, (body, _, _) in zip(left, groups, strict=True)
        ]
    information, total = np.zeros((3, 3)), 0.0
    for (_, sensor, count), sd in zip(groups, scatter, strict=True):
        power = float(np.sum(sensor**2)) * count / len(sensor) / sd**2
        information += power * np.eye(3) - sensor.T @ sensor * (count / len(sensor) / sd**2)
        total += power
    values, vectors = np.linalg.eigh(information)
    observability = float(np.sqrt(max(values[0], 0.0) / total)) if total > 0 else 0.0
    covariance = np.linalg.pinv(information, rcond=1e-12)
    blind = vectors[:, 0] * (1 if vectors[np.argmax(np.abs(vectors[:, 0])), 0] > 0 else -1)
    found = np.sqrt(np.maximum(np.diag(covariance), 0))
    return VectorMounting(rotation.from_matrix(R), observability, blind, sd=found)
