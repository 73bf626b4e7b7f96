"""The section of the report that judges."""

from __future__ import annotations

from testbench.records.findings.finding import Severity
from testbench.records.results.evaluation import Evaluation, Metric
from testbench.reporting.page.page import Section, Sentence
from testbench.reporting.page.tables import (
    AGAIN,
    Cell,
    Row,
    Table,
    digits,
    label,
    number,
    text,
)
from testbench.reporting.sections.findings import finding_sentences
from testbench.reporting.sections.ranking import REPEATED, plus_minus

NOT_EVALUATED = "This session has not been evaluated: there is nothing to judge yet."
WALK_ALONE = (
    "The walk of this session is reported below, and judged there by what was typed of it; its "
    "orientations have not been evaluated."
)
SAID_BELOW = {"cycles.none_found"}
"""Findings that stand in place of the figures they are the lack of."""


def verdict_section(evaluation: Evaluation | None, walked: bool = False) -> Section:
    """Metrics that have limits, then the others.

    Args:
        evaluation: Of the session, or None.
        walked: Whether a walk was found in it, which is reported without an evaluation.
    """
    section = Section("verdict", "Verdict")
    if evaluation is None:
        section.blocks.append(Sentence(WALK_ALONE if walked else NOT_EVALUATED))
        return section
    judged = [metric for metric in evaluation.metrics if metric.outcome is not None]
    others = [metric for metric in evaluation.metrics if metric.outcome is None]
    if judged:
        section.blocks.append(
            _metrics(
                "Metrics with limits",
                judged,
                "How to read: pass keeps the limit even if the truth is off by U (its expanded "
                "uncertainty, 95 %: at the edge of a pass the truth breaks the limit once in 40, "
                "JCGM 106:2012, 8.3); fail breaks it even then; marginal lies between, or keeps it "
                "with less to spare than the protocol wants, or keeps it while U cannot be stated, "
                "and then its meaning says why; not measured could not be taken. The worst of them "
                "is the verdict on the sensors. It says nothing about the bench. The 95 % "
                f"confidence interval {REPEATED}",
            )
        )
    else:
        section.blocks.append(Sentence("No limits were stated, so nothing is passed or failed."))
    if others:
        section.blocks += _unlimited(others)
    section.blocks += finding_sentences(
        own
        for own in evaluation.findings
        if own.code not in SAID_BELOW
        and not (evaluation.judged and own.severity is Severity.WARNING)  # on the first screen
    )
    return section


def _unlimited(metrics: list[Metric]) -> list[Table]:
    """What has no limit: of filters one row a metric and place, one column a filter; then what is
    of no filter.
    """
    filters = list(dict.fromkeys(m.filter for m in metrics if m.filter is not None))
    places: dict[tuple[str, str | None, str | None], dict[str | None, Metric]] = {}
    for metric in metrics:
        place = (metric.name, metric.sequence, metric.section)
        places.setdefault(place, {})[metric.filter] = metric
    by_filter: list[Row] = []
    alone: list[Row] = []
    told: set[str] = set()
    for (name, sequence, section), own in places.items():
        first = next(iter(own.values()))
        keys = filters if first.filter is not None else [None]
        cells = [_with_both(own.get(key)) for key in keys]
        leading = [label(name), text(sequence), text(section)]
        meaning = text(first.meaning, kind=f"wide {AGAIN}" if first.meaning in told else "wide")
        row = Row([*leading, *cells, text(first.unit), meaning])
        (alone if first.filter is None else by_filter).append(row)
        told.add(first.meaning)
    reasons = dict.fromkeys(
        f"{what}: {why}"
        for metric in metrics
        for what, why in (("U", metric.no_uncertainty), ("interval", metric.no_interval))
        if why
    )
    lacking = f" What is not known ({'; '.join(reasons)}) is left out." if reasons else ""
    how = (
        "How to read: for information; no limit was set for them. Value ± U; in square brackets "
        f"the 95 % confidence interval, which {REPEATED}{lacking}"
    )
    tables = []
    for rows, titles in ((by_filter, filters), (alone, ["value"])):
        columns = [Cell("metric"), Cell("sequence"), Cell("section")]
        columns += [Cell(title, kind="number") for title in titles]
        columns += [Cell("unit"), Cell("meaning")]
        what = "Metrics without a limit" + (", of no filter" if rows is alone else "")
        if rows:  # those of filters stand in the tables of joints and orientations
            screen = rows is by_filter
            tables.append(Table(what, columns, rows, how, folded=True, screen=screen))
    return tables


def _with_both(metric: Metric | None) -> Cell:
    """Value, U and interval, as far as they are known."""
    if metric is None:
        return number(None)
    shown = plus_minus(metric.value, metric.expanded_uncertainty).text
    return Cell(
        shown if metric.ci95 is None else f"{shown} {_interval(metric).text}", kind="number"
    )


def _metrics(caption: str, metrics: list[Metric], how: str) -> Table:
    rows = []
    for metric in metrics:
        cells = [
            label(metric.name),
            *(text(value) for value in (metric.filter, metric.sequence, metric.section)),
        ]
        cells += [
            plus_minus(metric.value, metric.expanded_uncertainty),
            _interval(metric),
            text(metric.unit),
        ]
        if metric.outcome is not None:
            cells += [
                text(_limits(metric), kind="limit"),
                Cell(metric.outcome.words, kind=f"badge {metric.outcome.value}"),
            ]
        lacking = f" (no U: {metric.no_uncertainty})" if metric.no_uncertainty else ""
        lacking += f" (95 % CI: {metric.no_interval})" if metric.no_interval else ""
        lacking += _among_equals(metric)
        rows.append(Row([*cells, text(metric.meaning + lacking, kind="wide")]))
    titles = ["metric", "filter", "sequence", "section"]
    columns = [
        *(Cell(title) for title in titles),
        Cell("value ± U", kind="number"),
        Cell("95 % CI", kind="number"),
        Cell("unit"),
    ]
    columns += [Cell("limit"), Cell("outcome")]
    return Table(caption, [*columns, Cell("meaning")], rows, how)


def _among_equals(metric: Metric) -> str:
    """What equal sessions say of a verdict."""
    if metric.session_sd is None:
        return ""
    said = (
        f" (of {metric.sessions} equal sessions the standard deviation is "
        f"{digits(metric.session_sd, 2)} {metric.unit}, which is in the guard band"
    )
    if metric.otherwise_percent is not None:
        said += f"; a further one would come out otherwise in {metric.otherwise_percent:.0f} %"
    return f"{said})"


def _interval(metric: Metric) -> Cell:
    if metric.ci95 is None:
        return Cell("not known", kind="number") if metric.no_interval else number(None)
    return Cell(f"[{digits(metric.ci95[0], 3)}, {digits(metric.ci95[1], 3)}]", kind="number")


def _limits(metric: Metric) -> str:
    if metric.lower is not None and metric.upper is not None:
        return f"{metric.lower:g} to {metric.upper:g}"
    return f"≥ {metric.lower:g}" if metric.lower is not None else f"≤ {metric.upper:g}"
