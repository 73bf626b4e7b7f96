"""Gait: strides, events and the path of a walk, by sensors on the foot or elsewhere on the body."""

from testbench.estimation.gait.parameters import PUBLISHED, PedestrianParameters
from testbench.estimation.gait.settings import GaitSettings, by_sensor
from testbench.estimation.gait.stage import gait
from testbench.estimation.gait.walk import Walk, walk

__all__ = [
    "PUBLISHED",
    "GaitSettings",
    "PedestrianParameters",
    "Walk",
    "by_sensor",
    "gait",
    "walk",
]
