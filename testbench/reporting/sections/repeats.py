"""The section of the report on sessions of the same protocol that were looked at together."""

from __future__ import annotations

from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import RANKED_METRICS, RepeatedMetric
from testbench.reporting.page.figures import scatter_rows
from testbench.reporting.page.page import Block, Figures, Section, Sentence
from testbench.reporting.page.palette import REFERENCE
from testbench.reporting.page.tables import (
    Cell,
    Row,
    Table,
    counted,
    digits,
    header,
    label,
    number,
    text,
)
from testbench.reporting.sections.ranking import places_of

DECIMALS = {"deg": 3, "ms": 1, "s": 2}


def repeats_section(evaluation: Evaluation, colours: dict[str, str]) -> Section | None:
    """How far sessions of this protocol scatter; None where this one stands alone.

    Args:
        evaluation: Of this session.
        colours: By filter.
    """
    sessions = evaluation.repeated_sessions
    if not sessions:
        return None
    parts = {session.part for session in sessions}
    of = "parts that nobody tells apart" if None in parts else counted(len(parts), "part")
    section = Section("repeats", "Repeated sessions")
    section.blocks.append(
        Sentence(
            f"{len(sessions)} sessions of this protocol, of {of}: "
            f"{', '.join(session.session for session in sessions)}. What they scatter by is what "
            "to expect of another session; the intervals elsewhere on this page speak of this "
            "session repeated on the same part."
        )
    )
    for place in _places(evaluation.repeats):
        own = [row for row in evaluation.repeats if _place(row) == place]
        section.blocks.append(_figure(own, colours))
    section.blocks += _rankings(evaluation)
    section.blocks.append(_table(evaluation.repeats))
    return section


def _place(row: RepeatedMetric) -> tuple[str, str | None, str | None]:
    return row.name, row.section, row.sequence


def _places(rows: list[RepeatedMetric]) -> list[tuple[str, str | None, str | None]]:
    drawn = [row for row in rows if row.name.partition(".")[2] in RANKED_METRICS]
    return list(dict.fromkeys(map(_place, drawn)))


def _words(row: RepeatedMetric) -> str:
    return ", ".join(
        [
            row.name,
            *([f"section {row.section}"] if row.section else []),
            *([row.sequence] if row.sequence else []),
        ]
    )


def _figure(rows: list[RepeatedMetric], colours: dict[str, str]) -> Block:
    """Each filter's values over the sessions."""
    rows = sorted(rows, key=lambda row: row.mean)
    drawn = {
        row.filter or row.name: (
            [value for value in row.values if value is not None],
            row.mean_ci95 or (),
            row.another_95 or (),
        )
        for row in rows
    }
    known = {name: colours.get(name, REFERENCE) for name in drawn}
    where = _words(rows[0])
    return Figures(
        f"Session by session: {where}",
        {f"{where}, each session and filter": scatter_rows(drawn, known, f"[{rows[0].unit}]")},
        "How to read: a circle is a session; the thick bar is where the mean over all such "
        "sessions lies, the thin one where another session will, 95 % each.",
    )


def _rankings(evaluation: Evaluation) -> list[Block]:
    blocks: list[Block] = []
    rows = evaluation.repeat_ranking
    keys = [(row.owner, row.section, row.sequence, row.criterion) for row in rows]
    for key in dict.fromkeys(keys):
        own = [row for row, its in zip(rows, keys, strict=True) if its == key]
        owner, section, sequence, criterion = key
        where = ", ".join(
            [
                owner,
                *([f"section {section}"] if section else []),
                *([sequence] if sequence else []),
            ]
        )
        body = [
            Row(
                [
                    label(row.filter),
                    Cell(places_of(row), kind="number"),
                    text(row.group),
                    number(row.value, 3),
                    text(", ".join(row.no_difference), kind="wide"),
                ]
            )
            for row in own
        ]
        blocks.append(
            Table(
                f"Ranking over sessions by {criterion}: {where}",
                [
                    Cell("filter"),
                    Cell("rank", kind="number"),
                    Cell("group"),
                    Cell(f"mean of {criterion} [deg]", kind="number"),
                    Cell("no difference shown from"),
                ],
                body,
                "How to read: filters are compared in pairs, session by session (Student's t, at a "
                "level of 5 % for all pairs together after Holm); those that share a letter were "
                "not shown to differ by more than 0.01 deg. What is shown here holds for other "
                "sessions of this kind.",
            )
        )
    return blocks


def _table(rows: list[RepeatedMetric]) -> Table:
    body = []
    for row in rows:
        decimals = DECIMALS.get(row.unit, 2)
        known = [value for value in row.values if value is not None]
        body.append(
            Row(
                [
                    label(row.name),
                    *(text(value) for value in (row.filter, row.sequence, row.section)),
                    Cell(f"{len(known)}", kind="number"),
                    number(row.values[0], decimals),
                    number(row.mean, decimals),
                    number(row.sd, decimals),
                    _ends(row.mean_ci95, decimals),
                    _ends(row.another_95, decimals),
                    text(row.unit),
                ]
            )
        )
    return Table(
        "Metrics over sessions",
        [
            *(Cell(title) for title in ("metric", "filter", "sequence", "section")),
            *header(
                "sessions",
                "this one",
                "mean",
                "sd",
                "mean of all such, 95 %",
                "another session, 95 %",
                numbers_from=0,
            ),
            Cell("unit"),
        ],
        body,
        "How to read: Student's t over sessions, of magnitudes in the logarithm. They hold as far "
        "as the sessions were drawn as those to come will be: parts, mountings, power-ups.",
        folded=True,
    )


def _ends(interval: list[float] | None, decimals: int) -> Cell:
    if interval is None:
        return number(None)
    return Cell(f"[{digits(interval[0], decimals)}, {digits(interval[1], decimals)}]", "number")
