"""The sensors on a chain as arrays: which joints carry each of them, and where it sits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from testbench.exceptions import InputError
from testbench.model.chain import Chain, Tip
from testbench.model.chain_placement import placement_slopes
from testbench.model.chain_sensor import sensor_reading
from testbench.model.kinematics import Kinematics, Pose


class SensorArrays(NamedTuple):
    """What compiled code takes of `ChainSensors`, which says what each is.

    Attributes:
        rotations: Shape (s, k, 3, 3).
        offsets: Shape (s, k, 3) [m].
        axes: Shape (s, k, 3).
        columns: Shape (s, k).
        counts: Shape (s,).
        tip_rotations: Shape (s, 3, 3).
        tip_offsets: Shape (s, 3) [m].
        gravity: Shape (3,) [m/s^2].
    """

    rotations: np.ndarray
    offsets: np.ndarray
    axes: np.ndarray
    columns: np.ndarray
    counts: np.ndarray
    tip_rotations: np.ndarray
    tip_offsets: np.ndarray
    gravity: np.ndarray


@njit(cache=True)
def read_sensor(
    sensors: SensorArrays, s: int, motion: np.ndarray, reading: np.ndarray, slopes: np.ndarray
) -> None:
    """Ideal reading of one sensor, and its derivatives.

    Args:
        sensors: All of them.
        s: Which one.
        motion: As for `sensor_reading`, shape (3, m).
        reading: As for `sensor_reading`, shape (6,).
        slopes: As for `sensor_reading`, shape (3, 6, m).
    """
    chain, tip = _carrying(sensors, s)
    # angular rate and specific force by the recursions of `model.chain_sensor`
    sensor_reading(chain, tip, sensors.gravity, motion, reading, slopes)


@njit(cache=True)
def read_placement(
    sensors: SensorArrays, s: int, motion: np.ndarray, reading: np.ndarray, slopes: np.ndarray
) -> None:
    """Derivatives of an ideal reading of one sensor by its placement and the lengths before it.

    Args:
        sensors: All of them.
        s: Which one.
        motion: As for `placement_slopes`, shape (3, m).
        reading: As for `placement_slopes`, shape (6,).
        slopes: As for `placement_slopes`, shape (6, 6 + k) of the longest chain.
    """
    chain, tip = _carrying(sensors, s)
    # d(reading) by turn, place and length, as `model.chain_placement` has them
    placement_slopes(chain, tip, motion, reading, slopes)


@njit(cache=True, inline="always")
def _carrying(sensors: SensorArrays, s: int) -> tuple[Chain, Tip]:
    """The joints that carry a sensor, and its place in the frame of the last."""
    # the tables are as wide as the longest chain
    count = sensors.counts[s]
    chain = Chain(
        sensors.rotations[s, :count],
        sensors.offsets[s, :count],
        sensors.axes[s, :count],
        sensors.columns[s, :count],
    )
    return chain, Tip(sensors.tip_rotations[s], sensors.tip_offsets[s])


@dataclass(frozen=True)
class ChainSensors:
    """Sensors on a tree of rotating joints of which m are estimated; the others stand still.

    Attributes:
        sensors: Names, s of them.
        joints: Names of the estimated joints, in the robot's order.
        rotations: Rotation of each estimated joint's frame in the one before it, joints that stand
            still folded in, shape (s, k, 3, 3).
        offsets: Origin of each estimated joint's frame in the one before it, shape (s, k, 3) [m].
        axes: Axis of each estimated joint in its own frame, unit vectors, shape (s, k, 3).
        columns: Which estimated joint it is, shape (s, k).
        counts: Number of estimated joints that carry each sensor, shape (s,).
        tip_rotations: Rotation of the sensor in the frame of the last of them, shape (s, 3, 3).
        tip_offsets: Place of the sensor in the frame of the last of them, shape (s, 3) [m].
        gravity: In the world, shape (3,) [m/s^2].
        limits: Lowest and highest angle, shape (m, 2) [rad].
    """

    sensors: list[str]
    joints: list[str]
    rotations: np.ndarray
    offsets: np.ndarray
    axes: np.ndarray
    columns: np.ndarray
    counts: np.ndarray
    tip_rotations: np.ndarray
    tip_offsets: np.ndarray
    gravity: np.ndarray
    limits: np.ndarray

    @property
    def arrays(self) -> SensorArrays:
        """What compiled code takes."""
        return SensorArrays(*(getattr(self, name) for name in SensorArrays._fields))

    def readings(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Ideal readings in one state, and their derivatives.

        Args:
            q: Joint angles, shape (m,) [rad].
            v: Joint rates, shape (m,) [rad/s].
            a: Joint accelerations, shape (m,) [rad/s^2].

        Returns:
            Angular rate and specific force of every sensor, shape (s, 6); derivatives by q, v and
            a, shape (s, 6, m).
        """
        s, m = len(self.sensors), len(self.joints)
        reading = np.zeros((s, 6))
        slopes, motion = np.zeros((s, 3, 6, m)), np.array([q, v, a], dtype=float)
        for i in range(s):
            read_sensor(self.arrays, i, motion, reading[i], slopes[i])
        return reading, slopes[:, 0], slopes[:, 1], slopes[:, 2]


def chain_sensors(
    kinematics: Kinematics,
    places: Mapping[str, tuple[str, Pose]],
    joints: list[str] | None,
    standing: np.ndarray,
    lengths: np.ndarray | None = None,
) -> ChainSensors:
    """The sensors of a robot's chain.

    Args:
        kinematics: Of the robot.
        places: Link and mounting of each sensor, by its name.
        joints: Those to estimate; all that carry a sensor if None.
        standing: Angles at which the other joints stand still, shape (n_joints,) in the robot's
            order [rad].
        lengths: Of the offset before each joint in the robot's order, in multiples of what the
            robot says, shape (n_joints,); None: as it says.

    Raises:
        InputError: A joint carries none of the sensors: nothing would be known of it.
    """
    # Longer than a screen: joints are chosen, folded and filled into arrays of one length.
    robot = kinematics.robot
    for link, _ in places.values():
        kinematics.check_carrier(link)
    chains = {
        name: _scaled(kinematics.chain_to(link), lengths) for name, (link, _) in places.items()
    }
    carrying = {
        robot.joint_names[column] for chain, _ in chains.values() for column in chain.columns
    }
    chosen = [
        name for name in robot.joint_names if name in (carrying if joints is None else joints)
    ]
    if not chosen:
        raise InputError(f"no joint of {robot.name} carries any of the sensors {', '.join(places)}")
    idle = [name for name in chosen if name not in carrying]
    if idle:
        raise InputError(
            f"the joint {idle[0]} carries none of the sensors {', '.join(places)}: nothing tells "
            "how it moves"
        )
    place = {robot.joint_names.index(name): i for i, name in enumerate(chosen)}
    folded = [
        _fold(chains[name], mounting, place, standing) for name, (_, mounting) in places.items()
    ]
    s, k = len(places), max(len(columns) for _, _, columns, _ in folded)
    rotations, offsets, axes = np.zeros((s, k, 3, 3)), np.zeros((s, k, 3)), np.zeros((s, k, 3))
    columns, counts = np.zeros((s, k), dtype=np.int64), np.zeros(s, dtype=np.int64)
    tip_rotations, tip_offsets = np.zeros((s, 3, 3)), np.zeros((s, 3))
    for i, (poses, own_axes, own_columns, tip) in enumerate(folded):
        counts[i] = len(own_columns)
        for j, (pose, axis, column) in enumerate(zip(poses, own_axes, own_columns, strict=True)):
            rotations[i, j], offsets[i, j], axes[i, j], columns[i, j] = (
                pose.R,
                pose.position,
                axis,
                column,
            )
        tip_rotations[i], tip_offsets[i] = tip.R, tip.position
    limits = np.array([robot.position_limits[robot.joint_names.index(name)] for name in chosen])
    return ChainSensors(
        list(places),
        chosen,
        rotations,
        offsets,
        axes,
        columns,
        counts,
        tip_rotations,
        tip_offsets,
        robot.gravity,
        limits,
    )


def _scaled(carried_by: tuple[Chain, Pose], lengths: np.ndarray | None) -> tuple[Chain, Pose]:
    """A chain with offsets of other lengths; what lies beyond its last joint stays."""
    chain, tip = carried_by
    if lengths is None:
        return carried_by
    return chain._replace(offsets=chain.offsets * lengths[chain.columns][:, None]), tip


def _fold(
    carried_by: tuple[Chain, Pose],
    mounting: Pose,
    place: Mapping[int, int],
    standing: np.ndarray,
) -> tuple[list[Pose], list[np.ndarray], list[int], Pose]:
    """The chain of one sensor, joints that stand still folded into the placement of the next."""
    chain, link = carried_by
    poses, own_axes, own_columns = [], [], []
    carried = Pose(np.eye(3), np.zeros(3))
    for R, position, axis, column in zip(*chain, strict=True):
        carried = carried @ Pose(R, position)
        if int(column) in place:
            poses.append(carried)
            own_axes.append(axis)
            own_columns.append(place[int(column)])
            carried = Pose(np.eye(3), np.zeros(3))
        else:
            carried = carried @ Pose(_turn(axis, standing[column]), np.zeros(3))
    return poses, own_axes, own_columns, carried @ link @ mounting


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation about a unit axis by an angle [rad], shape (3, 3) (Rodrigues)."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
