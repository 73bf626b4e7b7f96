"""Joint angles: the distal segment against the proximal one, as intrinsic Euler angles of any sequence."""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.model.kinematics import Pose
from testbench.records.protocol import Sensor


def segment_pose(sensor: Sensor) -> Pose:
    """The segment's frame in the sensor's link."""
    assert sensor.segment is not None  # a protocol whose joints name sensors without a segment is refused
    return Pose.from_placement(sensor.segment.placement())


def segment_from_sensor(sensor: Sensor) -> np.ndarray:
    """q_segment_from_sensor by the mounting and segment axes that the protocol states, shape (4,)."""
    link_from_segment, link_from_sensor = segment_pose(sensor), Pose.from_placement(sensor.mounting)
    return rotation.from_matrix(link_from_segment.R.T @ link_from_sensor.R)


def segment_orientation(q_world_from_sensor: np.ndarray, sensor: Sensor) -> np.ndarray:
    """q_world_from_segment = q_world_from_sensor conj(q_segment_from_sensor), shape (n, 4) (reference eqs 2.1 to 2.4)."""
    return rotation.multiply(q_world_from_sensor, rotation.conjugate(segment_from_sensor(sensor)))


def joint_angles(q_world_from_proximal: np.ndarray, q_world_from_distal: np.ndarray, sequence: str) -> np.ndarray:
    """Euler angles [rad] of q_proximal_from_distal = conj(q_world_from_proximal) q_world_from_distal (eq. 2.5).

    Args:
        q_world_from_proximal, q_world_from_distal: Of the segments, shape (n, 4). sequence: Intrinsic, e.g. "ZXZ".

    Returns:
        Shape (n, 3).
    """
    relative = rotation.multiply(rotation.conjugate(q_world_from_proximal), q_world_from_distal)
    return rotation.to_euler(sequence, relative)
