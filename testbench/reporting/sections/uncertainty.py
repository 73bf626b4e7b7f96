"""The section of the report on how far the truth itself may be off."""

from __future__ import annotations

from testbench.records.results.evaluation import Evaluation
from testbench.records.results.uncertainty import UncertaintyBudget
from testbench.records.session.session import Session
from testbench.reporting.page.page import Folded, Section, Sentence
from testbench.reporting.page.tables import (
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
        tables = [_budget(budget) for budget in budgets if budget.quantity == quantity]
        section.blocks += (
            [Folded(f"Budgets of the {quantity} errors", tables)]
            if len(tables) > MOST_BUDGETS
            else tables
        )
    return section


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
    where = b.owner if b.section is None else f"{b.owner}, section {b.section}"
    return Table(
        f"Budget of the {b.quantity} error: {where}",
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
    )


def _freedom(budget: UncertaintyBudget) -> Cell:
    return _infinite(budget.degrees_of_freedom) if budget.complete else number(None)


def _divisor(divisor: float) -> str:
    return "√3" if abs(divisor - 3**0.5) < 1e-9 else f"{divisor:g}"


def _infinite(freedom: float | None) -> Cell:
    return Cell("∞", kind="number") if freedom is None or freedom > 1e5 else number(freedom, 0)
