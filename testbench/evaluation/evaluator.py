"""The stage `evaluate`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation.angle_errors import angle_error_rows, convention_findings
from testbench.evaluation.arm_time import DOUBTS as ARM_TIME_DOUBTS
from testbench.evaluation.arm_time import arm_findings
from testbench.evaluation.budgets import TrueArm, flexion_time_sd, joint_budgets, sensor_budgets
from testbench.evaluation.chain import judge_chain
from testbench.evaluation.cycles import Found, cycle_findings, cycle_tables, joint_cycles
from testbench.evaluation.differences import difference_tables
from testbench.evaluation.dynamics import TrueTurning
from testbench.evaluation.euler_ranges import euler_range_rows
from testbench.evaluation.field_following import following_rows
from testbench.evaluation.flexion import covered, joint_errors, joint_rows, whole_recording
from testbench.evaluation.gyroscope_bias import bias_rows
from testbench.evaluation.joint_summary import summarise_joint
from testbench.evaluation.judged import judgeable, sound_truth
from testbench.evaluation.left_out import left_out
from testbench.evaluation.magnetic import (
    field_deviation,
    field_error_rows,
    field_rows,
)
from testbench.evaluation.noise import LongRest, noise_of, norm_error_percent
from testbench.evaluation.orientation import (
    SensorErrors,
    lost_truth,
    rank_sensor,
    sensor_errors,
    sensor_rows,
    summarise_sensor,
    sweep_rows,
)
from testbench.evaluation.outliers import outlier_rows
from testbench.evaluation.repeatability import EqualSessions
from testbench.evaluation.time_lines import TimeDoubt
from testbench.evaluation.unjudged import (
    FoundCycle,
    found_cycle_tables,
    unjudged_joint,
    unjudged_sensor,
)
from testbench.evaluation.verdict import judge, summarise_metrics
from testbench.model.reference_step import reference_warning
from testbench.records.disk.free_memory import give_back
from testbench.records.disk.neighbouring_rows import Instants, united
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.answer import answers
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import SEVERITY, Evaluation, Metric, Outcome, ResultTables
from testbench.records.results.evaluation_rows import TunedRow
from testbench.records.session.earlier_steps import earlier_steps
from testbench.records.session.layout import (
    allan_table,
    joint_table,
    magnetic_table,
    orientation_table,
)
from testbench.records.session.manifest import ENDED
from testbench.records.session.plan import PlannedStep, judged_steps
from testbench.records.session.samples import Truth
from testbench.records.session.sensor_file import SensorFile
from testbench.records.session.session import RunStatus, Session
from testbench.records.specs.protocol import BodyJoint, Estimation

MOST_OF_THE_ARM = 200_000
"""Instants of a long campaign at which its budgets look at the arm."""
LEFT_OUT = {"after a gap": "judged.after_gap"}
"""Codes of findings on samples that were left out, by the reason, where one says more."""
NORM_MEANING = "error of the mean specific force at rest against standard gravity"


def evaluate(
    session: Session, estimate: Estimate, settings: Estimation | None = None
) -> Evaluation:
    """Compare estimates with the truth and judge them by the protocol's limits.

    What cannot be judged is described: how sensors and joints moved, and how far the filters lie
    apart.

    Args:
        session: The recording.
        estimate: What `estimate` made of it.
        settings: Sequence, comparison and return of what is described; the session's own if None.
    """
    whole = estimate
    estimate, unaligned = judgeable(estimate, session.analysis.joints)
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
        noise = noise_of(name, rest)
        curves = {allan_table(name): noise.curves} if noise.curves else {}
        parts.append(ResultTables(noise=noise.rows, series=curves))
        parts.append(_sensor_tables(session, estimate, name, steps, arm))
        parts.append(ResultTables(findings=unaligned.get(name, [])))
        give_back()
        norms += _norm_metrics(name, rest)
    if steps is not None and not steps:
        parts.append(ResultTables(findings=[finding("judged.no_step")]))
    judged = whole_recording(estimate) if steps is None else steps
    for name in estimate.joints:
        joint, found = _joint_tables(session, estimate, name, judged, arm)
        parts.append(joint)
        parts.append(ResultTables(findings=unaligned.get(f"joint '{name}'", [])))
        cycles += found
    parts.append(_described(session, whole, parts, settings or session.analysis.estimate))
    outliers = outlier_rows(ResultTables.joined(parts), estimate.behaviour)
    parts.append(ResultTables(outliers=outliers, findings=estimate.findings))
    chain, found = judge_chain(session, estimate)
    tables = ResultTables.joined([*parts, chain, cycle_tables(cycles + found)])
    if not (tables.orientation or tables.joint_angle or tables.chain):
        tables = replace(tables, findings=_nothing_judged(session, whole, tables.findings))
    named = {limit.repeatability for limit in session.analysis.accept if limit.repeatability}
    equal = {folder: EqualSessions.beside(session, folder) for folder in sorted(named)}
    metrics, outcome = judge(session.analysis, summarise_metrics(tables) + norms, equal)
    tables = replace(tables, findings=tables.findings + _unjudged(metrics))
    if (
        session.status is not RunStatus.COMPLETED
    ):  # part of what was to be judged is missing: it cannot have passed
        outcome = max(outcome, Outcome.NOT_MEASURED, key=SEVERITY.index)
    elif any(own.code in ARM_TIME_DOUBTS for own in tables.findings):
        outcome = max(outcome, Outcome.MARGINAL, key=SEVERITY.index)
    complete = Evaluation(**vars(tables), session=session.name, metrics=metrics, outcome=outcome)
    return replace(complete, headline=_headline(complete))


def _headline(evaluation: Evaluation) -> str:
    """The first sentence of what a session answers; empty where it answers nothing."""
    return next((answer.text for answer in answers(evaluation)), "")


def _described(
    session: Session, estimate: Estimate, parts: list[ResultTables], settings: Estimation
) -> ResultTables:
    """What is said of the sensors and joints that were not judged, and what is compared.

    Args:
        session: The recording.
        estimate: Of it, with what was not aligned to the truth.
        parts: What was judged.
        settings: Sequence, comparison and return.
    """
    judged = {row.sensor for part in parts for row in part.orientation}
    judged_joints = {row.joint for part in parts for row in part.joint_angle}
    found: list[ResultTables] = []
    cycles: list[FoundCycle] = []
    for name, sensor in estimate.sensors.items():
        if name not in judged:
            tables, own = unjudged_sensor(session, name, sensor, settings)
            found.append(tables)
            cycles += own
        elif settings.compare is not None:
            found.append(difference_tables(name, sensor, settings.compare))
    for name, joint in estimate.joints.items():
        if name not in judged_joints:
            tables, own = unjudged_joint(name, session.analysis.joints[name], joint)
            found.append(tables)
            cycles += own
    if settings.compare is not None:
        told = finding("comparison.no_truth", filter=settings.compare)
        found.append(ResultTables(findings=[told]))
    return ResultTables.joined([*found, found_cycle_tables(cycles)])


OF_NO_TRUTH = {"judged.no_truth", "judged.no_truth_of_joint"}
"""Findings of each sensor and joint that one of the whole session stands for."""
UNALIGNED = {"judged.not_aligned", "judged.joint_not_aligned", "judged.angles_not_aligned"}
"""Findings of what was not aligned to the truth."""


def _nothing_judged(session: Session, estimate: Estimate, findings: list[Finding]) -> list[Finding]:
    """The findings of a session in which nothing was judged, that and its cause said once."""
    causes = []
    known = [name for name in session.sensor_names if session.truth_file(name) is not None]
    if not known and not session.manifest.true_angles:
        causes.append("no truth is known of any sensor")
    if not any(sensor.orientation for sensor in estimate.sensors.values()):
        causes.append("no filter could run")
    if not causes and any(own.code in UNALIGNED for own in findings):
        causes.append("the truth could not be aligned to the sensors")
    cause = " and ".join(causes) or "no sample counts at which truth and estimate are known"
    told = [own for own in findings if own.code not in OF_NO_TRUTH]
    return [finding("judged.nothing", cause=cause), *told]


def _bench_tables(session: Session, estimate: Estimate) -> ResultTables:
    """What must be known of the run and of the filters, whatever they come to."""
    warned = session.manifest.plan.check.warnings
    found = [finding("plan.warning", text=text) for text in warned]
    doubt = reference_warning(session.steps, session.analysis.estimate.align)
    if doubt is not None and doubt not in warned:  # else the plan has said so
        found.append(finding("plan.reference", text=doubt))
    if session.status is not RunStatus.COMPLETED:
        message = session.manifest.message or "it did not finish"
        found.append(finding("run.incomplete", how=ENDED[session.status], message=message))
    earlier = earlier_steps(session)
    if earlier is not None:
        found.append(finding("run.resumed", goes_on=earlier.sentence))
    tuned = _tuned_rows(estimate)
    found += arm_findings(session) + tuning_findings(tuned) + _set_findings(estimate)
    return ResultTables(findings=found, tuned=tuned)


def _unjudged(metrics: list[Metric]) -> list[Finding]:
    """Why a metric with a limit was neither passed nor failed."""
    unmeasured = [
        finding("judged.unmeasured", metric=m.name, filter=str(m.filter))
        for m in metrics
        if m.outcome is Outcome.NOT_MEASURED
    ]
    return unmeasured + [
        finding(
            "judged.no_uncertainty",
            metric=m.name,
            filter=str(m.filter),
            section=f", section {m.section}," if m.section else "",
            why=m.no_uncertainty,
        )
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
    found = [
        finding("judged.filter_left_out", name, filter=key, why=why)
        for key, why in sensor.skipped.items()
    ]
    told = {own.values.get("reason") for own in sensor.findings if own.code.startswith("samples.")}
    found += [
        finding(LEFT_OUT.get(reason, "judged.samples_left_out"), name, count=count, reason=reason)
        for reason, count in sensor.quality.items()
        if count and reason.removeprefix("excluded: ") not in told
    ]
    found += [own.at(name) for own in sensor.findings]
    raw = session.sensor(name) if sensor.stored_calibration is None else None
    truth, jumps = sound_truth(session, name)
    if truth is None:
        found.append(finding("judged.no_truth", name))
    elif not sensor.orientation:
        truth = None
    elif jumps:
        found.append(finding("judged.truth_jumps", name, count=jumps))
    own = ResultTables(
        findings=found,
        gyroscope_bias=[] if raw is None else bias_rows(name, sensor, raw, session.steps),
    )
    if truth is None:
        return own
    return ResultTables.joined(
        [own, *_orientation_tables(session, estimate, name, steps, arm, truth, raw)]
    )


def _orientation_tables(
    session: Session,
    estimate: Estimate,
    name: str,
    steps: list[PlannedStep] | None,
    arm: TrueArm | None,
    truth: Truth,
    raw: SensorFile | None,
) -> list[ResultTables]:
    """What a sensor's orientations come to against the truth."""
    sensor = estimate.sensors[name]
    wanted = session.analysis.estimate.euler_ranges
    errors = sensor_errors(name, sensor, truth, steps)
    defined = session.analysis.joints.values()
    found: list[Finding] = []
    if steps is not None and not any(
        name in {joint.proximal, joint.distal} for joint in defined
    ):  # else its joint tells
        known = np.isfinite(errors.q_true[:, 0])
        found = left_out(name, steps, sensor.host_time_ns, sensor.static, known, ~sensor.left_out)
    lost = lost_truth(errors, truth)
    if steps is None and lost:
        count, samples_within = lost
        found.append(finding("judged.truth_lost", name, count=count, samples=samples_within))
    parts = [
        ResultTables(
            findings=found,
            euler_ranges=euler_range_rows(name, sensor, truth, session.steps, wanted),
            orientation=sensor_rows(errors),
            series={orientation_table(name): errors.series()},
        )
    ]
    if not errors.judged.any():
        return parts
    true = TrueTurning.of(sensor.host_time_ns, errors.q_true)
    doubt = TimeDoubt.of(session, estimate)
    budgets = sensor_budgets(session, estimate, name, true, errors.judged, steps or [], arm)
    ranks, comparisons = rank_sensor(errors)
    parts.append(
        ResultTables(
            findings=doubt.findings(name),
            uncertainty=budgets,
            orientation_summary=summarise_sensor(errors, budgets, true, doubt.sd(estimate, name)),
            orientation_sweeps=sweep_rows(errors),
            ranking=ranks,
            comparisons=comparisons,
        )
    )
    return parts if raw is None else [*parts, _magnetic_tables(errors, raw, session.steps)]


def _magnetic_tables(
    errors: SensorErrors, raw: SensorFile, steps: list[PlannedStep]
) -> ResultTables:
    """How far the field of a sensor was disturbed; nothing without a magnetometer.

    Args:
        errors: Of the sensor.
        raw: Its samples.
        steps: Of the session.
    """
    read = raw.quantities("mag", every=errors.estimate.every)
    deviation = field_deviation(errors, read.get("mag"), steps)
    if deviation is None:
        return ResultTables()
    return ResultTables(
        magnetic_field=field_rows(errors, deviation),
        magnetic_errors=field_error_rows(errors, deviation),
        magnetic_following=following_rows(errors, deviation),
        series={magnetic_table(errors.name): deviation.series(errors)},
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
            used.comparison,
        )
        for key, used in estimate.tuned.items()
    ]


def _set_findings(estimate: Estimate) -> list[Finding]:
    """Which parameters a person set for this estimate."""
    found = []
    for key, names in estimate.set_parameters.items():
        values = estimate.filter_parameters[key]
        chosen = ", ".join(f"{name} {values[name]:.4g}" for name in names)
        found.append(finding("filter.set", filter=key, parameters=chosen))
    return found


def tuning_findings(rows: list[TunedRow]) -> list[Finding]:
    """What must be known of the errors of filters that were tuned."""
    found = []
    for row in rows:
        chosen = ", ".join(f"{name} {value:.4g}" for name, value in row.parameters.items())
        found.append(
            finding(
                "filter.tuned",
                filter=row.filter,
                parameters=chosen,
                objective=row.objective,
                on=list(row.tuned_on),
            )
        )
        if row.comparison is not None:
            found.append(finding("filter.tuned_to", filter=row.filter, comparison=row.comparison))
        if row.on_this_session:
            found.append(finding("filter.tuned_here", filter=row.filter))
    return found


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
        where = f"joint '{name}'"
        unknown = joint.true_clock is None
        told = [finding("judged.no_truth_of_joint", where)] if unknown else []
        told += [own.at(where) for own in joint.findings]
        return ResultTables(findings=told), []
    time_sd = flexion_time_sd(session, estimate, errors) if errors.steps else 0.0
    cycles = joint_cycles(errors)
    rows = joint_rows(errors, time_sd)
    budgets = joint_budgets(session, estimate, errors, arm)
    summaries, ranks, comparisons = summarise_joint(errors, rows, budgets, time_sd)
    where = f"joint '{name}'"
    told = errors.findings + [own.at(where) for own in joint.findings] + covered(errors, joint)
    if errors.clock is not None:
        told += [own.at(where) for own in convention_findings(errors)]
    of_body = isinstance(errors.joint, BodyJoint)
    told += cycle_findings(where, [step for step, _ in errors.steps], cycles)
    tables = ResultTables(
        findings=told,
        series={joint_table(name): errors.series() | joint.heading_series()},
        joint_angle=rows,
        uncertainty=budgets,
        joint_summary=summaries,
        angle_errors=angle_error_rows(errors) if of_body else [],
        ranking=ranks,
        comparisons=comparisons,
    )
    return tables, cycles
