"""Figures in space, which can be turned."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.reporting.page.figure_parts import Figure, layout, rounded, text, titled
from testbench.reporting.page.figures import Axis
from testbench.reporting.page.palette import REFERENCE, rgb

MERIDIANS, PARALLELS, ROUND = 12, 5, 49
"""Circles of a sphere, and points of each."""


def surfaces(
    title: str,
    x: Axis,
    y: Axis,
    z: Mapping[str, np.ndarray],
    colours: Mapping[str, str],
    z_title: str,
    shown: str,
) -> Figure:
    """Values over a grid as surfaces in space, one above the other; all but one begin hidden.

    Args:
        title: Of the figure.
        x: The m columns.
        y: The n rows.
        z: By name, shape (n, m), in the unit of `z_title`; NaN where there is none.
        colours: By name.
        z_title: Of the vertical axis.
        shown: The name whose surface begins to be seen.
    """
    data = [
        {
            "type": "surface",
            "name": text(name),
            "x": list(x.places),
            "y": list(y.places),
            "z": [rounded(row) for row in values],
            "colorscale": [[0, _shaded(colours[name], 0.45)], [1, _shaded(colours[name], 1.0)]],
            "showscale": False,
            "showlegend": True,
            "opacity": 0.92,
            "visible": True if name == shown else "legendonly",
            "contours": {"z": {"show": True, "usecolormap": False, "color": "#ffffff", "width": 1}},
            "hovertemplate": f"{text(x.title)} %{{x}}<br>{text(y.title)} %{{y}}<br>"
            f"{text(z_title)} %{{z:.3f}}",
        }
        for name, values in z.items()
    ]
    figure = layout(520, margin={"l": 0, "r": 0, "t": 34, "b": 0})
    figure["title"] = titled(title)
    figure["legend"] = {"x": 0, "y": 0.92, "yanchor": "top"}
    figure["scene"] = {
        "aspectmode": "manual",
        "aspectratio": {"x": 1.3, "y": 1.3, "z": 0.8},
        "xaxis": {"title": {"text": text(x.title)}},
        "yaxis": {"title": {"text": text(y.title)}},
        "zaxis": {"title": {"text": text(z_title)}, "rangemode": "tozero"},
        "camera": {"eye": {"x": 1.5, "y": -1.6, "z": 0.9}},
    }
    return {"data": data, "layout": figure}


def _shaded(colour: str, share: float) -> str:
    """A colour between black and itself."""
    return "rgb({}, {}, {})".format(*(round(share * part) for part in rgb(colour)))


def sphere(
    title: str, directions: np.ndarray, values: np.ndarray, value_title: str, axes: str
) -> Figure:
    """Points on a sphere, coloured by a value of each.

    Args:
        title: Of the figure.
        directions: Unit vectors, shape (n, 3).
        values: Shape (n,), in the unit of `value_title`.
        value_title: Of the colours.
        axes: What the three axes are of, such as the sensor.
    """
    lines = _circles()
    largest = max(float(np.abs(values).max()), 1e-9)
    points = {
        "type": "scatter3d",
        "mode": "markers",
        "name": text(title),
        **{key: rounded(directions[:, i]) for i, key in enumerate("xyz")},
        "marker": {
            "size": 6,
            "color": rounded(values),
            "cmin": -largest,
            "cmax": largest,
            "colorscale": "RdBu",
            "line": {"width": 1, "color": REFERENCE},
            "colorbar": {"title": {"text": text(value_title), "side": "right"}, "thickness": 12},
        },
        "text": [str(i + 1) for i in range(len(values))],
        "hovertemplate": "pose %{text}<br>%{marker.color:.3g}",
        "showlegend": False,
    }
    grid = {
        "type": "scatter3d",
        "mode": "lines",
        **{key: rounded(lines[:, i]) for i, key in enumerate("xyz")},
        "line": {"color": REFERENCE, "width": 1},
        "opacity": 0.5,
        "hoverinfo": "skip",
        "showlegend": False,
    }
    figure = layout(430, margin={"l": 0, "r": 0, "t": 34, "b": 0})
    figure["title"] = titled(title)
    ticks = {"tickvals": [-1, 0, 1], "range": [-1.2, 1.2]}
    figure["scene"] = {
        "aspectmode": "cube",
        **{f"{key}axis": {"title": {"text": f"{axes} {key}"}, **ticks} for key in "xyz"},
    }
    return {"data": [grid, points], "layout": figure}


def _circles() -> np.ndarray:
    """Meridians and parallels of a unit sphere, apart by rows of NaN, shape (n, 3)."""
    turn = np.linspace(0, 2 * np.pi, ROUND)
    circles = []
    for longitude in np.pi * np.arange(MERIDIANS // 2) / (MERIDIANS // 2):
        c, s = np.cos(longitude), np.sin(longitude)
        circles.append(np.column_stack([c * np.cos(turn), s * np.cos(turn), np.sin(turn)]))
    for latitude in np.linspace(-np.pi / 2, np.pi / 2, PARALLELS + 2)[1:-1]:
        radius = np.cos(latitude)
        height = np.full(ROUND, np.sin(latitude))
        circles.append(np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height]))
    gap = np.full((1, 3), np.nan)
    return np.concatenate([part for circle in circles for part in (circle, gap)])
