"""Errors of each joint's flexion by each filter and Euler sequence."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbench.evaluation.angular_rate import turned_by_sensor
from testbench.evaluation.dynamics import amplitude_and_frequency, angle_delay, convergence_times
from testbench.evaluation.judged import rows_by_step
from testbench.evaluation.left_out import left_out
from testbench.evaluation.metrics import Summary, correlation, summarise_each
from testbench.model import rotation
from testbench.model.joint_angle import (
    INDEX,
    beside,
    decomposition_of,
    flexion_of,
    joint_angle_series,
    nearest_turn,
    unwrapped,
)
from testbench.model.told_angles import told_angles
from testbench.model.true_segment import true_segment
from testbench.model.truth import WIDEST_GAP_NS, truth_at
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import ClockFit, Estimate, JointEstimate
from testbench.records.results.evaluation import JointRow
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth
from testbench.records.session.session import Session
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.protocol import JointDefinition

Key = tuple[str, str]
"""Filter and label of the definition."""
COVERED = 1.96
"""Standard uncertainties to either side that hold 95 % of normal errors."""
WHOLE = "recording"
"""The section and step that a recording without a protocol is judged as."""
LEAST_GIMBAL_MARGIN = np.radians(1.0)
"""Nearer than this to where it stops being defined (gimbal lock), an angle beside the flexion is
not judged [rad].
"""


@dataclass(frozen=True)
class JointErrors:
    """Flexion errors of one joint, and where they count.

    Attributes:
        name: What the protocol calls the joint.
        joint: Its definition in the protocol.
        time_ns: Of the proximal sensor, shape (n,) [ns].
        reference: True flexion [rad], shape (n,).
        flexion: Estimated flexion by filter and Euler sequence [rad], shape (n,) each.
        error: Estimated less true flexion by filter and Euler sequence [rad], shape (n,) each.
        true_angles: All three true Euler angles by sequence [rad], shape (n, 3) each.
        angles: All three estimated Euler angles by filter and sequence [rad], shape (n, 3) each.
        steps: Judged steps with the rows that count in each, in the order of time; those without
            any are left out.
        total: Angle of the rotation between estimated and true orientation of the distal segment
            against the proximal one, by filter [rad], shape (n,); NaN where nothing is judged.
        turned: What the motion of the proximal and of the distal sensor has added to the true
            flexion, shape (n, 2) [rad].
        findings: What was to be judged and was not.
        clock: The joint's time against that of the truth, where that is angles by another system.
    """

    name: str
    joint: JointDefinition
    time_ns: np.ndarray
    reference: np.ndarray
    flexion: dict[Key, np.ndarray]
    error: dict[Key, np.ndarray]
    true_angles: dict[str, np.ndarray]
    angles: dict[Key, np.ndarray]
    steps: list[tuple[PlannedStep, np.ndarray]]
    total: dict[str, np.ndarray]
    turned: np.ndarray
    findings: list[Finding] = field(default_factory=list)
    clock: ClockFit | None = None

    def sections(self) -> dict[str, list[tuple[PlannedStep, np.ndarray]]]:
        """Steps by section, in their order."""
        result: dict[str, list[tuple[PlannedStep, np.ndarray]]] = {}
        for step, rows in self.steps:
            result.setdefault(step.section, []).append((step, rows))
        return result

    def definition(self, sequence: str) -> FlexionAngle:
        """How a sequence gives the flexion."""
        return next(item for item in self.joint.definitions() if item.label == sequence)

    def series(self) -> dict[str, np.ndarray]:
        """Columns for figures and the viewer."""
        judged = np.zeros(len(self.time_ns), dtype=bool)
        for _, rows in self.steps:
            judged[rows] = True
        columns = {"host_time_ns": self.time_ns, "judged": judged, "reference_rad": self.reference}
        for (key, sequence), flexion in self.flexion.items():
            columns[f"{key}_{sequence}_flexion_rad"] = flexion.astype(np.float32)
            columns[f"{key}_{sequence}_error_rad"] = self.error[key, sequence].astype(np.float32)
        for key, total in self.total.items():
            columns[f"{key}_total_error_rad"] = total.astype(np.float32)
        return columns


def joint_errors(
    session: Session, name: str, estimate: Estimate, steps: list[PlannedStep]
) -> JointErrors | None:
    """Errors of one joint; None where nobody knows the true angle."""
    joint, joint_estimate = session.analysis.joints[name], estimate.joints[name]
    time = joint_estimate.host_time_ns
    clock = joint_estimate.true_clock
    if clock is not None:
        truth = _told_angles(session, name, joint_estimate)
    else:
        truth = _true_angles(session, joint, time)
    if truth is None:
        return None
    true_angles, turned, held = truth
    static, sound = _both_sensors(estimate, joint, time)
    reference = _reference(session, joint, true_angles, time)
    flexion, error = {}, {}
    for (key, sequence), angles in joint_estimate.angles.items():
        if sequence not in true_angles:
            continue
        definition = next(item for item in joint.definitions() if item.label == sequence)
        flexion[key, sequence], error[key, sequence] = flexion_error(
            definition, angles, reference, true_angles[sequence]
        )
    finite = np.isfinite(reference) & sound
    counted = [(step, rows[finite[rows]]) for step, rows in rows_by_step(steps, time, static)]
    judged = [(step, rows) for step, rows in counted if len(rows)]
    total = _total_errors(joint, joint_estimate.angles, true_angles[joint.label], judged)
    findings = held + left_out(
        f"joint '{name}'", steps, time, static, np.isfinite(reference), sound
    )
    own = joint_estimate.angles
    return JointErrors(
        name,
        joint,
        time,
        reference,
        flexion,
        error,
        true_angles,
        own,
        judged,
        total,
        turned,
        findings,
        clock,
    )


_Truth = tuple[dict[str, np.ndarray], np.ndarray, list[Finding]]
"""True angles by sequence, shape (n, 3) each, what each sensor has turned the flexion by, shape (n,
2) [rad], NaN where unknown, and what is to be said of them.
"""


def _told_angles(session: Session, name: str, joint: JointEstimate) -> _Truth | None:
    """True angles by another system, which say nothing of the sensors."""
    told = told_angles(session, name, joint)
    if told is None:
        return None
    return told[0], np.full((len(joint.host_time_ns), 2), np.nan), told[1]


def _total_errors(
    joint: JointDefinition,
    angles: dict[Key, np.ndarray],
    true: np.ndarray,
    judged: list[tuple[PlannedStep, np.ndarray]],
) -> dict[str, np.ndarray]:
    """All three angles of the joint's own definition at once: the angle between two rotations does
    not depend on how they are written, and no definition loses it in gimbal lock.
    """
    rows = np.concatenate([rows for _, rows in judged]) if judged else np.zeros(0, dtype=np.int64)
    if np.isnan(true[rows]).any():  # a truth of one angle alone is no rotation
        return {}
    decomposition = decomposition_of(joint)
    q_true = decomposition.rotation(true[rows])
    result = {}
    for (key, sequence), own in angles.items():
        if sequence == joint.label:
            result[key] = np.full(len(true), np.nan)
            difference = rotation.multiply(
                rotation.conjugate(q_true), decomposition.rotation(own[rows])
            )
            result[key][rows] = rotation.angle(difference)
    return result


def flexion_error(
    definition: FlexionAngle, angles: np.ndarray, reference: np.ndarray, true: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Flexion [rad] and its error, shape (n,) each.

    Args:
        definition: Which of the angles it is.
        angles: Estimated, shape (n, 3) [rad].
        reference: True flexion [rad], shape (n,).
        true: True angles by the same definition, shape (n, 3) [rad].
    """
    if definition.continuous:
        angles = beside(definition, angles, true, reference)
    flexion = nearest_turn(flexion_of(definition, angles), reference)
    return flexion, rotation.wrap(flexion - reference)


def joint_rows(errors: JointErrors, time_sd: float) -> list[JointRow]:
    """One row for each step, filter and sequence.

    Args:
        errors: Of the joint.
        time_sd: Standard uncertainty of the flexion's time [s], part of that of a delay.
    """
    if not errors.steps:
        return []
    every = np.concatenate([rows for _, rows in errors.steps])
    sizes = np.array([len(rows) for _, rows in errors.steps])
    poses = [step for step, _ in errors.steps if step.kind != "sweep"]
    sweeps = _measured_sweeps(errors)
    defined = {
        label: (
            decomposition_of(errors.definition(label)).margins(true[every]) >= LEAST_GIMBAL_MARGIN
        )
        & np.isfinite(true[every])
        for label, true in errors.true_angles.items()
    }
    by_key = []
    for key, error in errors.error.items():
        by_step = summarise_each(np.degrees(error[every]), sizes)
        others = _others(errors, key, every, sizes, defined[key[1]])
        settled = iter(convergence_times(errors.time_ns, error, poses).tolist())
        by_key.append(
            [
                _row(
                    errors,
                    key,
                    step,
                    by_step[i],
                    other_mean_abs_error_deg=others[i],
                    **(
                        _of_sweep(errors, key, rows, time_sd) | sweeps[step.index]
                        if step.kind == "sweep"
                        else {"convergence_s": _known(next(settled))}
                    ),
                )
                for i, (step, rows) in enumerate(errors.steps)
            ]
        )
    return [row for of_step in zip(*by_key, strict=True) for row in of_step]


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _measured_sweeps(errors: JointErrors) -> dict[int, dict[str, float | None]]:
    """Amplitude and frequency of the true flexion in each sweep, by the step's index."""
    result: dict[int, dict[str, float | None]] = {}
    for step, rows in errors.steps:
        if step.kind == "sweep":
            found = amplitude_and_frequency(errors.time_ns[rows], errors.reference[rows])
            amplitude, frequency = (None, None) if found is None else found
            result[step.index] = {
                "amplitude_deg": None if amplitude is None else float(np.degrees(amplitude)),
                "frequency_hz": frequency,
            }
    return result


def _of_sweep(
    errors: JointErrors, key: Key, rows: np.ndarray, time_sd: float
) -> dict[str, float | None]:
    """What is said of a filter in sweeps alone."""
    delay = angle_delay(errors.time_ns, errors.flexion[key], errors.reference, [rows])
    return {
        "flexion_correlation": correlation(errors.flexion[key][rows], errors.reference[rows]),
        "latency_ms": None if delay is None else 1e3 * delay[0],
        "latency_sd_ms": None if delay is None else 1e3 * float(np.hypot(delay[1], time_sd)),
    }


def _both_sensors(
    estimate: Estimate, joint: JointDefinition, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where both sensors are at rest, and where neither is flagged, at the proximal sensor's
    instants.
    """
    proximal, distal = estimate.sensors[joint.proximal], estimate.sensors[joint.distal]
    following = np.clip(np.searchsorted(distal.host_time_ns, time), 1, len(distal.host_time_ns) - 1)
    before = following - 1
    bridged = distal.host_time_ns[following] - distal.host_time_ns[before] > WIDEST_GAP_NS
    static = proximal.static & distal.static[following] & distal.static[before]
    return static, ~(
        proximal.flagged | distal.flagged[following] | distal.flagged[before] | bridged
    )


def _true_orientation(session: Session, sensor: str, time: np.ndarray) -> np.ndarray | None:
    """q_world_from_sensor where errors count, shape (n, 4); the truth itself, which may be long, is
    let go of.
    """
    truth = session.truth(sensor)
    if truth is None:
        return None
    q_true = truth_at(truth, time)
    q_true[~_counts(truth, time)] = np.nan
    return q_true


def _true_angles(session: Session, joint: JointDefinition, time: np.ndarray) -> _Truth | None:
    """Euler angles of the segments' true orientations."""
    orientations = []
    for sensor in (joint.proximal, joint.distal):
        q_true = _true_orientation(session, sensor, time)
        if q_true is None:
            return None
        orientations.append(q_true)
        del q_true
    known = np.isfinite(orientations[0][:, 0]) & np.isfinite(orientations[1][:, 0])
    world_from_proximal, world_from_distal = (
        true_segment(session.analysis, sensor, orientations.pop(0)[known])
        for sensor in (joint.proximal, joint.distal)
    )
    angles: dict[str, np.ndarray] = {}
    for definition in joint.definitions():
        full = np.full((len(time), 3), np.nan)
        full[known] = joint_angle_series(world_from_proximal, world_from_distal, definition)
        angles[definition.label] = full
    turned = np.full((len(time), 2), np.nan)
    turned[known] = turned_by_sensor(world_from_proximal, world_from_distal, joint)
    return angles, turned, []


def covered(errors: JointErrors, joint: JointEstimate) -> list[Finding]:
    """How many errors of the flexion the stated uncertainty covers, by filter.

    Args:
        errors: Of the joint.
        joint: Its estimate.
    """
    if not errors.steps:
        return []
    rows, found = np.concatenate([own for _, own in errors.steps]), []
    for key, sd in joint.sd.items():
        if key in errors.error and key[1] == errors.joint.label:
            place = INDEX[errors.joint.flexion]
            error, known = errors.error[key][rows], COVERED * sd[rows, place]
            sound = np.isfinite(error) & np.isfinite(known)
            percent = 100 * float(np.mean(np.abs(error[sound]) <= known[sound]))
            where = f"joint '{errors.name}'"
            found.append(finding("judged.joint_covered", where, filter=key[0], percent=percent))
    return found


def _counts(truth: Truth, time: np.ndarray) -> np.ndarray:
    """Where errors count by the truth's own marks, shape (n,), bool."""
    if truth.judged is None or not len(truth.host_time_ns):
        return np.ones(len(time), dtype=bool)
    nearest = np.clip(np.searchsorted(truth.host_time_ns, time), 0, len(truth.host_time_ns) - 1)
    return np.asarray(truth.judged[nearest])


def whole_recording(estimate: Estimate) -> list[PlannedStep]:
    """A recording without steps as one that is judged throughout.

    Args:
        estimate: Of it.
    """
    times = [sensor.host_time_ns for sensor in estimate.sensors.values()]
    begin, end = min(int(own[0]) for own in times), max(int(own[-1]) for own in times)
    return [PlannedStep(0, WHOLE, "evaluation", WHOLE, "sweep", {}, begin, end, end)]


def _reference(
    session: Session, joint: JointDefinition, true_angles: dict[str, np.ndarray], time: np.ndarray
) -> np.ndarray:
    """True flexion [rad]: the arm's measured joint if the protocol names one, else the same angle
    of the truth, unwrapped.
    """
    measured = None if joint.reference_joint is None else session.arm_joint(joint.reference_joint)
    if measured is not None and not len(measured[0]):
        return np.full(len(time), np.nan)
    if measured is not None:
        return np.asarray(np.interp(time, *measured, left=np.nan, right=np.nan))
    return unwrapped(flexion_of(joint, true_angles[joint.label]))


def _others(
    errors: JointErrors, key: Key, every: np.ndarray, sizes: np.ndarray, defined: np.ndarray
) -> list[list[float | None]]:
    """Mean absolute error [deg] of the two angles that are not the flexion, in each step.

    None for one that is nowhere defined.

    Args:
        errors: Of the joint.
        key: Of the estimate.
        every: Rows of all steps, shape (m,).
        sizes: How many of them each step has, shape (steps,).
        defined: Where each true angle is far enough from gimbal lock, shape (m, 3).
    """
    starts = np.cumsum(sizes) - sizes
    definition = errors.definition(key[1])
    columns = []
    for i in range(3):
        if i != INDEX[definition.flexion]:
            difference = errors.angles[key][every, i] - errors.true_angles[key[1]][every, i]
            error = np.where(defined[:, i], np.abs(rotation.wrap(difference)), 0.0)
            count = np.add.reduceat(defined[:, i], starts, dtype=np.int64)
            mean = np.degrees(np.add.reduceat(error, starts) / np.maximum(count, 1))
            columns.append(np.where(count > 0, mean, np.nan))
    means = np.column_stack(columns)
    rows: list[list[float | None]] = means.tolist()
    for row in np.flatnonzero(np.isnan(means).any(axis=1)):
        rows[row] = [_known(value) for value in rows[row] if value is not None]
    return rows


def _row(
    errors: JointErrors, key: Key, step: PlannedStep, summary: Summary, **further: Any
) -> JointRow:
    """The row of a step by a filter, with what is said of poses or sweeps alone."""
    variables, joint = step.variables, errors.joint
    return JointRow(
        joint=errors.name,
        filter=key[0],
        sequence=key[1],
        section=step.section,
        step=step.index,
        kind=step.kind,
        misalignment_deg=variables.get(joint.misalignment),
        flexion_deg=variables.get(joint.flexion_variable),
        variables=variables,
        n=summary.n,
        flexion_mean_error_deg=summary.mean,
        flexion_mean_abs_error_deg=summary.mean_abs,
        flexion_sd_deg=summary.sd,
        flexion_rmse_deg=summary.rmse,
        flexion_max_abs_error_deg=summary.max_abs,
        flexion_median_error_deg=summary.median,
        flexion_iqr_deg=summary.iqr,
        flexion_p95_abs_error_deg=summary.p95_abs,
        **further,
    )
