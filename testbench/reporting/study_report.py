"""The report of a study: one HTML file that works offline, in the style of a session's report."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from urllib.parse import quote

import numpy as np

from testbench.clock import utc_shown
from testbench.records.disk.replacing import stored, write_text
from testbench.records.results.study import (
    StudyBoxes,
    StudyCurves,
    StudyRecord,
    StudyRow,
    StudySurface,
    StudyTable,
    Value,
)
from testbench.reporting.page.figures import Axis, Curve, Figure, box_plots, error_curves, heat_map
from testbench.reporting.page.page import Block, Figures, Page, Section, Sentence
from testbench.reporting.page.palette import COLOURS, REFERENCE, ordered_colours
from testbench.reporting.page.render import render_page
from testbench.reporting.page.tables import (
    Cell,
    Row,
    Table,
    label,
    number,
    power_of_ten,
    powers_of_ten,
    ratio,
    significant,
    significant_digits,
    text,
    to_uncertainty,
)

FILE = "report.html"
LONG_WORDS, LONG_LABEL = 40, 70
"""Characters from which on the words of a cell, or of a label, are broken into lines."""
MOST_ANSWERING = 4
"""More figures stand behind the tables."""
MOST_OPEN = 12
"""A table of more sessions is folded."""
SYMBOLS = ("circle", "diamond", "square", "triangle-up", "star", "hexagon")
"""Of measurements, filter by filter; simulation has `SIMULATED`."""
SIMULATED = "circle-open"
POINTS = ("simulation", "measurement", "published")
MOST_POINTS = 100
"""A curve with more is a series over time and drawn as a line."""
SMALLEST_FIXED = 1e-3
"""Numbers below this, of a column with enough decimals to lose them, are shown with significant
digits.
"""


def study_report(study: StudyRecord, folder: Path) -> Path:
    """Write report.html into the study's folder, and return its path.

    Raises:
        StorageError: The disk does not take it; an earlier report stays.
    """
    path = folder / FILE
    page = render_study(study, folder)
    with stored(path, "the sessions of the study are as they were"):
        write_text(path, page)
    return path


def render_study(study: StudyRecord, folder: Path | None = None) -> str:
    """The report as HTML.

    Args:
        study: What is reported.
        folder: That it will lie in, for links to the sessions; without one they are named alone.
    """
    sections = [_answer(study)]
    titles = {table.key: table.title for table in study.tables}
    for i, table in enumerate(study.tables):
        blocks: list[Block] = [_table(table)]
        blocks += [Sentence(table.why)] if table.why else []
        blocks += [_reasons(table, titles)] if table.reasons else []
        sections.append(Section(f"table{i}", table.title, blocks))
    further = _figures(study)[MOST_ANSWERING:]
    if further:
        sections.append(Section("figures", "Further figures", further))
    sections.append(_provenance(study, folder))
    return render_page(
        Page(
            kind="study",
            title=study.title,
            purpose=study.question,
            facts=_facts(study),
            tiles=[],
            sections=sections,
            footer=_footer(study),
        )
    )


def _footer(study: StudyRecord) -> str:
    if not study.beside_published:
        return f"The method is that of {study.source}; the data are not theirs."
    return (
        f"Rows in italics: {study.source}, as printed. Ratio: ours divided by the published value, "
        "where both are of one definition."
    )


def _facts(study: StudyRecord) -> list[tuple[str, str]]:
    settings = [
        (key.replace("_", " ").capitalize(), str(value))
        for key, value in study.settings.items()
        if "hash" not in key
    ]
    return [
        ("Study", study.name),
        ("Beside" if study.beside_published else "After", study.source),
        ("Started", utc_shown(datetime.fromisoformat(study.started_utc))),
        *settings,
    ]


def _answer(study: StudyRecord) -> Section:
    blocks: list[Block] = [Sentence(finding) for finding in study.findings]
    if study.simulated:
        blocks.append(
            Sentence(
                "Ours are simulated: models of the arm and of the sensor, with errors drawn from "
                "the data sheet."
            )
        )
    return Section("answer", "Answer", blocks + _figures(study)[:MOST_ANSWERING])


def _figures(study: StudyRecord) -> list[Block]:
    """All of them: box plots, curves, surfaces."""
    blocks: list[Block] = [_figure(figure) for figure in study.figures]
    blocks += [
        Figures(curves.caption, {curves.caption: draw_curves(curves)}, curves.how)
        for curves in study.curves
    ]
    for axis in dict.fromkeys(surface.z_axis for surface in study.surfaces):
        blocks.append(_surfaces([surface for surface in study.surfaces if surface.z_axis == axis]))
    return blocks


def draw_curves(curves: StudyCurves) -> Figure:
    """Theory and truth as lines, fits as dotted ones, simulation and measurement as points.

    Long series of points as lines.
    """
    groups = list(
        dict.fromkeys(curve.group or curve.name for curve in curves.curves if curve.kind != "truth")
    )
    palette = ordered_colours(len(groups)) if curves.ordered else COLOURS
    drawn = []
    for curve in curves.curves:
        group = curve.group or curve.name
        points = curve.kind in POINTS and len(curve.x) <= MOST_POINTS
        mode = "lines+markers" if curves.plane and points else "markers" if points else "lines"
        measured = [
            c
            for c in curves.curves
            if c.kind in ("measurement", "published") and (c.group or c.name) == group
        ]
        symbol = SYMBOLS[measured.index(curve) % len(SYMBOLS)] if curve in measured else SIMULATED
        drawn.append(
            Curve(
                curve.name,
                curve.x.tolist(),
                curve.y.tolist(),
                REFERENCE if curve.kind == "truth" else palette[groups.index(group) % len(palette)],
                dashed=curve.kind == "fit",
                mode=mode,
                symbol=symbol,
            )
        )
    return error_curves(drawn, curves.x_axis, curves.y_axis, curves.logarithmic, curves.plane)


def _surfaces(surfaces: list[StudySurface]) -> Figures:
    """Heat maps with the same colours for the same values."""
    largest = max(
        [
            1e-9,
            *(float(np.nanmax(surface.z)) for surface in surfaces if np.isfinite(surface.z).any()),
        ]
    )
    figures = {
        s.caption: heat_map(
            s.caption,
            Axis(s.x_axis, s.x.tolist()),
            Axis(s.y_axis, s.y.tolist()),
            s.z,
            s.z_axis,
            largest,
        )
        for s in surfaces
    }
    how = (
        " ".join(dict.fromkeys(s.how for s in surfaces if s.how))
        or "How to read: the same colour is the same value in all."
    )
    return Figures(f"Surfaces of {surfaces[0].z_axis}", figures, how, small=True)


def _figure(figure: StudyBoxes) -> Figures:
    families = list(dict.fromkeys(name.split(",")[0] for name in figure.boxes))
    colours = {
        name: COLOURS[families.index(name.split(",")[0]) % len(COLOURS)] for name in figure.boxes
    }
    colours |= dict.fromkeys(figure.published, REFERENCE)
    drawn = box_plots(figure.boxes | figure.published, colours, figure.axis, figure.logarithmic)
    return Figures(figure.caption, {figure.caption: drawn}, figure.how)


def _table(table: StudyTable) -> Table:
    compared = table.ratio_column
    words = [
        all(
            isinstance(value, str | None)
            for row in table.rows
            for value in (row.values[i], *row.published[i : i + 1])
        )
        for i in range(len(table.columns))
    ]
    rows = []
    for row in table.rows:
        ours = [] if compared is None else [ratio(row.ratio(compared))]
        printed = [
            _printed_with(value, sd, own)
            for value, sd, own in zip(
                row.published, row.published_spread or (None,) * len(words), words, strict=False
            )
        ]
        if row.published_alone:
            rows.append(Row([_label(row), *printed, *ours], kind="published"))
            continue
        rows.append(Row([_label(row), *_cells(table, row, words), *ours]))
        if row.published:
            beneath = [label(row.published_title), *printed, *(Cell("") for _ in ours)]
            rows.append(Row(beneath, kind="published"))
    columns = [Cell("")]
    columns += [
        Cell(title, kind="" if own else "number")
        for title, own in zip(table.columns, words, strict=True)
    ]
    if compared is not None:
        columns.append(Cell(f"ratio, {table.columns[compared].split(' [')[0]}", kind="number"))
    beside = (
        f" (beside table{'s' if ' ' in table.table else ''} {table.table})" if table.table else ""
    )
    return Table(table.caption + beside, columns, rows, f"{table.how}{_spreads(table)}")


def _spreads(table: StudyTable) -> str:
    """What stands behind the signs ± of a table."""
    ours = f" ± is the {table.spread}." if table.spread else ""
    theirs = f" Published: ± is the {table.published_spread}." if table.published_spread else ""
    return ours + theirs


def _reasons(table: StudyTable, titles: dict[str, str]) -> Table:
    """Why ours and the published values may differ, and what runs say of it.

    Args:
        table: Whose values they are.
        titles: Of all tables, by key.
    """
    rows = []
    for reason in table.reasons:
        shown_by = titles.get(reason.run, reason.run)
        cells = [text(reason.claim, kind="wide"), text(shown_by, kind="wide")]
        rows.append(Row([label(reason.verdict), *cells]))
    return Table(
        "Why they differ",
        [Cell(""), Cell("reason"), Cell("shown by")],
        rows,
        "How to read: shown and refuted are what a run of this study says; a candidate could be "
        "it, and nothing tells it from others; open is what nobody has run.",
    )


def _printed_with(value: Value, sd: Value, among_words: bool) -> Cell:
    """A published value with its spread, both as printed."""
    cell = _as_printed(value, among_words)
    if not isinstance(sd, int | float):
        return cell
    return Cell(f"{cell.text} ± {_as_printed(sd, False).text}", kind="number")


def _as_printed(value: Value, among_words: bool) -> Cell:
    if not isinstance(value, int | float):
        return _word(value, among_words)
    mantissa, _, exponent = f"{value:.7g}".partition("e")
    return Cell(
        power_of_ten(mantissa, int(exponent)) if exponent else mantissa.replace("-", "−"),
        kind="number",
    )


def _word(value: str | None, among_words: bool) -> Cell:
    """A word, or that there is none, on the side where the others of its column stand."""
    if value is None and not among_words:
        return number(None)
    kind = "wide" if value is not None and len(value) > LONG_WORDS else ""
    return text(None if value is None else powers_of_ten(value), kind=kind)


def _label(row: StudyRow) -> Cell:
    """The name that a row begins with; a sentence is broken into lines."""
    return replace(label(row.title, row.note), kind="wide" if len(row.title) > LONG_LABEL else "")


def _cells(table: StudyTable, row: StudyRow, words: list[bool]) -> list[Cell]:
    cells = []
    for i, value in enumerate(row.values):
        sd = row.spread[i] if row.spread else None
        if isinstance(value, int | float) and isinstance(sd, int | float):
            cells.append(
                Cell(f"{to_uncertainty(value, sd)} ± {significant_digits(sd, 2)}", kind="number")
            )
        elif isinstance(value, int | float):
            decimals = table.decimals[i] if i < len(table.decimals) else 3
            tiny = 0 < abs(value) < SMALLEST_FIXED and decimals > 5
            cells.append(significant(value, 3) if tiny else number(value, decimals))
        else:
            cells.append(_word(value, words[i]))
    return cells


def _provenance(study: StudyRecord, folder: Path | None) -> Section:
    rows = []
    for i, path in enumerate(study.sessions, 1):
        link = _link(Path(path), folder)
        rows.append(
            Row(
                [
                    label(f"session {i}"),
                    Cell(Path(path).name if link else path, kind="code", link=link),
                ]
            )
        )
    entries = [(key, str(value)) for key, value in study.settings.items()]
    entries += [(f"version of {name}", version) for name, version in study.software.items()]
    rows += [Row([label(name), Cell(value, kind="code")]) for name, value in entries]
    how = f"How to read: every number of ours comes from these sessions. {study.trace}".strip()
    table = Table(
        "Sessions and versions",
        [Cell("entry"), Cell("value")],
        rows,
        how,
        folded=len(study.sessions) > MOST_OPEN,
    )
    return Section("provenance", "Provenance", [table])


def _link(session: Path, folder: Path | None) -> str:
    """The way from a study's folder to the report of a session, to its folder where it has none,
    nowhere where it is gone.
    """
    if folder is None or not session.is_dir():
        return ""
    target = session / FILE if (session / FILE).is_file() else session
    try:
        return quote(Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix())
    except ValueError:  # on another drive
        return ""
