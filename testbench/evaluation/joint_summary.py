"""Flexion errors of whole sections: with confidence, delay and settling, and the filters ranked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from testbench.evaluation.confidence import with_intervals
from testbench.evaluation.dynamics import angle_delay, settling_sd
from testbench.evaluation.flexion import JointErrors, Key
from testbench.evaluation.metrics import correlation, summarise
from testbench.evaluation.ranking import rank_filters
from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.model.statistics.memory import Layout, error_series, layout
from testbench.records.results.evaluation import JointRow
from testbench.records.results.evaluation_rows import (
    MEAN_MAGNITUDE,
    MEAN_SQUARE,
    Comparison,
    ErrorSummary,
    JointSummary,
    RankRow,
)
from testbench.records.results.uncertainty import UncertaintyBudget
from testbench.records.session.plan import PlannedStep

Judged = list[tuple[PlannedStep, np.ndarray]]
SHORT_SWEEP_S = 30.0
"""A section of one sweep that lasts less ranks nothing [s]: an offset that is there from its
beginning to its end is in every error of it, and no scatter shows it
(docs/uncertainty.md, Ranking).
"""


def summarise_joint(
    errors: JointErrors, rows: list[JointRow], budgets: list[UncertaintyBudget], time_sd: float
) -> tuple[list[JointSummary], list[RankRow], list[Comparison]]:
    """Summaries of every section, filter and sequence, and the ranking of the filters.

    They are ranked by the flexion in the joint's own sequence and by the total error, which sees
    headings where the flexion does not.

    Args:
        errors: Of the joint.
        rows: Its rows by step.
        budgets: Of the truth, by section.
        time_sd: Standard uncertainty of the flexion's time [s].
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
        summaries += _section_summaries(errors, section, own, budget, time_sd)
        ranked, compared = _section_ranking(errors, section, steps)
        ranks += ranked
        comparisons += compared
    return summaries, ranks, comparisons


def _section_summaries(
    errors: JointErrors,
    section: str,
    rows: list[JointRow],
    budget: UncertaintyBudget | None,
    time_sd: float,
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
        when = _layout(errors, judged)
        for key in errors.error:
            of_motion = [row for row in rows_of[key] if motion in ("all", _motion(row.kind))]
            found = _summary(errors, key, judged, of_motion, motion, when, time_sd)
            if motion != "dynamic":
                poses = [row for row in of_motion if row.kind != "sweep"]
                interval = median_interval(errors.time_ns) / NANOSECONDS
                found = _with_settling(found, poses, interval, time_sd)
            result.append(JointSummary(errors.name, *key, section, motion, found, *expanded))
    return result


def _section_ranking(
    errors: JointErrors, section: str, steps: list[tuple[PlannedStep, np.ndarray]]
) -> tuple[list[RankRow], list[Comparison]]:
    """Of the filters in a section, by the flexion and by the total error."""
    when = _layout(errors, steps)
    if when is None or one_short_sweep([step for step, _ in steps]):
        return [], []
    flexion = {
        name: np.degrees(error)
        for (name, label), error in errors.error.items()
        if label == errors.joint.label
    }
    own = {name: error_series(when, error) for name, error in flexion.items()}
    whole = {
        name: error_series(when, np.degrees(total), *([flexion[name]] if name in flexion else []))
        for name, total in errors.total.items()
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


def one_short_sweep(steps: Sequence[PlannedStep]) -> bool:
    """Whether a section is one sweep, too short to tell an offset from how errors scatter."""
    if len(steps) != 1 or steps[0].kind != "sweep":
        return False
    only = steps[0]
    return only.settled_ns - only.start_ns < SHORT_SWEEP_S * NANOSECONDS


def by_motion(steps: Judged) -> dict[str, Judged]:
    """Poses as "static", sweeps as "dynamic", and where there are both, "all" of them too."""
    static = [item for item in steps if _motion(item[0].kind) == "static"]
    dynamic = [item for item in steps if _motion(item[0].kind) == "dynamic"]
    groups = {"static": static, "dynamic": dynamic} | ({"all": steps} if static and dynamic else {})
    return {motion: judged for motion, judged in groups.items() if judged}


def _motion(kind: str) -> str:
    return "dynamic" if kind == "sweep" else "static"


def _layout(errors: JointErrors, judged: Judged) -> Layout | None:
    """When the errors of some steps count, every step alike."""
    return layout(errors.time_ns / NANOSECONDS, [rows for _, rows in judged], equally=True)


def _summary(
    errors: JointErrors,
    key: Key,
    judged: Judged,
    by_step: list[JointRow],
    motion: str,
    when: Layout | None,
    time_sd: float,
) -> ErrorSummary:
    """Of a section by one filter and sequence.

    Args:
        errors: Of the joint.
        key: Filter and sequence.
        judged: Steps of the section in which it moves so.
        by_step: What was found in each of them.
        motion: "static", "dynamic" or "all".
        when: Layout of these steps.
        time_sd: Standard uncertainty of the flexion's time [s].
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
    result = with_intervals(
        result, None if when is None else error_series(when, np.degrees(errors.error[key]))
    )
    if motion == "dynamic" and len(by_step) == len(judged) == 1:  # known from the sweep itself
        (row,) = by_step
        result = replace(result, latency_ms=row.latency_ms, latency_sd_ms=row.latency_sd_ms)
    elif motion == "dynamic":
        delay = angle_delay(
            errors.time_ns, errors.flexion[key], errors.reference, [rows for _, rows in judged]
        )
        if delay is not None:
            result = replace(
                result,
                latency_ms=1e3 * delay[0],
                latency_sd_ms=1e3 * float(np.hypot(delay[1], time_sd)),
            )
    return result


def _with_settling(
    summary: ErrorSummary, rows: list[JointRow], interval_s: float, time_sd: float
) -> ErrorSummary:
    times = [row.convergence_s for row in rows if row.convergence_s is not None]
    unsettled = len(rows) - len(times)
    if not times:
        return replace(summary, unsettled=unsettled)
    return replace(
        summary,
        convergence_s=float(np.median(times)),
        convergence_max_s=float(np.max(times)),
        convergence_sd_s=settling_sd(times, interval_s, time_sd),
        unsettled=unsettled,
    )
