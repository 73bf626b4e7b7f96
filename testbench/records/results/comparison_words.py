"""What a comparison of sessions answers, in sentences that report, terminal and summaries share."""

from __future__ import annotations

from pathlib import Path

from testbench.records.results.answer import listed, subject
from testbench.records.results.numbers import decimals_by
from testbench.records.results.session_comparison import (
    ComparedMetric,
    ComparedSession,
    Differing,
    SessionComparison,
    Told,
)

LEAST_DECIMALS = 2
"""Of values whose standard error is not known."""
SMALLEST_P = 0.001
"""A smaller probability is told to be below this."""
MOST_TOLD = 6
MOST_UNKNOWN = 2
"""Metrics that differ are told one by one up to so many, and those of which nothing is known."""


def comparison_sentences(comparison: SessionComparison) -> list[str]:
    """The answer: what is shown, what is not known, and what differs.

    Args:
        comparison: Of two sides of sessions.
    """
    told = [_headline(comparison)]
    shown = [*comparison.of(Told.WORSE), *comparison.of(Told.BETTER)]
    told += [f"{metric_sentence(metric)}." for metric in shown[:MOST_TOLD]]
    if len(shown) > MOST_TOLD:
        told.append(f"{len(shown) - MOST_TOLD} more differ; the table has them.")
    unknown: dict[str, list[ComparedMetric]] = {}
    for metric in comparison.of(Told.NOT_KNOWN):
        unknown.setdefault(metric.why or "", []).append(metric)
    for why, metrics in unknown.items():
        few = metrics[:MOST_UNKNOWN] if len(metrics) > MOST_UNKNOWN + 1 else metrics
        names = [f"{m.name} ({m.place})" for m in few]
        more = len(metrics) - len(few)
        whose = listed([*names, *([f"{more} more"] if more else [])])
        told.append(f"Not known of {whose}: {why}.")
    told.append(differing_sentence(comparison.differing))
    return told + comparison.notes


def _headline(comparison: SessionComparison) -> str:
    """How many metrics became worse, and how many better."""
    tested = [m for m in comparison.metrics if m.told is not Told.NOT_KNOWN]
    sides = f"{named(comparison.new)} against {named(comparison.base)}"
    beyond = f" by more than the margin of {comparison.margin:g}" if comparison.margin else ""
    if not tested:
        return f"{sides}: nothing could be told of {_metrics(len(comparison.metrics))}."
    worse, better = len(comparison.of(Told.WORSE)), len(comparison.of(Told.BETTER))
    unknown = len(comparison.metrics) - len(tested)
    verb = "is" if unknown == 1 else "are"
    also = f"; {unknown} of {len(comparison.metrics)} {verb} not known" if unknown else ""
    if not worse and not better:
        return f"{sides}: no difference{beyond} is shown in {_metrics(len(tested))}{also}."
    parts = [
        f"{count} of {_metrics(len(tested))} {'is' if count == 1 else 'are'} {what}{beyond}"
        for count, what in ((worse, "worse"), (better, "better"))
        if count
    ]
    return f"{sides}: {' and '.join(parts)}{also}."


def _metrics(count: int) -> str:
    return f"{count} metric{'' if count == 1 else 's'}"


def named(side: list[ComparedSession]) -> str:
    """A side of a comparison in a few words: its session, or how many and in which folder."""
    if len(side) == 1:
        return side[0].session
    folders = {Path(one.folder).resolve().parent.name for one in side}
    return f"{len(side)} sessions" + (f" of {folders.pop()}" if len(folders) == 1 else "")


def metric_sentence(metric: ComparedMetric) -> str:
    """Both values of a metric, their difference and its interval."""
    return f"{subject(metric, metric.filter)} {in_numbers(metric)}: {metric.told.words}"


def in_numbers(metric: ComparedMetric) -> str:
    """Both values and the difference with its interval, to two digits of its standard error."""
    unit = metric.unit
    decimals = decimals_of(metric)
    values = f"{metric.base:.{decimals}f} to {metric.new:.{decimals}f} {unit}"
    if metric.difference is None or metric.ci95 is None:
        return values
    low, high = metric.ci95
    return (
        f"{values}, difference {metric.difference:+.{decimals}f} {unit} "
        f"(95 %: {low:+.{decimals}f} to {high:+.{decimals}f})"
    )


def p_words(p: float | None) -> str:
    """A probability as people read it; empty where there is none."""
    if p is None:
        return ""
    return f"{p:.3f}" if p >= SMALLEST_P else f"< {SMALLEST_P:g}"


def decimals_of(metric: ComparedMetric) -> int:
    """Decimals of a metric's values: two digits of its standard error, of itself without one."""
    decimals = decimals_by(metric.standard_error)
    if decimals is None:
        return max(decimals_by(abs(metric.base)) or 0, LEAST_DECIMALS)
    return decimals


def differing_sentence(differing: list[Differing]) -> str:
    """What is not the same on both sides, in a sentence."""
    if not differing:
        return "Nothing that the sessions state differs between both sides."
    told = [f"{own.what} ({_values(own.base)} to {_values(own.new)})" for own in differing]
    return f"What differs: {'; '.join(told)}."


def _values(values: list[str]) -> str:
    return " or ".join(values) if len(values) <= 2 else f"{len(values)} of them"
