"""Which way a body faces in a standing pose, in the earth of each of its sensors.

In a standing pose gravity shows the long axes of all segments, but not which way they face. Three
things tell it: axes of sensors that a person says point forwards; the earth that filters with a
magnetometer share, or the centre of a joint that moves as both its sensors say, which leave one
angle for all; and for that one the axis that joints flex about, which points to the right (found in
walking and squatting by Kong, Sessa, Zecca & Takanishi, Sensors 16, 2016). Knees flex backwards,
hips and elbows forwards: that tells right from left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from testbench.estimation.joints.joint_centre import heading_by_centre
from testbench.estimation.joints.limb import Limb
from testbench.estimation.joints.standing import Standing
from testbench.model import rotation
from testbench.records.specs.anatomy import JointKind
from testbench.records.specs.protocol import BodyJoint

SHARED_SD, DEVICE_SD = np.radians(3.0), np.radians(8.0)
"""How far apart the headings of filters with a magnetometer are, in a field without iron, and of
the orientations that sensors compute themselves, of which nobody knows whether they use one [rad].
"""
SHARED = "the earth that the filter's sensors share"
STATED_SD = np.radians(5.0)
"""Of a sensor's axis that a person says points forwards [rad]: by eye."""
AXIS_SD_DEG: dict[JointKind | None, float] = {"knee": 3.0, "elbow": 5.0, "hip": 8.0, None: 5.0}
"""How far the main axis of a joint's motion is from the one it flexes about [deg]: that of a hip is
farther, for other motions go with its flexion (Ramakrishnan & Kadaba, J. Biomechanics 24, 1991).
"""
FORWARDS: dict[JointKind | None, int] = {"knee": -1, "hip": 1, "elbow": 1, None: 1}
"""Sign, about the axis that points to the right, of the larger part of a joint's flexion; it is
taken for positive where nobody says which joint it is.
"""
LEAST_SWING = np.radians(10.0)
"""Joints that turn less have no main axis [rad]."""
LEAST_LEVEL, LEAST_SHARE, LEAST_SKEW = 0.7, 0.7, 0.25
"""Of a main axis: its level part, the part of the motion about it, and how much farther a joint
turns one way than the other [1].
"""


@dataclass(frozen=True)
class Facing:
    """Which way a body faces.

    Attributes:
        heading: Of forwards in the earth of each sensor, by sensor [rad].
        common_sd: Standard uncertainty of what all share [rad].
        relative_sd: Of the heading between the sensors of a joint, by joint [rad].
        by: What told it, in words, for all and by joint.
    """

    heading: dict[str, float]
    common_sd: float
    relative_sd: dict[str, float]
    by: str
    relative_by: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Unknown:
    """Why nobody knows which way a body faces, and what to add."""

    why: str
    add: str


@dataclass(frozen=True)
class Relative:
    """What the earths of a joint's sensors are turned by.

    Attributes:
        heading: That turns the earth of the distal sensor into that of the proximal one [rad].
        sd: Its standard uncertainty [rad].
        by: What told it, in words.
    """

    heading: float
    sd: float
    by: str


def relative_headings(
    limb: Limb, joints: Mapping[str, BodyJoint], shared_sd: float | None
) -> dict[str, Relative]:
    """By how much the earths of each joint's sensors are turned, where it can be told.

    Args:
        limb: The sensors.
        joints: Between them, by name.
        shared_sd: How far apart headings are that share an earth [rad]; None where each filter has
            an earth of its own.
    """
    found = {}
    for name, joint in joints.items():
        centre = heading_by_centre(limb, joint.proximal, joint.distal)
        if shared_sd is not None:
            if centre is None or abs(centre.heading) > 4 * np.hypot(centre.sd, shared_sd):
                found[name] = Relative(0.0, shared_sd, SHARED)
                continue
            weights = 1 / np.array([centre.sd, shared_sd]) ** 2
            heading = float(weights[0] * centre.heading / weights.sum())
            sd = float(1 / np.sqrt(weights.sum()))
            found[name] = Relative(heading, sd, "the shared earth and the joint's centre")
        elif centre is not None:
            found[name] = Relative(
                centre.heading, centre.sd, "how the joint's centre moves as both sensors say"
            )
    return found


def find_facing(
    limb: Limb,
    joints: Mapping[str, BodyJoint],
    kinds: Mapping[str, JointKind | None],
    standing: Standing,
    forward: Mapping[str, np.ndarray],
    relative: Mapping[str, Relative],
) -> Facing | Unknown:
    """Which way a body faces in a standing pose.

    Args:
        limb: The sensors.
        joints: Between them, by name.
        kinds: Which joint each is, None where nobody says.
        standing: The pose.
        forward: Axes of sensors that point forwards, as vectors in the sensor, shape (3,) each.
        relative: Of `relative_headings`.
    """
    stated = {name: _level_heading(standing.q[name], axis) for name, axis in forward.items()}
    if any(np.isnan(own) for own in stated.values()):
        upright = ", ".join(name for name, own in stated.items() if np.isnan(own))
        return Unknown(
            f"the axis of {upright} that is to point forwards is vertical while standing",
            "name another axis in alignment.forward",
        )
    headings, sds = _stated_pairs(joints, stated, relative)
    missing = [name for name in joints if name not in sds]
    if missing:
        return Unknown(
            f"how the headings of the sensors of {', '.join(missing)} differ: the filter has an "
            "earth of its own for each, and the motion of the joint's centre does not tell",
            "a filter with a magnetometer, walking or another brisk motion, or alignment.forward "
            "for both sensors",
        )
    apart = chained(joints, headings)
    if stated:
        name, told = next(iter(stated.items()))
        common, sd, by = told - apart[name], STATED_SD, f"the stated axis of {name}"
    else:
        found = _main_direction(limb, joints, kinds, standing, apart)
        if isinstance(found, Unknown):
            return found
        common, sd, by = found
    heading = {name: float(rotation.wrap(np.array(common + own))) for name, own in apart.items()}
    ways = {name: relative[name].by if name in relative else "stated axes" for name in joints}
    return Facing(heading, sd, sds, by, ways)


def _stated_pairs(
    joints: Mapping[str, BodyJoint], stated: Mapping[str, float], relative: Mapping[str, Relative]
) -> tuple[dict[str, float], dict[str, float]]:
    """Facing of the proximal less that of the distal sensor in their earths, and its sd."""
    headings, sds = {}, {}
    for name, joint in joints.items():
        if joint.proximal in stated and joint.distal in stated:
            headings[name] = stated[joint.proximal] - stated[joint.distal]
            sds[name] = STATED_SD * np.sqrt(2)
        elif name in relative:
            headings[name], sds[name] = relative[name].heading, relative[name].sd
    return headings, sds


def chained(joints: Mapping[str, BodyJoint], between: Mapping[str, float]) -> dict[str, float]:
    """Heading of one world in the earth of each sensor less that in the first's, along the joints.

    Args:
        joints: That hang together, by name.
        between: Heading that turns the earth of the distal sensor into that of the proximal one, by
            joint [rad]; 0 where it is not told.
    """
    first = next(iter(joints.values())).proximal
    found = {first: 0.0}
    for _ in joints:
        for name, joint in joints.items():
            if joint.proximal in found and joint.distal not in found:
                found[joint.distal] = found[joint.proximal] - between.get(name, 0.0)
            elif joint.distal in found and joint.proximal not in found:
                found[joint.proximal] = found[joint.distal] + between.get(name, 0.0)
    return found


def _level_heading(q_earth_from_sensor: np.ndarray, axis: np.ndarray) -> float:
    """Heading of a sensor's axis in its earth [rad]; NaN where it is nearly vertical."""
    x, y, z = rotation.rotate(q_earth_from_sensor, axis)
    return float("nan") if abs(z) > 0.9 else float(np.arctan2(y, x))


def joint_turns(
    limb: Limb, joint: BodyJoint, standing: Standing, apart: Mapping[str, float]
) -> np.ndarray:
    """Turns of a joint since standing, as rotation vectors in one level frame, shape (n, 3) [rad].

    Args:
        limb: The sensors.
        joint: Between two of them.
        standing: The pose.
        apart: Heading of that frame in the earth of each sensor [rad].
    """
    since = []
    for name in (joint.proximal, joint.distal):
        level = rotation.from_heading(-apart[name])
        turned = rotation.multiply(limb.q[name], rotation.conjugate(standing.q[name]))
        since.append(rotation.multiply(rotation.multiply(level, turned), rotation.conjugate(level)))
    return rotation.to_rotation_vector(rotation.multiply(rotation.conjugate(since[0]), since[1]))


def _main_direction(
    limb: Limb,
    joints: Mapping[str, BodyJoint],
    kinds: Mapping[str, JointKind | None],
    standing: Standing,
    apart: Mapping[str, float],
) -> tuple[float, float, str] | Unknown:
    """Heading of forwards in the frame of `apart`, its standard uncertainty and what told it."""
    axes, weights, names = [], [], []
    for name, joint in joints.items():
        if kinds[name] not in FORWARDS:
            continue
        found = _main_axis(joint_turns(limb, joint, standing, apart), kinds[name])
        if found is not None:
            axes.append(found)
            weights.append(1 / np.radians(AXIS_SD_DEG[kinds[name]]) ** 2)
            names.append(name)
    if not axes:
        return Unknown(
            "which way the body faces: no joint that flexes one way turns far enough about one "
            "level axis",
            "a motion of it (squats, walking), or alignment.forward: the axis of a sensor that "
            "points forwards",
        )
    chosen = np.array(weights)
    together = np.sum(chosen * np.exp(1j * np.array(axes)))
    if np.abs(together) < 0.7 * chosen.sum():
        return Unknown(
            f"which way the body faces: {' and '.join(names)} flex about axes that differ by more "
            "than 45 deg",
            "alignment.forward: the axis of a sensor that points forwards",
        )
    right = float(np.angle(together))
    return right + np.pi / 2, float(1 / np.sqrt(chosen.sum())), f"the motion of {', '.join(names)}"


def _main_axis(turns: np.ndarray, kind: JointKind | None) -> float | None:
    """Heading of the axis that a joint flexes about, pointing to the right [rad].

    Of a joint that nobody names the larger part of the motion is positive, be it hardly larger.
    """
    _, vectors = np.linalg.eigh(turns.T @ turns)
    axis = vectors[:, -1]
    along = turns @ axis
    low, high = np.quantile(along, [0.02, 0.98])
    share = float(np.sum(along**2) / max(np.sum(turns**2), 1e-12))
    if high - low < LEAST_SWING or np.hypot(axis[0], axis[1]) < LEAST_LEVEL or share < LEAST_SHARE:
        return None
    skew = (high + low) / (high - low)
    if kind is not None and abs(skew) < LEAST_SKEW:
        return None
    axis = axis * (1 if skew >= 0 else -1) * FORWARDS[kind]
    return float(np.arctan2(axis[1], axis[0]))
