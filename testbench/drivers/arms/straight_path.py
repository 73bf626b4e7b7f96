"""Clearance along straight lines between joint angles: the path of moveJ.

No plan has looked at it.
"""

from __future__ import annotations

import math

import numpy as np

from testbench.model.collision import CollisionModel, NearestPair
from testbench.model.kinematics import Kinematics
from testbench.records.specs.robot import Robot

STEP_RAD = math.radians(1.0)
"""Joint motion, summed over the joints, between two configurations that are looked at; as for
plans.
"""


class StraightPaths:
    """Looks at straight paths of an arm.

    Args:
        robot: Its collision bodies, floor and margin.
    """

    def __init__(self, robot: Robot):
        self._model = CollisionModel(Kinematics(robot))
        self.margin = robot.spec.collision.margin_mm / 1000
        self._limits = robot.position_limits

    def blocked(self, start: np.ndarray, end: np.ndarray) -> NearestPair | None:
        """The pair that comes nearest within the margin on the way, or None if the way is free.

        Args:
            start: Joint angles at the start, shape (n,) [rad].
            end: Joint angles at the end, shape (n,) [rad].
        """
        count = max(math.ceil(float(np.abs(end - start).sum()) / STEP_RAD), 1)
        for share in np.linspace(0.0, 1.0, count + 1):
            nearest = self._model.nearest(start + share * (end - start))
            if nearest is not None and nearest.distance <= self.margin:
                return nearest
        return None
