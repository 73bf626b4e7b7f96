"""Orientations against other earth frames, as devices give them."""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM


def to_earth_frame(q_enu_from_sensor: np.ndarray, earth: str) -> np.ndarray:
    """Orientations against another earth frame; the axes of the sensor stay as they are.

    Args:
        q_enu_from_sensor: Shape (..., 4).
        earth: "ENU", "NED" or "NWU".

    Returns:
        q_earth_from_sensor, shape (..., 4).
    """
    return rotation.multiply(rotation.conjugate(np.array(Q_ENU_FROM[earth])), q_enu_from_sensor)
