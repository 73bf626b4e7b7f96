"""Kinematics of an arm: the one door to Pinocchio.

Position, orientation, velocity and classical acceleration of any frame for arrays of joint angles,
and what an ideal inertial sensor fixed to that frame would measure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from testbench.exceptions import FileProblems, NotFoundError, Problem
from testbench.model import rotation
from testbench.model.chain import Chain, Tip, chain_motion, link_poses
from testbench.model.links import Link, LinkErrors, Twist, twists_of
from testbench.records.specs.robot import Robot
from testbench.records.specs.strict import Placement
from testbench.records.specs.urdf_joint import joints_to, read_urdf


@dataclass(frozen=True)
class Pose:
    """A rigid displacement: a point x in `source` is R x + position in `target`.

    Attributes:
        R: Rotation target from source, shape (3, 3).
        position: Origin of the source in the target, shape (3,) [m].
    """

    R: np.ndarray
    position: np.ndarray

    @staticmethod
    def from_placement(placement: Placement) -> Pose:
        """The pose a person wrote in degrees and millimetres."""
        matrix = np.eye(3)
        for sequence, angles in placement.rotation_deg.items():
            matrix = rotation.to_matrix(rotation.from_euler(sequence, np.radians(angles)))
        return Pose(matrix, np.asarray(placement.position_mm, float) / 1000.0)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.R @ other.R, self.R @ other.position + self.position)

    @property
    def quaternion(self) -> np.ndarray:
        """w, x, y, z."""
        return rotation.from_matrix(self.R)


@dataclass(frozen=True)
class FrameMotion:
    """Motion of a frame over n instants, in the world frame.

    Attributes:
        position: Shape (n, 3) [m].
        R_world_from_frame: Shape (n, 3, 3).
        velocity: Shape (n, 3) [m/s].
        angular_velocity: Shape (n, 3) [rad/s].
        acceleration: Classical acceleration of the frame's origin, shape (n, 3) [m/s^2], without
            gravity.
        angular_acceleration: Shape (n, 3) [rad/s^2].
    """

    position: np.ndarray
    R_world_from_frame: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray

    @cached_property
    def q_world_from_frame(self) -> np.ndarray:
        """Unit quaternions w, x, y, z, shape (n, 4)."""
        return rotation.from_matrix(self.R_world_from_frame)

    @property
    def angular_velocity_in_frame(self) -> np.ndarray:
        """What an ideal gyroscope fixed to the frame reads, shape (n, 3) [rad/s]."""
        return np.einsum("nji,nj->ni", self.R_world_from_frame, self.angular_velocity)

    def specific_force_in_frame(self, gravity: np.ndarray) -> np.ndarray:
        """What an ideal accelerometer at the frame's origin reads.

        Args:
            gravity: In the world, shape (3,) [m/s^2].

        Returns:
            Shape (n, 3) [m/s^2].
        """
        return np.einsum("nji,nj->ni", self.R_world_from_frame, self.acceleration - gravity)


class Kinematics:
    """Forward kinematics of a robot.

    Args:
        robot: The arm; joints of its URDF that it does not name are locked at zero.
        wrong: What the links of this very arm are off by against its URDF; None for nothing.

    Raises:
        FileProblems: Pinocchio cannot build a model of the URDF.
    """

    def __init__(self, robot: Robot, wrong: LinkErrors | None = None):
        self.robot, self.wrong = robot, wrong
        try:
            full = pin.buildModelFromUrdf(str(robot.urdf))
        except (ValueError, RuntimeError) as error:
            raise FileProblems(
                robot.urdf, [Problem(f"Pinocchio cannot read this URDF: {error}")]
            ) from None
        unknown = [name for name in robot.joint_names if not full.existJointName(name)]
        if unknown:
            raise FileProblems(
                robot.urdf,
                [
                    Problem(
                        f"the URDF has no movable joint {unknown[0]}; it has {list(full.names)[1:]}"
                    )
                ],
            )
        self._locked = [i for i in range(1, full.njoints) if full.names[i] not in robot.joint_names]
        self._full = full
        self.model = (
            pin.buildReducedModel(full, self._locked, pin.neutral(full)) if self._locked else full
        )
        self.world_from_base = Pose.from_placement(robot.spec.base)
        self._column = {name: i for i, name in enumerate(robot.joint_names)}
        self._check_axes()

    def _check_axes(self) -> None:
        """Pinocchio takes an axis of zeros for one: its joint turns, and nothing moves."""
        still = [n for n in self._column if not self._axis(self.model.getJointId(n)).any()]
        if still:
            joints = read_urdf(self.robot.urdf)[1]
            raise FileProblems(
                self.robot.urdf, [p for name in still for p in joints[name].problems()]
            )

    @cached_property
    def link_names(self) -> list[str]:
        """Links of the URDF, base first."""
        return [frame.name for frame in self.model.frames if frame.type == pin.FrameType.BODY]

    @cached_property
    def neutral(self) -> np.ndarray:
        """Pinocchio's configuration vector at zero angles, shape (nq,)."""
        return pin.neutral(self.model)

    @cached_property
    def _places(self) -> list[tuple[int, int, bool]]:
        """Of each joint its column, its place in Pinocchio's vector, and whether it is two numbers.

        A joint without limits stands there as cosine and sine.
        """
        joints = [
            (column, self.model.joints[self.model.getJointId(name)])
            for name, column in self._column.items()
        ]
        return [(column, joint.idx_q, joint.nq == 2) for column, joint in joints]

    def configuration(self, q: np.ndarray) -> np.ndarray:
        """Pinocchio's configuration vector, shape (nq,).

        Args:
            q: Joint angles in the robot's order, shape (n_joints,) [rad].
        """
        result = self.neutral.copy()
        for column, place, unlimited in self._places:
            if unlimited:
                result[place : place + 2] = np.cos(q[column]), np.sin(q[column])
            else:
                result[place] = q[column]
        return result

    def check_link(self, link: str) -> None:
        """Refuse a link the arm does not have.

        Raises:
            NotFoundError: Lists the links that exist.
        """
        if link not in self.link_names:
            raise NotFoundError(f"link of {self.robot.name}", link, self.link_names)

    def check_carrier(self, link: str) -> None:
        """Refuse a link that can carry no sensor, for its motion is not known.

        Raises:
            NotFoundError: Lists the links that exist.
            FileProblems: A joint that mimics another, which is not followed, carries it.
        """
        self.check_link(link)
        for joint in joints_to(self.robot.urdf, link):
            if joint.mimics is not None and joint.name not in self._column:
                problem = joint.problem(
                    f"it mimics {joint.mimics}, which is not followed here, and it carries the "
                    f"link {link}, whose motion is not known therefore; put sensors on links "
                    "before it, or describe the arm without <mimic>"
                )
                raise FileProblems(self.robot.urdf, [problem])

    def frame_motion(
        self,
        link: str,
        q: np.ndarray,
        v: np.ndarray | None = None,
        a: np.ndarray | None = None,
        offset: Pose | None = None,
    ) -> FrameMotion:
        """Motion of a link's frame, or of a frame fixed to it.

        Args:
            link: Name of the link in the URDF.
            q: Joint angles in the robot's order, shape (n, n_joints) [rad].
            v: Joint rates, shape (n, n_joints) [rad/s]; zero if None.
            a: Joint accelerations, shape (n, n_joints) [rad/s^2]; zero if None.
            offset: Pose of the wanted frame in the link; the link's own frame if None.

        Raises:
            NotFoundError: The arm has no such link.
        """
        self.check_link(link)
        q = np.ascontiguousarray(np.atleast_2d(q), dtype=float)
        zero = np.zeros_like(q)
        v = zero if v is None else np.ascontiguousarray(np.atleast_2d(v), dtype=float)
        a = zero if a is None else np.ascontiguousarray(np.atleast_2d(a), dtype=float)
        chain, tip = self.chain_to(link)
        if offset is not None:
            tip = tip @ offset
        arrays = chain_motion(chain, Tip(np.ascontiguousarray(tip.R), tip.position), q, v, a)
        return FrameMotion(*arrays)

    def link_poses(self, links: Sequence[str], q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where several links are, in one walk along each chain that carries some of them.

        Args:
            links: Names of links in the URDF, l of them.
            q: Joint angles in the robot's order, shape (n, n_joints) [rad].

        Returns:
            Positions, shape (n, l, 3) [m], and rotations world from link, shape (n, l, 3, 3).

        Raises:
            NotFoundError: The arm has no such link.
        """
        q = np.ascontiguousarray(np.atleast_2d(q), dtype=float)
        positions = np.empty((len(q), len(links), 3))
        rotations = np.empty((len(q), len(links), 3, 3))
        for chain, places in self._chains(tuple(links)):
            positions[:, places], rotations[:, places] = link_poses(*chain, q)
        return positions, rotations

    @lru_cache(maxsize=64)  # noqa: B019 - a Kinematics lives as long as the run
    def _chains(self, links: tuple[str, ...]) -> list[tuple[tuple[Any, ...], list[int]]]:
        """The chains that carry some links, longest first, as `link_poses` takes them.

        With each come the places of the links on it: those whose joints are the first ones of it.
        """
        for link in links:
            self.check_link(link)
        found = [self.chain_to(link) for link in links]
        columns = [chain.columns for chain, _ in found]
        left = sorted(range(len(links)), key=lambda i: -len(columns[i]))
        chains: list[tuple[tuple[Any, ...], list[int]]] = []
        while left:
            joints, longest = found[left[0]][0], columns[left[0]]
            own = [i for i in left if np.array_equal(longest[: len(columns[i])], columns[i])]
            tips = [found[i][1] for i in own]
            chain = (
                joints,
                np.array([len(columns[i]) for i in own]),
                np.array([tip.R for tip in tips]),
                np.array([tip.position for tip in tips]),
            )
            chains.append((chain, own))
            left = [i for i in left if i not in own]
        return chains

    @lru_cache(maxsize=64)  # noqa: B019 - a Kinematics lives as long as the run
    def chain_to(self, link: str) -> tuple[Chain, Pose]:
        """The joints that carry a link, and the pose of the link in the last of them."""
        model = self.model
        frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
        joints: list[int] = []
        joint = frame.parentJoint
        while joint > 0:
            joints.insert(0, joint)
            joint = model.parents[joint]
        placements = [
            Pose(
                model.jointPlacements[j].rotation.copy(),
                model.jointPlacements[j].translation.copy(),
            )
            for j in joints
        ]
        tip = Pose(frame.placement.rotation.copy(), frame.placement.translation.copy())
        if self.wrong is not None:
            placements = [
                Pose(*self.wrong.moved(model.names[j], pose.R, pose.position))
                for j, pose in zip(joints, placements, strict=True)
            ]
        if placements:
            placements[0] = self.world_from_base @ placements[0]
        else:
            tip = self.world_from_base @ tip
        rotations = np.array([pose.R for pose in placements]).reshape(-1, 3, 3)
        offsets = np.array([pose.position for pose in placements]).reshape(-1, 3)
        axes = np.array([self._axis(j) for j in joints]).reshape(-1, 3)
        columns = np.array([self._column[model.names[j]] for j in joints], dtype=np.int64)
        return Chain(rotations, offsets, axes, columns), tip

    @cached_property
    def links(self) -> list[Link]:
        """Pairs of neighbouring joints of the arm, in the order of the joints behind."""
        model, found = self.model, []
        for name in self.robot.joint_names:
            joint = model.getJointId(name)
            before = model.parents[joint]
            if before > 0:
                placement = model.jointPlacements[joint]
                R, offset = placement.rotation.copy(), placement.translation.copy()
                axes = self._axis(before), self._axis(joint)
                found.append(Link.between(model.names[before], name, R, offset, axes))
        return found

    @cached_property
    def twists(self) -> list[Twist]:
        """Every direction in which an axis of the arm may be tilted against the one before it."""
        return twists_of(self.links)

    def error_axes(self, link: str, q: np.ndarray) -> np.ndarray:
        """About what a link is turned by an error of each joint's zero, and of each twist.

        Args:
            link: Name of the link in the URDF.
            q: Joint angles in the robot's order, shape (m, n_joints) [rad].

        Returns:
            Axes in the world, the joints' first and those of `twists` behind, shape
            (m, n_joints + twists, 3): unit vectors; 0 for what does not carry the link.
        """
        chain, n = self.chain_to(link)[0], q.shape[1]
        result = np.zeros((len(q), n + len(self.twists), 3))
        R, before = np.broadcast_to(np.eye(3), (len(q), 3, 3)), ""
        for rotation_, axis, column in zip(chain.rotations, chain.axes, chain.columns, strict=True):
            name = self.robot.joint_names[column]
            for i, twist in enumerate(self.twists):
                if (twist.link.before, twist.link.after) == (before, name):
                    result[:, n + i] = R @ twist.axis
            R, before = R @ rotation_, name
            result[:, column] = R @ axis
            turn = rotation.from_rotation_vector(q[:, column, None] * axis)
            R = R @ rotation.to_matrix(turn)
        return result

    def offset_before(self, joint: str) -> float:
        """How far a joint lies from the one before it [m]."""
        placement = self.model.jointPlacements[self.model.getJointId(joint)]
        return float(np.linalg.norm(placement.translation))

    def _axis(self, joint: int) -> np.ndarray:
        """Axis of a rotating joint in its own frame, shape (3,): angular part of its subspace."""
        data = self.model.createData()
        pin.forwardKinematics(
            self.model, data, self.neutral, np.eye(self.model.nv)[self.model.joints[joint].idx_v]
        )
        return np.asarray(data.v[joint].angular).copy()

    def collision_geometry(self) -> pin.GeometryModel:
        """The collision bodies of the URDF.

        Raises:
            FileProblems: A mesh cannot be found or read.
        """
        folders = [str(folder) for folder in self.robot.mesh_folders()]
        try:
            geometry = pin.buildGeomFromUrdf(
                self._full, str(self.robot.urdf), pin.GeometryType.COLLISION, package_dirs=folders
            )
        except (ValueError, RuntimeError) as error:
            raise FileProblems(
                self.robot.urdf,
                [
                    Problem(
                        f"collision geometry: {error} The package of package://NAME/... is a "
                        "folder NAME that this URDF lies in or beside, or one of the Python "
                        "packages that mesh_packages of a robot.yaml names"
                    )
                ],
            ) from None
        if self._locked:
            _, geometry = pin.buildReducedModel(
                self._full, geometry, self._locked, pin.neutral(self._full)
            )
        return geometry
