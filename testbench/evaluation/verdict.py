"""Metrics that sum a session up, their limits, and the verdict."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

import numpy as np

from testbench.records.evaluation import SEVERITY, JointRow, Metric, OrientationRow, Outcome
from testbench.records.protocol import JOINT_METRICS, SENSOR_METRICS, AcceptanceLimit, Analysis

_POOL: dict[str, Callable[[list[JointRow]], float]] = {
    "flexion_mean_error_deg": lambda rows: float(np.mean([row.flexion_mean_error_deg for row in rows])),
    "flexion_mean_abs_error_deg": lambda rows: float(np.mean([row.flexion_mean_abs_error_deg for row in rows])),
    "flexion_rmse_deg": lambda rows: float(np.sqrt(np.mean([row.flexion_rmse_deg**2 for row in rows]))),
    "flexion_max_abs_error_deg": lambda rows: max(row.flexion_max_abs_error_deg for row in rows),
}


def summarise_metrics(joints: list[JointRow], orientations: list[OrientationRow]) -> list[Metric]:
    """Every metric of every filter, without limits; joint metrics give each pose or sweep the same weight."""
    metrics = []

    def key(row: JointRow) -> tuple[str, str, str, str]:
        return row.joint, row.section, row.filter, row.sequence

    for (joint, section, name, sequence), group in groupby(sorted(joints, key=key), key=key):
        rows = list(group)
        for kind, meaning in JOINT_METRICS.items():
            value = _POOL[kind](rows)
            metrics.append(Metric(f"{joint}.{kind}", value, "deg", None, None, None, meaning, name, sequence, section))
    for row in orientations:
        for kind, meaning in SENSOR_METRICS.items():
            metrics.append(Metric(f"{row.sensor}.{kind}", getattr(row, kind), "deg", None, None, None, meaning, row.filter))
    return metrics


def judge(analysis: Analysis, metrics: list[Metric]) -> tuple[list[Metric], Outcome]:
    """Put the protocol's limits to the metrics.

    Returns:
        The judged metrics first, then those without a limit; and the worst outcome, not_measured where there is no limit.
    """
    judged = [judged_metric for limit in analysis.accept for judged_metric in _judge_limit(analysis, limit, metrics)]
    keys = {(m.name, m.filter, m.sequence, m.section) for m in judged}
    rest = [m for m in metrics if (m.name, m.filter, m.sequence, m.section) not in keys]
    outcomes = [metric.outcome for metric in judged if metric.outcome is not None]
    worst = max(outcomes, key=SEVERITY.index) if outcomes else Outcome.NOT_MEASURED
    return [*judged, *rest], worst


def _judge_limit(analysis: Analysis, limit: AcceptanceLimit, metrics: list[Metric]) -> list[Metric]:
    owner, _, kind = limit.metric.partition(".")
    sequence = analysis.joints[owner].label if owner in analysis.joints else None
    matching = [
        metric
        for metric in metrics
        if metric.name == limit.metric
        and limit.filter in (None, metric.filter)
        and limit.section in (None, metric.section)
        and (sequence is None or (limit.sequence or sequence) == metric.sequence)
    ]
    if not matching:
        meaning = (JOINT_METRICS | SENSOR_METRICS)[kind]
        return [Metric(limit.metric, None, "deg", limit.min, limit.max, Outcome.NOT_MEASURED, meaning, limit.filter, sequence,
                       limit.section)]  # fmt: skip
    return [
        Metric(
            m.name,
            m.value,
            m.unit,
            limit.min,
            limit.max,
            outcome_of(m.value, limit),
            m.meaning,
            m.filter,
            m.sequence,
            m.section,
        )
        for m in matching
    ]


def outcome_of(value: float | None, limit: AcceptanceLimit) -> Outcome:
    """Fail beyond a limit; marginal within `marginal_percent` of it; else pass."""
    if value is None or not np.isfinite(value):
        return Outcome.NOT_MEASURED
    part = limit.marginal_percent / 100
    if (limit.max is not None and value > limit.max) or (limit.min is not None and value < limit.min):
        return Outcome.FAIL
    near_max = limit.max is not None and value > limit.max - part * abs(limit.max)
    near_min = limit.min is not None and value < limit.min + part * abs(limit.min)
    return Outcome.MARGINAL if near_max or near_min else Outcome.PASS
