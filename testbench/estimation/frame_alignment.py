"""Frame alignment: the heading of a filter's earth, and what is left of the mounting, from a pose the arm knows.

Two rotations stand between what a filter says and the truth: the unknown heading acts on the left (about the vertical, one
angle, new at each power-up), the mounting acts on the right (in the sensor). One known pose gives three numbers: the heading
is the
rotation about the vertical that explains most, the rest is put to the mounting.
"""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.records.estimate import FrameFit


def fit_frames(q_earth_from_sensor: np.ndarray, q_world_from_sensor: np.ndarray, method: str) -> FrameFit:
    """Alignment from a reference pose.

    Args:
        q_earth_from_sensor: By the filter, over the reference pose, shape (n, 4). q_world_from_sensor: The truth, (m, 4).
        method: "heading" or "reference_pose".
    """
    estimated, true = rotation.mean(q_earth_from_sensor), rotation.mean(q_world_from_sensor)
    heading = float(rotation.heading_angle(rotation.multiply(estimated, rotation.conjugate(true))))
    mounting = np.zeros(3)
    if method == "reference_pose":
        levelled = rotation.multiply(rotation.from_heading(-heading), estimated)
        mounting = rotation.to_rotation_vector(rotation.multiply(rotation.conjugate(levelled), true))
    x, y, z = np.degrees(mounting)
    return FrameFit(float(np.degrees(heading)), (float(x), float(y), float(z)), method)


def apply_frames(q_earth_from_sensor: np.ndarray, fit: FrameFit) -> np.ndarray:
    """q_world_from_sensor, shape (n, 4)."""
    if fit.method == "none":
        return q_earth_from_sensor
    left = rotation.from_heading(-np.radians(fit.heading_deg))
    right = rotation.from_rotation_vector(np.radians(np.array(fit.mounting_deg)))
    return rotation.multiply(rotation.multiply(left, q_earth_from_sensor), right)
