"""TRIAD (Black 1964; Shuster & Oh 1981): an orthogonal triad from two vectors."""

from __future__ import annotations

import numpy as np

from testbench.exceptions import InputError
from testbench.model import rotation

LEAST_SINE = 1e-6
"""Two unit vectors whose cross product is shorter than this lie in one line."""


def triad(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """W = [w1 w2 w3] with w1 = b1, w2 = b1 × b2 / |b1 × b2| and w3 = b1 × w2, of unit vectors.

    Args:
        first: b1, trusted wholly, such as gravity, shape (..., 3), of any length.
        second: b2, such as the magnetic field, shape (..., 3), of any length.

    Returns:
        Its columns are w1, w2, w3, shape (..., 3, 3); with w3 = w1 × w2 it is a rotation.

    Raises:
        InputError: The two lie in one line.
    """
    b1 = _unit(first)
    across = np.cross(b1, _unit(second))
    if np.any(np.linalg.norm(across, axis=-1) < LEAST_SINE):
        raise InputError("TRIAD needs two vectors that do not lie in one line")
    w2 = _unit(across)
    return np.stack([b1, w2, np.cross(b1, w2)], axis=-1)


def rotation_between_triads(
    first_proximal: np.ndarray,
    second_proximal: np.ndarray,
    first_distal: np.ndarray,
    second_distal: np.ndarray,
) -> np.ndarray:
    """q_proximal_from_distal of two sensors that see the same two directions, by TRIAD alone.

    With the triads as columns it is W_proximal W_distal' (Castellanos Alonso 2023 writes them as
    rows: W_A' W_F). It is the same as the difference of the two sensors' orientations by TRIAD.

    Args:
        first_proximal: Gravity in the proximal sensor, shape (..., 3).
        second_proximal: Field in the proximal sensor, shape (..., 3).
        first_distal: Gravity in the distal sensor, shape (..., 3).
        second_distal: Field in the distal sensor, shape (..., 3).

    Returns:
        Shape (..., 4).

    Raises:
        InputError: The two directions lie in one line.
    """
    proximal, distal = triad(first_proximal, second_proximal), triad(first_distal, second_distal)
    return rotation.from_matrix(proximal @ np.swapaxes(distal, -1, -2))


def _unit(vector: np.ndarray) -> np.ndarray:
    vector = np.asarray(vector, float)
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), np.finfo(float).tiny)
