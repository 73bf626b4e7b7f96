"""Which face of the sensor a pose turns up, for the methods that want each of the six."""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.poses import StaticPoses
from testbench.model.statistics.least_squares import PoorExcitation

FACES = ("+x", "-x", "+y", "-y", "+z", "-z")
LEAST_SHARE = 0.95
"""An axis counts as up where it reads this share of the whole (18 deg), or expects it."""


def face_of(vectors: np.ndarray) -> np.ndarray:
    """The face that each vector points out of.

    Args:
        vectors: Shape (m, 3), any unit.

    Returns:
        Indices into `FACES`, -1 where no face is up, shape (m,), int.
    """
    axis = np.argmax(np.abs(vectors), axis=1)
    along = vectors[np.arange(len(vectors)), axis]
    clear = np.abs(along) >= LEAST_SHARE * np.linalg.norm(vectors, axis=1)
    return np.asarray(np.where(clear, 2 * axis + (along < 0), -1))


def need_all_faces(face: np.ndarray) -> None:
    """Refuse poses that leave a face out.

    Args:
        face: As of `face_of`, shape (m,).

    Raises:
        PoorExcitation: A face is never up.
    """
    absent = [name for i, name in enumerate(FACES) if not (face == i).any()]
    if absent:
        axes = sorted({name[1] for name in absent})
        lost = [name for axis in axes for name in (f"bias_{axis}", f"response_{axis}{axis}")]
        raise PoorExcitation(lost, float("inf"), f"no pose has the face {' or '.join(absent)} up")


def six_faces(poses: StaticPoses) -> tuple[np.ndarray, np.ndarray]:
    """Mean reading with each face up, and its covariance; poses with the same face up count alike.

    Args:
        poses: Faces are taken from the expected vectors, or else from the readings.

    Returns:
        Shapes (6, 3) and (6, 3, 3), in the order of `FACES`.

    Raises:
        PoorExcitation: A face is never up.
    """
    face = face_of(poses.mean if poses.expected is None else poses.expected)
    need_all_faces(face)
    covariance = poses.covariance()
    mean = np.array([poses.mean[face == i].mean(axis=0) for i in range(6)])
    return mean, np.array(
        [covariance[face == i].sum(axis=0) / np.sum(face == i) ** 2 for i in range(6)]
    )
