"""The pictures of a certificate, drawn by matplotlib from its record; the one door to it."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

from testbench.records.results.certificate import Figure
from testbench.reporting.page.palette import AXES_COLOURS, COLOURS, REFERENCE

INCH = 25.4
WIDTH_MM = {"log_log": 84, "points": 174, "intervals": 174}
HEIGHT_MM = {"log_log": 62, "points": 48}
ROW_MM, AROUND_MM = 6.5, 18
STYLE = {
    "font.size": 7.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.linewidth": 0.4,
    "grid.color": "#d9dde3",
    "lines.linewidth": 1.1,
    "svg.hashsalt": "testbench",  # the same bytes for the same picture
    "savefig.transparent": True,
}
DASHES = (":", "--", "-.")


def svg_of(figure: Figure) -> bytes:
    """A picture as SVG.

    Args:
        figure: What it shows.
    """
    import matplotlib

    rows = len(figure.rows)
    height = AROUND_MM + ROW_MM * rows if figure.kind == "intervals" else HEIGHT_MM[figure.kind]
    with matplotlib.rc_context(STYLE):
        from matplotlib.figure import Figure as Canvas  # without pyplot: no window, no state

        size = (WIDTH_MM[figure.kind] / INCH, height / INCH)
        canvas = Canvas(figsize=size, layout="constrained")
        axes = canvas.add_subplot()
        DRAWN[figure.kind](axes, figure)
        axes.set_xlabel(figure.x_title)
        axes.set_ylabel(figure.y_title)
        axes.grid(True, which="major")
        axes.set_axisbelow(True)
        target = io.BytesIO()
        canvas.savefig(target, format="svg", metadata={"Date": None})
    return target.getvalue()


def _log_log(axes: Any, figure: Figure) -> None:
    """Curves with bands, and dotted lines of the parts that were found."""
    dashes = iter(DASHES)
    for curve in figure.curves:
        if curve.lower:
            colour = AXES_COLOURS.get(curve.name, COLOURS[0])
            axes.fill_between(curve.x, curve.lower, curve.upper, color=colour, alpha=0.18, lw=0)
            axes.plot(curve.x, curve.y, color=colour, label=curve.name)
        else:
            style = next(dashes, "-")
            axes.plot(curve.x, curve.y, color=REFERENCE, ls=style, lw=0.9, label=curve.name)
    axes.set_xscale("log")
    axes.set_yscale("log")
    ends = [end for curve in figure.curves for end in (*curve.lower, *curve.upper) if end > 0]
    if ends:
        axes.set_ylim(min(ends) / 1.4, max(ends) * 1.4)
    axes.legend(frameon=False, fontsize=6.5, handlelength=1.8)


def _points(axes: Any, figure: Figure) -> None:
    """Points over their number."""
    for curve, colour, marker in zip(figure.curves, (REFERENCE, COLOURS[0]), "ox", strict=False):
        fill = {"mfc": "none"} if marker == "o" else {}
        axes.plot(curve.x, curve.y, marker, color=colour, ms=4, label=curve.name, **fill)
    axes.axhline(0, color="black", lw=0.6)
    axes.legend(frameon=False, ncols=2)


def _intervals(axes: Any, figure: Figure) -> None:
    """Values with intervals, a row each, the first above, and the limits of each row."""
    (curve,) = figure.curves
    for row, value, low, high in zip(curve.x, curve.y, curve.lower, curve.upper, strict=True):
        axes.plot([low, high], [row, row], color=COLOURS[0], lw=1.4, solid_capstyle="butt")
        axes.plot([value], [row], "o", color=COLOURS[0], ms=4)
        for limit in figure.limits[int(row)] if figure.limits else ():
            axes.plot([limit, limit], [row - 0.36, row + 0.36], color=COLOURS[4], lw=1.6)
    axes.set_yticks(curve.x, figure.rows)
    axes.set_ylim(len(figure.rows) - 0.5, -0.5)


DRAWN: dict[str, Callable[[Any, Figure], None]] = {
    "log_log": _log_log,
    "points": _points,
    "intervals": _intervals,
}
