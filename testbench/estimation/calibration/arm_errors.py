"""What the truth would be with an error of the arm off by its standard uncertainty: the zero of a
joint, or the twist of a link (`model.links`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.kinematics import Kinematics
from testbench.model.statistics.intervals import gradient
from testbench.records.session.samples import ArmSamples, Truth
from testbench.records.specs.protocol import Sensor
from testbench.records.specs.robot import Robot

SAME = 1e-3
"""Errors that turn a sensor by less than this part of themselves, or always alike about the
vertical, change neither its force nor its turns."""
UP = np.array([0.0, 0.0, 1.0])


def shifted_truths(
    arm: ArmSamples | None, robot: Robot | None, placed: Sensor | None, truth: Truth
) -> list[Truth]:
    """The truth with each error of the arm off by its standard uncertainty.

    Args:
        arm: What the arm reported; nothing comes of it without.
        robot: The arm.
        placed: Where the sensor sits on it.
        truth: Of the sensor.

    Returns:
        One truth for each joint and each twist that turn the sensor.
    """
    if arm is None or robot is None or placed is None or len(arm.host_time_ns) < 2:
        return []
    kinematics, at = Kinematics(robot), truth.host_time_ns
    q = np.column_stack([np.interp(at, arm.host_time_ns, column) for column in arm.q_measured.T])
    twist = np.radians(robot.spec.uncertainty.link_twist_deg)
    sizes = [*robot.joint_angle_uncertainty, *[twist] * len(kinematics.twists)]
    axes = kinematics.error_axes(placed.link, q)
    return [
        _turned(truth, size * axes[:, i])
        for i, size in enumerate(sizes)
        if size > 0 and _counts(axes[:, i])
    ]


def _counts(axes: np.ndarray) -> bool:
    """Whether turns about some axes of the world do more than turn everything about the vertical.

    Args:
        axes: Shape (n, 3); 0 for what does not carry the sensor.
    """
    return bool(np.abs(axes - (axes @ UP).mean() * UP).max() > SAME)


def _turned(truth: Truth, turns: np.ndarray) -> Truth:
    """The truth of a sensor that is turned by small rotations.

    Args:
        truth: Of the sensor.
        turns: Rotation vectors in the world, shape (n, 3) [rad].
    """
    q = rotation.multiply(rotation.from_rotation_vector(turns), truth.q_world_from_sensor)
    if truth.rate is None:
        return replace(truth, q_world_from_sensor=q)
    # R' = dR R turns by R' w' = d(turns)/dt + dR R w, so that w' = w + R^T d(turns)/dt
    change = gradient(turns, truth.host_time_ns / NANOSECONDS)
    seen = rotation.rotate(rotation.conjugate(truth.q_world_from_sensor), change)
    return replace(truth, q_world_from_sensor=q, rate=truth.rate + seen)
