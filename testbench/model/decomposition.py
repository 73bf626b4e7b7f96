"""A joint's rotation q_proximal_from_distal as three angles, and back, by every known definition.

Each says where its angles stop being defined (`margins`) and which other triples mean the same
rotation (`alternatives`), which is what following an angle across the ends of its range needs.
docs/joint_angles.md compares them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.model import rotation

TURN = 2.0 * np.pi
SMALL = 1e-12


class Decomposition(ABC):
    """A way to write rotations as three angles [rad].

    Attributes:
        names: What the three are.
        periodic: Which of them mean the same a turn later.
    """

    names: tuple[str, str, str]
    periodic: tuple[bool, bool, bool]

    @abstractmethod
    def angles(self, q: np.ndarray) -> np.ndarray:
        """The three angles of rotations, each in its principal range.

        Args:
            q: q_proximal_from_distal, shape (n, 4).

        Returns:
            Shape (n, 3) [rad].
        """

    @abstractmethod
    def rotation(self, angles: np.ndarray) -> np.ndarray:
        """The rotations of angles: the inverse of `angles`.

        Args:
            angles: Shape (n, 3) [rad].

        Returns:
            q_proximal_from_distal, shape (n, 4).
        """

    @abstractmethod
    def margins(self, angles: np.ndarray) -> np.ndarray:
        """How far each angle is from where it stops being defined.

        Args:
            angles: Shape (n, 3) [rad].

        Returns:
            Shape (n, 3) [rad]; infinite for an angle that is always defined.
        """

    @abstractmethod
    def alternatives(self, angles: np.ndarray) -> np.ndarray:
        """Other triples of the same rotations, but for whole turns of the periodic angles.

        Args:
            angles: Shape (n, 3) [rad].

        Returns:
            Shape (k, n, 3) [rad].
        """


@dataclass(frozen=True)
class Euler(Decomposition):
    """Intrinsic Euler angles of any of the twelve sequences, each with a sign of its own.

    The joint coordinate systems of Grood & Suntay (1983) and of the ISB (Wu et al. 2002, 2005) are
    such sequences: e1 is the first axis, fixed to the proximal segment, e3 the last, fixed to the
    distal one, and e2 the floating axis e3 × e1.
    """

    sequence: str
    signs: tuple[int, int, int] = (1, 1, 1)
    names: tuple[str, str, str] = ("first", "second", "third")
    periodic = (True, True, True)

    @property
    def symmetric(self) -> bool:
        """Whether the outer axes are the same, as in ZXZ."""
        return self.sequence[0] == self.sequence[2]

    def angles(self, q: np.ndarray) -> np.ndarray:
        return rotation.to_euler(self.sequence, q) * np.array(self.signs)

    def rotation(self, angles: np.ndarray) -> np.ndarray:
        return rotation.from_euler(self.sequence, np.asarray(angles, float) * np.array(self.signs))

    def margins(self, angles: np.ndarray) -> np.ndarray:
        outer = rotation.gimbal_margin(self.sequence, rotation.wrap(angles))
        return np.stack([outer, np.full_like(outer, np.inf), outer], axis=-1)

    def alternatives(self, angles: np.ndarray) -> np.ndarray:
        first, second, third = np.moveaxis(np.asarray(angles, float), -1, 0)
        middle = -second if self.symmetric else np.pi - second
        return np.stack([np.stack([first + np.pi, middle, third + np.pi], axis=-1)])


@dataclass(frozen=True)
class SwingTwist(Decomposition):
    """q = swing · twist: a twist about `axis` and a swing, a rotation vector across it [rad].

    The twist is the rotation about the axis nearest to q; it is written first, the swing along the
    two directions of `across`. Defined unless the swing is half a turn.
    """

    axis: tuple[float, float, float]
    names = ("twist", "swing 1", "swing 2")
    periodic = (True, False, False)

    def angles(self, q: np.ndarray) -> np.ndarray:
        twist, swing = _twist_and_swing(q, np.array(self.axis))
        return np.column_stack([twist, rotation.to_rotation_vector(swing) @ across(self.axis).T])

    def rotation(self, angles: np.ndarray) -> np.ndarray:
        angles = np.asarray(angles, float)
        swing = rotation.from_rotation_vector(angles[:, 1:] @ across(self.axis))
        return rotation.multiply(
            swing, rotation.from_rotation_vector(angles[:, :1] * np.array(self.axis))
        )

    def margins(self, angles: np.ndarray) -> np.ndarray:
        margin = np.abs(np.pi - np.hypot(angles[:, 1], angles[:, 2]))
        return np.repeat(margin[:, None], 3, axis=1)

    def alternatives(self, angles: np.ndarray) -> np.ndarray:
        swing = np.hypot(angles[:, 1], angles[:, 2])[:, None]
        other = np.divide(TURN, swing, out=np.ones_like(swing), where=swing > SMALL)
        return np.stack([np.hstack([angles[:, :1], angles[:, 1:] * (1 - other)])])


@dataclass(frozen=True)
class Hinge(Decomposition):
    """The angle [rad] of a hinge about `axis`, and what the hinge does not explain.

    The rest is how far the distal segment's axis is tilted from the proximal one's, and which way
    (the azimuth about the axis). The angle is that of the rotation about the axis nearest to q,
    which is the twist of `SwingTwist`; Seel, Raisch & Schauer (Sensors 14, 2014) call for it once
    both segments' axes are known. It is defined unless the tilt is half a turn.
    """

    axis: tuple[float, float, float]
    names = ("flexion", "tilt", "azimuth of the tilt")
    periodic = (True, False, True)

    def angles(self, q: np.ndarray) -> np.ndarray:
        twist, one, two = SwingTwist(self.axis).angles(q).T
        return np.column_stack([twist, np.hypot(one, two), np.arctan2(two, one)])

    def rotation(self, angles: np.ndarray) -> np.ndarray:
        flexion, tilt, azimuth = np.asarray(angles, float).T
        return SwingTwist(self.axis).rotation(
            np.column_stack([flexion, tilt * np.cos(azimuth), tilt * np.sin(azimuth)])
        )

    def margins(self, angles: np.ndarray) -> np.ndarray:
        tilt = np.abs(angles[:, 1])
        return np.column_stack(
            [
                np.abs(np.pi - tilt),
                np.full_like(tilt, np.inf),
                np.minimum(tilt, np.abs(np.pi - tilt)),
            ]
        )

    def alternatives(self, angles: np.ndarray) -> np.ndarray:
        return np.stack([angles * np.array([1, -1, 1]) + np.array([0, 0, np.pi])])


@dataclass(frozen=True)
class AxisAngle(Decomposition):
    """The whole angle in [0, pi] and its axis [rad].

    The axis is written as azimuth about z from x and elevation above the x-y plane. The angle is
    always defined, the axis neither at no turn nor (its sign) at half a turn.
    """

    names = ("angle", "azimuth of the axis", "elevation of the axis")
    periodic = (True, True, False)

    def angles(self, q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, float)
        x, y, z = np.where(q[:, :1] < 0, -q[:, 1:], q[:, 1:]).T
        return np.column_stack([rotation.angle(q), np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])

    def rotation(self, angles: np.ndarray) -> np.ndarray:
        angle, azimuth, elevation = np.asarray(angles, float).T
        level = np.cos(elevation)
        axis = np.column_stack(
            [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        )
        return rotation.from_rotation_vector(angle[:, None] * axis)

    def margins(self, angles: np.ndarray) -> np.ndarray:
        turn = np.abs(rotation.wrap(angles[:, 0]))
        axis = np.minimum(turn, np.pi - turn)
        pole = np.abs(np.pi / 2 - np.abs(angles[:, 2]))
        return np.column_stack([np.full_like(turn, np.inf), np.minimum(axis, pole), axis])

    def alternatives(self, angles: np.ndarray) -> np.ndarray:
        return np.stack([angles * np.array([-1, 1, -1]) + np.array([0, np.pi, 0])])


@dataclass(frozen=True)
class RotationVector(Decomposition):
    """Axis times angle [rad], of length up to pi; its sign is not defined at half a turn."""

    names = ("x", "y", "z")
    periodic = (False, False, False)

    def angles(self, q: np.ndarray) -> np.ndarray:
        return rotation.to_rotation_vector(q)

    def rotation(self, angles: np.ndarray) -> np.ndarray:
        return rotation.from_rotation_vector(angles)

    def margins(self, angles: np.ndarray) -> np.ndarray:
        margin = np.abs(np.pi - np.linalg.norm(angles, axis=1) % TURN)
        return np.repeat(margin[:, None], 3, axis=1)

    def alternatives(self, angles: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(angles, axis=1)[:, None]
        turn = TURN * np.divide(angles, length, out=np.zeros_like(angles), where=length > SMALL)
        return np.stack([angles + k * turn for k in (-3, -2, -1, 1, 2, 3)])


def across(axis: tuple[float, float, float]) -> np.ndarray:
    """Two unit directions that make a right-handed frame with an axis, shape (2, 3).

    For an axis along x, y or z they are the two that follow it: y, z of x; z, x of y; x, y of z.
    """
    unit = np.array(axis, float)
    largest = int(np.argmax(np.abs(unit)))
    first = np.eye(3)[(largest + 1) % 3]
    first = first - unit * (first @ unit)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(unit, first)])


def follow(decomposition: Decomposition, angles: np.ndarray) -> np.ndarray:
    """The same rotations with angles that run on from sample to sample, past ends of their ranges.

    Of all triples that mean a sample's rotation the nearest to the neighbour's is taken, forwards
    and backwards from the sample farthest from a singularity, which keeps its principal angles. In
    a singularity there is nothing to follow: noise decides there which way it goes on, so this is
    for motions that pass through one, not for rests in one.

    Args:
        decomposition: Of the angles.
        angles: In the order of time, shape (n, 3) [rad]; rows that are not finite are passed over.

    Returns:
        Shape (n, 3) [rad].
    """
    angles = np.array(angles, float)
    known = np.flatnonzero(np.isfinite(angles).all(axis=1))
    if len(known) < 2:
        return angles
    own = angles[known]
    choices = np.concatenate([own[None], decomposition.alternatives(own)])
    periods = np.where(decomposition.periodic, TURN, 0.0)
    start = int(np.argmax(decomposition.margins(own).min(axis=1)))
    own[start:] = _nearest(np.ascontiguousarray(choices[:, start:]), periods)
    own[: start + 1] = _nearest(np.ascontiguousarray(choices[:, start::-1]), periods)[::-1]
    angles[known] = own
    return angles


@njit(cache=True)
def _nearest(choices: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Of the triples choices[:, i], give or take whole periods, the nearest to the one before.

    The first is kept.
    """
    count, n, _ = choices.shape
    taken = np.empty((n, 3))
    taken[0] = choices[0, 0]
    candidate = np.empty(3)
    for i in range(1, n):
        least = np.inf
        for k in range(count):
            distance = 0.0
            for j in range(3):
                value = choices[k, i, j]
                if periods[j] > 0.0:
                    # whole periods to the angle before: the nearest of all that mean the same
                    value += periods[j] * np.round((taken[i - 1, j] - value) / periods[j])
                candidate[j] = value
                distance += (value - taken[i - 1, j]) ** 2
            if distance < least:
                least = distance
                taken[i] = candidate
    return taken


def _twist_and_swing(q: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Twist in [-pi, pi) about the axis, shape (n,) [rad], and swing before it, shape (n, 4)."""
    q = np.asarray(q, float)
    twist = rotation.wrap(2.0 * np.arctan2(q[:, 1:] @ axis, q[:, 0]))
    back = rotation.from_rotation_vector(-twist[:, None] * axis)
    return twist, rotation.multiply(q, back)
