"""Does the flexion of a joint definition follow what it is compared with?

URDFs of one arm label their link axes differently.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from testbench.model import rotation
from testbench.model.joint_angle import (
    INDEX,
    decomposition_of,
    flexion_of,
    joint_angles,
    segment_pose,
)
from testbench.model.kinematics import Kinematics
from testbench.records.session.plan import PlannedStep, evaluated_steps
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.protocol import JointDefinition, Protocol
from testbench.records.specs.robot import Robot

MOST_SEQUENCE_ERROR_DEG = 15.0
"""The error that an Euler sequence alone makes in the published study stays below 9 deg at 20 deg
of misalignment.
"""
LEAST_SLOPE = 0.5
"""A flexion that changes by less than this part of the true one does not follow it: a sequence that
does not fit the motion still changes by cos d of it, 0.94 at a misalignment d of 20 deg.
"""
LEAST_SPAN_DEG = 1.0
"""Flexion that changes by less has no slope."""
LEAST_MARGIN_DEG = 5.0
"""Nearer to a singularity than this an angle magnifies every error more than eleven times (1 /
sin).
"""
SUGGESTED_WITHIN_DEG = 5.0
"""Another angle or sign is suggested where it would be this near."""
SWEEP_SAMPLES = 101
"""Instants of a sweep that are looked at, its ends included."""


def segment_frame_warnings(
    robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]
) -> list[str]:
    """Joint definitions whose flexion is not what it is compared with, or is lost in a singularity.

    Every definition of a joint is held against the true flexion: the arm's joint where one is
    named, else the angle of the joint's own definition. The true flexion is held against the
    commanded one, over which results are tabled. The median over poses and instants of sweeps is
    asked for, so that an Euler sequence that fails at large angles may still be studied, and
    besides whether the angle changes along at all. For singularities the worst pose is asked for.

    Returns:
        A sentence for each that is off by more than any Euler sequence could be, and for each whose
        flexion is not defined in one of the poses.
    """
    judged = evaluated_steps(steps)
    if not judged:
        return []
    moments = moments_of(judged)
    kinematics, q = Kinematics(robot), trajectory.at(np.array([time for _, time in moments]))[0]
    posed = np.array([step.kind != "sweep" for step, _ in moments])
    warnings = []
    for name, joint in protocol.spec.joints.items():
        proximal, distal = segments_of(joint, protocol, kinematics, q)
        own = [
            _Read(definition, joint_angles(proximal, distal, definition))
            for definition in joint.definitions()
        ]
        at_rest = posed if posed.any() else ~posed
        warnings += [sentence for read in own for sentence in read.lost(name, at_rest)]
        if joint.reference_joint is None:
            true, called, compared = own[0].flexion, f"the true one, {joint.label},", own[1:]
        else:
            true, called, compared = (
                q[:, robot.joint_names.index(joint.reference_joint)],
                joint.reference_joint,
                own,
            )
        warnings += _commanded(name, joint, [step for step, _ in moments], posed, true, own[0])
        for read in compared:
            frames = f"its segment frames (rotation_deg) do not fit the link frames of {robot.name}"
            what = (
                f"joint '{name}': in the middle of the poses the {read.definition.label} flexion "
                "of the segments differs"
            )
            warnings += read.differs(what, true, called, frames)
    return warnings


def segments_of(
    joint: JointDefinition, protocol: Protocol, kinematics: Kinematics, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Orientations of the segments of a joint, proximal and distal, as the arm moves.

    Args:
        joint: Of the protocol.
        protocol: With its sensors.
        kinematics: Of the arm.
        q: Joint angles of the arm, shape (n, k) [rad].

    Returns:
        q_world_from_segment, shape (n, 4) each.
    """
    proximal, distal = (
        kinematics.frame_motion(sensor.link, q, offset=segment_pose(sensor)).q_world_from_frame
        for sensor in (protocol.spec.sensors[name] for name in (joint.proximal, joint.distal))
    )
    return proximal, distal


def moments_of(judged: list[PlannedStep]) -> list[tuple[PlannedStep, int]]:
    """When to look [ns]: at the end of each pose, and all along each sweep."""
    moments = []
    for step in judged:
        ends = step.start_ns, step.settled_ns
        times = (
            np.linspace(*ends, SWEEP_SAMPLES).astype(np.int64).tolist()
            if step.kind == "sweep"
            else [step.end_ns]
        )
        moments += [(step, int(time)) for time in times]
    return moments


def _commanded(
    name: str,
    joint: JointDefinition,
    steps: list[PlannedStep],
    posed: np.ndarray,
    true: np.ndarray,
    own: _Read,
) -> list[str]:
    """Whether the true flexion of the poses is the one that the protocol calls commanded."""
    variable = joint.flexion_variable
    rows = np.array(
        [i for i, step in enumerate(steps) if posed[i] and variable in step.variables], dtype=int
    )
    if not len(rows):
        return []
    commanded = np.radians([steps[i].variables[variable] for i in rows])
    tabled = (
        "errors are tabled and drawn over the commanded one, so name the right variable as "
        "flexion_variable, or mend the "
    )
    if joint.reference_joint is not None:
        what = (
            f"joint '{name}': in the middle of the poses the true flexion, "
            f"{joint.reference_joint}, differs"
        )
        return _differs(what, true[rows], commanded, variable, tabled + "reference_joint", [])
    what = (
        f"joint '{name}': in the middle of the poses the true flexion, {joint.label} of the "
        "segments, differs"
    )
    return own.at(rows).differs(
        what, commanded, variable, tabled + "definition and the segment frames (rotation_deg)"
    )


@dataclass(frozen=True)
class _Read:
    """The three angles [rad] of a definition at some moments, shape (n, 3)."""

    definition: FlexionAngle
    angles: np.ndarray

    @property
    def flexion(self) -> np.ndarray:
        return flexion_of(self.definition, self.angles)

    def at(self, rows: np.ndarray) -> _Read:
        return _Read(self.definition, self.angles[rows])

    def lost(self, name: str, rows: np.ndarray) -> list[str]:
        """Whether the flexion is nearly undefined somewhere."""
        d = self.definition
        margin = math.degrees(
            float(decomposition_of(d).margins(self.angles[rows])[:, INDEX[d.flexion]].min())
        )
        if margin >= LEAST_MARGIN_DEG:
            return []
        flexion = (
            f"joint '{name}': the {d.flexion} angle of {d.label} is its flexion, and in one of the "
            "poses it is"
        )
        return [
            (
                f"{flexion} {margin:.1f} deg from where that angle is not defined; its error there "
                "says nothing"
            )
        ]

    def differs(self, what: str, true: np.ndarray, called: str, otherwise: str) -> list[str]:
        """Whether the flexion is not the true one.

        Args:
            what: What the flexion is called.
            true: The true flexion, shape (n,) [rad].
            called: What that is called.
            otherwise: What to do where no other angle or sign fits.
        """
        d, angles = self.definition, self.angles
        choices = [angles]
        # followed over time it may be on another branch: the nearest of all triples of the same
        # rotation
        if d.continuous:
            choices += list(decomposition_of(d).alternatives(angles))
        others = []
        for flexion, column in INDEX.items():
            for sign in (1, -1):
                read = _nearest([sign * choice[:, column] for choice in choices], true)
                if (flexion, sign) == (d.flexion, d.sign):
                    own = read
                else:
                    said = [f"`flexion: {flexion}`"] if flexion != d.flexion else []
                    said += [f"`sign: {sign}`"] if sign != d.sign else []
                    swapped = ", or proximal and distal are swapped" if flexion == d.flexion else ""
                    others.append((f"give it {' and '.join(said)}, which fits{swapped}", read))
        return _differs(what, own, true, called, otherwise, others)


def _nearest(choices: list[np.ndarray], true: np.ndarray) -> np.ndarray:
    """Of each sample the choice nearest to the true angle [rad]."""
    stacked = np.stack(choices)
    best = np.abs(rotation.wrap(stacked - true)).argmin(axis=0)
    return np.asarray(stacked[best, np.arange(len(true))])


def _differs(
    what: str,
    read: np.ndarray,
    true: np.ndarray,
    called: str,
    otherwise: str,
    others: list[tuple[str, np.ndarray]],
) -> list[str]:
    """A sentence where an angle is off or does not follow, with another one that fits."""
    off, slope = _off_deg(read, true), _slope(read, true)
    if off <= MOST_SEQUENCE_ERROR_DEG and (slope is None or slope >= LEAST_SLOPE):
        return []
    said = f"{what} from {called} by {off:.1f} deg"
    if slope is not None and slope <= -LEAST_SLOPE:
        said += " and runs against it"
    elif slope is not None and slope < LEAST_SLOPE:
        said += (
            f" and does not follow it: over {_span_deg(true):.1f} deg of that it changes by "
            f"{_span_deg(read):.1f} deg"
        )
    fitting = [
        (_off_deg(angle, true), words)
        for words, angle in others
        if (_slope(angle, true) or 0.0) >= LEAST_SLOPE
    ]
    nearest, words = min(fitting, default=(math.inf, ""))
    return [f"{said}; {words if nearest <= min(SUGGESTED_WITHIN_DEG, off / 2) else otherwise}"]


def _off_deg(read: np.ndarray, true: np.ndarray) -> float:
    """Median magnitude of the difference [deg]."""
    return math.degrees(float(np.median(np.abs(rotation.wrap(read - true)))))


def _slope(read: np.ndarray, true: np.ndarray) -> float | None:
    """Change of an angle with the true one, by least squares; None where that hardly changes."""
    if np.ptp(true) < math.radians(LEAST_SPAN_DEG):
        return None
    centred = true - true.mean()
    beside = true + rotation.wrap(read - true)
    return float(beside @ centred / (centred @ centred))


def _span_deg(angle: np.ndarray) -> float:
    """Largest less smallest angle on the circle about the first [deg]."""
    return math.degrees(float(np.ptp(rotation.wrap(angle - angle[0]))))
