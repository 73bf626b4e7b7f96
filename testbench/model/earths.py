"""Earth frames of other filters, and the way between them and the bench's own, ENU."""

from __future__ import annotations

import numpy as np

from testbench.model import rotation

HALF = float(np.sqrt(0.5))
Q_ENU_FROM = {
    "ENU": [1.0, 0.0, 0.0, 0.0],
    "NED": [0.0, HALF, HALF, 0.0],
    "NWU": [HALF, 0.0, 0.0, HALF],
}
"""q_enu_from_earth for east-north-up, north-east-down and north-west-up."""


def to_earth_frame(q_enu_from_sensor: np.ndarray, earth: str) -> np.ndarray:
    """Orientations against another earth frame; the axes of the sensor stay as they are.

    Args:
        q_enu_from_sensor: Shape (..., 4).
        earth: "ENU", "NED" or "NWU".

    Returns:
        q_earth_from_sensor, shape (..., 4).
    """
    return rotation.multiply(rotation.conjugate(np.array(Q_ENU_FROM[earth])), q_enu_from_sensor)
