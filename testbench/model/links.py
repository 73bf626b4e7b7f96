"""What may be off between neighbouring joints of an arm: how its axes stand to one another.

By the parameters of Denavit & Hartenberg a joint's axis stands to the one before it by a twist
alpha about their common normal, a length a along it, and an offset d along the axis before. Of axes
that are parallel alpha alone does not reach every direction: a second tilt beta, about the
direction across, completes it (Hayati, Robot arm geometric link parameter estimation, 22nd IEEE
Conf. Decision and Control, 1983). The fourth parameter, theta, is the zero of the joint's angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.model import rotation
from testbench.model.noise import random_stream
from testbench.records.specs.robot import Robot

PARALLEL = float(np.sin(np.radians(5.0)))
"""Axes at a smaller sine of their angle are parallel [1]."""


@dataclass(frozen=True)
class Link:
    """Two neighbouring joints; vectors in the frame of the first one, which turns with it.

    Attributes:
        before: The joint nearer to the base.
        after: The joint that it carries.
        tilts: Axes about which the second joint may be tilted: alpha, and of parallel joints beta,
            shape (1 or 2, 3), unit vectors.
        length: Direction of a, shape (3,).
        offset: Direction of d, shape (3,).
    """

    before: str
    after: str
    tilts: np.ndarray
    length: np.ndarray
    offset: np.ndarray

    @staticmethod
    def between(
        before: str,
        after: str,
        R: np.ndarray,
        offset: np.ndarray,
        axes: tuple[np.ndarray, np.ndarray],
    ) -> Link:
        """The link between two joints.

        Args:
            before: Name of the joint nearer to the base.
            after: Name of the other one.
            R: Rotation of the frame of the joint after in that of the joint before, shape (3, 3).
            offset: Its origin there, shape (3,) [m].
            axes: Of the joint before and of the joint after, each in its own frame, shape (3,)
                each.
        """
        axis, other = axes[0], R @ axes[1]
        normal = np.cross(axis, other)
        if np.linalg.norm(normal) > PARALLEL:
            normal /= np.linalg.norm(normal)
            return Link(before, after, normal[None], normal, axis)
        normal = offset - (axis @ offset) * axis
        if np.linalg.norm(normal) < 1e-6:  # one line: any direction across it will do
            normal = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        normal /= np.linalg.norm(normal)
        return Link(before, after, np.stack([normal, np.cross(axis, normal)]), normal, axis)


@dataclass(frozen=True)
class Twist:
    """One direction in which a joint's axis may be tilted against the one before it.

    Attributes:
        link: Between the two joints.
        name: "alpha" or "beta".
        axis: Of the tilt, in the frame of the joint before, shape (3,).
    """

    link: Link
    name: str
    axis: np.ndarray


def twists_of(links: list[Link]) -> list[Twist]:
    """Every tilt of every link."""
    return [
        Twist(link, name, axis)
        for link in links
        for name, axis in zip(("alpha", "beta"), link.tilts, strict=False)
    ]


@dataclass(frozen=True)
class LinkErrors:
    """What the links of one arm are off by, by the joint behind each of them.

    Attributes:
        tilt: Rotation vector in the frame of the joint before, shape (3,) [rad].
        shift: Displacement there, shape (3,) [m].
    """

    tilt: dict[str, np.ndarray]
    shift: dict[str, np.ndarray]

    def moved(self, after: str, R: np.ndarray, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where a joint really stands in the frame of the one before it.

        Args:
            after: Its name.
            R: Rotation as believed, shape (3, 3).
            offset: Origin as believed, shape (3,) [m].
        """
        if after not in self.tilt:
            return R, offset
        turn = rotation.to_matrix(rotation.from_rotation_vector(self.tilt[after]))
        return turn @ R, offset + self.shift[after]


def draw_link_errors(robot: Robot, links: list[Link], seed: int) -> LinkErrors:
    """What the links of a simulated arm are off by through a whole run, as the robot file says.

    Args:
        robot: The arm.
        links: Its own.
        seed: Of the run.
    """
    stated, rng = robot.spec.uncertainty, random_stream(seed, "arm", "links")
    tilt, shift = {}, {}
    for link in links:
        turns = np.radians(stated.link_twist_deg) * rng.standard_normal(len(link.tilts))
        tilt[link.after] = turns @ link.tilts
        a, d = rng.standard_normal(2) * [stated.link_length_mm, stated.link_offset_mm]
        shift[link.after] = 1e-3 * (a * link.length + d * link.offset)
    return LinkErrors(tilt, shift)
