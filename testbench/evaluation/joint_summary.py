"""Flexion errors of whole sections: with confidence, delay and settling, and the filters ranked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation.dynamics import angle_delay
from testbench.evaluation.flexion import JointErrors, Key
from testbench.evaluation.metrics import correlation, summarise
from testbench.evaluation.ranking import MEAN_MAGNITUDE, MEAN_SQUARE, rank_filters
from testbench.model.noise import random_stream
from testbench.model.statistics.blocks import ErrorSeries, intervals, step_series
from testbench.records.results.evaluation import JointRow
from testbench.records.results.evaluation_rows import (
    Comparison,
    ErrorSummary,
    JointSummary,
    RankRow,
)
from testbench.records.results.uncertainty import UncertaintyBudget
from testbench.records.session.plan import PlannedStep

Judged = list[tuple[PlannedStep, np.ndarray]]


def summarise_joint(
    errors: JointErrors, rows: list[JointRow], budgets: list[UncertaintyBudget], clock_sd: float
) -> tuple[list[JointSummary], list[RankRow], list[Comparison]]:
    """Summaries of every section, filter and sequence, and the ranking of the filters.

    They are ranked by the flexion in the joint's own sequence and by the total error, which sees
    headings where the flexion does not.

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
        own = [row for row in rows if row.section == section]
        summaries += _section_summaries(errors, section, own, budget, clock_sd)
        ranked, compared = _section_ranking(errors, section, steps)
        ranks += ranked
        comparisons += compared
    return summaries, ranks, comparisons


def _section_summaries(
    errors: JointErrors,
    section: str,
    rows: list[JointRow],
    budget: UncertaintyBudget | None,
    clock_sd: float,
) -> list[JointSummary]:
    """Of every filter and sequence, over all steps of a section, at rest and in motion."""
    expanded = (
        (None, None) if budget is None else (budget.expanded_deg, budget.expanded_magnitude_deg)
    )
    rows_of: dict[Key, list[JointRow]] = {key: [] for key in errors.error}
    for row in rows:
        rows_of[row.filter, row.sequence].append(row)
    result = []
    for motion, judged in by_motion(errors.sections()[section]).items():
        for key in errors.error:
            of_motion = [row for row in rows_of[key] if motion in ("all", _motion(row.kind))]
            found = _summary(errors, key, judged, of_motion, motion, clock_sd)
            if motion != "dynamic":
                found = _with_settling(found, [row for row in of_motion if row.kind != "sweep"])
            result.append(JointSummary(errors.name, *key, section, motion, found, *expanded))
    return result


def _section_ranking(
    errors: JointErrors, section: str, steps: list[tuple[PlannedStep, np.ndarray]]
) -> tuple[list[RankRow], list[Comparison]]:
    """Of the filters in a section, by the flexion and by the total error."""
    own = {
        name: series
        for (name, label), error in errors.error.items()
        if label == errors.joint.label and (series := _series(error, steps)) is not None
    }
    whole = {
        name: series
        for name, total in errors.total.items()
        if (series := _series(total, steps)) is not None
    }
    ranks: list[RankRow] = []
    comparisons: list[Comparison] = []
    for sequence, criterion, judged_by in (
        (errors.joint.label, MEAN_MAGNITUDE, own),
        (None, MEAN_SQUARE, whole),
    ):
        if len(judged_by) > 1:
            ranked, compared = rank_filters(errors.name, section, sequence, criterion, judged_by)
            ranks += ranked
            comparisons += compared
    return ranks, comparisons


def by_motion(steps: Judged) -> dict[str, Judged]:
    """Poses as "static", sweeps as "dynamic", and where there are both, "all" of them too."""
    static = [item for item in steps if _motion(item[0].kind) == "static"]
    dynamic = [item for item in steps if _motion(item[0].kind) == "dynamic"]
    groups = {"static": static, "dynamic": dynamic} | ({"all": steps} if static and dynamic else {})
    return {motion: judged for motion, judged in groups.items() if judged}


def _motion(kind: str) -> str:
    return "dynamic" if kind == "sweep" else "static"


def _series(error: np.ndarray, judged: Judged) -> ErrorSeries | None:
    moving = all(step.kind == "sweep" for step, _ in judged)
    return step_series(np.degrees(error), [rows for _, rows in judged], moving, equally=True)


def _summary(
    errors: JointErrors,
    key: Key,
    judged: Judged,
    by_step: list[JointRow],
    motion: str,
    clock_sd: float,
) -> ErrorSummary:
    """Of a section by one filter and sequence.

    Args:
        errors: Of the joint.
        key: Filter and sequence.
        judged: Steps of the section in which it moves so.
        by_step: What was found in each of them.
        motion: "static", "dynamic" or "all".
        clock_sd: Standard uncertainty of the proximal sensor's time [s].
    """
    every = np.concatenate([rows for _, rows in judged])
    together = summarise(np.degrees(errors.error[key][every]))
    result = ErrorSummary(
        n=together.n,
        steps=len(by_step),
        mean_error_deg=float(np.mean([row.flexion_mean_error_deg for row in by_step])),
        mean_abs_error_deg=float(np.mean([row.flexion_mean_abs_error_deg for row in by_step])),
        rmse_deg=float(np.sqrt(np.mean([row.flexion_rmse_deg**2 for row in by_step]))),
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
