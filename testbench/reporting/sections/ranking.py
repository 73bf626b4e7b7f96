"""Tables and figure of the ranking of filters, for a joint or a sensor."""

from __future__ import annotations

from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import (
    Comparison,
    ErrorSummary,
    Interval,
    OutlierRow,
    RankRow,
)
from testbench.reporting.page.page import Block, Sentence
from testbench.reporting.page.tables import Cell, Row, Table, digits, header, label, number, text
from testbench.reporting.sections.outliers import how_remarks, outliers_of, remark
from testbench.reporting.sections.tuning import fitted_here

WHOLE_JOINT = (
    "the total error is the angle between estimated and true orientation of the distal segment "
    "against the proximal one, all three angles at once: headings count here, even where the "
    "flexion does not see them; "
)
REPEATED = (
    "is for this session repeated on the same part, from the scatter of its errors and how long "
    "they last; what another part, mounting, power-up or alignment would change is not in it. Not "
    "known: the errors may hang together for too long to tell from this session."
)
"""What confidence intervals speak of."""
FORMS = (("shares", "its", "it", "it is"), ("share", "their", "them", "they are"))
"""Of one and of several filters."""


def ranking_blocks(evaluation: Evaluation, owner: str, section: str | None = None) -> list[Block]:
    """The rankings of one joint's section or of one sensor.

    A sentence where the filters could not be compared.
    """
    rows = [row for row in evaluation.ranking if (row.owner, row.section) == (owner, section)]
    where = owner if section is None else f"{owner}, section {section}"
    if not rows:
        several = {row.filter for row in evaluation.orientation} | {
            row.filter for row in evaluation.joint_angle
        }
        judged = {
            (row.step, row.kind)
            for row in evaluation.joint_angle
            if (row.joint, row.section) == (owner, section)
        }
        reason = (
            "only one filter ran"
            if len(several) < 2
            else "one short sweep does not tell an offset of the session from what they differ by"
            if [kind for _, kind in judged] == ["sweep"]
            else "their errors may last too long for what was evaluated, so that nothing is known "
            "from this session"
        )
        return [Sentence(f"The filters are not ranked for {where}: {reason}.")]
    compared = [c for c in evaluation.comparisons if (c.owner, c.section) == (owner, section)]
    blocks: list[Block] = []
    for criterion in dict.fromkeys(row.criterion for row in rows):
        own = [row for row in rows if row.criterion == criterion]
        far = outliers_of(
            evaluation, owner, section, own[0].sequence, motion="all" if section is None else ""
        )
        if section is not None:
            quantity = "flexion" if own[0].sequence else "total"
            far = {
                name: found[:1]
                for name, found in outliers_of(
                    evaluation, owner, section, own[0].sequence, quantity
                ).items()
            }
        blocks.append(_ranking(where, own, [c for c in compared if c.criterion == criterion], far))
    fitted = [
        row.filter
        for row in evaluation.tuned
        if row.on_this_session and row.filter in {r.filter for r in rows}
    ]
    return [*blocks, *([fitted_here(fitted)] if fitted else [])]


# One piece: the cells of a row stand beside the titles that they fall under.
def _ranking(
    where: str, rows: list[RankRow], compared: list[Comparison], far: dict[str, list[OutlierRow]]
) -> Table:
    """One ranking: of rows by one criterion."""
    clearest = {
        row.filter: min(
            (c.p_holm for c in compared if row.filter in (c.first, c.second)), default=1.0
        )
        for row in rows
    }
    blocks = min((c.blocks for c in compared), default=0)
    body = []
    for row in rows:
        alike = (
            "any other"
            if len(row.no_difference) == len(rows) - 1 > 1
            else ", ".join(row.no_difference)
        )
        body.append(
            Row(
                [
                    label(row.filter),
                    Cell(places_of(row), kind="number"),
                    text(row.group),
                    number(row.value, 3),
                    _p_value(clearest[row.filter]),
                    text(alike, kind="wide"),
                    *([remark(far.get(row.filter, []))] if far else []),
                ]
            )
        )
    criterion = rows[0].criterion + (f" ({rows[0].sequence})" if rows[0].sequence else "")
    what = WHOLE_JOINT if rows[0].section is not None and rows[0].sequence is None else ""
    return Table(
        f"Ranking of the filters by {criterion}: {where}",
        [
            Cell("filter"),
            Cell("rank", kind="number"),
            Cell("group"),
            Cell(f"{rows[0].criterion} [deg]", kind="number"),
            Cell("smallest p", kind="number"),
            Cell("no difference shown from"),
            *([Cell("remark")] if far else []),
        ],
        body,
        f"How to read: {what}filters that share a letter were not shown to differ by more than "
        "0.01 deg, which does not say that they are equal; the rank gives every place that this "
        "leaves open. Pairs are compared on the same samples, which hold at least "
        f"{blocks} memories of their errors, at a level of 5 % for all pairs together, for this "
        "session repeated on the same part; another part, mounting, power-up or alignment may "
        "order them otherwise. The smallest p is that of "
        "the clearest difference from any other filter, after Holm's correction. The truth is the "
        f"same for all, so its uncertainty does not count here.{how_remarks(bool(far))}",
    )


def places_of(row: RankRow) -> str:
    """Every place that the comparisons leave open."""
    best, worst = row.best_rank, row.worst_rank
    return f"{best}" if best == worst else f"{best} to {worst}"


def _p_value(p: float) -> Cell:
    return Cell("< 0.001" if p < 0.001 else digits(p, 3), kind="number")


def plus_minus(value: float | None, expanded: float | None, decimals: int = 3) -> Cell:
    """A value with its expanded uncertainty."""
    shown = digits(value, decimals)
    return Cell(
        shown if expanded is None else f"{shown} ± {digits(expanded, decimals)}", kind="number"
    )


def with_interval(
    value: float | None, interval: Interval, decimals: int = 3, why: str | None = None
) -> Cell:
    """A value with its confidence interval.

    Args:
        value: None for one that could not be taken.
        interval: Its ends.
        decimals: Of all three numbers.
        why: The interval is missing, in words; None where a value of this kind has none.
    """
    if interval is None and why and value is not None:
        return Cell(f"{digits(value, decimals)} [not known]", kind="number")
    if interval is None:
        return number(value, decimals)
    ends = f"{digits(interval[0], decimals)}, {digits(interval[1], decimals)}"
    return Cell(f"{digits(value, decimals)} [{ends}]", kind="number")


def distribution_table(
    caption: str, names: list[str], rows: list[tuple[list[Cell], ErrorSummary]], how: str = ""
) -> Table:
    """How errors are spread, how late they are and how they settle.

    Args:
        caption: What the table shows.
        names: Titles of the leading columns.
        rows: Their cells, and the errors.
        how: More to read it by.
    """
    body = []
    for leading, e in rows:
        late = digits(e.latency_ms, 1) + (
            f" ± {digits(2 * e.latency_sd_ms, 1)}" if e.latency_sd_ms is not None else ""
        )
        settling = digits(e.convergence_s, 2)
        if e.convergence_max_s is not None:
            settling += f" ({digits(e.convergence_max_s, 2)})"
        body.append(
            Row(
                [
                    *leading,
                    number(e.median_error_deg, 3),
                    number(e.iqr_deg, 3),
                    number(e.p95_abs_error_deg, 3),
                    number(e.max_abs_error_deg, 3),
                    number(e.correlation, 4),
                    Cell(late, kind="number"),
                    Cell(settling, kind="number"),
                    number(e.unsettled if e.convergence_s is not None or e.unsettled else None, 0),
                ]
            )
        )
    return Table(
        caption,
        header(
            *names,
            "median e [deg]",
            "quartile range of e [deg]",
            "95 % of |e| below [deg]",
            "max |e| [deg]",
            "correlation",
            "delay [ms]",
            "settling time (longest) [s]",
            "poses unsettled",
            numbers_from=len(names),
        ),
        body,
        "How to read: of all samples together. The correlation is that of estimated and true "
        "angle, and given where the true one changes. The delay is how far the estimate runs "
        "behind the truth in motion, ± twice its standard uncertainty, beyond what the fit of the "
        "sensor's clock took out; negative is ahead. The settling time runs from the end of a move "
        "until the error stays within 0.1 deg of its settled value, median over the poses that "
        f"settle.{how}",
        folded=True,
    )


def ranking_doubts(evaluation: Evaluation, owner: str, section: str | None = None) -> list[Block]:
    """Sentences on filters that a ranking leaves out, and on those that it places nowhere."""
    rows = [row for row in evaluation.ranking if (row.owner, row.section) == (owner, section)]
    if section is None:
        ran = [row.filter for row in evaluation.orientation if row.sensor == owner]
    else:
        ran = [
            row.filter
            for row in evaluation.joint_angle
            if (row.joint, row.section) == (owner, section)
        ]
    left = [name for name in dict.fromkeys(ran) if name not in {row.filter for row in rows}]
    sentences: list[Block] = []
    if rows and left:
        verb = "is" if len(left) == 1 else "are"
        sentences.append(
            Sentence(
                f"{', '.join(left)} {verb} not ranked: errors may last too long for what was "
                "judged."
            )
        )
    for criterion in dict.fromkeys(row.criterion for row in rows):
        own = [row for row in rows if row.criterion == criterion]
        if all(len(row.no_difference) == len(own) - 1 for row in own):
            continue  # nobody was told apart: the letters say so
        nowhere = [
            f"{row.filter} ({digits(row.value, 3)} deg)"
            for row in own
            if len(row.no_difference) == len(own) - 1
        ]
        if nowhere:
            shares, its, places, it_is = FORMS[len(nowhere) > 1]
            sentences.append(
                Sentence(
                    f"{', '.join(nowhere)} {shares} a letter with every other by {criterion}: "
                    f"{its} errors differ so much from one stretch to the next that this recording "
                    f"places {places} nowhere. That is no sign that {it_is} as good as the best."
                )
            )
    return sentences
