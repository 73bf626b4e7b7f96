"""Curves on two logarithmic axes, with their bands and straight lines of known slopes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from testbench.reporting.page.figure_parts import Figure, axis, layout, rounded, text, titled
from testbench.reporting.page.palette import REFERENCE, translucent


@dataclass(frozen=True)
class Banded:
    """A curve of positive values with an interval about each.

    Attributes:
        value: In the unit of the ordinate, shape (k,).
        lower: Lower end of the interval, shape (k,), in that unit.
        upper: Upper end, shape (k,), in that unit.
    """

    value: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def log_log(
    title: str,
    x: np.ndarray,
    curves: Mapping[str, Banded],
    guides: Mapping[str, np.ndarray],
    colours: Mapping[str, str],
    titles: tuple[str, str],
) -> Figure:
    """Curves with bands, and dotted lines between them.

    Args:
        title: Of the figure.
        x: Common abscissae, shape (k,), positive.
        curves: By name.
        guides: By name, ordinates at `x`, shape (k,) each.
        colours: By name of a curve.
        titles: Of the abscissa and of the ordinate.
    """
    data = []
    for name, curve in curves.items():
        edges = np.concatenate([curve.lower, curve.upper[::-1]])
        data.append(
            _line(np.concatenate([x, x[::-1]]), edges)
            | {
                "fill": "toself",
                "fillcolor": translucent(colours[name], 0.16),
                "line": {"width": 0},
                "name": text(name),
                "legendgroup": text(name),
                "showlegend": False,
                "hoverinfo": "skip",
            }
        )
        data.append(
            _line(x, curve.value)
            | {
                "name": text(name),
                "legendgroup": text(name),
                "line": {"color": colours[name], "width": 1.8},
                "hovertemplate": "%{y:.3g}",
            }
        )
    for (name, values), dash in zip(guides.items(), ("dot", "dash", "dashdot"), strict=False):
        line = {"color": REFERENCE, "width": 1.4, "dash": dash}
        data.append(_line(x, values) | {"name": text(name), "line": line, "hoverinfo": "skip"})
    figure = layout(340, hovermode="x")
    figure["title"] = titled(title)
    figure["margin"]["t"] += 26
    ends = np.concatenate([np.concatenate([c.lower, c.upper]) for c in curves.values()])
    low, high = np.log10(ends[ends > 0].min()), np.log10(ends.max())
    logarithmic = {"type": "log", "zeroline": False, "dtick": 1, "exponentformat": "power"}
    figure["xaxis"] = axis(titles[0]) | logarithmic
    figure["yaxis"] = axis(titles[1]) | logarithmic | {"range": [low - 0.15, high + 0.15]}
    return {"data": data, "layout": figure}


def _line(x: np.ndarray, y: np.ndarray) -> Figure:
    return {"type": "scatter", "mode": "lines", "x": rounded(x), "y": rounded(y)}
