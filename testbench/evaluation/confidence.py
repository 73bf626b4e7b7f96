"""Confidence intervals of the errors of a section, or why there are none."""

from __future__ import annotations

from dataclasses import replace

from testbench.model.statistics.memory import ErrorSeries, intervals
from testbench.records.results.evaluation_rows import ErrorSummary

TOO_SHORT = "not known from this session: too few samples were evaluated"


def with_intervals(summary: ErrorSummary, series: ErrorSeries | None) -> ErrorSummary:
    """A summary with the confidence intervals of its errors, or the reason why there are none.

    Args:
        summary: Without them.
        series: The errors in time; None for too few of them.
    """
    if series is None:
        return replace(summary, no_interval=TOO_SHORT)
    found = intervals(series)
    return replace(
        summary,
        mean_error_ci95_deg=found.mean,
        mean_abs_error_ci95_deg=found.absolute,
        rmse_ci95_deg=found.rms,
        blocks=found.memories,
        block_length=series.layout.pieces_in(found.memory_s),
        memory_s=found.memory_s,
        no_interval=found.reason,
    )
