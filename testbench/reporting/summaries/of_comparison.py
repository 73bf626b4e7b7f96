"""A comparison of sessions in short, each metric as a case."""

from __future__ import annotations

from testbench.records.results.comparison_words import (
    comparison_sentences,
    in_numbers,
    named,
    p_words,
)
from testbench.records.results.session_comparison import (
    ComparedMetric,
    SessionComparison,
    Told,
)
from testbench.reporting.summaries.summary import Case, Summary

COLUMNS = ["metric", "filter", "section", "base to new", "p (Holm)", "told"]


def comparison_summary(comparison: SessionComparison) -> Summary:
    """A comparison in short.

    Args:
        comparison: Of two sides of sessions.
    """
    sides = {"base": comparison.base, "new": comparison.new}
    facts = {name: ", ".join(one.session for one in side) for name, side in sides.items()}
    facts["simulated"] = " and ".join(comparison.simulated) or "nothing"
    return Summary(
        title=f"{named(comparison.new)} against {named(comparison.base)}",
        verdict=comparison.verdict,
        sentences=[*comparison_sentences(comparison), *comparison.left_out],
        columns=COLUMNS,
        rows=[_row(metric) for metric in comparison.metrics],
        cases=[_case(metric) for metric in comparison.metrics],
        facts=facts,
        started=comparison.new[0].recorded or "",
    )


def _row(metric: ComparedMetric) -> list[str]:
    where = [metric.name, metric.filter or "", metric.section or ""]
    return [*where, in_numbers(metric), p_words(metric.p_holm), metric.told.words]


def _case(metric: ComparedMetric) -> Case:
    name, message = f"{metric.name} [{metric.place}]", in_numbers(metric)
    if metric.told is Told.NOT_KNOWN:
        return Case(name, "skipped", f"{message}; not known: {metric.why}")
    worse = metric.told is Told.WORSE
    return Case(name, "failed" if worse else "passed", f"{message}: {metric.told.words}")
