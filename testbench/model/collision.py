"""Clearance between the bodies of an arm, and between the arm and the floor (Pinocchio, Coal)."""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from testbench.model.kinematics import Kinematics

FLOOR = "the floor"
ROUND = 24
"""Corners of a circle, where a round body becomes flat faces."""
COARSE_M, FEW_CORNERS = 0.004, 200
"""Corners of a mesh that are nearer to one another than the first are one, where it has more of
them than the second [m].
"""


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


@dataclass(frozen=True)
class Solid:
    """The convex hull of a collision body, where it stands at one configuration.

    Attributes:
        link: That it belongs to.
        corners: In the world, shape (n, 3) [m].
        triangles: Rows of `corners`, counter-clockwise seen from outside, shape (m, 3).
    """

    link: str
    corners: np.ndarray
    triangles: np.ndarray


def solids(kinematics: Kinematics, q: np.ndarray) -> list[Solid]:
    """The collision bodies of an arm as convex hulls; those without an end are left out.

    Args:
        kinematics: The arm.
        q: Joint angles in the robot's order, shape (n_joints,) [rad].

    Raises:
        FileProblems: A mesh cannot be found or read.
    """
    geometry, model = kinematics.collision_geometry(), kinematics.model
    placed = geometry.createData()
    pin.updateGeometryPlacements(
        model, model.createData(), geometry, placed, kinematics.configuration(q)
    )
    base = kinematics.world_from_base
    found = []
    for body, pose in zip(geometry.geometryObjects, placed.oMg, strict=True):
        points = _corners(body.geometry)
        if points is None:
            continue
        points = points * np.asarray(body.meshScale) if _is_mesh(body.geometry) else points
        corners, triangles = _hull(_coarse(points))
        in_base = corners @ pose.rotation.T + pose.translation
        in_world = in_base @ base.R.T + base.position
        found.append(Solid(str(model.frames[body.parentFrame].name), in_world, triangles))
    return found


def _hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners and triangles of a convex hull, counter-clockwise seen from outside, by
    Coal, which is loaded anyway.

    Args:
        points: Shape (n, 3) [m].
    """
    given = coal.StdVec_Vec3s()
    given.extend(list(points))
    hull = coal.Convex.convexHull(given, True, "Qt")
    faces = (hull.polygons(i) for i in range(hull.num_polygons))
    return np.array(hull.points()), np.array([[face[k] for k in range(3)] for face in faces])


def _is_mesh(shape: coal.CollisionGeometry) -> bool:
    return isinstance(shape, coal.BVHModelBase | coal.ConvexBase)


def _corners(shape: coal.CollisionGeometry) -> np.ndarray | None:
    """Points whose convex hull is the body, shape (n, 3) [m]; None for a body without an end."""
    if isinstance(shape, coal.BVHModelBase):
        return np.asarray(shape.vertices()).reshape(-1, 3)
    if isinstance(shape, coal.Box):
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        return np.asarray(signs * np.asarray(shape.halfSide).ravel())
    angles = 2 * np.pi * np.arange(ROUND) / ROUND
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(ROUND)])
    if isinstance(shape, coal.Cylinder):
        ends = [0.0, 0.0, shape.halfLength]
        return np.concatenate([shape.radius * circle + ends, shape.radius * circle - ends])
    if isinstance(shape, coal.Sphere | coal.Capsule):
        half = shape.halfLength if isinstance(shape, coal.Capsule) else 0.0
        heights = np.sin(np.linspace(0, np.pi / 2, ROUND // 4 + 1))
        rings = [np.sqrt(1 - h**2) * circle + [0.0, 0.0, h] for h in heights]
        cap = shape.radius * np.concatenate(rings)
        up = cap + np.array([0.0, 0.0, half])
        return np.concatenate([up, up * [1, 1, -1]])
    return None


def _coarse(points: np.ndarray) -> np.ndarray:
    """The same corners, of which those close together are one."""
    if len(points) <= FEW_CORNERS:
        return points
    return np.unique(np.round(points / COARSE_M), axis=0) * COARSE_M
