"""The section of the report on how far the truth itself may be off."""

from __future__ import annotations

import numpy as np

from testbench.records.results.evaluation import Evaluation
from testbench.records.results.uncertainty import UncertaintyBudget
from testbench.records.session.session import Session
from testbench.reporting.page.distributions import stacked_squares
from testbench.reporting.page.page import Block, Figures, Folded, Section, Sentence
from testbench.reporting.page.tables import (
    AGAIN,
    NOTHING,
    Cell,
    Row,
    Table,
    digits,
    header,
    label,
    number,
    significant,
    text,
)

OF_JOINTS = ("flexion", "angle")
MOST_COLUMNS = 8
"""Budgets beside one another in a table."""
MOST_SOURCES = 5
"""Bars of a budget; what other sources add is one bar."""
USES = ("of a mean error", "of mean magnitudes")
MOST_BUDGETS = 4
"""Budgets of one quantity that stand one below the other; more are folded into one."""


def uncertainty_section(evaluation: Evaluation, session: Session) -> Section:
    """What every U of the page is made of."""
    section = Section("uncertainty", "Uncertainty of the truth")
    if not evaluation.uncertainty:
        section.blocks.append(
            Sentence("Nothing was evaluated against a truth, so there is no uncertainty to state.")
        )
        return section
    budgets = sorted(
        evaluation.uncertainty, key=lambda budget: budget.quantity not in ("flexion", "angle")
    )
    section.blocks.append(_overview(budgets))
    if session.robot is not None:
        section.blocks.append(
            Sentence(
                "What the robot file says of its values: "
                f"{session.robot.spec.uncertainty.why.strip()}"
            )
        )
    for quantity in dict.fromkeys(budget.quantity for budget in budgets):
        own = [budget for budget in budgets if budget.quantity == quantity]
        section.blocks += budget_bars(quantity, own)
    section.blocks += _together([budget for budget in budgets if budget.complete])
    for quantity in dict.fromkeys(budget.quantity for budget in budgets):
        tables = [_budget(budget) for budget in budgets if budget.quantity == quantity]
        section.blocks += (
            [Folded(f"Budgets of the {quantity} errors", tables)]
            if len(tables) > MOST_BUDGETS
            else tables
        )
    return section


def budget_bars(quantity: str, budgets: list[UncertaintyBudget]) -> list[Block]:
    """What each source adds, of every budget that is complete; of many the largest few."""
    known = [own for own in budgets if own.complete and any(s.magnitude_deg for s in own.sources)]
    largest = sorted(known, key=lambda own: -(own.combined_magnitude_deg or 0.0))[:MOST_BUDGETS]
    figures = {}
    for budget in (own for own in known if own in largest):
        parts: dict[str, list[float]] = {}
        for source in budget.sources:
            both = parts.setdefault(source.source, [0.0, 0.0])
            values = (source.contribution_deg, source.magnitude_deg)
            parts[source.source] = [
                float(np.hypot(a, b)) for a, b in zip(both, values, strict=True)
            ]
        counted = _largest(parts)
        title = f"{_where(budget)}: u = {significant(budget.combined_magnitude_deg, 2).text} deg"
        figures[f"budget of the {quantity} error of {_where(budget)}"] = stacked_squares(
            title, counted, USES, "u [deg]"
        )
    if not figures:
        return []
    left = f" Of {len(known)} budgets the largest." if len(known) > len(figures) else ""
    return [
        Figures(
            f"What the uncertainty of the {quantity} error is made of",
            figures,
            "How to read: the standard uncertainty that each source adds, to a mean error and to "
            "mean magnitudes, in which errors of the truth do not cancel; their squares add up. "
            f"The longest bar is what to improve first.{left}",
            small=len(figures) > 1,
        )
    ]


def _largest(parts: dict[str, list[float]]) -> dict[str, list[float]]:
    """The sources that add most, and the root of the sum of squares of the others."""
    order = sorted(parts, key=lambda source: -max(parts[source]))
    shown = {source: parts[source] for source in order[:MOST_SOURCES] if any(parts[source])}
    left = np.array([parts[source] for source in order if source not in shown]).reshape(-1, 2)
    if left.any():
        shown[f"{len(left)} others"] = np.sqrt(np.sum(left**2, axis=0)).tolist()
    return shown


def _where(budget: UncertaintyBudget) -> str:
    return budget.owner if budget.section is None else f"{budget.owner}, section {budget.section}"


def _overview(budgets: list[UncertaintyBudget]) -> Table:
    rows = []
    for b in budgets:
        largest = max(b.sources, key=lambda source: source.magnitude_deg, default=None)
        told = [largest.source] if b.complete and largest is not None else []
        said = "; ".join([*told, *b.notes, *b.assumed]) or None
        rows.append(
            Row(
                [
                    label(b.owner),
                    text(b.quantity),
                    text(b.section),
                    number(b.combined_deg, 3),
                    _freedom(b),
                    number(b.expanded_deg, 3),
                    number(b.expanded_magnitude_deg, 3),
                    text(said, kind="wide"),
                ]
            )
        )
    return Table(
        "Expanded uncertainty of the truth",
        [
            Cell("of"),
            Cell("error"),
            Cell("section"),
            *header(
                "u of the mean [deg]",
                "degrees of freedom",
                "U of the mean [deg]",
                "U of magnitudes [deg]",
                numbers_from=0,
            ),
            Cell("largest source, or what is missing"),
        ],
        rows,
        "How to read: the true mean error lies within the reported one ± U (95 %). U "
        "of magnitudes, an upper bound, goes with mean magnitudes, RMS and percentiles, in which "
        "errors of the truth do not cancel over poses. A dash: something of the truth is not "
        "known, so no U can be given; the last column says what. U does not hold the scatter of "
        "this session: the confidence intervals in square brackets do. The fewer degrees of "
        "freedom, the greater k: 1.96 with many, 2.31 with 8 (Student's t; JCGM 100:2008, G.4).",
    )


def _together(budgets: list[UncertaintyBudget]) -> list[Block]:
    """What each source adds to each budget, those of joints and of sensors apart, without what it
    follows from.
    """
    told: set[str] = set()
    tables: list[Block] = []
    for of_joints, words in ((True, "joints"), (False, "orientations")):
        own = [b for b in budgets if (b.quantity in OF_JOINTS) == of_joints]
        for begin in range(0, len(own), MOST_COLUMNS):
            tables.append(_added(words, own[begin : begin + MOST_COLUMNS], told))
    return tables


def _added(words: str, budgets: list[UncertaintyBudget], told: set[str]) -> Table:
    """One row a source, one column a budget.

    Args:
        words: What the budgets are of.
        budgets: Complete ones.
        told: Where values are from, as far as tables above said it; grows.
    """
    lines: dict[tuple[str, str, str, str], dict[int, str]] = {}
    for i, budget in enumerate(budgets):
        for s in budget.sources:
            key = (s.source, s.kind, f"{significant(s.value).text} {s.unit}", s.why)
            lines.setdefault(key, {})[i] = _both(s.contribution_deg, s.magnitude_deg)
    rows = []
    for (source, kind, value, why), added in lines.items():
        cells = [Cell(added.get(i, NOTHING), kind="number") for i in range(len(budgets))]
        from_where = text(why, kind=f"wide {AGAIN}" if why in told else "wide")
        rows.append(
            Row([label(source), text(kind), Cell(value, kind="number"), *cells, from_where])
        )
        told.add(why)
    for name, values in (
        ("combined u", [(b.combined_deg, b.combined_magnitude_deg) for b in budgets]),
        ("U (95 %)", [(b.expanded_deg, b.expanded_magnitude_deg) for b in budgets]),
    ):
        cells = [Cell(_both(*own), kind="number best") for own in values]
        rows.append(Row([label(name), Cell(""), Cell(""), *cells, Cell("")]))
    return Table(
        f"What each source adds to the uncertainty of {words}",
        [
            *(Cell("source"), Cell("type"), Cell("value", kind="number")),
            *(Cell(f"{b.quantity}, {_where(b)} [deg]", kind="number") for b in budgets),
            Cell("where from"),
        ],
        rows,
        "How to read: the standard uncertainty that a source adds, to a mean error / to mean "
        "magnitudes. The budgets themselves, with distributions and sensitivities, follow.",
        folded=True,
    )


def _both(mean: float | None, magnitude: float | None) -> str:
    return f"{significant(mean, 2).text} / {significant(magnitude, 2).text}"


# One piece: the cells of a row stand beside the titles that they fall under.
def _budget(b: UncertaintyBudget) -> Table:
    rows = [
        Row(
            [
                label(s.source),
                text(s.kind),
                Cell(f"{significant(s.value).text} {s.unit}", kind="number"),
                text(f"{s.distribution}, {_divisor(s.divisor)}"),
                significant(s.sensitivity),
                significant(s.contribution_deg, 2),
                significant(s.magnitude_deg, 2),
                _infinite(s.degrees_of_freedom),
                text(s.why, kind="wide"),
            ]
        )
        for s in b.sources
    ]
    if b.complete:
        rows.append(
            Row(
                [
                    label("combined"),
                    Cell("", span=4),
                    significant(b.combined_deg, 2),
                    significant(b.combined_magnitude_deg, 2),
                    _freedom(b),
                    text(
                        f"k = {digits(b.coverage_factor, 2)}: U = {digits(b.expanded_deg, 3)} deg; "
                        f"of magnitudes k = {digits(b.coverage_factor_magnitude, 2)}: "
                        f"{digits(b.expanded_magnitude_deg, 3)} deg",
                        kind="wide",
                    ),
                ]
            )
        )
    return Table(
        f"Budget of the {b.quantity} error: {_where(b)}",
        [
            Cell("source"),
            Cell("type"),
            Cell("value", kind="number"),
            Cell("distribution, divisor"),
            *header(
                "sensitivity [deg/unit]",
                "contribution [deg]",
                "to magnitudes [deg]",
                "degrees of freedom",
                numbers_from=0,
            ),
            Cell("where from"),
        ],
        rows,
        "How to read: value over divisor is a standard uncertainty; times the sensitivity it is "
        "the contribution to the mean error, and the root of the sum of squares is the combined "
        "one (JCGM 100:2008). Type A comes from this recording's own scatter, type B from "
        "elsewhere. The robot file's block `uncertainty` states the values of your own arm.",
        folded=True,
        screen=b.complete,
    )


def _freedom(budget: UncertaintyBudget) -> Cell:
    return _infinite(budget.degrees_of_freedom) if budget.complete else number(None)


def _divisor(divisor: float) -> str:
    return "√3" if abs(divisor - 3**0.5) < 1e-9 else f"{divisor:g}"


def _infinite(freedom: float | None) -> Cell:
    return Cell("∞", kind="number") if freedom is None or freedom > 1e5 else number(freedom, 0)
