"""The stage `evaluate`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation.arm_time import arm_notes
from testbench.evaluation.budgets import Arm, flexion_clock_sd, joint_budgets, sensor_budgets
from testbench.evaluation.chain import judge_chain
from testbench.evaluation.cycles import add_cycles, cycle_notes, joint_cycles
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.euler_ranges import euler_range_rows
from testbench.evaluation.field_following import following_rows
from testbench.evaluation.flexion import joint_errors, joint_rows
from testbench.evaluation.gyroscope_bias import bias_rows
from testbench.evaluation.joint_summary import summarise_joint
from testbench.evaluation.judged import sound_truth
from testbench.evaluation.left_out import left_out_notes
from testbench.evaluation.magnetic import field_deviation, field_error_rows, field_rows
from testbench.evaluation.noise import Rest, noise_rows, norm_error_percent
from testbench.evaluation.orientation import (
    rank_sensor,
    sensor_errors,
    sensor_rows,
    summarise_sensor,
    sweep_rows,
)
from testbench.evaluation.outliers import outlier_rows
from testbench.evaluation.verdict import judge, summarise_metrics
from testbench.model.reference_step import reference_warning
from testbench.records.earlier_steps import earlier_steps
from testbench.records.estimate import Estimate
from testbench.records.evaluation import SEVERITY, Evaluation, Metric, Outcome
from testbench.records.evaluation_rows import Comparison, RankRow, TunedRow
from testbench.records.near import Instants, united
from testbench.records.plan import PlannedStep, judged_steps
from testbench.records.session import RunStatus, Session

MOST_OF_THE_ARM = 200_000
"""Instants of a long campaign at which its budgets look at the arm."""
ENDED = {
    RunStatus.RUNNING: "the recording was not closed",
    RunStatus.ERROR: "the run ended in an error",
    RunStatus.INTERRUPTED: "the run was interrupted",
    RunStatus.ABORTED: "the run was aborted",
}
"""How a run ended that is not complete."""
NORM_MEANING = "error of the mean specific force at rest against standard gravity"


def evaluate(session: Session, estimate: Estimate) -> Evaluation:
    """Compare estimates with the truth and judge them by the protocol's limits.

    Args:
        session: The recording.
        estimate: What `estimate` made of it.
    """
    instants = _instants(session, estimate)
    session = session.near(instants)
    steps = judged_steps(session.steps) if session.has_protocol or session.steps else None
    result = Evaluation(session.name, [], [], [], Outcome.NOT_MEASURED)
    result.notes.extend(session.manifest.get("plan", {}).get("check", {}).get("warnings", []))
    doubt = reference_warning(session.steps, session.analysis.estimate.align)
    if doubt is not None and doubt not in result.notes:  # else the plan has said so
        result.notes.append(doubt)
    if session.status is not RunStatus.COMPLETED:
        result.notes.append(
            f"{ENDED[session.status]}: {session.manifest.get('message') or 'it did not finish'}"
        )
    earlier = earlier_steps(session)
    if earlier is not None:
        result.notes.append(f"this session {earlier.sentence}")
    result.notes.extend(arm_notes(session))
    result.tuned.extend(_tuned_rows(estimate))
    result.notes.extend(tuning_notes(result.tuned))
    sparse = max(-(-len(instants.arm) // MOST_OF_THE_ARM), 1)
    arm = Arm.of(session.near(replace(instants, arm=instants.arm[::sparse])))
    norms = [
        metric
        for name in estimate.sensors
        for metric in _judge_sensor(session, estimate, name, steps, arm, result)
    ]
    if steps is not None and not steps:
        result.notes.append("no step of the protocol was finished, so there is nothing to judge")
    for name in estimate.joints:
        _judge_joint(session, estimate, name, steps or [], arm, result)
    result.outliers.extend(outlier_rows(result, estimate.behaviour))
    result.notes.extend(estimate.remarks)
    judge_chain(session, estimate, result)
    metrics, outcome = judge(session.analysis, summarise_metrics(result) + norms)
    result.notes.extend(
        f"{m.name} by {m.filter} has a limit but was not measured"
        for m in metrics
        if m.outcome is Outcome.NOT_MEASURED
    )
    result.notes.extend(
        f"{m.name} by {m.filter}{f', section {m.section},' if m.section else ''} is marginal and "
        "cannot pass, for the "
        f"uncertainty of the truth is not known: {m.no_uncertainty}"
        for m in metrics
        if m.outcome is Outcome.MARGINAL and m.no_uncertainty
    )
    if (
        session.status is not RunStatus.COMPLETED
    ):  # part of what was to be judged is missing: it cannot have passed
        outcome = max(outcome, Outcome.NOT_MEASURED, key=SEVERITY.index)
    return replace(result, metrics=metrics, outcome=outcome)


def _instants(session: Session, estimate: Estimate) -> Instants:
    """When each truth, and the arm, is asked for: at a sensor's own instants, and at those of the
    joints and chains.
    """
    wanted = {name: [sensor.host_time_ns] for name, sensor in estimate.sensors.items()}
    arm = []
    for name, joint in estimate.joints.items():
        defined = session.analysis.joints[name]
        arm.append(joint.host_time_ns)
        for sensor in (defined.proximal, defined.distal):
            wanted[sensor].append(joint.host_time_ns)
    arm += [chain.host_time_ns for chain in estimate.chain]
    arm = arm or [times[0] for times in list(wanted.values())[:1]]
    return Instants({name: united(times) for name, times in wanted.items()}, united(arm))


def _judge_sensor(
    session: Session,
    estimate: Estimate,
    name: str,
    steps: list[PlannedStep] | None,
    arm: Arm | None,
    result: Evaluation,
) -> list[Metric]:
    """Add a sensor's rows to the result; returns the metric of its accelerometer at rest."""
    sensor = estimate.sensors[name]
    result.notes.extend(f"{name}: {key} was left out: {why}" for key, why in sensor.skipped.items())
    result.notes.extend(
        f"{name}: {count} samples left out: {reason}"
        for reason, count in sensor.quality.items()
        if count
    )
    result.notes.extend(f"{name}: {remark}" for remark in sensor.remarks)
    rest = Rest.longest(session, name, sensor)
    result.noise.extend(noise_rows(name, rest))
    norm_error = norm_error_percent(rest)
    metrics = []
    if norm_error is not None:
        metrics.append(
            Metric(
                f"{name}.gravity_norm_error_percent",
                norm_error,
                "%",
                None,
                None,
                None,
                NORM_MEANING,
            )
        )
    samples = session.imu(name, every=sensor.every) if sensor.stored_calibration is None else None
    if samples is not None:
        result.gyroscope_bias.extend(bias_rows(name, sensor, samples, session.steps))
    truth, jumps = sound_truth(session, name)
    if truth is None:
        result.notes.append(f"{name}: no truth, so its orientation is not judged")
        return metrics
    result.notes.extend(
        [f"{name}: {jumps} orientations of the truth left out: jumps"] if jumps else []
    )
    wanted = session.analysis.estimate.euler_ranges
    result.euler_ranges.extend(euler_range_rows(name, sensor, truth, session.steps, wanted))
    errors = sensor_errors(name, sensor, truth, steps)
    result.series[f"orientation_{name}"] = errors.series()
    result.orientation.extend(sensor_rows(errors))
    defined = session.analysis.joints.values()
    if steps is not None and not any(
        name in {joint.proximal, joint.distal} for joint in defined
    ):  # else its joint tells
        known = np.isfinite(errors.q_true[:, 0])
        result.notes.extend(
            left_out_notes(name, steps, sensor.host_time_ns, sensor.static, known, ~sensor.flagged)
        )
    if errors.judged.any():
        true = TrueTurning.of(sensor.host_time_ns, errors.q_true)
        own = sensor_budgets(session, estimate, name, true, errors.judged, steps or [], arm)
        result.uncertainty.extend(own)
        result.orientation_summary.extend(summarise_sensor(errors, own, true))
        result.orientation_sweeps.extend(sweep_rows(errors))
        _add_ranking(result, *rank_sensor(errors))
        deviation = None if samples is None else field_deviation(errors, samples, session.steps)
        if deviation is not None:
            result.magnetic_field.extend(field_rows(errors, deviation))
            result.magnetic_errors.extend(field_error_rows(errors, deviation))
            result.magnetic_following.extend(following_rows(errors, deviation))
            result.series[f"magnetic_{name}"] = deviation.series(errors)
    return metrics


def _tuned_rows(estimate: Estimate) -> list[TunedRow]:
    """Of every filter that ran with tuned parameters."""
    return [
        TunedRow(
            key,
            {name: estimate.filter_parameters[key][name] for name in used.tuned},
            used.objective,
            used.tuned_utc,
            used.tuned_on,
            used.on_this_session,
        )
        for key, used in estimate.tuned.items()
    ]


def tuning_notes(rows: list[TunedRow]) -> list[str]:
    """What must be known of the errors of filters that were tuned, in sentences."""
    notes = []
    for row in rows:
        chosen = ", ".join(f"{name} {value:.4g}" for name, value in row.parameters.items())
        notes.append(
            f"{row.filter} ran with {chosen}, tuned for {row.objective} on "
            f"{', '.join(row.tuned_on)}"
        )
        if row.on_this_session:
            notes.append(
                f"{row.filter} was tuned on this session: its errors here are those of a fit, not "
                "of a test"
            )
    return notes


def _judge_joint(
    session: Session,
    estimate: Estimate,
    name: str,
    steps: list[PlannedStep],
    arm: Arm | None,
    result: Evaluation,
) -> None:
    """Add a joint's rows to the result."""
    errors = joint_errors(session, name, estimate, steps)
    if errors is None:
        result.notes.append(f"{name}: no truth, so its angle is not judged")
        return
    result.notes.extend(errors.notes)
    result.notes.extend(f"joint '{name}': {remark}" for remark in estimate.joints[name].remarks)
    result.series[f"joint_{name}"] = errors.series() | estimate.joints[name].heading_series()
    clock_sd = flexion_clock_sd(estimate, errors) if errors.steps else 0.0
    cycles = joint_cycles(errors)
    add_cycles(result, cycles)
    result.notes.extend(cycle_notes(f"joint '{name}'", [step for step, _ in errors.steps], cycles))
    rows = joint_rows(errors, clock_sd)
    result.joint_angle.extend(rows)
    own = joint_budgets(session, estimate, errors, arm)
    result.uncertainty.extend(own)
    summaries, ranks, comparisons = summarise_joint(errors, rows, own, clock_sd)
    result.joint_summary.extend(summaries)
    _add_ranking(result, ranks, comparisons)


def _add_ranking(result: Evaluation, ranks: list[RankRow], comparisons: list[Comparison]) -> None:
    result.ranking.extend(ranks)
    result.comparisons.extend(comparisons)
