"""Flexion errors of whole sections: with confidence, delay and settling, and the filters ranked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation.blocks import ErrorSeries, intervals, step_series
from testbench.evaluation.dynamics import angle_delay
from testbench.evaluation.flexion import JointErrors, Key
from testbench.evaluation.metrics import correlation, summarise
from testbench.evaluation.ranking import MEAN_MAGNITUDE, MEAN_SQUARE, rank_filters
from testbench.model.noise import random_stream
from testbench.records.evaluation import JointRow
from testbench.records.evaluation_rows import Comparison, ErrorSummary, JointSummary, RankRow
from testbench.records.plan import PlannedStep
from testbench.records.uncertainty import UncertaintyBudget

Judged = list[tuple[PlannedStep, np.ndarray]]


def summarise_joint(
    errors: JointErrors, rows: list[JointRow], budgets: list[UncertaintyBudget], clock_sd: float
) -> tuple[list[JointSummary], list[RankRow], list[Comparison]]:
    """Summaries of every section, filter and sequence; and the ranking of the filters, by the
    flexion in the joint's own sequence and by the total error, which sees headings where the
    flexion does not.

    Args:
        errors: Of the joint.
        rows: Its rows by step.
        budgets: Of the truth, by section.
        clock_sd: Standard uncertainty of the proximal sensor's time [s].
    """
    summaries: list[JointSummary] = []
    ranks: list[RankRow] = []
    comparisons: list[Comparison] = []
    for section, steps in errors.sections().items():
        budget = next(
            (item for item in budgets if item.owner == errors.name and item.section == section),
            None,
        )
        own: dict[str, ErrorSeries] = {}
        whole: dict[str, ErrorSeries] = {}
        for motion, judged in by_motion(steps).items():
            for key in errors.error:
                found = _summary(errors, key, judged, motion, clock_sd)
                settling = [
                    r
                    for r in rows
                    if r.section == section and (r.filter, r.sequence) == key and r.kind != "sweep"
                ]
                if motion != "dynamic":
                    found = _with_settling(found, settling)
                expanded = (
                    (None, None)
                    if budget is None
                    else (budget.expanded_deg, budget.expanded_magnitude_deg)
                )
                summaries.append(JointSummary(errors.name, *key, section, motion, found, *expanded))
        for (name, label), error in errors.error.items():
            series = _series(error, steps)
            if label == errors.joint.label and series is not None:
                own[name] = series
        for name, total in errors.total.items():
            series = _series(total, steps)
            if series is not None:
                whole[name] = series
        for sequence, criterion, judged_by in (
            (errors.joint.label, MEAN_MAGNITUDE, own),
            (None, MEAN_SQUARE, whole),
        ):
            if len(judged_by) > 1:
                ranked, compared = rank_filters(
                    errors.name, section, sequence, criterion, judged_by
                )
                ranks += ranked
                comparisons += compared
    return summaries, ranks, comparisons


def by_motion(steps: Judged) -> dict[str, Judged]:
    """Poses as "static", sweeps as "dynamic", and where there are both, "all" of them too."""
    static = [item for item in steps if item[0].kind != "sweep"]
    dynamic = [item for item in steps if item[0].kind == "sweep"]
    groups = {"static": static, "dynamic": dynamic} | ({"all": steps} if static and dynamic else {})
    return {motion: judged for motion, judged in groups.items() if judged}


def _series(error: np.ndarray, judged: Judged) -> ErrorSeries | None:
    moving = all(step.kind == "sweep" for step, _ in judged)
    return step_series(np.degrees(error), [rows for _, rows in judged], moving, equally=True)


def _summary(
    errors: JointErrors, key: Key, judged: Judged, motion: str, clock_sd: float
) -> ErrorSummary:
    every = np.concatenate([rows for _, rows in judged])
    error = np.degrees(errors.error[key])
    together = summarise(error[every])
    steps = [summarise(error[rows]) for _, rows in judged]
    result = ErrorSummary(
        n=together.n,
        steps=len(steps),
        mean_error_deg=float(np.mean([step.mean for step in steps])),
        mean_abs_error_deg=float(np.mean([step.mean_abs for step in steps])),
        rmse_deg=float(np.sqrt(np.mean([step.rmse**2 for step in steps]))),
        median_error_deg=together.median,
        iqr_deg=together.iqr,
        p95_abs_error_deg=together.p95_abs,
        max_abs_error_deg=together.max_abs,
        correlation=correlation(errors.flexion[key][every], errors.reference[every]),
    )
    series = _series(errors.error[key], judged)
    if series is not None:
        found = intervals(
            series, random_stream(0, errors.name, *key, judged[0][0].section, motion, "bootstrap")
        )
        result = replace(
            result,
            mean_error_ci95_deg=found.mean,
            mean_abs_error_ci95_deg=found.absolute,
            rmse_ci95_deg=found.rms,
            blocks=found.blocks,
            block_length=found.length,
        )
    if motion == "dynamic":
        delay = angle_delay(
            errors.time_ns, errors.flexion[key], errors.reference, [rows for _, rows in judged]
        )
        if delay is not None:
            result = replace(
                result,
                latency_ms=1e3 * delay[0],
                latency_sd_ms=1e3 * float(np.hypot(delay[1], clock_sd)),
            )
    return result


def _with_settling(summary: ErrorSummary, rows: list[JointRow]) -> ErrorSummary:
    times = [row.convergence_s for row in rows if row.convergence_s is not None]
    unsettled = len(rows) - len(times)
    if not times:
        return replace(summary, unsettled=unsettled)
    return replace(
        summary,
        convergence_s=float(np.median(times)),
        convergence_max_s=float(np.max(times)),
        unsettled=unsettled,
    )
