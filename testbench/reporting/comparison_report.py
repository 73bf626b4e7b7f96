"""The report of a comparison of sessions: one HTML file that works offline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.results.comparison_words import (
    comparison_sentences,
    decimals_of,
    named,
    p_words,
)
from testbench.records.results.session_comparison import (
    ComparedMetric,
    ComparedSession,
    Overlay,
    SessionComparison,
    Told,
)
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Figure, scatter_rows, time_panels
from testbench.reporting.page.page import Block, Figures, Page, Section, Sentence
from testbench.reporting.page.palette import COLOURS, REFERENCE
from testbench.reporting.page.render import render_page
from testbench.reporting.page.tables import Cell, Row, Table, digits, header, label, number, text

BADGES = {Told.WORSE: "fail", Told.BETTER: "pass", Told.NOT_SHOWN: "pass"}
"""Colour of the badge of each outcome, and of each row; grey of the rest."""
GREY = "not_measured"
BASE, NEW, APART = "base", "new", "new less base"
PAIRED = {
    "step": "step by step",
    "cycle": "cycle by cycle",
    "sample": "sample by sample",
    "part": "part by part",
    "nothing": "not in pairs",
}
OF_MODELS = "models of the sensors", "models of the arm and of the sensors, not from real ones"
FOOTER = (
    "Differences are new minus base; positive where an error became larger. Errors are estimated "
    "minus true; angles in degrees."
)


def comparison_report(comparison: SessionComparison, path: Path) -> Path:
    """Write the page, and return its path.

    Args:
        comparison: Of two sides of sessions.
        path: Of the file.

    Raises:
        InputError: There is no such place.
        StorageError: The disk does not take it; an earlier page stays.
    """
    page = render_comparison(comparison)
    with stored_where_asked(path):
        write_text(path, page)
    return path


def render_comparison(comparison: SessionComparison) -> str:
    """The page as HTML."""
    drawn = _over_time(comparison)
    sections = [Section("metrics", "Metrics", [_metric_table(comparison)])]
    if drawn[1:]:
        sections.append(Section("errors", "Errors over time", list(drawn[1:])))
    sections.append(Section("differing", "What differs", [_differing(comparison)]))
    left_out = [Sentence(own) for own in comparison.left_out]
    sections.append(Section("sessions", "Sessions", [_sessions(comparison), *left_out]))
    return render_page(
        Page(
            kind="comparison",
            title=f"{named(comparison.new)} against {named(comparison.base)}",
            purpose="",
            outcome=_badge(comparison),
            verdict=comparison.verdict,
            simulated=OF_MODELS["arm" in comparison.simulated] if comparison.simulated else "",
            facts=_facts(comparison),
            tiles=[],
            sections=sections,
            answer=[*_sentences(comparison), *_forests(comparison), *drawn[:1]],
            footer=FOOTER,
        )
    )


def _facts(comparison: SessionComparison) -> list[tuple[str, str]]:
    margin = f"{comparison.margin:g}" if comparison.margin else "none: any difference counts"
    return [
        ("Base", named(comparison.base)),
        ("New", named(comparison.new)),
        ("Metrics", str(len(comparison.metrics))),
        ("Margin", margin),
        ("Level", "5 % for all metrics together (Holm)"),
    ]


def _sentences(comparison: SessionComparison) -> list[Block]:
    first, *others = comparison_sentences(comparison)
    return [Sentence(first, _badge(comparison)), *map(Sentence, others)]


def _badge(comparison: SessionComparison) -> str:
    """Its colour: amber of a good outcome where part of the metrics is not known."""
    colour = BADGES.get(comparison.told, GREY)
    return "marginal" if colour == "pass" and comparison.of(Told.NOT_KNOWN) else colour


def _forests(comparison: SessionComparison) -> list[Block]:
    """The differences beside one another, with their intervals: a figure for each unit."""
    figures = {}
    for unit in dict.fromkeys(metric.unit for metric in comparison.metrics):
        own = [m for m in comparison.metrics if m.unit == unit and m.difference is not None]
        if own:
            figures[f"difference of each metric [{unit}]"] = _forest(own, unit, comparison.margin)
    if not figures:
        return []
    beyond = "; dashed uprights are the margin" if comparison.margin else ""
    how = (
        "How to read: new less base. A circle is the difference, a line its 95 % confidence "
        "interval by itself; to the right of zero errors became larger. Red is worse and green "
        "better by the test of all metrics together, grey is not shown or not known"
        f"{beyond}."
    )
    return [Figures("Difference of each metric", figures, how)]


def _forest(metrics: Sequence[ComparedMetric], unit: str, margin: float) -> Figure:
    names = _names(metrics)
    shown = {Told.WORSE: COLOURS[4], Told.BETTER: COLOURS[2]}
    rows = {
        name: ([metric.difference or 0.0], (), tuple(metric.ci95 or ()))
        for name, metric in names.items()
    }
    colours = {name: shown.get(metric.told, REFERENCE) for name, metric in names.items()}
    figure = scatter_rows(rows, colours, f"new less base [{unit}]")
    figure["layout"]["xaxis"]["rangemode"] = "tozero"
    if margin:
        line = {"color": REFERENCE, "width": 1.5, "dash": "dash"}
        figure["layout"]["shapes"] = [
            {"type": "line", "xref": "x", "yref": "paper", "y0": 0, "y1": 1, "line": line}
            | {"x0": at, "x1": at}
            for at in (-margin, margin)
        ]
    return figure


def _names(metrics: Sequence[ComparedMetric]) -> dict[str, ComparedMetric]:
    """Metrics by names for figures, without what all of them have alike."""
    whole = [[m.name.partition(".")[0], m.filter or "", m.section or "", _kind(m)] for m in metrics]
    varies = [len({row[i] for row in whole}) > 1 for i in range(4)]
    varies[1] = True
    found: dict[str, ComparedMetric] = {}
    for metric, row in zip(metrics, whole, strict=True):
        parts = [part for part, kept in zip(row, varies, strict=True) if kept and part]
        found[", ".join(parts) or metric.name] = metric
    return found


def _kind(metric: ComparedMetric) -> str:
    return metric.name.rpartition(".")[2].replace("_", " ")


def _over_time(comparison: SessionComparison) -> list[Figures]:
    """The errors of both sides over one another, what was told worse first."""
    order = [Told.WORSE, Told.BETTER, Told.NOT_SHOWN, Told.NOT_KNOWN]
    drawn = sorted(
        comparison.overlays, key=lambda own: order.index(comparison.metrics[own.metric].told)
    )
    return [_overlaid(comparison.metrics[own.metric], own) for own in drawn]


def _overlaid(metric: ComparedMetric, overlay: Overlay) -> Figures:
    """The errors of one metric: those of both sides, and where both are one session their
    difference below.
    """
    sides = overlay.errors
    begins = {side: [time[0] for time, _ in own.values()] for side, own in sides.items()}
    time = max(
        (own for side in sides.values() for own, _ in side.values()),
        key=lambda own: own[-1] - own[0],
    )
    envelope = Envelope(time)
    errors: dict[str, np.ndarray] = {}
    colours = {APART: COLOURS[3]}
    single = all(len(side) == 1 for side in sides.values())
    for (side, own), colour in zip(sides.items(), COLOURS, strict=False):
        for (session, (at, error)), begin in zip(own.items(), begins[side], strict=True):
            name = side if single else f"{side}: {session}"
            shifted = at - begin + time[0]
            errors[name] = np.interp(time, shifted, error, left=np.nan, right=np.nan)
            colours[name] = colour
    panels = {"error [deg]": {name: envelope(own) for name, own in errors.items()}}
    if single:
        apart = np.abs(errors[NEW]) - np.abs(errors[BASE])
        panels["|new| less |base| [deg]"] = {APART: envelope(apart)}
    caption = f"Errors behind {metric.name} ({metric.place})"
    how = (
        "How to read: errors of both sides where they are evaluated, laid on one another from "
        "where the first evaluated sample is."
        + (" Below, by how much the magnitude of the new one is larger." if single else "")
    )
    figure = time_panels(envelope.time, panels, colours)
    return Figures(caption, {f"errors of both sides over time, {metric.place}": figure}, how)


def _metric_table(comparison: SessionComparison) -> Table:
    rows = []
    for metric in comparison.metrics:
        decimals = decimals_of(metric)
        ends = [digits(end, decimals) for end in metric.ci95 or ()]
        rows.append(
            Row(
                [
                    label(metric.name),
                    text(metric.filter),
                    text(metric.section),
                    number(metric.base, decimals),
                    number(metric.new, decimals),
                    number(metric.difference, decimals),
                    Cell(" to ".join(ends) or digits(None), kind="number"),
                    Cell(p_words(metric.p_holm) or digits(None), kind="number"),
                    text(PAIRED[metric.paired_by]),
                    Cell(metric.told.words, kind=f"badge {BADGES.get(metric.told, GREY)}"),
                ]
            )
        )
    titles = ("metric", "filter", "section", "base", "new", "difference", "95 %", "p (Holm)")
    columns = [*header(*titles, numbers_from=3), Cell("compared"), Cell("told")]
    how = (
        "How to read: difference and interval are of what was compared in pairs, of several "
        "sessions of their geometric means. p is the probability that no difference shows as "
        "much, corrected for all metrics (Holm 1979), or that one of the margin does, where that "
        "is larger; below 0.05 a difference is told."
    )
    units = " and ".join(dict.fromkeys(metric.unit for metric in comparison.metrics))
    return Table(f"Both sides of each metric [{units}]", columns, rows, how)


def _differing(comparison: SessionComparison) -> Block:
    if not comparison.differing:
        return Sentence("Nothing that the sessions state differs between both sides.")
    rows = [
        Row(
            [
                label(own.what),
                *(text("; ".join(values), kind="wide") for values in (own.base, own.new)),
            ]
        )
        for own in comparison.differing
    ]
    how = (
        "How to read: what the manifests state; of more than one value each is named once. A "
        "difference may come from any of these, and from what no manifest states."
    )
    return Table("What is not the same", header("what", BASE, NEW, numbers_from=3), rows, how)


def _sessions(comparison: SessionComparison) -> Table:
    rows = [
        _session_row(side, one)
        for side, sessions in ((BASE, comparison.base), (NEW, comparison.new))
        for one in sessions
    ]
    columns = header("session", "side", "part", "recorded (UTC)", "folder", numbers_from=5)
    return Table("What was compared", columns, rows, "", folded=len(rows) > 12)


def _session_row(side: str, one: ComparedSession) -> Row:
    recorded = (one.recorded or "")[:16].replace("T", " ")
    return Row(
        [
            label(one.session),
            text(side),
            text(one.part),
            text(recorded),
            Cell(one.folder, kind="code"),
        ]
    )
