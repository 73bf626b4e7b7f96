"""Metrics that sum a session up, their limits, and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import cast

import numpy as np

from testbench.evaluation.outcomes import (
    FEWEST_SESSIONS,
    guard_band,
    otherwise_percent,
    outcome_of,
)
from testbench.evaluation.repeatability import EqualSessions, key_of
from testbench.evaluation.uncertainty import coverage_factor
from testbench.records.results.evaluation import (
    SEVERITY,
    ChainRow,
    JointRow,
    Metric,
    Outcome,
    ResultTables,
)
from testbench.records.results.evaluation_rows import ErrorSummary, JointSummary
from testbench.records.specs.protocol import (
    JOINT_METRICS,
    SENSOR_METRICS,
    AcceptanceLimit,
    Analysis,
)
from testbench.records.specs.protocol_chain import CHAIN_METRICS, WHOLE_CHAIN

_POOL: dict[str, Callable[[list[JointRow]], float]] = {
    "flexion_mean_error_deg": lambda rows: float(
        np.mean([row.flexion_mean_error_deg for row in rows])
    ),
    "flexion_mean_abs_error_deg": lambda rows: float(
        np.mean([row.flexion_mean_abs_error_deg for row in rows])
    ),
    "flexion_rmse_deg": lambda rows: float(
        np.sqrt(np.mean([row.flexion_rmse_deg**2 for row in rows]))
    ),
    "flexion_max_abs_error_deg": lambda rows: max(row.flexion_max_abs_error_deg for row in rows),
}
_OF_ERRORS: dict[str, str] = {
    "flexion_median_error_deg": "median_error_deg",
    "flexion_iqr_deg": "iqr_deg",
    "flexion_p95_abs_error_deg": "p95_abs_error_deg",
    "flexion_latency_ms": "latency_ms",
    "flexion_convergence_s": "convergence_s",
}
"""Metrics of a joint, and where they stand in the summary of a section."""
_SD_OF_TIMES = {
    "flexion_latency_ms": "latency_sd_ms",
    "flexion_convergence_s": "convergence_sd_s",
}
"""Delays and times of a joint, and where their standard uncertainties stand."""
_CONFIDENCE = {
    "flexion_mean_error_deg": "mean_error_ci95_deg",
    "flexion_mean_abs_error_deg": "mean_abs_error_ci95_deg",
    "flexion_rmse_deg": "rmse_ci95_deg",
}
_OF_CHAIN: dict[str, Callable[[list[ChainRow]], float]] = {
    "angle_mean_error_deg": lambda rows: float(np.mean([row.mean_error_deg for row in rows])),
    "angle_mean_abs_error_deg": lambda rows: float(
        np.mean([row.mean_abs_error_deg for row in rows])
    ),
    "angle_rmse_deg": lambda rows: float(np.sqrt(np.mean([row.rmse_deg**2 for row in rows]))),
    "angle_max_abs_error_deg": lambda rows: max(abs(row.largest_error_deg) for row in rows),
    "angle_covered_percent": lambda rows: float(np.mean([row.covered_percent for row in rows])),
}
"""Metrics of a joint of the chain, or of all of them, every joint alike."""
_SIGNED = (
    "flexion_mean_error_deg",
    "flexion_median_error_deg",
    "heading_mean_error_deg",
    "angle_mean_error_deg",
)
"""Metrics in which errors of the truth average out as they do in the mean; in all others they add
to magnitudes.
"""
_OF_PARTS: dict[str, tuple[str, str, str | None]] = {
    "total_mean_error_deg": ("total", "mean_error_deg", "mean_error_ci95_deg"),
    "heading_mean_error_deg": ("heading", "mean_error_deg", "mean_error_ci95_deg"),
    "inclination_mean_error_deg": ("inclination", "mean_error_deg", "mean_error_ci95_deg"),
    "total_p95_error_deg": ("total", "p95_abs_error_deg", None),
    "total_rmse_deg": ("total", "rmse_deg", "rmse_ci95_deg"),
    "heading_rmse_deg": ("heading", "rmse_deg", "rmse_ci95_deg"),
    "inclination_rmse_deg": ("inclination", "rmse_deg", "rmse_ci95_deg"),
}
"""Metrics of a sensor: part of the orientation error, and its value and confidence in the
summary.
"""


def summarise_metrics(evaluation: ResultTables) -> list[Metric]:
    """Every metric of every filter, without limits.

    Joint metrics give each pose or sweep the same weight.
    """
    return _joint_metrics(evaluation) + _chain_metrics(evaluation) + _sensor_metrics(evaluation)


def _summarised(kind: str, own: list[JointSummary], whole: JointSummary | None) -> float | None:
    """A metric as the summaries of a section have it: angles over all steps, times by motion."""
    if whole and kind.endswith("_deg"):
        return cast("float | None", getattr(whole.errors, _OF_ERRORS[kind]))
    of_motion = _of_motion(kind, own)
    return None if of_motion is None else getattr(of_motion, _OF_ERRORS[kind])


def _of_motion(kind: str, own: list[JointSummary]) -> ErrorSummary | None:
    """The summary that knows a time: the delay belongs to sweeps, settling to poses."""
    known = (item.errors for item in own if getattr(item.errors, _OF_ERRORS[kind]) is not None)
    return next(known, None)


def _expanded_time(value_sd: float | None) -> tuple[float | None, str | None]:
    """Expanded uncertainty of a delay or a time, or why it has none.

    Args:
        value_sd: Its standard uncertainty in its unit, None or NaN where that is not known.
    """
    if value_sd is None or not np.isfinite(value_sd):
        return None, "too little was recorded to say how sure this time is"
    return coverage_factor(None) * value_sd, None


# One piece: most lines are the arguments of one metric.
def _joint_metrics(evaluation: ResultTables) -> list[Metric]:
    metrics = []
    lacking = _lacking(evaluation)
    summaries: dict[tuple[str, str, str, str], list[JointSummary]] = {}
    for item in evaluation.joint_summary:
        summaries.setdefault((item.joint, item.section, item.filter, item.sequence), []).append(
            item
        )

    by_place: dict[tuple[str, str, str, str], list[JointRow]] = {}
    for row in evaluation.joint_angle:
        by_place.setdefault((row.joint, row.section, row.filter, row.sequence), []).append(row)
    for place, rows in sorted(by_place.items()):
        own = summaries.get(place, [])
        joint, section, name, sequence = place
        whole = (
            own[0] if len(own) == 1 else next((item for item in own if item.motion == "all"), None)
        )
        for kind, meaning in JOINT_METRICS.items():
            value = _POOL[kind](rows) if kind in _POOL else _summarised(kind, own, whole)
            if value is None:
                continue
            expanded, missing = None, None
            if kind in _SD_OF_TIMES:
                expanded, missing = _expanded_time(
                    getattr(_of_motion(kind, own), _SD_OF_TIMES[kind])
                )
            elif own and has_uncertainty(kind):
                missing = lacking.get((joint, "flexion", section))
                expanded = (
                    own[0].expanded_uncertainty_deg
                    if kind in _SIGNED
                    else own[0].expanded_uncertainty_magnitude_deg
                )
            ci95 = (
                getattr(whole.errors, _CONFIDENCE[kind]) if whole and kind in _CONFIDENCE else None
            )
            metrics.append(
                Metric(
                    f"{joint}.{kind}",
                    value,
                    unit_of(kind),
                    None,
                    None,
                    None,
                    meaning,
                    name,
                    sequence,
                    section,
                    expanded,
                    ci95,
                    missing,
                    None
                    if whole is None or kind not in _CONFIDENCE or ci95
                    else whole.errors.no_interval,
                )
            )
    return metrics


def _chain_metrics(evaluation: ResultTables) -> list[Metric]:
    metrics = []
    lacking = _lacking(evaluation)
    for place in dict.fromkeys((row.section, row.state) for row in evaluation.chain):
        own = [row for row in evaluation.chain if (row.section, row.state) == place]
        groups = {WHOLE_CHAIN: own} | {row.joint: [row] for row in own}
        for joint, rows in groups.items():
            for kind, meaning in CHAIN_METRICS.items():
                signed = kind in _SIGNED
                if joint == WHOLE_CHAIN and signed:
                    continue
                known = [
                    row.expanded_uncertainty_deg
                    if signed
                    else row.expanded_uncertainty_magnitude_deg
                    for row in rows
                ]
                expanded = max((value for value in known if value is not None), default=None)
                why = [
                    lacking[key]
                    for row in rows
                    if (key := (row.joint, "angle", place[0])) in lacking
                ]
                metrics.append(
                    Metric(
                        f"{joint}.{kind}",
                        _OF_CHAIN[kind](rows),
                        unit_of(kind),
                        None,
                        None,
                        None,
                        meaning,
                        place[1],
                        None,
                        place[0],
                        expanded if has_uncertainty(kind) and None not in known else None,
                        no_uncertainty=why[0] if why and has_uncertainty(kind) else None,
                    )
                )
    return metrics


def _sensor_metrics(evaluation: ResultTables) -> list[Metric]:
    metrics = []
    lacking = _lacking(evaluation)
    found = {
        (item.sensor, item.filter, item.motion, item.part): item
        for item in evaluation.orientation_summary
    }
    for row in evaluation.orientation:
        for kind, meaning in SENSOR_METRICS.items():
            name = f"{row.sensor}.{kind}"
            if kind == "total_latency_ms":
                moving = found.get((row.sensor, row.filter, "dynamic", "total"))
                if moving is not None and moving.errors.latency_ms is not None:
                    metrics.append(_delay_metric(name, meaning, row.filter, moving.errors))
                continue
            part, attribute, confidence = _OF_PARTS[kind]
            item = found.get((row.sensor, row.filter, "all", part))
            value = getattr(row, kind, None) if item is None else getattr(item.errors, attribute)
            if value is None:
                continue
            expanded = ci95 = no_interval = None
            if item is not None:
                expanded = (
                    item.expanded_uncertainty_deg
                    if kind in _SIGNED
                    else item.expanded_uncertainty_magnitude_deg
                )
                if confidence:
                    ci95 = getattr(item.errors, confidence)
                    no_interval = item.errors.no_interval if ci95 is None else None
            metrics.append(
                Metric(
                    name,
                    value,
                    "deg",
                    None,
                    None,
                    None,
                    meaning,
                    row.filter,
                    expanded_uncertainty=expanded,
                    ci95=ci95,
                    no_uncertainty=lacking.get((row.sensor, part, None)),
                    no_interval=no_interval,
                )
            )
    return metrics


def _delay_metric(name: str, meaning: str, by: str, errors: ErrorSummary) -> Metric:
    """Of a sensor's orientation, by a filter."""
    expanded, missing = _expanded_time(errors.latency_sd_ms)
    metric = Metric(name, errors.latency_ms, "ms", None, None, None, meaning, by)
    return replace(metric, expanded_uncertainty=expanded, no_uncertainty=missing)


def _lacking(evaluation: ResultTables) -> dict[tuple[str, str, str | None], str]:
    """What the budgets that could not be completed lack, by owner, quantity and section."""
    return {
        (b.owner, b.quantity, b.section): "; ".join(b.notes)
        for b in evaluation.uncertainty
        if not b.complete
    }


def has_uncertainty(kind: str) -> bool:
    """Whether a metric answers to what the truth is off by; a spread about the median does not."""
    return unit_of(kind) == "deg" and kind != "flexion_iqr_deg"


def has_sign(kind: str) -> bool:
    """Whether a metric may be negative: means and medians of signed errors, and delays."""
    return kind in _SIGNED or kind.endswith("_latency_ms")


def unit_of(kind: str) -> str:
    """The unit of a metric, which its name ends with."""
    return kind.rpartition("_")[2]


def judge(
    analysis: Analysis, metrics: list[Metric], equal: Mapping[str, EqualSessions] | None = None
) -> tuple[list[Metric], Outcome]:
    """Put the protocol's limits to the metrics.

    Args:
        analysis: With the limits.
        metrics: Of the session.
        equal: Sessions that did the same, by the folder that a limit names.

    Returns:
        The judged metrics first, then those without a limit; and the worst outcome, not_measured
        where there is no limit.
    """
    judged = [
        judged_metric
        for limit in analysis.accept
        for judged_metric in _judge_limit(analysis, limit, metrics, equal or {})
    ]
    keys = {key_of(m) for m in judged}
    rest = [m for m in metrics if key_of(m) not in keys]
    outcomes = [metric.outcome for metric in judged if metric.outcome is not None]
    worst = max(outcomes, key=SEVERITY.index) if outcomes else Outcome.NOT_MEASURED
    return [*judged, *rest], worst


def _judge_limit(
    analysis: Analysis,
    limit: AcceptanceLimit,
    metrics: list[Metric],
    equal: Mapping[str, EqualSessions],
) -> list[Metric]:
    owner, _, kind = limit.metric.partition(".")
    sequence = (
        analysis.joints[owner].label if kind in JOINT_METRICS and owner in analysis.joints else None
    )
    matching = [
        metric
        for metric in metrics
        if metric.name == limit.metric
        and limit.filter in (None, metric.filter)
        and limit.section in (None, metric.section)
        and (sequence is None or (limit.sequence or sequence) == metric.sequence)
    ]
    if not matching:
        meaning = (JOINT_METRICS | SENSOR_METRICS | CHAIN_METRICS)[kind]
        absent = Metric(
            limit.metric, None, unit_of(kind), limit.min, limit.max, Outcome.NOT_MEASURED, meaning
        )
        return [replace(absent, filter=limit.filter, sequence=sequence, section=limit.section)]
    return [_judged(metric, limit, equal) for metric in matching]


def _judged(metric: Metric, limit: AcceptanceLimit, equal: Mapping[str, EqualSessions]) -> Metric:
    """A metric with its limits and verdict. Where its uncertainty ought to be stated and could not
    be, a limit that is kept is kept by nobody knows how much: marginal. One that is broken stays
    broken: that is the safe side.
    """
    guard, sessions = metric.expanded_uncertainty, 0
    sd = otherwise = None
    if limit.repeatability is not None:
        values = equal[limit.repeatability].values.get(key_of(metric), [])
        sessions = len(values)
        if sessions < FEWEST_SESSIONS:
            few = f"{sessions} equal {'session' if sessions == 1 else 'sessions'} in"
            lacking = f"{few} {limit.repeatability}, and {FEWEST_SESSIONS} are needed"
            known = [metric.no_uncertainty] if metric.no_uncertainty else []
            metric = replace(metric, no_uncertainty="; ".join([*known, lacking]))
        else:
            sd, guard = float(np.std(values, ddof=1)), guard_band(guard, values)
    outcome = outcome_of(metric.value, limit, guard)
    if outcome is Outcome.PASS and metric.no_uncertainty is not None:
        outcome = Outcome.MARGINAL
    if sd is not None and metric.no_uncertainty is None:
        otherwise = otherwise_percent(outcome, limit, guard, values)
    return replace(
        metric,
        lower=limit.min,
        upper=limit.max,
        outcome=outcome,
        sessions=sessions,
        session_sd=sd,
        otherwise_percent=otherwise,
    )
