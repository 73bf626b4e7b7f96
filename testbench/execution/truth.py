"""Kinematic truth: what each sensor went through, from what the arm measured, the URDF and the mounting as believed."""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.protocol import Sensor
from testbench.records.samples import ArmSamples, Truth

SMOOTHING_S = 0.1
"""Width of the cubic Savitzky-Golay window that differentiates the measured joint rates [s]."""


def kinematic_truth(kinematics: Kinematics, samples: ArmSamples, sensor: Sensor) -> Truth:
    """What a sensor went through.

    Orientation and angular rate come from the measured joint angles and rates; the specific force needs joint accelerations,
    which are the smoothed derivative of the rates.
    """
    acceleration = joint_acceleration(samples)
    offset = Pose.from_placement(sensor.mounting)
    motion = kinematics.frame_motion(sensor.link, samples.q_measured, samples.v_measured, acceleration, offset)
    return Truth(
        samples.host_time_ns,
        motion.q_world_from_frame,
        motion.angular_velocity_in_frame,
        motion.specific_force_in_frame(kinematics.robot.gravity),
    )


def joint_acceleration(samples: ArmSamples) -> np.ndarray:
    """Joint accelerations [rad/s^2], shape (n, n_joints), from measured rates at a regular interval."""
    n = len(samples.host_time_ns)
    if n < 5:
        return np.zeros_like(samples.v_measured)
    interval = float(np.median(np.diff(samples.host_time_ns))) / NANOSECONDS
    window = min(max(2 * round(SMOOTHING_S / interval / 2) + 1, 5), n - 1 + n % 2)
    return np.asarray(savgol_filter(samples.v_measured, window, 3, deriv=1, delta=interval, axis=0))
