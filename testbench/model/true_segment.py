"""The true orientation of the segment that a sensor stands for, on an arm or on a body."""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.model.joint_angle import segment_orientation
from testbench.model.kinematics import Pose
from testbench.records.specs.protocol import Analysis, Body


def true_segment(analysis: Analysis, sensor: str, q_true: np.ndarray) -> np.ndarray:
    """q_world_from_segment by the truth of a sensor.

    On an arm the sensor sits on the segment as the protocol states. On a body the truth is that of
    the part that carries the sensor, and the segment's axes lie in it as `body.segments` states:
    they are its own where nothing is stated.

    Args:
        analysis: Of the session.
        sensor: Its name.
        q_true: Of the truth, shape (n, 4).

    Returns:
        Shape (n, 4).
    """
    if sensor in analysis.sensors:
        return segment_orientation(q_true, analysis.sensors[sensor])
    return rotation.multiply(q_true, stated_axes(analysis.body or Body(), sensor))


def stated_axes(body: Body, sensor: str) -> np.ndarray:
    """q_sensor_from_segment as a person states it, shape (4,); in the truth's body where there is
    one.
    """
    return rotation.from_matrix(Pose.from_placement(body.segment(sensor).placement()).R)
