"""Errors of each joint's flexion by each filter and Euler sequence."""

from __future__ import annotations

import numpy as np

from testbench.evaluation.judged import rows_by_step
from testbench.evaluation.metrics import summarise
from testbench.model import rotation
from testbench.model.joint_angle import (
    INDEX,
    decomposition_of,
    flexion_of,
    joint_angle_series,
    nearest_turn,
    segment_orientation,
    unwrapped,
)
from testbench.model.truth import WIDEST_GAP_NS, truth_at
from testbench.records.estimate import Estimate
from testbench.records.evaluation import JointRow
from testbench.records.joint_definition import FlexionAngle
from testbench.records.plan import PlannedStep
from testbench.records.protocol import JointDefinition
from testbench.records.samples import ArmSamples
from testbench.records.session import Session

LEAST_GIMBAL_MARGIN = np.radians(1.0)
"""Nearer than this to where it stops being defined (gimbal lock), an angle beside the flexion is not judged [rad]."""


def evaluate_joint(
    session: Session, name: str, estimate: Estimate, steps: list[PlannedStep], arm: ArmSamples | None
) -> tuple[list[JointRow], dict[str, np.ndarray]]:
    """Rows and error signals of one joint."""
    joint, joint_estimate = session.analysis.joints[name], estimate.joints[name]
    time = joint_estimate.host_time_ns
    static, sound = _both_sensors(estimate, joint, time)
    true_angles = _true_angles(session, joint, time)
    definitions = joint.definitions()
    if true_angles is None:
        return [], {}
    reference = _reference(joint, true_angles, arm, time)
    series = {"host_time_ns": time, "judged": np.zeros(len(time), dtype=bool), "reference_rad": reference}
    errors: dict[tuple[str, str], np.ndarray] = {}
    for (key, sequence), angles in joint_estimate.angles.items():
        definition = next(item for item in definitions if item.label == sequence)
        flexion = nearest_turn(flexion_of(definition, angles), reference)
        errors[key, sequence] = rotation.wrap(flexion - reference)
        series[f"{key}_{sequence}_flexion_rad"] = flexion
        series[f"{key}_{sequence}_error_rad"] = errors[key, sequence]
    rows = []
    finite = np.isfinite(reference) & sound
    for step, candidates in rows_by_step(steps, time, static):
        counted = candidates[finite[candidates]]
        series["judged"][counted] = True
        if not len(counted):
            continue
        for (key, sequence), error in errors.items():
            definition = next(item for item in definitions if item.label == sequence)
            others = _others(joint_estimate.angles[key, sequence][counted], true_angles[sequence][counted], definition)
            rows.append(_row(name, key, sequence, step, joint, np.degrees(error[counted]), others))
    return rows, series


def _both_sensors(estimate: Estimate, joint: JointDefinition, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where both sensors are at rest, and where neither is flagged, at the proximal sensor's instants."""
    proximal, distal = estimate.sensors[joint.proximal], estimate.sensors[joint.distal]
    following = np.clip(np.searchsorted(distal.host_time_ns, time), 1, len(distal.host_time_ns) - 1)
    before = following - 1
    bridged = distal.host_time_ns[following] - distal.host_time_ns[before] > WIDEST_GAP_NS
    static = proximal.static & distal.static[following] & distal.static[before]
    return static, ~(proximal.flagged | distal.flagged[following] | distal.flagged[before] | bridged)


def _true_angles(session: Session, joint: JointDefinition, time: np.ndarray) -> dict[str, np.ndarray] | None:
    """Euler angles of the segments' true orientations by sequence, shape (n, 3) [rad]; NaN where the truth is unknown."""
    truths = [session.truth(joint.proximal), session.truth(joint.distal)]
    if truths[0] is None or truths[1] is None:
        return None
    q_proximal, q_distal = truth_at(truths[0], time), truth_at(truths[1], time)
    known = np.isfinite(q_proximal[:, 0]) & np.isfinite(q_distal[:, 0])
    placed = session.analysis.sensors
    world_from_proximal = segment_orientation(q_proximal[known], placed[joint.proximal])
    world_from_distal = segment_orientation(q_distal[known], placed[joint.distal])
    angles: dict[str, np.ndarray] = {}
    for definition in joint.definitions():
        full = np.full((len(time), 3), np.nan)
        full[known] = joint_angle_series(world_from_proximal, world_from_distal, definition)
        angles[definition.label] = full
    return angles


def _reference(
    joint: JointDefinition, true_angles: dict[str, np.ndarray], arm: ArmSamples | None, time: np.ndarray
) -> np.ndarray:
    """True flexion [rad]: the arm's measured joint if the protocol names one, else the same angle of the truth, unwrapped."""
    if joint.reference_joint is not None and arm is not None and joint.reference_joint in arm.joint_names:
        column = arm.joint_names.index(joint.reference_joint)
        return np.asarray(np.interp(time, arm.host_time_ns, arm.q_measured[:, column], left=np.nan, right=np.nan))
    return unwrapped(flexion_of(joint, true_angles[joint.label]))


def _others(estimated: np.ndarray, true: np.ndarray, definition: FlexionAngle) -> list[float | None]:
    """Mean absolute error [deg] of the two angles that are not the flexion; None for one that is nowhere defined."""
    margins = decomposition_of(definition).margins(true)
    result: list[float | None] = []
    for i in range(3):
        defined = margins[:, i] >= LEAST_GIMBAL_MARGIN
        if i != INDEX[definition.flexion]:
            error = np.abs(rotation.wrap(estimated[defined, i] - true[defined, i]))
            result.append(float(np.degrees(error.mean())) if defined.any() else None)
    return result


def _row(
    name: str, key: str, sequence: str, step: PlannedStep, joint: JointDefinition, error: np.ndarray, others: list[float | None]
) -> JointRow:
    summary = summarise(error)
    return JointRow(
        joint=name,
        filter=key,
        sequence=sequence,
        section=step.section,
        step=step.index,
        kind=step.kind,
        misalignment_deg=step.variables.get(joint.misalignment),
        flexion_deg=step.variables.get(joint.flexion_variable),
        variables=step.variables,
        n=summary.n,
        flexion_mean_error_deg=summary.mean,
        flexion_mean_abs_error_deg=summary.mean_abs,
        flexion_sd_deg=summary.sd,
        flexion_rmse_deg=summary.rmse,
        flexion_max_abs_error_deg=summary.max_abs,
        other_mean_abs_error_deg=others,
    )
