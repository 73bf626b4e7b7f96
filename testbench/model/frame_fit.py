"""What an alignment of frames does to orientations."""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.records.results.estimate import FrameFit


def apply_frames(q_earth_from_sensor: np.ndarray, fit: FrameFit) -> np.ndarray:
    """q_world_from_sensor by a filter and its alignment, shape (n, 4).

    Args:
        q_earth_from_sensor: By the filter, shape (n, 4).
        fit: The alignment.
    """
    if fit.method == "none":
        return q_earth_from_sensor
    left, right = _parts(fit)
    return rotation.multiply(rotation.multiply(left, q_earth_from_sensor), right)


def moved_to_frames(q_world_from_sensor: np.ndarray, given: FrameFit, to: FrameFit) -> np.ndarray:
    """Orientations that one alignment gave, as another would have given them, shape (n, 4).

    Args:
        q_world_from_sensor: Aligned by `given`, shape (n, 4).
        given: The alignment that they have.
        to: The one that they get.
    """
    plain = q_world_from_sensor
    if given.method != "none":
        left, right = (rotation.conjugate(part) for part in _parts(given))
        plain = rotation.multiply(rotation.multiply(left, plain), right)
    return apply_frames(plain, to)


def _parts(fit: FrameFit) -> tuple[np.ndarray, np.ndarray]:
    """What stands on either side of a filter's orientation, shape (4,) each."""
    tilt = rotation.from_rotation_vector(np.radians(np.array(fit.tilt_deg)))
    left = rotation.multiply(tilt, rotation.from_heading(np.radians(fit.heading_deg)))
    mounting = rotation.from_rotation_vector(np.radians(np.array(fit.mounting_deg)))
    return left, rotation.conjugate(mounting)
