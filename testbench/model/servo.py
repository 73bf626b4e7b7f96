"""A joint that follows its reference as a second-order servo, solved between control instants."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from testbench.records.specs.robot import Robot


def servo_parameters(robot: Robot) -> tuple[float, float]:
    """Natural angular frequency [rad/s] and damping ratio of every joint's servo."""
    return 2 * np.pi * robot.spec.servo.natural_frequency_hz, robot.spec.servo.damping_ratio


def servo_update(robot: Robot, period: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Exact discrete form of the servo for a reference that is linear between instants.

    x+ = Phi x + now u + following u+ for x = (angle, rate) (Franklin et al. 1998, section 6.3).

    Args:
        robot: Gives frequency and damping.
        period: Between instants [s].

    Returns:
        Phi, now and following: shapes (2, 2), (2,), (2,).
    """
    omega, damping = servo_parameters(robot)
    A = np.array([[0.0, 1.0], [-(omega**2), -2 * damping * omega]])
    B = np.array([[0.0], [omega**2]])
    augmented = np.zeros((4, 4))
    augmented[:2, :2], augmented[:2, 2:3], augmented[2, 3] = A * period, B * period, 1.0
    exponential = expm(augmented)
    now, slope = exponential[:2, 2], exponential[:2, 3]
    return exponential[:2, :2].copy(), now - slope, slope.copy()
