"""Calibration: the sensor errors that a recording shows."""

from testbench.estimation.calibration.methods import (
    ACCELEROMETER_METHODS,
    MAGNETOMETER_METHODS,
    Method,
)
from testbench.estimation.calibration.poses import StaticPoses, static_poses
from testbench.estimation.calibration.validation import cross_validate, validate

__all__ = [
    "ACCELEROMETER_METHODS",
    "MAGNETOMETER_METHODS",
    "Method",
    "StaticPoses",
    "cross_validate",
    "static_poses",
    "validate",
]
