"""Clearance between the bodies of an arm, and between the arm and the floor (Pinocchio, Coal)."""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from testbench.model.kinematics import Kinematics

FLOOR = "the floor"


@dataclass(frozen=True)
class NearestPair:
    """The two bodies that are nearest to one another at one configuration.

    Attributes:
        first: Name of one body.
        second: Name of the other.
        distance: Between them [m], negative where they overlap.
    """

    first: str
    second: str
    distance: float


class CollisionModel:
    """Collision bodies of an arm with the floor of its robot file.

    Pairs on the same or on neighbouring links are left out, and those the robot file names. Meshes
    are replaced by their convex hulls: a hull is never smaller than its mesh, and distances between
    hulls are a hundred times faster.

    Args:
        kinematics: The arm.
    """

    def __init__(self, kinematics: Kinematics):
        self.kinematics = kinematics
        self.geometry = kinematics.collision_geometry()
        for body in self.geometry.geometryObjects:
            body.geometry = _convex(body.geometry)
        self.links = [self._link(body) for body in self.geometry.geometryObjects]
        self._add_floor()
        self._add_pairs()
        self._pairs = [
            (self.links[pair.first], self.links[pair.second])
            for pair in self.geometry.collisionPairs
        ]
        self._data = kinematics.model.createData()
        self._geometry_data = self.geometry.createData()

    @property
    def pairs(self) -> int:
        """Number of pairs that are checked."""
        return len(self._pairs)

    def nearest(self, q: np.ndarray) -> NearestPair | None:
        """The two bodies nearest to one another; None when there is nothing to check.

        Args:
            q: Joint angles in the robot's order, shape (n_joints,) [rad].
        """
        if not self._pairs:
            return None
        model, data = self.kinematics.model, self._data
        k = pin.computeDistances(
            model, data, self.geometry, self._geometry_data, self.kinematics.configuration(q)
        )
        distance = float(self._geometry_data.distanceResults[k].min_distance)
        first, second = self._pairs[k]
        return NearestPair(first, second, distance)

    def _link(self, body: pin.GeometryObject) -> str:
        return str(self.kinematics.model.frames[body.parentFrame].name)

    def _add_floor(self) -> None:
        floor = self.kinematics.robot.spec.floor
        if floor is None:
            return
        thickness = 0.1
        base = self.kinematics.world_from_base
        box = coal.Box(10.0, 10.0, thickness)
        world_from_floor = pin.SE3(
            np.eye(3), np.array([0.0, 0.0, floor.height_mm / 1000 - thickness / 2])
        )
        base_from_world = pin.SE3(base.R, base.position).inverse()
        body = pin.GeometryObject("floor", 0, base_from_world * world_from_floor, box)
        self.geometry.addGeometryObject(body)
        self.links.append(FLOOR)

    def _add_pairs(self) -> None:
        spec, model = self.kinematics.robot.spec, self.kinematics.model
        ignored = {frozenset(pair) for pair in spec.collision.ignore}
        standing = set(spec.floor.ignore) if spec.floor else set()
        bodies = self.geometry.geometryObjects
        for i in range(len(bodies)):
            for j in range(i + 1, len(bodies)):
                first, second = self.links[i], self.links[j]
                if FLOOR in (first, second):
                    other = bodies[i] if second == FLOOR else bodies[j]
                    if (first if second == FLOOR else second) in standing or other.parentJoint == 0:
                        continue
                else:
                    a, b = bodies[i].parentJoint, bodies[j].parentJoint
                    if (
                        a == b
                        or model.parents[a] == b
                        or model.parents[b] == a
                        or frozenset((first, second)) in ignored
                    ):
                        continue
                self.geometry.addCollisionPair(pin.CollisionPair(i, j))


def _convex(shape: coal.CollisionGeometry) -> coal.CollisionGeometry:
    if not isinstance(shape, coal.BVHModelBase):
        return shape
    shape.buildConvexHull(True, "Qt")
    return shape.convex
