"""Does a joint definition reach every flexion that is evaluated?

The middle angle of an Euler sequence goes from -90 to 90 deg, that of a symmetric one, and the
angle about an axis, from 0 to 180: a flexion beyond is read as 180 deg less it, or without its
sign. That is the definition's, and no error of a filter.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from testbench.model import rotation
from testbench.model.decomposition import AxisAngle, Decomposition, Euler
from testbench.model.joint_angle import INDEX, decomposition_of, flexion_of, joint_angles
from testbench.model.kinematics import Kinematics
from testbench.planning.segment_frames import (
    LEAST_MARGIN_DEG,
    MOST_SEQUENCE_ERROR_DEG,
    moments_of,
    segments_of,
)
from testbench.records.session.plan import PlannedStep, evaluated_steps
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.protocol import JointDefinition, Protocol
from testbench.records.specs.robot import Robot

LEAST_ERROR = np.radians(2.0)
"""Beyond its range by less than half of this a definition is not refused [rad]."""
NEARER = 0.5
"""Another triple of the same rotation is the true one if its flexion is off by less than this part
of what the principal one is off by."""
FOLLOWS_WITHIN = np.radians(MOST_SEQUENCE_ERROR_DEG)
"""A definition that is further off on every branch is of other axes, of which others warn [rad]."""
FITS_WITHIN = np.radians(1.0)
"""A definition is suggested if its flexion is the true one within this everywhere [rad]."""
# The axes of the segments differ, and so does a Tait-Bryan sequence's meaning: first those, whose
# first and third angle turn all the way round.
_SEQUENCES = sorted(
    ("".join(s) for s in itertools.product("XYZ", repeat=3) if s[0] != s[1] != s[2]),
    key=lambda sequence: (sequence[0] == sequence[2], sequence),
)


def check_definition_ranges(
    robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]
) -> None:
    """Refuse definitions that do not reach the flexion of an evaluated pose or sweep.

    Args:
        robot: The arm.
        protocol: With its joints.
        trajectory: Of the arm, as planned.
        steps: All of the protocol; the evaluated ones count.

    Raises:
        FileProblems: Names the definition that would fit.
    """
    moments = moments_of(evaluated_steps(steps))
    if not moments or not protocol.spec.joints:
        return
    kinematics, q = Kinematics(robot), trajectory.at(np.array([time for _, time in moments]))[0]
    for name, joint in protocol.spec.joints.items():
        segments = segments_of(joint, protocol, kinematics, q)
        true, called, rows = _true_flexion(joint, segments, robot, q, [s for s, _ in moments])
        pair = (segments[0][rows], segments[1][rows])
        for i, definition in enumerate(joint.definitions()):
            if definition.continuous or not len(rows):
                continue
            beyond = _beyond(definition, joint_angles(*pair, definition), true)
            if beyond.any():
                where: tuple[Any, ...] = ("compare", i - 1) if i else ()
                what = _sentence(definition, true[beyond], called, len(rows))
                fits = _fitting(pair, true)
                raise protocol.document.problem(f"{what} {fits}", "joints", name, *where)


def _true_flexion(
    joint: JointDefinition,
    segments: tuple[np.ndarray, np.ndarray],
    robot: Robot,
    q: np.ndarray,
    steps: list[PlannedStep],
) -> tuple[np.ndarray, str, np.ndarray]:
    """True flexion [rad] of some moments, what it is called, and the rows of these moments."""
    rows = np.arange(len(steps))
    if joint.reference_joint is not None:
        return q[:, robot.joint_names.index(joint.reference_joint)], joint.reference_joint, rows
    variable = joint.flexion_variable
    commanded = [
        i for i, step in enumerate(steps) if step.kind != "sweep" and variable in step.variables
    ]
    if commanded:
        angles = np.radians([steps[i].variables[variable] for i in commanded])
        return angles, variable, np.array(commanded)
    return flexion_of(joint, joint_angles(*segments, joint)), joint.label, rows


def _beyond(definition: FlexionAngle, angles: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Where another triple of the same rotation has the true flexion, shape (n,), bool."""
    others = decomposition_of(definition).alternatives(angles)
    off = np.abs(rotation.wrap(flexion_of(definition, angles) - true))
    least = np.min(
        [np.abs(rotation.wrap(flexion_of(definition, other) - true)) for other in others], axis=0
    )
    if np.minimum(off, least).max() > FOLLOWS_WITHIN:  # it is not this flexion in any range
        return np.zeros(len(true), dtype=bool)
    return np.asarray((off > LEAST_ERROR) & (least < NEARER * off))


def _sentence(definition: FlexionAngle, true: np.ndarray, called: str, moments: int) -> str:
    low, high = np.degrees([true.min(), true.max()]).round(1) + 0.0
    span = f"{low:g} deg" if low == high else f"{low:g} to {high:g} deg"
    return (
        f"the {definition.flexion} angle of {definition.label} is the flexion, and "
        f"{_range(decomposition_of(definition), definition)}; in {len(true)} of {moments} "
        f"evaluated poses and instants of sweeps it lies beyond ({called} {span}), where it would "
        "be read as another angle, and the filters be blamed for that."
    )


def _range(kind: Decomposition, definition: FlexionAngle) -> str:
    middle = definition.flexion == "second"
    if (isinstance(kind, Euler) and kind.symmetric and middle) or isinstance(kind, AxisAngle):
        ends = "0 to 180 deg" if definition.sign > 0 else "-180 to 0 deg"
        return f"has no sign: it goes from {ends} only"
    if isinstance(kind, Euler) and middle:
        return "goes from -90 to 90 deg only"
    return "does not go all the way round"


def _fitting(segments: tuple[np.ndarray, np.ndarray], true: np.ndarray) -> str:
    """The definition that has the true flexion everywhere, and keeps off its singularities."""
    for sequence in _SEQUENCES:
        angles = joint_angles(*segments, sequence)
        margins = decomposition_of(sequence).margins(angles)
        for (flexion, column), sign in itertools.product(INDEX.items(), (1, -1)):
            off = np.abs(rotation.wrap(sign * angles[:, column] - true)).max()
            if off <= FITS_WITHIN and np.degrees(margins[:, column].min()) >= LEAST_MARGIN_DEG:
                signed = ", sign: -1" if sign < 0 else ""
                return (
                    f"This fits: {{sequence: {sequence}, flexion: {flexion}{signed}}}; or "
                    "`continuous: true` follows the angle beyond its range"
                )
    return "`continuous: true` follows the angle beyond its range"
