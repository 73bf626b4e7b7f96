"""Figures of how values are spread, and of what a sum of squares is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap

import numpy as np

from testbench.reporting.page.figure_parts import Figure, axis, layout, rounded, text, titled
from testbench.reporting.page.palette import translucent

BINS = 40
CENTRAL = (0.25, 99.75)
"""Percentiles that a histogram ends at: single values would make it a spike."""
NAME = 30
"""Letters in a line of a bar's name."""
CURVE = 81
"""Points of a density."""


def histogram(title: str, values: np.ndarray, colour: str, x_title: str) -> Figure:
    """How often values occur, as a density, with the normal one of their mean and deviation.

    Args:
        title: Of the figure.
        values: Shape (n,), n >= 2, in the unit of `x_title`, not all the same.
        colour: Of the bars.
        x_title: Of the axis of values.
    """
    mean, sd = float(values.mean()), float(values.std(ddof=1))
    low, high = np.percentile(values, CENTRAL)
    edges = np.linspace(low, high, BINS + 1) if high > low else mean + sd * np.array([-3.0, 3.0])
    counts, _ = np.histogram(values, edges)
    density = counts / (len(values) * np.diff(edges))
    x = np.linspace(edges[0], edges[-1], CURVE)
    normal = np.exp(-0.5 * ((x - mean) / sd) ** 2) / (sd * np.sqrt(2 * np.pi))
    unit = x_title.rpartition("[")[2].rstrip("]")
    bars = {
        "type": "bar",
        "name": "measured",
        "x": rounded((edges[:-1] + edges[1:]) / 2),
        "y": rounded(density),
        "width": float(edges[1] - edges[0]),
        "marker": {"color": translucent(colour, 0.55), "line": {"width": 0}},
        "hovertemplate": "%{x:.3f}: %{y:.3g}",
    }
    curve = {
        "type": "scatter",
        "mode": "lines",
        "name": "normal",
        "x": rounded(x),
        "y": rounded(normal),
        "line": {"color": colour, "width": 2},
        "hoverinfo": "skip",
    }
    figure = layout(250, bargap=0, showlegend=False)
    figure["title"] = titled(title)
    figure["xaxis"] = axis(x_title, range=[float(edges[0]), float(edges[-1])], nticks=7)
    figure["yaxis"] = axis(f"density [1/{unit}]", nticks=5)
    return {"data": [bars, curve], "layout": figure}


def stacked_squares(
    title: str, parts: Mapping[str, Sequence[float]], names: Sequence[str], x_title: str
) -> Figure:
    """Bars of standard uncertainties, the largest source above, one colour for each use of them.

    Args:
        title: Of the figure.
        parts: By source, one value for each name.
        names: What the values are of.
        x_title: Of the axis of values.
    """
    order = sorted(parts, key=lambda source: max(parts[source]))
    colours = ("#3276d8", "#cc6632")
    data = [
        {
            "type": "bar",
            "orientation": "h",
            "name": text(name),
            "y": [wrapped(source) for source in order],
            "x": rounded(parts[source][i] for source in order),
            "marker": {"color": colours[i % len(colours)]},
            "hovertemplate": "%{x:.3g}",
        }
        for i, name in enumerate(names)
    ]
    figure = layout(124 + 38 * len(parts), barmode="group", bargap=0.25)
    figure["title"] = titled(title)
    figure["margin"]["t"] += 26
    figure["xaxis"] = axis(x_title, rangemode="tozero")
    figure["yaxis"] = axis("", type="category") | {"tickfont": {"size": 11}}
    return {"data": data, "layout": figure}


def wrapped(name: str) -> str:
    """A long name in lines of which none takes half of a small figure."""
    return "<br>".join(text(line) for line in wrap(name, NAME))
