"""The stage `evaluate`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation.arm_time import arm_notes
from testbench.evaluation.budgets import TrueArm, flexion_clock_sd, joint_budgets, sensor_budgets
from testbench.evaluation.chain import judge_chain
from testbench.evaluation.cycles import Found, cycle_notes, cycle_tables, joint_cycles
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.euler_ranges import euler_range_rows
from testbench.evaluation.field_following import following_rows
from testbench.evaluation.flexion import joint_errors, joint_rows
from testbench.evaluation.gyroscope_bias import bias_rows
from testbench.evaluation.joint_summary import summarise_joint
from testbench.evaluation.judged import sound_truth
from testbench.evaluation.left_out import left_out_notes
from testbench.evaluation.magnetic import (
    FieldDeviation,
    field_deviation,
    field_error_rows,
    field_rows,
)
from testbench.evaluation.noise import LongRest, noise_rows, norm_error_percent
from testbench.evaluation.orientation import (
    SensorErrors,
    rank_sensor,
    sensor_errors,
    sensor_rows,
    summarise_sensor,
    sweep_rows,
)
from testbench.evaluation.outliers import outlier_rows
from testbench.evaluation.verdict import judge, summarise_metrics
from testbench.model.reference_step import reference_warning
from testbench.records.disk.near import Instants, united
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import SEVERITY, Evaluation, Metric, Outcome, ResultTables
from testbench.records.results.evaluation_rows import TunedRow
from testbench.records.session.earlier_steps import earlier_steps
from testbench.records.session.layout import joint_table, magnetic_table, orientation_table
from testbench.records.session.plan import PlannedStep, judged_steps
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import RunStatus, Session

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
    sparse = max(-(-len(instants.arm) // MOST_OF_THE_ARM), 1)
    arm = TrueArm.of(session.near(replace(instants, arm=instants.arm[::sparse])))
    parts = [_bench_tables(session, estimate)]
    cycles: list[Found] = []
    norms: list[Metric] = []
    for name in estimate.sensors:
        rest = LongRest.longest(session, name, estimate.sensors[name])
        parts.append(ResultTables(noise=noise_rows(name, rest)))
        parts.append(_sensor_tables(session, estimate, name, steps, arm))
        norms += _norm_metrics(name, rest)
    if steps is not None and not steps:
        nothing = "no step of the protocol was finished, so there is nothing to judge"
        parts.append(ResultTables(notes=[nothing]))
    for name in estimate.joints:
        joint, found = _joint_tables(session, estimate, name, steps or [], arm)
        parts.append(joint)
        cycles += found
    outliers = outlier_rows(ResultTables.joined(parts), estimate.behaviour)
    parts.append(ResultTables(outliers=outliers, notes=estimate.remarks))
    chain, found = judge_chain(session, estimate)
    tables = ResultTables.joined([*parts, chain, cycle_tables(cycles + found)])
    metrics, outcome = judge(session.analysis, summarise_metrics(tables) + norms)
    tables = replace(tables, notes=tables.notes + _verdict_notes(metrics))
    if (
        session.status is not RunStatus.COMPLETED
    ):  # part of what was to be judged is missing: it cannot have passed
        outcome = max(outcome, Outcome.NOT_MEASURED, key=SEVERITY.index)
    return Evaluation(**vars(tables), session=session.name, metrics=metrics, outcome=outcome)


def _bench_tables(session: Session, estimate: Estimate) -> ResultTables:
    """What must be known of the run and of the filters, whatever they come to."""
    notes = list(session.manifest.plan.check.warnings)
    doubt = reference_warning(session.steps, session.analysis.estimate.align)
    if doubt is not None and doubt not in notes:  # else the plan has said so
        notes.append(doubt)
    if session.status is not RunStatus.COMPLETED:
        notes.append(f"{ENDED[session.status]}: {session.manifest.message or 'it did not finish'}")
    earlier = earlier_steps(session)
    if earlier is not None:
        notes.append(f"this session {earlier.sentence}")
    tuned = _tuned_rows(estimate)
    notes += arm_notes(session) + tuning_notes(tuned) + _set_notes(estimate)
    return ResultTables(notes=notes, tuned=tuned)


def _verdict_notes(metrics: list[Metric]) -> list[str]:
    """Why a metric with a limit was neither passed nor failed."""
    unmeasured = [
        f"{m.name} by {m.filter} has a limit but was not measured"
        for m in metrics
        if m.outcome is Outcome.NOT_MEASURED
    ]
    return unmeasured + [
        f"{m.name} by {m.filter}{f', section {m.section},' if m.section else ''} is marginal and "
        f"cannot pass, for the uncertainty of the truth is not known: {m.no_uncertainty}"
        for m in metrics
        if m.outcome is Outcome.MARGINAL and m.no_uncertainty
    ]


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


def _sensor_tables(
    session: Session,
    estimate: Estimate,
    name: str,
    steps: list[PlannedStep] | None,
    arm: TrueArm | None,
) -> ResultTables:
    """A sensor's rows and error signals."""
    sensor = estimate.sensors[name]
    notes = [f"{name}: {key} was left out: {why}" for key, why in sensor.skipped.items()]
    notes += [
        f"{name}: {count} samples left out: {reason}"
        for reason, count in sensor.quality.items()
        if count
    ]
    notes += [f"{name}: {remark}" for remark in sensor.remarks]
    samples = session.imu(name, every=sensor.every) if sensor.stored_calibration is None else None
    truth, jumps = sound_truth(session, name)
    if truth is None:
        notes.append(f"{name}: no truth, so its orientation is not judged")
    elif jumps:
        notes.append(f"{name}: {jumps} orientations of the truth left out: jumps")
    own = ResultTables(
        notes=notes,
        gyroscope_bias=[] if samples is None else bias_rows(name, sensor, samples, session.steps),
    )
    if truth is None:
        return own
    return ResultTables.joined(
        [own, *_orientation_tables(session, estimate, name, steps, arm, truth, samples)]
    )


def _orientation_tables(
    session: Session,
    estimate: Estimate,
    name: str,
    steps: list[PlannedStep] | None,
    arm: TrueArm | None,
    truth: Truth,
    samples: ImuSamples | None,
) -> list[ResultTables]:
    """What a sensor's orientations come to against the truth."""
    sensor = estimate.sensors[name]
    wanted = session.analysis.estimate.euler_ranges
    errors = sensor_errors(name, sensor, truth, steps)
    defined = session.analysis.joints.values()
    notes: list[str] = []
    if steps is not None and not any(
        name in {joint.proximal, joint.distal} for joint in defined
    ):  # else its joint tells
        known = np.isfinite(errors.q_true[:, 0])
        notes = left_out_notes(
            name, steps, sensor.host_time_ns, sensor.static, known, ~sensor.flagged
        )
    parts = [
        ResultTables(
            notes=notes,
            euler_ranges=euler_range_rows(name, sensor, truth, session.steps, wanted),
            orientation=sensor_rows(errors),
            series={orientation_table(name): errors.series()},
        )
    ]
    if not errors.judged.any():
        return parts
    true = TrueTurning.of(sensor.host_time_ns, errors.q_true)
    budgets = sensor_budgets(session, estimate, name, true, errors.judged, steps or [], arm)
    ranks, comparisons = rank_sensor(errors)
    parts.append(
        ResultTables(
            uncertainty=budgets,
            orientation_summary=summarise_sensor(errors, budgets, true),
            orientation_sweeps=sweep_rows(errors),
            ranking=ranks,
            comparisons=comparisons,
        )
    )
    deviation = None if samples is None else field_deviation(errors, samples, session.steps)
    if deviation is not None:
        parts.append(_magnetic_tables(name, errors, deviation))
    return parts


def _magnetic_tables(name: str, errors: SensorErrors, deviation: FieldDeviation) -> ResultTables:
    return ResultTables(
        magnetic_field=field_rows(errors, deviation),
        magnetic_errors=field_error_rows(errors, deviation),
        magnetic_following=following_rows(errors, deviation),
        series={magnetic_table(name): deviation.series(errors)},
    )


def _norm_metrics(name: str, rest: LongRest | None) -> list[Metric]:
    """The metric of a sensor's accelerometer at rest, where it was at rest."""
    error, label = norm_error_percent(rest), f"{name}.gravity_norm_error_percent"
    return [] if error is None else [Metric(label, error, "%", None, None, None, NORM_MEANING)]


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


def _set_notes(estimate: Estimate) -> list[str]:
    """Which parameters a person set for this estimate, in sentences."""
    notes = []
    for key, names in estimate.set_parameters.items():
        values = estimate.filter_parameters[key]
        chosen = ", ".join(f"{name} {values[name]:.4g}" for name in names)
        notes.append(f"{key} ran with {chosen}, set for this estimate")
    return notes


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


def _joint_tables(
    session: Session,
    estimate: Estimate,
    name: str,
    steps: list[PlannedStep],
    arm: TrueArm | None,
) -> tuple[ResultTables, list[Found]]:
    """A joint's rows and error signals, and its average cycles."""
    errors, joint = joint_errors(session, name, estimate, steps), estimate.joints[name]
    if errors is None:
        return ResultTables(notes=[f"{name}: no truth, so its angle is not judged"]), []
    clock_sd = flexion_clock_sd(estimate, errors) if errors.steps else 0.0
    cycles = joint_cycles(errors)
    rows = joint_rows(errors, clock_sd)
    budgets = joint_budgets(session, estimate, errors, arm)
    summaries, ranks, comparisons = summarise_joint(errors, rows, budgets, clock_sd)
    notes = errors.notes + [f"joint '{name}': {remark}" for remark in joint.remarks]
    notes += cycle_notes(f"joint '{name}'", [step for step, _ in errors.steps], cycles)
    tables = ResultTables(
        notes=notes,
        series={joint_table(name): errors.series() | joint.heading_series()},
        joint_angle=rows,
        uncertainty=budgets,
        joint_summary=summaries,
        ranking=ranks,
        comparisons=comparisons,
    )
    return tables, cycles
