"""The field of magnetic dipoles from the textbook, beside which the compiled one is held."""

from __future__ import annotations

import numpy as np

from testbench.model.magnetic_field import MU_0_OVER_4PI


def dipole_field(displacement: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Field of magnetic dipoles (Jackson, Classical Electrodynamics, eq. 5.56).

    Args:
        displacement: From the dipole to the point, shape (n, 3) [m].
        moment: In the same frame, shape (n, 3) or (3,) [A m^2].

    Returns:
        Shape (n, 3) [uT].
    """
    distance = np.linalg.norm(displacement, axis=1, keepdims=True)
    direction = displacement / distance
    field = (
        MU_0_OVER_4PI
        * (3 * direction * np.sum(direction * moment, axis=1, keepdims=True) - moment)
        / distance**3
    )
    return 1e6 * field
