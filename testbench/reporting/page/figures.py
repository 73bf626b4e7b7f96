"""Figures of the report, as plain dictionaries that plotly.js draws; the one door to plotly.

A figure is {"data": [...], "layout": {...}} without colours of text, grid or background: the page
adds those of its scheme. Validated graph objects would cost more time than everything else in the
report.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from testbench.records.results.study import BoxNumbers
from testbench.reporting.page.figure_parts import MARGIN
from testbench.reporting.page.figure_parts import Figure as Figure
from testbench.reporting.page.figure_parts import axis as _axis
from testbench.reporting.page.figure_parts import layout as _layout
from testbench.reporting.page.figure_parts import packed as _packed
from testbench.reporting.page.figure_parts import rounded as _rounded
from testbench.reporting.page.figure_parts import text as _text
from testbench.reporting.page.figure_parts import titled as _titled
from testbench.reporting.page.figure_parts import two_lines as _two_lines
from testbench.reporting.page.palette import REFERENCE, translucent

FLAT = 8.0
"""The highest curve over the median of ours from which a linear axis leaves half of these an eighth
of its height.
"""
_NAMES = 16
"""Height of a line with the names of sections [px]."""


@cache
def packed_plotly() -> str:
    """The source of plotly.js for a page, which a browser unpacks: gzip in base64, less than half
    the size.
    """
    from plotly.offline import get_plotlyjs

    packed = gzip.compress(str(get_plotlyjs()).encode(), compresslevel=6, mtime=0)
    return base64.b64encode(packed).decode("ascii")


def as_plotly(figure: Figure) -> Any:
    """The figure as an object of plotly's, `plotly.graph_objects.Figure`."""
    import plotly.graph_objects as go

    return go.Figure(figure)


@dataclass(frozen=True)
class Curve:
    """A line over the commanded flexion.

    Attributes:
        name: For the legend.
        x: Abscissae, shape (n,).
        y: Ordinates, shape (n,); None is a gap.
        colour: Of the line and its markers.
        sd: Half height of its band, shape (n,), or None for none.
        dashed: A reference.
        hidden: Shown only once its name is clicked.
        mode: "lines", "markers" or both, as plotly has it.
        symbol: Of the markers.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float | None]
    colour: str
    sd: Sequence[float] | None = None
    dashed: bool = False
    hidden: bool = False
    mode: str = "lines+markers"
    symbol: str = ""


# One piece: a figure as plotly.js takes it, most lines are its keys.
def error_curves(
    curves: Iterable[Curve],
    x_title: str,
    y_title: str,
    logarithmic: bool = False,
    plane: bool = False,
    signed: bool = False,
) -> Figure:
    """Lines with markers and bands.

    On a logarithmic axis, without bands, where a linear one would leave most of them flat.

    Args:
        curves: What is drawn.
        x_title: Of the abscissa.
        y_title: Of the ordinate.
        logarithmic: The vertical axis in any case; zeros have no place on it.
        plane: Both axes are places, drawn to one scale.
        signed: The values are no errors: the axis goes where they are, and is linear.
    """
    data: list[Figure] = []
    curves = list(curves)
    logarithmic = logarithmic or (not plane and not signed and flat_on_a_linear_axis(curves))
    for curve in curves:
        if curve.sd is not None and not logarithmic:
            least = -np.inf if signed else 0.0  # magnitudes end at none
            low = [
                max(y - s, least) for y, s in zip(curve.y, curve.sd, strict=True) if y is not None
            ]
            high = [y + s for y, s in zip(curve.y, curve.sd, strict=True) if y is not None]
            x = [value for value, y in zip(curve.x, curve.y, strict=True) if y is not None]
            data.append(_band(x, low, high, curve))
        data.append(
            {
                "type": "scatter",
                "mode": curve.mode,
                "name": _text(curve.name),
                "legendgroup": _text(curve.name),
                "x": _rounded(curve.x),
                "y": _rounded(
                    [None if logarithmic and y is not None and y <= 0 else y for y in curve.y]
                ),
                "line": {
                    "color": curve.colour,
                    "width": 2,
                    "dash": "dot" if curve.dashed else "solid",
                },
                "marker": {
                    "size": 6,
                    "color": curve.colour,
                    "symbol": curve.symbol or ("diamond-open" if curve.dashed else "circle"),
                },
                "visible": "legendonly" if curve.hidden else True,
                "hovertemplate": "%{y:.3f}",
            }
        )
    layout = _layout(380, hovermode="closest" if plane else "x unified", showlegend=True)
    layout["xaxis"] = _axis(x_title)
    layout["yaxis"] = _axis(y_title, rangemode="normal" if signed else "tozero")
    if logarithmic:
        layout["yaxis"] = _axis(y_title) | {
            "type": "log",
            "zeroline": False,
            "dtick": 1,
            "exponentformat": "none",
        }
    if plane:
        layout["yaxis"] |= {"scaleanchor": "x", "rangemode": "normal"}
    return {"data": data, "layout": layout}


def flat_on_a_linear_axis(curves: Sequence[Curve]) -> bool:
    """Whether half of our curves would keep to the lowest part of an axis that shows every curve
    that is not hidden.

    Never where a value is negative: signed errors have no place on a logarithmic axis.
    """
    if any(y is not None and y < 0 for curve in curves for y in curve.y):
        return False
    tops = {
        dashed: [
            max(known)
            for curve in curves
            if curve.dashed is dashed and not curve.hidden
            if (known := [y for y in curve.y if y is not None and np.isfinite(y)])
        ]
        for dashed in (False, True)
    }
    return bool(tops[False]) and max(*tops[False], *tops[True], 0.0) >= FLAT * float(
        np.median(tops[False])
    )


def _band(x: list[float], low: list[float], high: list[float], curve: Curve) -> Figure:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _rounded([*x, *reversed(x)]),
        "y": _rounded([*low, *reversed(high)]),
        "fill": "toself",
        "fillcolor": translucent(curve.colour, 0.16),
        "line": {"width": 0},
        "legendgroup": _text(curve.name),
        "showlegend": False,
        "visible": "legendonly" if curve.hidden else True,
        "hoverinfo": "skip",
    }


@dataclass(frozen=True)
class Axis:
    """One side of a grid.

    Attributes:
        title: With the unit in square brackets.
        places: Where the cells lie, shape (n,); words make cells of equal size.
    """

    title: str
    places: Sequence[float] | Sequence[str]


def heat_map(title: str, x: Axis, y: Axis, z: np.ndarray, z_title: str, z_max: float) -> Figure:
    """Values over a grid.

    Args:
        title: Of the figure.
        x: The m columns.
        y: The n rows.
        z: Values, shape (n, m), in the unit of `z_title`; NaN where there is none.
        z_title: Of the colours.
        z_max: Upper end of the colours; cells beyond it are crossed.
    """
    end = _rounded_up(z_max)
    columns, rows = _places(x.places), _places(y.places)
    data = {
        "type": "heatmap",
        "x": columns,
        "y": rows,
        "z": [_rounded(row) for row in z],
        "zmin": 0,
        "zmax": end,
        "colorscale": "Viridis",
        "colorbar": {
            "title": {"text": _text(z_title), "side": "right"},
            "thickness": 12,
            "outlinewidth": 0,
        },
        "hovertemplate": f"{_text(x.title)} %{{x}}<br>{_text(y.title)} %{{y}}<br>{_text(z_title)} "
        "%{z:.3f}<extra></extra>",
    }
    layout = _layout(300) | {
        "title": {
            "text": _text(title),
            "font": {"size": 14},
            "x": 0.02,
            "xanchor": "left",
            "y": 0.97,
        }
    }
    layout["xaxis"] = _axis(x.title, range=_edges(x.places)) | _few_ticks(x.places)
    layout["yaxis"] = _axis(y.title, range=_edges(y.places)) | _few_ticks(y.places)
    return {"data": [data, *_crosses(columns, rows, z, end)], "layout": layout}


def _crosses(x: list[Any], y: list[Any], z: np.ndarray, z_max: float) -> list[Figure]:
    """A cross in each cell that lies beyond the colours."""
    rows, columns = np.nonzero(np.isfinite(z) & (z > z_max * (1 + 1e-9)))
    if not len(rows):
        return []
    marker = {"symbol": "x-thin", "size": 5, "line": {"color": "#14171c", "width": 1}}
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "x": [x[j] for j in columns],
            "y": [y[i] for i in rows],
            "marker": marker,
            "hoverinfo": "skip",
            "showlegend": False,
        }
    ]


def _rounded_up(value: float) -> float:
    """To three significant digits, so that nothing below it comes to lie beyond it."""
    step = 10.0 ** (np.floor(np.log10(value)) - 2) if value > 0 else 1.0
    return float(f"{np.ceil(value / step - 1e-6) * step:.3g}")


def _edges(values: Sequence[float] | Sequence[str]) -> list[float]:
    """Where the first cell begins and the last one ends, as plotly draws cells about their
    places.
    """
    if len(values) < 2 or isinstance(values[0], str):
        first = 0.0 if isinstance(values[0], str) else float(values[0])
        return [first - 0.5, first + len(values) - 0.5]
    places = [float(value) for value in values]
    return [1.5 * places[0] - 0.5 * places[1], 1.5 * places[-1] - 0.5 * places[-2]]


def _places(values: Sequence[float] | Sequence[str]) -> list[Any]:
    return [_text(value) if isinstance(value, str) else value for value in values]


def _few_ticks(values: Sequence[float] | Sequence[str]) -> Figure:
    """A tick at every value where they are few; an even choice otherwise."""
    if len(values) > 8:
        return {"nticks": 8}
    kind = {"type": "category"} if isinstance(values[0], str) else {}
    return {"tickmode": "array", "tickvals": _places(values), **kind}


def box_plots(
    boxes: Mapping[str, BoxNumbers],
    colours: Mapping[str, str],
    x_title: str,
    logarithmic: bool = False,
) -> Figure:
    """Lying box plots, one above the other, from their numbers.

    Args:
        boxes: By name, the uppermost first.
        colours: By name.
        x_title: Of the axis of values.
        logarithmic: That axis.
    """
    data: list[Figure] = []
    for name, box in boxes.items():
        data.append(
            {
                "type": "box",
                "orientation": "h",
                "name": _text(name),
                "y": [_text(name)],
                "q1": _rounded([box.q1]),
                "median": _rounded([box.median]),
                "q3": _rounded([box.q3]),
                "lowerfence": _rounded([box.lower]),
                "upperfence": _rounded([box.upper]),
                "line": {"color": colours[name], "width": 1.6},
                "fillcolor": translucent(colours[name], 0.25),
                "showlegend": False,
            }
        )
        if box.outliers:
            data.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "name": _text(name),
                    "x": _rounded(box.outliers),
                    "y": [_text(name)] * len(box.outliers),
                    "marker": {"size": 6, "symbol": "circle-open", "color": colours[name]},
                    "showlegend": False,
                    "hovertemplate": "%{x:.3f}",
                }
            )
    layout = _layout(110 + 30 * len(boxes))
    layout["xaxis"] = _axis(x_title) | (
        {"type": "log", "zeroline": False, "dtick": 1} if logarithmic else {}
    )
    layout["yaxis"] = _axis("") | {
        "type": "category",
        "categoryorder": "array",
        "categoryarray": _reversed(boxes),
    }
    return {"data": data, "layout": layout}


def scatter_rows(
    rows: Mapping[str, tuple[Sequence[float], Sequence[float], Sequence[float]]],
    colours: Mapping[str, str],
    x_title: str,
) -> Figure:
    """Values of each name in a row of its own, with two intervals below them.

    Args:
        rows: By name, the uppermost first: the values, the ends of a narrow interval, drawn thick,
            and those of a wide one, drawn thin.
        colours: By name.
        x_title: Of the axis of values.
    """
    data: list[Figure] = []
    for name, (values, narrow, wide) in rows.items():
        for ends, width in ((wide, 2), (narrow, 8)):
            data.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "x": _rounded(ends),
                    "y": [_text(name)] * 2,
                    "line": {"color": translucent(colours[name], 0.45), "width": width},
                    "showlegend": False,
                    "hovertemplate": "%{x:.3f}",
                    "name": _text(name),
                }
            )
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": _text(name),
                "x": _rounded(values),
                "y": [_text(name)] * len(values),
                "marker": {"size": 8, "symbol": "circle-open", "color": colours[name]},
                "showlegend": False,
                "hovertemplate": "%{x:.3f}",
            }
        )
    layout = _layout(110 + 30 * len(rows))
    layout["xaxis"] = _axis(x_title)
    layout["yaxis"] = _axis("") | {
        "type": "category",
        "categoryorder": "array",
        "categoryarray": _reversed(rows),
    }
    return {"data": data, "layout": layout}


@dataclass(frozen=True)
class Bar:
    """A value, and the ends of its interval or None where that is not known."""

    value: float
    interval: Sequence[float] | None = None


def dots(
    title: str,
    bars: Mapping[str, Bar],
    colours: Mapping[str, str],
    x_title: str,
    line: float | None = None,
    line_name: str = "",
) -> Figure:
    """A dot for each name, with its interval, over a common axis.

    Logarithmic where the values would crowd at its end.

    Args:
        title: Of the figure.
        bars: By name, the uppermost first; values above zero.
        colours: By name.
        x_title: Of the axis of values.
        line: Where an upright is drawn, in the unit of the axis; none if None.
        line_name: What stands beside it.
    """
    values = [bar.value for bar in bars.values()]
    ends = [end for bar in bars.values() for end in bar.interval or ()]
    logarithmic = min(values) > 0 and max(values) > FLAT * float(np.median(values))
    least = min(values) / 10 if logarithmic else -np.inf
    data = [trace for name, bar in bars.items() for trace in _dot(name, bar, colours[name], least)]
    layout = _layout(104 + 26 * len(bars))
    layout["title"] = _titled(title)
    layout["margin"]["t"] += 14
    low, high = min([0.0, *ends, *values]), max([*values, *ends, line or 0.0])
    layout["xaxis"] = _axis(x_title) | (
        {"type": "log", "zeroline": False, "dtick": 1, "exponentformat": "none"}
        if logarithmic
        else {"range": [low - 0.02 * (high - low), high + 0.06 * (high - low)]}
    )
    layout["yaxis"] = _axis("") | {
        "type": "category",
        "categoryorder": "array",
        "categoryarray": _reversed(bars),
    }
    if line is not None:
        layout["shapes"], layout["annotations"] = _upright(line, line_name, logarithmic)
    return {"data": data, "layout": layout}


def _dot(name: str, bar: Bar, colour: str, least: float) -> list[Figure]:
    """A dot, over the line of its interval, which an axis shows from `least` on."""
    common: Figure = {"type": "scatter", "showlegend": False}
    dot = common | {
        "mode": "markers",
        "name": _text(name),
        "x": _rounded([bar.value]),
        "y": [_text(name)],
        "marker": {"size": 10, "color": colour},
        "hovertemplate": "%{x:.3f} deg",
    }
    if bar.interval is None:
        return [dot]
    low, high = bar.interval
    line = common | {
        "mode": "lines",
        "x": _rounded([max(low, least), high]),
        "y": [_text(name)] * 2,
        "line": {"color": colour, "width": 3},
        "hoverinfo": "skip",
    }
    return [line, dot]


def _upright(at: float, name: str, logarithmic: bool) -> tuple[list[Figure], list[Figure]]:
    """A dashed line across a figure, and its name above the panel."""
    line = {"color": REFERENCE, "width": 1.5, "dash": "dash"}
    place = {"xref": "x", "yref": "paper", "y0": 0, "y1": 1}
    words = {
        "text": _text(name),
        "xref": "x",
        "yref": "paper",
        "x": np.log10(at) if logarithmic else at,  # plotly places notes on such axes by exponents
        "y": 1,
        "yanchor": "bottom",
        "showarrow": False,
        "font": {"size": 11, "color": REFERENCE},
    }
    return [{"type": "line", "x0": at, "x1": at, "line": line} | place], [words]


def _reversed(names: Iterable[str]) -> list[str]:
    """From the bottom to the top."""
    return [_text(name) for name in names][::-1]


@dataclass(frozen=True)
class Span:
    """A part of the time axis that is named: a section of the protocol [s]."""

    name: str
    begin: float
    end: float


def time_panels(
    time: np.ndarray,
    panels: Mapping[str, Mapping[str, np.ndarray]],
    colours: Mapping[str, str],
    spans: Sequence[Span] = (),
    hidden: Iterable[str] = (),
) -> Figure:
    """Signals over time, in panels one above the other that share the time axis.

    Args:
        time: Shape (n,) [s].
        panels: By title of the vertical axis, the signals by name, shape (n,).
        colours: By name.
        spans: Sections of the protocol, marked in every panel.
        hidden: Signals shown only once their name is clicked.
    """
    hidden = set(hidden)
    data: list[Figure] = []
    height = 96 + (200 if len(panels) > 1 else 260) * len(panels)
    layout = _layout(height, hovermode="x")
    gap = 0.05 if len(panels) == 2 else 0.1 / len(panels) if len(panels) > 1 else 0.0
    each = (1 - gap * (len(panels) - 1)) / len(panels)
    times = _packed(time)
    for i, (title, signals) in enumerate(panels.items()):
        number = "" if i == 0 else str(i + 1)
        rank = _smoothness(signals)
        for name, values in signals.items():
            data.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "name": _text(name),
                    "legendgroup": _text(name),
                    "showlegend": i == 0,
                    "x": times,
                    "y": _packed(values),
                    "yaxis": f"y{number}",
                    "zorder": rank[name],
                    "line": {"color": colours[name], "width": 1.2},
                    "connectgaps": False,
                    "visible": "legendonly" if name in hidden else True,
                    "hovertemplate": "%{y:.3f}",
                }
            )
        top = 1 - i * (each + gap)
        layout[f"yaxis{number}"] = _axis(title) | {"domain": [max(top - each, 0.0), top]}
        if len(panels) > 1:  # a title longer than its panel is high would run into the next
            layout[f"yaxis{number}"]["title"] |= {"text": _two_lines(title), "font": {"size": 12}}
    layout["xaxis"] = _axis("time since start [s]") | {
        "anchor": "y" if len(panels) == 1 else f"y{len(panels)}",
        "showspikes": True,
    }
    layout["shapes"], layout["annotations"] = _section_marks(spans)
    if layout["annotations"]:  # their names stand between the panel and the legend
        layout["margin"]["t"] += _NAMES
        layout["height"] += _NAMES
        layout["legend"]["y"] = 1 + _NAMES / (height - MARGIN["t"] - MARGIN["b"])
    return {"data": data, "layout": layout}


def _smoothness(signals: Mapping[str, np.ndarray]) -> dict[str, int]:
    """Order of drawing: the noisiest signal first, so that it does not cover the others."""

    def roughness(name: str) -> float:
        steps = np.abs(np.diff(signals[name]))
        return float(np.nanmean(steps)) if np.isfinite(steps).any() else 0.0

    return {name: i for i, name in enumerate(sorted(signals, key=roughness, reverse=True))}


def _section_marks(spans: Sequence[Span]) -> tuple[list[Figure], list[Figure]]:
    """A line where each section begins, and the names of those wide enough to carry one."""
    if len(spans) < 2:
        return [], []
    whole = spans[-1].end - spans[0].begin
    lines = [
        {
            "type": "line",
            "xref": "x",
            "yref": "paper",
            "x0": s.begin,
            "x1": s.begin,
            "y0": 0,
            "y1": 1,
            "line": {"color": REFERENCE, "width": 1, "dash": "dot"},
            "layer": "below",
        }
        for s in spans
    ]
    names = [
        {
            "text": _text(s.name),
            "xref": "x",
            "yref": "paper",
            "x": s.begin,
            "y": 1,
            "xanchor": "left",
            "yanchor": "bottom",
            "showarrow": False,
            "font": {"size": 11, "color": REFERENCE},
            "borderpad": 0,
        }
        for s in spans
        if s.end - s.begin > 0.1 * whole
    ]
    return lines, names
