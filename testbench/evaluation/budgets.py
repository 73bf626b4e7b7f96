"""The budgets of a session: for each section of a joint, and for the parts of each sensor's
orientation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.evaluation.angular_rate import judged_motion, judged_swing, length_of
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.flexion import JointErrors
from testbench.evaluation.foreign_truth import (
    RIGID,
    UNKNOWN_TRUTH,
    flexion_sensitivities,
    known_of,
    reference_sources,
)
from testbench.evaluation.sensitivity import (
    flexion_by_arm,
    judged_configurations,
)
from testbench.evaluation.time_lines import (
    STILL_DEG,
    JudgedMotion,
    TimeDoubt,
    arm_time_source,
    clock_source,
    group_delay_source,
)
from testbench.evaluation.uncertainty import (
    ArmSensitivity,
    alignment_source,
    arm_sources,
    combine,
    levelling_source,
    mounting_source,
)
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.kinematics import Kinematics
from testbench.model.statistics.intervals import gradient
from testbench.model.truth import truth_at
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import ClockFit, Estimate, SensorEstimate
from testbench.records.results.uncertainty import UncertaintyBudget, UncertaintySource
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Session
from testbench.records.specs.robot import Robot

PARTS = ("total", "heading", "inclination")


@dataclass(frozen=True)
class ChainTruth:
    """The true angle of a joint of the arm [rad], and which of its samples count, shape (n,)
    each.
    """

    angle: np.ndarray
    judged: np.ndarray


@dataclass(frozen=True)
class TrueArm:
    """An arm that gave the truth, with what it reported."""

    robot: Robot
    kinematics: Kinematics
    samples: ArmSamples

    @staticmethod
    def of(session: Session) -> TrueArm | None:
        """The arm of a session that the bench ran; None where the truth came from elsewhere."""
        samples = session.arm()
        if (
            samples is None
            or session.robot is None
            or not session.has_protocol
            or not len(samples.host_time_ns)
        ):
            return None
        return TrueArm(session.robot, Kinematics(session.robot), samples)

    def reference_pose(self, session: Session) -> np.ndarray | None:
        """Joint angles in which the frames were aligned, shape (1, n_joints) [rad]."""
        step = next((s for s in session.steps if s.role == "reference" and s.kind != "sweep"), None)
        found = None if step is None else judged_configurations(self.samples, [step])
        return None if found is None else found.q


def joint_budgets(
    session: Session, estimate: Estimate, errors: JointErrors, arm: TrueArm | None
) -> list[UncertaintyBudget]:
    """One budget for each section of a joint."""
    if errors.clock is not None:
        return [
            _of_true_angles(errors, errors.clock, section, [rows for _, rows in steps])
            for section, steps in errors.sections().items()
        ]
    return [
        _joint_budget(session, estimate, errors, section, steps, arm)
        for section, steps in errors.sections().items()
    ]


def _joint_budget(
    session: Session,
    estimate: Estimate,
    errors: JointErrors,
    section: str,
    judged: list[tuple[PlannedStep, np.ndarray]],
    arm: TrueArm | None,
) -> UncertaintyBudget:
    aligned = session.analysis.estimate.align
    counted = [rows for _, rows in judged]
    ends = (errors.joint.proximal, errors.joint.distal)
    motions = {
        name: judged_motion(errors.time_ns, errors.turned[:, i], counted)
        for i, name in enumerate(ends)
    }
    whole = judged_motion(errors.time_ns, errors.reference, counted)
    times = _times(session, estimate, motions, whole)
    steps = [step for step, _ in judged]
    configurations = None if arm is None else judged_configurations(arm.samples, steps)
    if arm is None or configurations is None:
        return _foreign_budget(session, estimate, errors, (section, counted), times)
    placed, joint = session.analysis.sensors, errors.joint
    by_arm, by_mounting = flexion_by_arm(arm.kinematics, placed, joint, configurations.q)
    pose = arm.reference_pose(session)
    at_reference = (
        None if pose is None else np.abs(flexion_by_arm(arm.kinematics, placed, joint, pose)[0][0])
    )
    weight = np.full(len(steps), 1 / len(steps))
    joints = len(arm.robot.joint_names)
    c = ArmSensitivity(by_arm, np.abs(by_arm), configurations.step, weight, at_reference, joints)
    mounting = ArmSensitivity(
        by_mounting, np.abs(by_mounting), configurations.step, weight, None, 0
    ).constant()
    sources = [
        *arm_sources(arm.robot, arm.kinematics.twists, arm.samples, steps, c),
        mounting_source(
            arm.robot, aligned, *(float(np.sqrt(np.sum(part**2))) for part in mounting)
        ),
        *times.lines,
        alignment_source(arm.robot, aligned, c, None),
    ]
    return combine(errors.name, "flexion", section, sources, times.missing, times.assumed)


def _foreign_budget(
    session: Session,
    estimate: Estimate,
    errors: JointErrors,
    judged: tuple[str, list[np.ndarray]],
    times: _Times,
) -> UncertaintyBudget:
    """The budget of a flexion whose truth is orientations by another system.

    Args:
        session: The recording.
        estimate: With the fits of the frames.
        errors: Of the joint.
        judged: The section, and rows of each of its steps.
        times: Lines of the sensors' times.
    """
    ends, (section, counted) = (errors.joint.proximal, errors.joint.distal), judged
    aligned, definition = session.analysis.estimate.align, errors.joint.definitions()[0]
    moments = errors.time_ns[np.concatenate(counted)]
    reference = [
        line
        for name, c in zip(
            ends, flexion_sensitivities(session, ends, definition, moments), strict=True
        )
        for line in reference_sources(session, name, c, c)
    ]
    known = [sd for name in ends if (sd := _fitted_sd(estimate.sensors[name])) is not None]
    together = float(np.sqrt(np.sum(np.square(known)))) if known else None
    lines = [*reference, *times.lines, alignment_source(None, aligned, None, together)]
    missing = [*([] if known_of(session, list(ends)) else [UNKNOWN_TRUTH]), *times.missing]
    return combine(errors.name, "flexion", section, lines, missing, [*times.assumed, RIGID])


def _of_true_angles(
    errors: JointErrors, clock: ClockFit, section: str, counted: list[np.ndarray]
) -> UncertaintyBudget:
    """The budget of a joint whose truth is angles by another system.

    Args:
        errors: Of the joint.
        clock: Its time against that of the angles.
        section: That is judged.
        counted: Rows of each of its steps.
    """
    motion = judged_motion(errors.time_ns, errors.reference, counted)
    line = clock_source("the joint", clock, motion)
    lines = [] if line is None else [line]
    return combine(errors.name, "flexion", section, lines, [UNKNOWN_TRUTH])


def flexion_time_sd(session: Session, estimate: Estimate, errors: JointErrors) -> float:
    """Standard uncertainty of a flexion's time [s]: of its sensors' clocks and of the delays of
    their gyroscopes, by how much each of them makes it turn.
    """
    if errors.clock is not None:
        return float(np.nan_to_num(errors.clock.offset_sd_s))
    rates = gradient(errors.turned, errors.time_ns / NANOSECONDS)
    squares = rates[np.concatenate([rows for _, rows in errors.steps])] ** 2
    moved = np.nansum(squares, axis=0) / np.maximum(np.isfinite(squares).sum(axis=0), 1)
    doubt = TimeDoubt.of(session, estimate)
    known = [doubt.sd(estimate, name) for name in (errors.joint.proximal, errors.joint.distal)]
    return float(np.sqrt(np.sum(moved * np.square(known)) / max(float(moved.sum()), 1e-300)))


def unknown_time(sensor: str) -> str:
    """What a budget lacks where a sensor's clock could not be fitted although it moves the
    truth.
    """
    return f"the time of sensor '{sensor}' is not known, and its motion is evaluated"


@dataclass(frozen=True)
class _Times:
    """Lines of a budget that come from time, what is missing of them, and what was assumed."""

    lines: list[UncertaintySource]
    missing: list[str]
    assumed: list[str]


def _times(
    session: Session,
    estimate: Estimate,
    motions: dict[str, JudgedMotion],
    whole: JudgedMotion,
) -> _Times:
    """The lines of each sensor's clock and of the delay of its gyroscope, and of the arm's time.

    Args:
        session: The recording.
        estimate: With the fits of the clocks.
        motions: Of the truth, as far as each sensor makes it.
        whole: Of the truth.
    """
    doubt = TimeDoubt.of(session, estimate)
    clocks = {
        name: clock_source(name, estimate.sensors[name].clock, motion)
        for name, motion in motions.items()
    }
    delays = [group_delay_source(name, doubt, motion) for name, motion in motions.items()]
    lines = [*clocks.values(), *delays, arm_time_source(doubt, whole)]
    return _Times(
        [line for line in lines if line is not None],
        [unknown_time(name) for name, line in clocks.items() if line is None],
        doubt.notes(list(motions)),
    )


def chain_budget(
    session: Session,
    estimate: Estimate,
    chain: ChainEstimate,
    joint: str,
    true: ChainTruth,
    arm: TrueArm | None,
) -> UncertaintyBudget:
    """The budget of the true angle of one joint of the arm, which the chain filter is judged by.

    Mounting, levelling and the alignment of frames are no part of it: the filter takes them as the
    protocol states them, so that what they are wrong by is an error of its own.
    """
    time = chain.host_time_ns[true.judged]
    motion = judged_motion(chain.host_time_ns, true.angle, [np.flatnonzero(true.judged)])
    moving = _chain_clocks(session, estimate, chain, time, motion)
    times = _times(session, estimate, moving, motion)
    missing = [*times.missing, *([UNKNOWN_TRUTH] if arm is None else [])]
    steps = [step for step in session.steps if step.section == chain.section]
    counts = np.array(
        [np.diff(np.searchsorted(time, [step.start_ns, step.end_ns]))[0] for step in steps]
    )
    steps = [step for step, count in zip(steps, counts, strict=True) if count]
    sources = []
    if arm is not None:
        own = np.zeros((len(steps), len(arm.robot.joint_names)))
        own[:, arm.robot.joint_names.index(joint)] = 1.0
        weight = counts[counts > 0] / counts.sum()
        c = ArmSensitivity(own, own, np.arange(len(steps)), weight, None, own.shape[1])
        sources = arm_sources(arm.robot, [], arm.samples, steps, c)
    lines = [*sources, *times.lines]
    return combine(joint, "angle", chain.section, lines, missing, times.assumed)


def _chain_clocks(
    session: Session,
    estimate: Estimate,
    chain: ChainEstimate,
    time: np.ndarray,
    motion: JudgedMotion,
) -> dict[str, JudgedMotion]:
    """Sensors of a chain whose clocks count for one of its joints: the least sure one of those that
    were fitted, as if it alone saw the joint move, and each that was not, unless it stands still.
    """
    clocks = {name: estimate.sensors[name].clock for name in chain.sensors}
    known = {
        name: np.nan_to_num(clock.offset_sd_s)
        for name, clock in clocks.items()
        if np.isfinite(clock.offset_sd_s) or clock.method == "none"
    }
    found = {max(known, key=lambda name: known[name]): motion} if known else {}
    for name in clocks.keys() - known.keys():
        truth = session.truth(name)
        swing = motion.swing if truth is None else judged_swing(truth_at(truth, time), "total")
        if not swing <= STILL_DEG or not known:
            found[name] = replace(motion, swing=swing)
    return found


# One piece: the three parts of the error share what is judged, where the arm was, and its axes.
def sensor_budgets(
    session: Session,
    estimate: Estimate,
    name: str,
    true: TrueTurning,
    judged: np.ndarray,
    steps: list[PlannedStep],
    arm: TrueArm | None,
) -> list[UncertaintyBudget]:
    """Budgets of a sensor's total, heading and inclination errors.

    Args:
        session: The recording.
        estimate: Of the session.
        name: Of the sensor.
        true: The truth at the estimate's instants.
        judged: Which samples count, shape (n,), bool.
        steps: Evaluated steps of the protocol.
        arm: What is known of the arm's truth; None without one.
    """
    sensor, aligned = estimate.sensors[name], session.analysis.estimate.align
    time = sensor.host_time_ns
    spans = [slice(*np.searchsorted(time, [s.start_ns, s.end_ns])) for s in steps] or [slice(None)]
    whole = [true.q[span][judged[span]] for span in spans]
    turning = np.degrees(true.rate[judged & np.isfinite(true.rate[:, 0])])
    counts = np.array(
        [np.sum(judged[slice(*np.searchsorted(time, [s.start_ns, s.end_ns]))]) for s in steps]
    )
    steps = [step for step, count in zip(steps, counts, strict=True) if count]
    configurations = None if arm is None else judged_configurations(arm.samples, steps)
    axes = reference = None
    if arm is not None and configurations is not None:
        link = session.analysis.sensors[name].link
        axes = arm.kinematics.error_axes(link, configurations.q)
        pose = arm.reference_pose(session)
        reference = None if pose is None else arm.kinematics.error_axes(link, pose)[0]
    budgets = []
    for part in PARTS:
        speed = length_of(turning, part) if len(turning) else np.zeros(1)
        mean_rate = (
            float(turning[:, 2].mean())
            if part == "heading" and len(turning)
            else float(speed.mean())
        )
        swing = (
            0.0
            if np.isfinite(sensor.clock.offset_sd_s)
            else max(judged_swing(q, part) for q in whole)
        )
        # Axes of the sensor that a mounting error turns it about: all three, the vertical ones, the
        # level ones.
        mounted = {"total": np.sqrt(3.0), "heading": 1.0, "inclination": np.sqrt(2.0)}[part]
        motion = JudgedMotion(mean_rate, float(np.sqrt(np.mean(speed**2))), swing)
        times = _times(session, estimate, {name: motion}, motion)
        if arm is None or axes is None or configurations is None:
            frames = alignment_source(None, aligned, None, _fitted_sd(sensor))
            lines = [*reference_sources(session, name, mounted, 1.0), *times.lines, frames]
            missing = [*([] if known_of(session, [name]) else [UNKNOWN_TRUTH]), *times.missing]
            assumed = [*times.assumed, RIGID]
            budgets.append(combine(name, part, None, lines, missing, assumed))
            continue
        size = length_of(axes, part)
        c = ArmSensitivity(
            axes[:, :, 2] if part == "heading" else size,
            size,
            configurations.step,
            counts[counts > 0] / counts.sum(),
            None if reference is None else length_of(reference, part),
            len(arm.robot.joint_names),
        )
        lasting = _mean_vertical(true.q[judged]) if part == "heading" else mounted
        sources = [
            *arm_sources(arm.robot, arm.kinematics.twists, arm.samples, steps, c),
            None if part == "heading" else levelling_source(arm.robot, float(np.sqrt(2.0))),
            mounting_source(arm.robot, aligned, lasting, mounted),
            *times.lines,
            alignment_source(arm.robot, aligned, c, None),
        ]
        budgets.append(combine(name, part, None, sources, times.missing, times.assumed))
    return budgets


def _mean_vertical(q_world_from_sensor: np.ndarray) -> float:
    """Length of the mean of the vertical seen in the sensor, shape (n, 4): 1 where it stays, 0
    where all directions came.
    """
    if not len(q_world_from_sensor):
        return 0.0
    return float(np.linalg.norm(rotation.to_matrix(q_world_from_sensor)[:, 2, :].mean(axis=0)))


def _fitted_sd(sensor: SensorEstimate) -> float | None:
    """Standard uncertainty of an alignment by motion, about all axes together [deg]; None for other
    alignments.
    """
    stated = [
        np.linalg.norm(fit.mounting_sd_deg)
        for frames in (sensor.frames, *sensor.frames_apart)
        for fit in frames.values()
        if fit.mounting_sd_deg is not None
    ]
    return float(max(stated)) if stated else None
