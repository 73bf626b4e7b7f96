"""The stage `evaluate`."""

from __future__ import annotations

import numpy as np

from testbench.evaluation.chain import evaluate_chain
from testbench.evaluation.euler_ranges import euler_range_rows
from testbench.evaluation.flexion import evaluate_joint
from testbench.evaluation.judged import judged_steps
from testbench.evaluation.noise import noise_rows, norm_error_percent
from testbench.evaluation.orientation import evaluate_sensor
from testbench.evaluation.verdict import judge, summarise_metrics
from testbench.model.truth import without_jumps
from testbench.records.estimate import Estimate
from testbench.records.evaluation import (
    SEVERITY,
    ChainRow,
    EulerRangeRow,
    Evaluation,
    JointRow,
    Metric,
    NoiseRow,
    OrientationRow,
    Outcome,
)
from testbench.records.samples import ImuSamples
from testbench.records.session import RunStatus, Session

NORM_MEANING = "error of the mean specific force at rest against standard gravity"


def evaluate(session: Session, estimate: Estimate) -> Evaluation:
    """Compare estimates with the truth and judge them by the protocol's limits.

    Args:
        session: The recording. estimate: What `estimate` made of it.
    """
    steps = judged_steps(session.steps) if session.has_protocol else None
    orientations: list[OrientationRow] = []
    joints: list[JointRow] = []
    series: dict[str, dict[str, np.ndarray]] = {}
    noise: list[NoiseRow] = []
    ranges: list[EulerRangeRow] = []
    metrics: list[Metric] = []
    notes = list(session.manifest.get("plan", {}).get("check", {}).get("warnings", []))
    if session.status is not RunStatus.COMPLETED:
        notes.append(f"the run was {session.status}: {session.manifest.get('message') or 'it did not finish'}")
    for name, sensor in estimate.sensors.items():
        notes += [f"{name}: {key} was left out: {why}" for key, why in sensor.skipped.items()]
        notes += [f"{name}: {count} samples left out: {reason}" for reason, count in sensor.quality.items() if count]
        notes += [f"{name}: {remark}" for remark in sensor.remarks]
        samples = session.imu(name)
        still = sensor.static & ~sensor.flagged
        noise += noise_rows(name, samples, sensor.host_time_ns, still)
        norm_error = norm_error_percent(samples, sensor.host_time_ns, still)
        if norm_error is not None:
            metrics.append(Metric(f"{name}.gravity_norm_error_percent", norm_error, "%", None, None, None, NORM_MEANING))
        truth = session.truth(name)
        if truth is None:
            notes.append(f"{name}: no truth, so its orientation is not judged")
            continue
        if truth.rate is None:
            truth, jumps = without_jumps(truth, _fastest(samples))
            notes += [f"{name}: {jumps} orientations of the truth left out: jumps"] if jumps else []
        rows, series[f"orientation_{name}"] = evaluate_sensor(name, sensor, truth, steps)
        orientations += rows
        ranges += euler_range_rows(name, sensor, truth, session.steps, session.analysis.estimate.euler_ranges)
    if steps is not None and not steps:
        notes.append("no step of the protocol was finished, so there is nothing to judge")
    arm = session.arm()
    for name in estimate.joints:
        rows_of_joint, columns = evaluate_joint(session, name, estimate, steps or [], arm)
        joints += rows_of_joint
        if columns:
            series[f"joint_{name}"] = columns
        else:
            notes.append(f"{name}: no truth, so its angle is not judged")
    notes += estimate.remarks
    chain: list[ChainRow] = []
    for one in estimate.chain:
        if arm is None:
            break
        chain_rows, series[one.key] = evaluate_chain(session, one, arm)
        chain += chain_rows
    metrics = summarise_metrics(joints, orientations) + metrics
    metrics, outcome = judge(session.analysis, metrics)
    notes += [f"{m.name} by {m.filter} has a limit but was not measured" for m in metrics if m.outcome is Outcome.NOT_MEASURED]
    if session.status is not RunStatus.COMPLETED:  # part of what was to be judged is missing: it cannot have passed
        outcome = max(outcome, Outcome.NOT_MEASURED, key=SEVERITY.index)
    return Evaluation(session.name, joints, orientations, metrics, outcome, notes, noise, ranges, series, chain)


def _fastest(samples: ImuSamples) -> float:
    """Largest angular rate that a sensor reported [rad/s]; 0 where it reports none."""
    rates = np.linalg.norm(samples.gyr, axis=1)
    return float(np.max(rates[np.isfinite(rates)], initial=0.0))
