"""The certificate of a test: errors of joint angles and orientations, and the limits they keep."""

from __future__ import annotations

from collections.abc import Sequence

from testbench.exceptions import InputError
from testbench.records.results.answer import answers, headline_metrics, limits_of, listed
from testbench.records.results.certificate import (
    Figure,
    FigureCurve,
    ResultRow,
    ResultTable,
)
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation, Metric
from testbench.records.results.quantity import Quantity, rounding
from testbench.records.session.session import Session
from testbench.reporting.certificate import words
from testbench.reporting.certificate.parts import Parts, shortened
from testbench.reporting.certificate.statements import truth_references, weighty
from testbench.reporting.sections.run import simulated_parts

MOST_ROWS = 24
"""Metrics without a limit of which a certificate tells; of more it names the number."""
DEVICE = "device"
"""The orientation that a sensor computes itself; simulated sensors have an error model of it."""
K = 1.96
"""Coverage factor of delays and settling times, whose standard uncertainty is their own."""
UNSTATED = "no uncertainty is stated of a metric of this kind"


def performance_parts(session: Session, estimate: Estimate, evaluation: Evaluation) -> Parts:
    """What a certificate of a test says.

    Args:
        session: The recording.
        estimate: Of its orientations.
        evaluation: Of that.

    Raises:
        InputError: Nothing of it was held against a truth.
    """
    if not evaluation.judged:
        why = " ".join(evaluation.notes[:3])
        raise InputError(
            f"{session.path}: nothing was held against a truth, so there is no test to certify. "
            f"{why}".rstrip()
        )
    limited = [metric for metric in evaluation.metrics if metric.outcome is not None]
    others = [metric for metric in headline_metrics(evaluation) if metric not in limited]
    if not limited and not others:  # a chain alone
        others = [metric for metric in evaluation.metrics if metric.value is not None]
    tables = [_table("Metrics with a limit", evaluation, limited)] if limited else []
    if others:
        left = len(others) - MOST_ROWS
        more = [f"{left} more of this kind are in evaluation.json."] if left > 0 else []
        tables.append(_table("Metrics without a limit", evaluation, others[:MOST_ROWS], more))
    shown = [*limited, *others[:MOST_ROWS]]
    drawn = [metric for metric in limited or others if metric.unit == "deg"]
    return Parts(
        title=words.PERFORMANCE_TITLE,
        summary=[own.text for own in answers(evaluation)],
        procedure=_procedure(session, estimate, evaluation),
        results=tables,
        figures=_figures(evaluation, drawn[:MOST_ROWS]),
        findings=weighty([*session.manifest.findings, *evaluation.findings]),
        uncertainty=[words.PERFORMANCE_UNCERTAINTY],
        references=truth_references(session),
        not_claimed=_not_claimed(session, evaluation),
        conformity=[_decision_rule(evaluation)] if limited else [words.NO_LIMITS],
        untraceable="" if any(m.expanded_uncertainty for m in shown) else words.UNKNOWN_TRUTH,
    )


def _table(
    title: str, evaluation: Evaluation, metrics: Sequence[Metric], notes: Sequence[str] = ()
) -> ResultTable:
    meanings = dict.fromkeys(f"{_words(m)[1].capitalize()}: {m.meaning}." for m in metrics)
    limited = any(metric.outcome is not None for metric in metrics)
    return ResultTable(
        title=title,
        of=["of", "metric", "filter", "where"],
        columns=["value ± U"],
        more=["k", "95 % interval", *(["limit"] if limited else [])],
        rows=[_row(evaluation, metric, limited) for metric in metrics],
        notes=[*meanings, *_reasons(metrics), *notes],
    )


def _row(evaluation: Evaluation, metric: Metric, limited: bool) -> ResultRow:
    k = factor_of(evaluation, metric)
    lacking = metric.no_uncertainty or ""
    if metric.expanded_uncertainty is None:
        lacking = lacking or ("it was not measured" if metric.value is None else UNSTATED)
    return ResultRow(
        of=[*_words(metric), metric.filter or "–", _where(metric) or "the whole session"],
        key=metric.name,
        unit=metric.unit,
        quantities=[Quantity.of(metric.value, metric.expanded_uncertainty, k, lacking)],
        more=[
            "–" if k is None else f"{k:.2f}",
            _interval(metric),
            *([limits_of(metric)] if limited else []),
        ],
        outcome="" if metric.outcome is None else metric.outcome.words,
    )


def _words(metric: Metric) -> tuple[str, str]:
    """Whose a metric is, and its name without its unit, in words."""
    owner, _, kind = metric.name.rpartition(".")
    return owner, kind.removesuffix(f"_{metric.unit}").replace("_", " ")


def _where(metric: Metric) -> str:
    return ", ".join(part for part in (metric.section, metric.sequence) if part)


def factor_of(evaluation: Evaluation, metric: Metric) -> float | None:
    """The coverage factor of a metric's U: that of the budget it is from; None without a U.

    Args:
        evaluation: Of the session.
        metric: One of its metrics.
    """
    expanded = metric.expanded_uncertainty
    if expanded is None:
        return None
    owner = metric.name.rpartition(".")[0]
    own = [budget for budget in evaluation.uncertainty if budget.owner == owner]
    for budget in own or evaluation.uncertainty:
        if expanded == budget.expanded_deg:
            return budget.coverage_factor
        if expanded == budget.expanded_magnitude_deg:
            return budget.coverage_factor_magnitude
    return K


def _interval(metric: Metric) -> str:
    """The interval of a metric, no finer than its value is shown."""
    if metric.ci95 is None or metric.value is None:
        return "–"
    rounded = rounding(metric.value, metric.expanded_uncertainty or metric.value)
    low, high = (rounded.words(end) for end in metric.ci95)
    return f"{low} to {high}"


def _reasons(metrics: Sequence[Metric]) -> list[str]:
    """Why uncertainties and intervals are not there, and what equal sessions say."""
    told = []
    lacking: dict[str, list[str]] = {}
    for metric in metrics:
        if metric.no_uncertainty:
            lacking.setdefault(metric.no_uncertainty, []).append(metric.filter or metric.name)
        if metric.otherwise_percent is not None:
            told.append(
                words.OTHERWISE.format(
                    metric=_words(metric)[1],
                    filter=metric.filter,
                    sessions=metric.sessions,
                    percent=metric.otherwise_percent,
                )
            )
    told += [
        words.NO_U.format(filters=listed(dict.fromkeys(own)), why=why)
        for why, own in lacking.items()
    ]
    if any(metric.ci95 is None for metric in metrics):
        told.append(words.NO_INTERVAL_KNOWN)
    return told


def _procedure(session: Session, estimate: Estimate, evaluation: Evaluation) -> list[str]:
    """Motion, filters with their parameters, stored calibrations."""
    told = []
    if session.has_protocol:
        protocol = session.manifest.protocol.name
        told.append(words.MOVED.format(protocol=protocol, steps=len(session.steps)))
    else:
        told.append(words.CAME_WITH_TRUTH)
    ran = dict.fromkeys(metric.filter for metric in evaluation.metrics if metric.filter)
    shown = [_with_parameters(name, estimate.filter_parameters.get(name, {})) for name in ran]
    told.append(words.BY_FILTERS.format(filters="; ".join(shown)))
    for name, sensor in estimate.sensors.items():
        stored = sensor.stored_calibration
        if stored:
            told.append(words.CORRECTED_FIRST.format(sensor=name, session=stored.get("session")))
    if any(name in estimate.tuned for name in ran):
        tuned = ", ".join(name for name in ran if name in estimate.tuned)
        told.append(words.TUNED.format(filters=tuned))
    return told


def _with_parameters(name: str, parameters: dict[str, float]) -> str:
    shown = ", ".join(f"{key} {value:g}" for key, value in parameters.items())
    return f"{name} ({shown})" if shown else name


def _not_claimed(session: Session, evaluation: Evaluation) -> list[str]:
    """What was not judged."""
    told = []
    judged = {row.sensor for row in evaluation.orientation}
    left = [name for name in session.sensor_names if name not in judged]
    if left:
        told.append(f"Orientation of {', '.join(left)}: not evaluated.")
    angles = {row.joint for row in evaluation.joint_angle}
    joints = [name for name in session.analysis.joints if name not in angles]
    if joints:
        told.append(f"Angles of {', '.join(joints)}: not evaluated.")
    lacking = [n for n, own in session.manifest.sensors.items() if not own.magnetometer]
    if lacking:
        told.append(f"Magnetometer of {', '.join(lacking)}: not observed; there is none.")
    by = {metric.filter for metric in evaluation.metrics}
    if simulated_parts(session) and DEVICE in by:
        told.append(words.ERROR_MODEL)
    return [
        *told,
        words.OWN_QUANTITIES,
        words.OTHER_MOTIONS,
    ]


def _decision_rule(evaluation: Evaluation) -> str:
    """How limits are judged (ISO/IEC 17025:2017, 7.8.6)."""
    rule = words.DECISION_RULE.format(outcome=evaluation.verdict)
    if any(metric.session_sd is not None for metric in evaluation.metrics):
        rule += f" {words.EQUAL_SESSIONS}"
    return rule


def _figures(evaluation: Evaluation, metrics: Sequence[Metric]) -> list[Figure]:
    """Values with their U, and the limits."""
    known = [metric for metric in metrics if metric.value is not None]
    if not known:
        return []
    values = [metric.value or 0.0 for metric in known]
    halves = [metric.expanded_uncertainty or 0.0 for metric in known]
    ends = [
        [value + sign * half for value, half in zip(values, halves, strict=True)]
        for sign in (-1, 1)
    ]
    return [
        Figure(
            title="Values with their U" + (" and their limits" if evaluation.limited else ""),
            kind="intervals",
            x_title="deg",
            y_title="",
            curves=[
                FigureCurve(
                    name="value ± U",
                    x=[float(i) for i in range(len(known))],
                    y=shortened(values),
                    lower=shortened(ends[0]),
                    upper=shortened(ends[1]),
                )
            ],
            rows=[", ".join(p for p in (*_words(m), m.filter, m.section) if p) for m in known],
            limits=[[end for end in (m.lower, m.upper) if end is not None] for m in known],
        )
    ]
