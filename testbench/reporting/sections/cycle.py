"""Average cycles of periodic sweeps, as laboratories of motion draw them: angle and error over 0 to
100 % of the cycle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import CycleRow
from testbench.records.session.layout import CYCLES
from testbench.records.specs.band import Band, NormalCurve
from testbench.reporting.page.figure_parts import Figure, axis, layout, rounded, text
from testbench.reporting.page.page import Block, Figures
from testbench.reporting.page.palette import REFERENCE, translucent
from testbench.reporting.page.tables import Cell, Row, Table, digits, header, label, number
from testbench.reporting.page.tables import text as said
from testbench.reporting.sections.normal import normal_band, normal_words

MOST_SHOWN = 6
"""Cycles drawn at once: two rows of three, such as hip, knee and ankle of both legs."""
MOST_FOLDED = 24
"""Further ones that are drawn when asked for."""
MOST_FILTERS = 4
"""Filters in one figure: more bands cover one another."""
EVERY_PERCENT = 2
"""Of the 101 points of a cycle, one of so many is drawn."""
TRUE = "true"

Indexed = Mapping[int, CycleRow]
"""Rows by their place in the evaluation's list, which is how its table of average cycles names
them.
"""
Place = tuple[str, int]
"""Joint and step."""


# One piece: what is drawn at once decides what is left to draw, and what is said of it.
def cycle_blocks(
    evaluation: Evaluation,
    rows: Indexed,
    what: str,
    colours: Mapping[str, str],
    band: Band | None = None,
) -> list[Block]:
    """Figures and tables of the average cycles; none where no sweep has any.

    Of sweeps at the same frequency the widest is drawn, and of many joints those that move most:
    there the curves can be told from one another. Every other joint is drawn when asked for, and
    every sweep, filter and sequence has its row.

    Args:
        evaluation: With the table of average cycles.
        rows: Of one joint's or chain's section.
        what: Its name in captions.
        colours: By filter or state.
        band: Of persons without complaints, drawn behind the angles that it has.
    """
    if not rows or CYCLES not in evaluation.series:
        return []
    places = _places(rows.values())
    widest = sorted(places, key=lambda place: -places[place])[:MOST_SHOWN]
    shown = [place for place in places if place in widest]
    others = [place for place in places if place not in widest][:MOST_FOLDED]
    own = {i: row for i, row in rows.items() if row.sequence == _sequence(rows, row.joint)}
    filters = _best_filters([row for row in own.values() if (row.joint, row.step) in shown])
    several = len({step for _, step in places}) > 1
    one_of_many = len({row.step for row in rows.values()}) > len({step for _, step in places})
    caption = f"Average cycle: {what}"
    drawn = {i: row for i, row in own.items() if row.filter in filters}
    further = {i: row for i, row in own.items() if row.filter not in filters and _of(row) in shown}
    how = (
        "How to read: above the estimated angle, mean and band of one standard deviation over the "
        "cycles, and the true one, broad and grey; below the error, estimated minus true. Cycles "
        "are cut where the protocol says that they begin, which is 0 %; fades are left out."
        + (
            " Of sweeps at one frequency the one with the widest range is drawn."
            if one_of_many
            else ""
        )
        + (f" These are the {MOST_FILTERS} filters with the lowest RMSE." if further else "")
        + normal_words(band)
    )
    chosen = [row for row in drawn.values() if _of(row) in shown]
    blocks: list[Block] = [
        Figures(
            caption, _figures(evaluation, drawn, shown, several, colours, band), how, small=True
        ),
        _table(f"Range of motion and similarity of the average cycle: {what}", chosen),
    ]
    for words, left, places_left in (
        ("joints and sweeps", drawn, others),
        ("filters", further, shown),
    ):
        if left and places_left:
            figures = _figures(evaluation, left, places_left, several, colours, band)
            again = "How to read: as the figures above."
            blocks.append(
                Figures(f"{caption}, the other {words}", figures, again, small=True, folded=True)
            )
    if len(chosen) < len(rows):
        blocks.append(
            _table(
                f"Average cycles, every sweep and filter: {what}", list(rows.values()), folded=True
            )
        )
    return blocks


def _of(row: CycleRow) -> Place:
    return row.joint, row.step


def _places(rows: Iterable[CycleRow]) -> dict[Place, float]:
    """What may be drawn: every joint in the widest sweep of each frequency, with the true range of
    motion [deg] there.
    """
    rows = list(rows)
    by_frequency: dict[float, CycleRow] = {}
    for row in rows:
        best = by_frequency.get(row.frequency_hz)
        if best is None or row.true_rom_deg > best.true_rom_deg:
            by_frequency[row.frequency_hz] = row
    steps = [by_frequency[frequency].step for frequency in sorted(by_frequency)]
    joints = list(dict.fromkeys(row.joint for row in rows))
    ranges = {_of(row): row.true_rom_deg for row in rows}
    return {
        (joint, step): ranges[joint, step]
        for joint in joints
        for step in steps
        if (joint, step) in ranges
    }


def _sequence(rows: Indexed, joint: str) -> str | None:
    """The joint's own sequence, which comes first."""
    return next(row.sequence for row in rows.values() if row.joint == joint)


def _best_filters(rows: list[CycleRow]) -> list[str]:
    """Those with the lowest RMSE over all rows, in the order of the protocol."""
    names = list(dict.fromkeys(row.filter for row in rows))
    error = {
        name: np.mean([row.rmse_deg**2 for row in rows if row.filter == name]) for name in names
    }
    best = sorted(names, key=lambda name: error[name])[:MOST_FILTERS]
    return [name for name in names if name in best]


def _figures(
    evaluation: Evaluation,
    rows: Indexed,
    places: list[Place],
    several: bool,
    colours: Mapping[str, str],
    band: Band | None,
) -> dict[str, Figure]:
    """One small figure for each joint and sweep, by the words that a screen reader says."""
    figures = {}
    for place in places:
        own = {i: row for i, row in rows.items() if _of(row) == place}
        title = place[0] + (f", {next(iter(own.values())).frequency_hz:g} Hz" if several else "")
        curves = {row.filter: _average(evaluation, i) for i, row in own.items()}
        normal = None if band is None else band.curve(angle_name(next(iter(own.values()))))
        figures[f"average cycle of {title}"] = cycle_figure(title, curves, colours, normal)
    return figures


def angle_name(row: CycleRow) -> str:
    """What a cycle is of: of a chain, its joint is an angle; of others, it is the flexion."""
    return row.joint if row.sequence is None else f"{row.joint}_flexion"


def _average(evaluation: Evaluation, row: int) -> dict[str, np.ndarray]:
    """The columns of one average cycle in degrees, thinned out."""
    table = evaluation.series[CYCLES]
    mine = slice(*np.searchsorted(table["row"], [row, row + 1]))
    names = [name for name in table if name.endswith("_rad")]
    cycle = {
        name.removesuffix("_rad"): np.degrees(table[name][mine][::EVERY_PERCENT]) for name in names
    }
    return cycle | {"percent": table["cycle_percent"][mine][::EVERY_PERCENT]}


def cycle_figure(
    title: str,
    curves: Mapping[str, dict[str, np.ndarray]],
    colours: Mapping[str, str],
    normal: NormalCurve | None = None,
) -> Figure:
    """Angle over the cycle, and its error below.

    Args:
        title: Of the figure.
        curves: By filter, the average cycle: "percent", and "estimated", "true", "error" [deg] with
            their standard deviations "estimated_sd" and so on, shape (n,) each.
        colours: By filter.
        normal: That of persons without complaints, drawn behind; none if None.
    """
    true = next(
        iter(curves.values())
    )  # broad and below the others, so that it shows on either side of them
    data = [
        _line(true["percent"], true["true"], TRUE, translucent(REFERENCE, 0.5), "y")
        | {"showlegend": True}
    ]
    data[0]["line"]["width"] = 6
    if normal is not None:
        data.insert(0, normal_band(normal, true["percent"], true["true"]))
    for panel, key in (("y", "estimated"), ("y2", "error")):
        for name, cycle in curves.items():
            data += _band_and_line(
                cycle["percent"], cycle[key], cycle[f"{key}_sd"], name, colours[name], panel
            )
    rows_of_names = -(-(len(curves) + 1 + (normal is not None)) // 3)
    top = 30 + 28 * rows_of_names
    figure = layout(280 + top, hovermode="x", margin={"l": 50, "r": 18, "t": top, "b": 42})
    figure["title"] = {
        "text": text(title),
        "font": {"size": 14},
        "x": 0.02,
        "xanchor": "left",
        "y": 0.98,
        "yanchor": "top",
    }
    figure["xaxis"] = axis("cycle [%]", range=[0, 100], dtick=20, anchor="y2", zeroline=False)
    figure["yaxis"] = axis("angle [deg]", domain=[0.4, 1], nticks=6)
    figure["yaxis2"] = axis("error [deg]", domain=[0, 0.31], nticks=5)
    return {"data": data, "layout": figure}


def _band_and_line(
    x: np.ndarray, y: np.ndarray, sd: np.ndarray, name: str, colour: str, panel: str
) -> list[Figure]:
    band = _line(
        np.concatenate([x, x[::-1]]), np.concatenate([y - sd, (y + sd)[::-1]]), name, colour, panel
    ) | {
        "fill": "toself",
        "fillcolor": translucent(colour, 0.18),
        "line": {"width": 0},
        "hoverinfo": "skip",
    }
    del band["hovertemplate"]
    return [band, _line(x, y, name, colour, panel) | {"showlegend": panel == "y"}]


def _line(x: np.ndarray, y: np.ndarray, name: str, colour: str, panel: str) -> Figure:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": text(name),
        "legendgroup": text(name),
        "showlegend": False,
        "x": rounded(x),
        "y": rounded(y),
        "yaxis": panel,
        "line": {"color": colour, "width": 1.8},
        "hovertemplate": "%{y:.2f}",
    }


# One piece: the cells of a row stand beside the titles that they fall under.
def _table(caption: str, rows: list[CycleRow], folded: bool = False) -> Table:
    variables = list(dict.fromkeys(name for row in rows for name in row.variables))
    stated = any(
        all(row.variables.get(name) == row.frequency_hz for row in rows) for name in variables
    )
    sequences = any(row.sequence is not None for row in rows)
    places = list(dict.fromkeys(_of(row) for row in rows))
    best = {
        place: min((r for r in rows if _of(r) == place), key=lambda r: r.rmse_deg)
        for place in places
    }
    counted = len({row.filter for row in rows}) > 1
    body = []
    for row in sorted(rows, key=lambda r: places.index(_of(r))):
        cells: list[Cell] = [
            label(row.joint),
            *(number(row.variables.get(name), 2) for name in variables),
            said(row.filter),
        ]
        cells += [said(row.sequence)] if sequences else []
        cells += [] if stated else [number(row.frequency_hz, 3)]
        gaps = f"{row.left_out} left out for gaps" if row.left_out else ""
        cells.append(
            Cell(f"{row.cycles}" + (f" (−{row.left_out})" if row.left_out else ""), gaps, "number")
        )
        cells += [number(row.rom_deg), number(row.true_rom_deg)]
        cells.append(
            Cell(
                f"{digits(row.rom_error_deg, 3)} ± {digits(row.rom_error_sd_deg, 3)}", kind="number"
            )
        )
        cells += [number(row.mean_error_deg, 3)]
        cells += [number(row.rmse_deg, 3, kind="best" if counted and row is best[_of(row)] else "")]
        cells += [number(row.error_sd_deg, 3), number(row.cmc, 5)]
        body.append(Row(cells))
    columns = [
        "joint",
        *variables,
        "filter" if sequences else "state",
        *(["sequence"] if sequences else []),
    ]
    titles = header(
        *columns,
        *([] if stated else ["frequency [Hz]"]),
        "cycles",
        "ROM [deg]",
        "true ROM [deg]",
        "ROM error ± sd [deg]",
        "mean e [deg]",
        "RMSE of the average cycle [deg]",
        "scatter of e [deg]",
        "CMC",
        numbers_from=len(columns),
    )
    numbers = [
        Cell(cell.text, kind="number") if cell.text in variables else cell for cell in titles
    ]
    return Table(
        caption,
        numbers,
        body,
        "How to read: ROM is the range of motion, largest less smallest angle, mean over the "
        "cycles; its error with the standard deviation of a single cycle's. Scatter is the "
        "standard deviation of e from cycle to cycle; RMSE is what is left when that is averaged "
        "out, and bold is its lowest. CMC is the coefficient of multiple correlation of estimate "
        "and truth (Ferrari et al. 2010): 1 is the same curve; it grows with the ROM, so compare "
        "joints of like range; a dash means that the two differ more than they move.",
        folded=folded,
    )
