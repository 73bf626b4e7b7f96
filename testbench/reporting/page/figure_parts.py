"""What the figures of the report have in common: margins, axes, and how texts and numbers are
handed to plotly.js.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape
from typing import Any

import numpy as np

Figure = dict[str, Any]
MARGIN = {"l": 58, "r": 14, "t": 34, "b": 46}
"""About the panels of a figure [px]."""


def layout(height: int, **more: Any) -> Figure:
    """What every figure has; its height in pixels."""
    return {
        "height": height,
        "margin": dict(MARGIN),
        "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 1.0, "yanchor": "bottom"},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "hoverlabel": {"namelength": -1},
        **more,
    }


def titled(words: str) -> Figure:
    """A title at the upper edge, where it stays whatever room the names of curves take."""
    place = {"x": 0.02, "xanchor": "left", "y": 1, "yref": "container", "yanchor": "top"}
    return {"text": text(words), "font": {"size": 14}, "pad": {"t": 8}} | place


def axis(title: str, **more: Any) -> Figure:
    """An axis with its title."""
    return {
        "title": {"text": text(title), "standoff": 8},
        "automargin": True,
        "zeroline": True,
        **more,
    }


def two_lines(title: str) -> str:
    """A title broken at its comma, or before its unit where it is long."""
    for mark, keeps in ((", ", ","), (" [", "")):
        before, found, after = title.partition(mark)
        if found and len(title) > 20:
            return f"{text(before)}{keeps}<br>{text(mark.lstrip(', ') + after)}"
    return text(title)


def text(words: str) -> str:
    """Plotly reads its texts as HTML: show them as they are."""
    return escape(str(words), quote=False)


def rounded(values: Iterable[float | None]) -> list[float | None]:
    """Four significant digits are more than a figure can show; JSON has no NaN."""
    return [
        None if value is None or not np.isfinite(value) else float(f"{value:.4g}")
        for value in values
    ]


def packed(values: np.ndarray) -> Figure:
    """A typed array as plotly.js takes it: a third of the size of digits, and NaN is a gap.

    Args:
        values: Shape (n,), in the unit of the axis; what a figure cannot hold is a gap.
    """
    held = np.abs(values) < np.finfo(np.float32).max
    drawn = np.where(held, values, np.nan).astype("<f4")
    return {"dtype": "f4", "bdata": base64.b64encode(drawn.tobytes()).decode("ascii")}
