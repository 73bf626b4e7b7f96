"""Tables and reasons: each published figure of the norms and angles against each hypothesis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.model.integrators import Stages
from testbench.records.results.study import (
    BoxNumbers,
    Explained,
    StudyReason,
    StudyRow,
    StudyTable,
    Value,
)
from testbench.records.specs.published import PublishedRow, PublishedTables
from testbench.studies.gimvebo import words
from testbench.studies.gimvebo.hypotheses import (
    NAMED,
    RK4,
    TUSTIN,
    Tried,
    angles_deg,
    fit_in_degrees,
    in_degrees,
    try_norms,
)
from testbench.studies.gimvebo.recording import NONE, Part, bias_of
from testbench.studies.gimvebo.tables import BOX, INTEGRATORS, TITLES, box_values, published_box

NORMS, ANGLES = "norms", "angles in degrees"
FIGURES = {"q1": "Q1", "q3": "Q3", "lower": "lower whisker", "upper": "upper whisker"}


def tested_norms(part: Part, published: PublishedTables) -> dict[str, list[Tried]]:
    """Every hypothesis of RK4's and of Tustin's norms, on every turn of a part.

    One part says it for all: their motions are the same, and their scales differ by a percent where
    the speed is fitted.
    """
    turns = in_degrees((*part.fit.turns, *part.held_out.turns), bias_of(part).bias)
    return {
        name: [
            try_norms(of, turns, float(published.tables["4.2"].row(name).values[1] or 0.0))
            for of in hypotheses
        ]
        for name, hypotheses in (("rk4", RK4), ("tustin", TUSTIN))
    }


def box_of(row: PublishedRow) -> BoxNumbers:
    """A published box plot: quartiles first, then the ends of the whiskers."""
    q1, median, q3, _, low, high = (float(value or 0.0) for value in row.values[:6])
    return BoxNumbers(low, q1, median, q3, high, tuple(row.outliers))


def norms_table(tested: dict[str, list[Tried]], published: PublishedTables) -> StudyTable:
    """What each hypothesis makes of the norms at the speed of the published median."""
    rows = []
    for name, several in tested.items():
        theirs = published.tables["4.2"].row(name)
        box = box_of(theirs)
        printed = (None, box.median, *(getattr(box, figure) for figure in NAMED), None)
        rows.append(StudyRow(f"{TITLES[name]}, published", (None,) * 7, printed))
        rows += [_norms_row(each, box) for each in several]
    return StudyTable(
        NORMS,
        "Norms by hypotheses of what an implementation did, turn by turn, at the speed of the "
        "published median",
        (
            "factor of our speed",
            "median",
            *(FIGURES[figure] for figure in NAMED),
            "published inside the range",
        ),
        tuple(rows),
        words.NORMS_HOW,
        table="4.2",
        decimals=(2, 4, 4, 4, 4, 4, 0),
        reasons=norm_reasons(tested, published),
        short="Norms by hypothesis",
    )


def _norms_row(tested: Tried, published: BoxNumbers) -> StudyRow:
    of = tested.of
    label = f"{TITLES[of.integrator]}, deg/s taken for rad/s, {of.label}"
    if not tested.boxes:
        none = ("no speed", None, None, None, None, None, f"0 of {len(NAMED)}")
        return StudyRow(label, none, printed=of.printed)
    speeds = f"{min(tested.factors):.2f} to {max(tested.factors):.2f}"
    if len(tested.factors) < tested.turns:
        speeds += f" (in {len(tested.factors)} of {tested.turns} turns)"
    ranges = []
    for figure in NAMED:
        low, high = tested.range_of(figure) or (float("nan"), float("nan"))
        ranges.append(f"{low:.3f} to {high:.3f}")
    inside = tested.inside(published)
    said = f"{len(inside)} of {len(NAMED)}"
    if inside:
        said += f": {', '.join(FIGURES[figure] for figure in inside)}"
    return StudyRow(label, (speeds, published.median, *ranges, said), printed=of.printed)


def norm_reasons(
    tested: dict[str, list[Tried]], published: PublishedTables
) -> tuple[StudyReason, ...]:
    """What the table says of each hypothesis; open for an integrator that none fits."""
    reasons = []
    for name, several in tested.items():
        box = box_of(published.tables["4.2"].row(name))
        fitting = 0
        for each in several:
            all_in = len(each.inside(box)) == len(NAMED)
            fitting += all_in
            verdict: Explained = "candidate" if all_in else "refuted"
            claim = words.NORM_CLAIM.format(
                published=TITLES[name],
                method=TITLES[each.of.integrator],
                hypothesis=each.of.label,
                inside=len(each.inside(box)),
                all=len(NAMED),
            )
            reasons.append(StudyReason(claim, verdict, NORMS))
        if not fitting:
            above = words.ABOVE_ONE if box.upper > 1 else ""
            told = words.NORM_OPEN.format(published=TITLES[name], above=above)
            reasons.append(StudyReason(told, "open"))
    return tuple(reasons)


def angles_table(part: Part, published: PublishedTables) -> StudyTable:
    """What rates in deg/s leave of the angle, before and after a fit to the turns judged by."""
    turns = in_degrees(part.fit.turns, bias_of(part).bias)
    rows = []

    def add(label: str, values: np.ndarray, theirs: PublishedRow) -> None:
        row: tuple[Value, ...] = box_values(BoxNumbers.of(values), 1)
        rows.append(StudyRow(label, row, published_box(theirs)))

    for name, number in INTEGRATORS.items():
        beside = published.tables[number]
        add(
            f"{TITLES[name]}, before the fit",
            angles_deg(NONE, turns, name),
            beside.row("accelerometer"),
        )
        fitted = fit_in_degrees(turns, name)
        add(f"{TITLES[name]}, after the fit", angles_deg(fitted, turns, name), beside.row("both"))
    ways: Sequence[Stages] = ("constant", "measured")
    for stages in ways:
        fitted = fit_in_degrees(turns, "rk4", stages)
        add(
            f"RK4, after the fit, rate {stages} over the step",
            angles_deg(fitted, turns, "rk4", stages),
            published.tables["4.6"].row(stages),
        )
    return StudyTable(
        ANGLES,
        "Angle between gravity by the accelerometer and by integration, rates in deg/s taken for "
        "rad/s",
        tuple(f"{title} [deg]" for title in BOX),
        tuple(rows),
        f"{words.BOX_HOW} {words.ANGLES_HOW}",
        table="4.3 to 4.6",
        decimals=(1,) * 7,
        ratio_column=1,
        short="Angles in degrees",
    )


def angle_reasons(table: StudyTable) -> tuple[StudyReason, ...]:
    """What the table says of each published median: whether it lies between our quartiles."""
    reasons = []
    for row in table.rows:
        q1, median, q3 = (float(value or 0.0) for value in row.values[:3])
        theirs = float(row.published[1] or 0.0)
        verdict: Explained = "candidate" if q1 <= theirs <= q3 else "refuted"
        claim = words.ANGLE_CLAIM.format(
            row=row.label, q1=q1, q3=q3, median=median, published=theirs
        )
        reasons.append(StudyReason(claim, verdict, ANGLES))
    if any(reason.verdict == "refuted" for reason in reasons):
        reasons.append(StudyReason(words.ANGLE_OPEN, "open"))
    return tuple(reasons)
