"""Gait cycles, step lengths and a dead-reckoned path from the orientation of one worn sensor."""

from testbench.estimation.gait.parameters import PUBLISHED, PedestrianParameters
from testbench.estimation.gait.walk import Walk, walk

__all__ = ["PUBLISHED", "PedestrianParameters", "Walk", "walk"]
