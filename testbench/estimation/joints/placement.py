"""How each sensor of a body sits on its segment: by pose, by motion, or as stated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.calibration.hinge_axis import axis_of_turn
from testbench.estimation.joints.facing import Facing
from testbench.estimation.joints.limb import Limb
from testbench.estimation.joints.standing import Standing
from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.specs.anatomy import JointKind
from testbench.records.specs.joint_definition import JointRotation
from testbench.records.specs.protocol import BodyJoint

FACING_FROM_SEGMENT = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0, 0.0])
"""Segment axes as the ISB has them (x forward, y up, z right), seen in x forward, y left, z up."""
UP, RIGHT = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
"""In a segment."""
MOST_OFF = np.radians(35.0)
"""A hinge's axis farther than this from where the pose has it is not believed [rad]."""
AXIS_SD = np.radians(0.3)
"""What an axis is off by in one sensor alone, however long a recording [rad]: filters and skin go
with the motion.
"""
INDEPENDENT_HZ = 2.0
"""Rates count as independent so often: skin swings along for half a second [Hz]."""


@dataclass(frozen=True)
class Placed:
    """A sensor on its segment.

    Attributes:
        q_segment_from_sensor: Shape (4,).
        heading: Of the segment's world in the sensor's earth [rad]: the world is turned by it.
        covariance: Of a small rotation about the axes of the segment, shape (3, 3) [rad^2].
        by: What told it, in words.
        of_axis: Part of the covariance that both segments of a hinge share, for it is the axis
            that is off, shape (3, 3) [rad^2]; None where no hinge says which way the segment faces.
    """

    q_segment_from_sensor: np.ndarray
    heading: float
    covariance: np.ndarray
    by: str
    of_axis: np.ndarray | None = None

    @property
    def hinged(self) -> bool:
        """Whether the axis of a hinge says which way the segment faces."""
        return self.of_axis is not None

    def segment(self, q_earth_from_sensor: np.ndarray) -> np.ndarray:
        """q_world_from_segment, the world being the level frame that all segments share.

        Args:
            q_earth_from_sensor: By the filter, shape (n, 4).
        """
        level = rotation.multiply(rotation.from_heading(-self.heading), q_earth_from_sensor)
        return rotation.multiply(level, rotation.conjugate(self.q_segment_from_sensor))


def by_pose(sensor: str, standing: Standing, facing: Facing, axes_sd: float) -> Placed:
    """Upright and facing forwards in the standing pose.

    Args:
        sensor: Its name.
        standing: The pose.
        facing: Which way forwards is.
        axes_sd: How far the segment may be from that, about each axis [rad].
    """
    heading = facing.heading[sensor]
    level = rotation.multiply(rotation.from_heading(-heading), standing.q[sensor])
    q = rotation.multiply(rotation.conjugate(FACING_FROM_SEGMENT), level)
    variance = axes_sd**2 + standing.sway[sensor] ** 2 / 3
    return Placed(q, heading, variance * np.eye(3), "the standing pose")


@dataclass(frozen=True)
class HingePair:
    """The axis of a hinge in both of its sensors, pointing the same way.

    Attributes:
        axes: In the proximal and in the distal sensor, shape (3,) each.
        sds: Standard uncertainty of each across it [rad].
        turned: Of both together about the vertical [rad].
    """

    axes: tuple[np.ndarray, np.ndarray]
    sds: tuple[float, float]
    turned: float


def hinge_pair(
    limb: Limb, joint: BodyJoint, posed: Mapping[str, Placed], relative: float
) -> HingePair | str:
    """The axis of a hinge in both of its sensors, or why there is none.

    It is the main direction of the rate at which one turns against the other (Luinge, Veltink &
    Baten, J. Biomechanics 40, 2007; Seel, Raisch & Schauer, Sensors 14, 2014, find it without a
    common earth). Where the heading between both is off, both axes are off so that they still
    coincide.

    Args:
        limb: The sensors.
        joint: The hinge.
        posed: The sensors by the standing pose, which tells both ends of the axis apart.
        relative: Standard uncertainty of the heading between both [rad].
    """
    ends = (joint.proximal, joint.distal)
    levels = [rotation.from_heading(-posed[own].heading) for own in ends]
    first, second = (
        rotation.rotate(level, limb.rates(own)) for level, own in zip(levels, ends, strict=True)
    )
    independent = len(first) * limb.interval * INDEPENDENT_HZ
    axes, sds = [], []
    for own, level in zip(ends, levels, strict=True):
        q = rotation.multiply(level, limb.q[own])
        try:
            fit = axis_of_turn(rotation.rotate(rotation.conjugate(q), second - first), independent)
        except PoorExcitation as error:
            return str(error)
        expected = rotation.rotate(rotation.conjugate(posed[own].q_segment_from_sensor), RIGHT)
        axis = fit.values * np.sign(fit.values @ expected)
        if axis @ expected < np.cos(MOST_OFF):
            off = np.degrees(np.arccos(np.clip(axis @ expected, -1, 1)))
            return f"its axis in {own} is {off:.0f} deg from where the standing pose has it"
        axes.append(axis)
        sds.append(float(np.hypot(np.sqrt(np.trace(fit.covariance) / 2), AXIS_SD)))
    return HingePair((axes[0], axes[1]), (sds[0], sds[1]), relative / 2)


def facing_by_hinges(
    facing: Facing,
    joints: Mapping[str, BodyJoint],
    pairs: Mapping[str, HingePair],
    standing: Standing,
    axes_sd: float,
) -> Facing:
    """Forwards across the mean axis of all hinges in the standing pose.

    Segments without a hinge are placed by the pose, and shall face as those with one do.

    Args:
        facing: As found before.
        joints: Between the sensors, by name.
        pairs: Hinges among them.
        standing: The pose.
        axes_sd: How far the segment of a hinge may face from the body, standing [rad].
    """
    right = []
    for name, pair in pairs.items():
        for own, axis in zip((joints[name].proximal, joints[name].distal), pair.axes, strict=True):
            level = rotation.from_heading(-facing.heading[own])
            x, y, _ = rotation.rotate(rotation.multiply(level, standing.q[own]), axis)
            right.append(x + 1j * y)
    turn = float(np.angle(np.sum(right))) + np.pi / 2
    heading = {
        name: float(rotation.wrap(np.array(own + turn))) for name, own in facing.heading.items()
    }
    by = f"the axis of {', '.join(pairs)}"
    return replace(facing, heading=heading, common_sd=axes_sd, by=by)


def by_motion(
    joints: Mapping[str, BodyJoint],
    pairs: Mapping[str, HingePair],
    posed: Mapping[str, Placed],
    axes_sd: float,
) -> dict[str, Placed]:
    """As the pose has it, but for the sensors of a hinge, whose axis becomes their segment's z.

    The long axis is gravity's while standing. Of two hinges at one sensor the surer counts.

    Args:
        joints: Between the sensors, by name.
        pairs: Hinges among them.
        posed: The sensors by the standing pose.
        axes_sd: How far the long axis may be from the vertical [rad].
    """
    found = dict(posed)
    for name, pair in pairs.items():
        ends = (joints[name].proximal, joints[name].distal)
        for own, axis, sd in zip(ends, pair.axes, pair.sds, strict=True):
            placed = _with_axis(posed[own], axis, sd, pair.turned, axes_sd)
            known = found[own]
            if not known.hinged or np.trace(placed.covariance) < np.trace(known.covariance):
                found[own] = placed
    return found


def _with_axis(posed: Placed, axis: np.ndarray, sd: float, turned: float, axes_sd: float) -> Placed:
    """A sensor whose segment's z is an axis, and whose y is up in the standing pose as nearly as it
    can be.
    """
    up = rotation.rotate(rotation.conjugate(posed.q_segment_from_sensor), UP)
    y = up - (up @ axis) * axis
    y /= np.linalg.norm(y)
    q = rotation.from_matrix(np.stack([np.cross(y, axis), y, axis]))
    of_axis = axes_sd**2 * np.diag([1.0, 1.0, 0.0]) + turned**2 * np.diag([0.0, 1.0, 0.0])
    own = np.diag([sd**2, sd**2, axes_sd**2])
    # The world's heading stays: what the segment is turned about the vertical by is its own.
    return Placed(
        q,
        posed.heading,
        own + of_axis,
        "the axis of its hinge, and gravity while standing",
        of_axis,
    )


def is_hinge(joint: BodyJoint, kind: JointKind | None) -> bool:
    """Whether a joint turns about one axis: knees and elbows, and what is defined as a hinge."""
    defined = joint.rotation
    return kind in ("knee", "elbow") or (
        isinstance(defined, JointRotation) and defined.hinge is not None
    )


def as_stated(q_sensor_from_segment: np.ndarray, heading: float, sd: float) -> Placed:
    """A sensor whose segment's axes a person states.

    Args:
        q_sensor_from_segment: Shape (4,).
        heading: Of the common world in the sensor's earth [rad].
        sd: How well it is known about each axis [rad].
    """
    return Placed(
        rotation.conjugate(q_sensor_from_segment), heading, sd**2 * np.eye(3), "as stated"
    )
