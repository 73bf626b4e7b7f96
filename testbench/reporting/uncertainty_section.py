"""The section of the report on how far the truth itself may be off."""

from __future__ import annotations

from testbench.records.evaluation import Evaluation
from testbench.records.uncertainty import UncertaintyBudget
from testbench.reporting.page import Section, Sentence
from testbench.reporting.tables import Cell, Row, Table, digits, header, label, number, significant, text


def uncertainty_section(evaluation: Evaluation) -> Section:
    """What every U of the page is made of."""
    section = Section("uncertainty", "Uncertainty of the truth")
    if not evaluation.uncertainty:
        section.blocks.append(Sentence("Nothing was judged against a truth, so there is no uncertainty to state."))
        return section
    section.blocks.append(_overview(evaluation.uncertainty))
    section.blocks += [_budget(budget) for budget in evaluation.uncertainty]
    return section


def _overview(budgets: list[UncertaintyBudget]) -> Table:
    rows = []
    for b in budgets:
        largest = max(b.sources, key=lambda source: source.magnitude_deg, default=None)
        said = "; ".join(b.notes) if b.notes else (largest.source if largest is not None else None)
        rows.append(
            Row([label(b.owner), text(b.quantity), text(b.section), significant(b.combined_deg, 2), _freedom(b),
                 significant(b.expanded_deg, 2), significant(b.expanded_magnitude_deg, 2), text(said, kind="wide")])
        )  # fmt: skip
    return Table(
        "Expanded uncertainty of the truth",
        [Cell("of"), Cell("error"), Cell("section"),
         *header("u of the mean [deg]", "degrees of freedom", "U of the mean [deg]", "U of magnitudes [deg]", numbers_from=0),
         Cell("largest source, or what is missing")],
        rows,
        "How to read: the true mean error lies within the reported one ± U (k = 2, about 95 %). U of magnitudes, an upper "
        "bound, goes with mean magnitudes, RMS and percentiles, in which errors of the truth do not cancel over poses. A dash: "
        "nobody stated how good the reference is, so no U can be given. U does not hold the scatter of this session: the "
        "confidence intervals in square brackets do.",
    )  # fmt: skip


def _budget(b: UncertaintyBudget) -> Table:
    rows = [
        Row([label(s.source), text(s.kind), significant(s.value, 3), text(s.unit), text(s.distribution),
             significant(s.divisor, 3), significant(s.sensitivity, 3), significant(s.contribution_deg, 2),
             significant(s.magnitude_deg, 2), _infinite(s.degrees_of_freedom), text(s.why, kind="wide")])
        for s in b.sources
    ]  # fmt: skip
    if b.complete:
        rows.append(
            Row([label("combined"), *[text(None)] * 6, significant(b.combined_deg, 2), significant(b.combined_magnitude_deg, 2),
                 _freedom(b), text(f"k = {b.coverage_factor:g}: U = {digits(b.expanded_deg, 3)} deg, of magnitudes "
                                   f"{digits(b.expanded_magnitude_deg, 3)} deg", kind="wide")], "group")
        )  # fmt: skip
    where = b.owner if b.section is None else f"{b.owner}, section {b.section}"
    return Table(
        f"Budget of the {b.quantity} error: {where}",
        [Cell("source"), Cell("type"), Cell("value", kind="number"), Cell("unit"), Cell("distribution"),
         *header("divisor", "sensitivity [deg/unit]", "contribution [deg]", "to magnitudes [deg]", "degrees of freedom",
                 numbers_from=0), Cell("where from")],
        rows,
        "How to read: value over divisor is a standard uncertainty; times the sensitivity it is the contribution to the mean "
        "error, and the root of the sum of squares is the combined one (JCGM 100:2008). Type A comes from this recording's own "
        "scatter, type B from elsewhere. The robot file's block `uncertainty` states the values of your own arm.",
        folded=True,
    )  # fmt: skip


def _freedom(budget: UncertaintyBudget) -> Cell:
    return _infinite(budget.degrees_of_freedom) if budget.complete else number(None)


def _infinite(freedom: float | None) -> Cell:
    return Cell("∞", kind="number") if freedom is None or freedom > 1e5 else number(freedom, 0)
