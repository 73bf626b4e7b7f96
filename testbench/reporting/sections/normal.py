"""The band of persons without complaints behind an average cycle."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from testbench.records.specs.band import Band, NormalCurve
from testbench.reporting.page.figure_parts import Figure, rounded
from testbench.reporting.page.page import Figures, Section, Sentence
from testbench.reporting.page.palette import REFERENCE, translucent

NORMAL = "normal"
"""The group of a band's trace, by which it is found again."""


def normal_band(curve: NormalCurve, percent: np.ndarray, angle: np.ndarray) -> Figure:
    """Mean of other persons with one standard deviation to either side, as a trace.

    Cycles may be cut at another event than those of the band, so that it is moved by the whole
    percent at which it goes most like the angle.

    Args:
        curve: Of the persons.
        percent: Of the cycle, shape (k,).
        angle: Over it, shape (k,) [deg].
    """
    moved = best_shift(curve, percent, angle)
    mean, sd = curve.at(percent - moved)
    name = NORMAL if moved == 0 else f"{NORMAL}, moved by {moved} %"
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "legendgroup": NORMAL,
        "x": rounded(np.concatenate([percent, percent[::-1]])),
        "y": rounded(np.concatenate([mean - sd, (mean + sd)[::-1]])),
        "yaxis": "y",
        "fill": "toself",
        "fillcolor": translucent(REFERENCE, 0.22),
        "line": {"width": 0, "color": REFERENCE},
        "hoverinfo": "skip",
    }


def best_shift(curve: NormalCurve, percent: np.ndarray, angle: np.ndarray) -> int:
    """By how many percent a curve must come later to go most like an angle, -50 to 49.

    Args:
        curve: Of the persons.
        percent: Of the cycle, shape (k,).
        angle: Over it, shape (k,) [deg]; NaN counts nowhere.
    """
    known = np.isfinite(angle)
    own = angle[known] - angle[known].mean()
    shifts = np.arange(-50, 50)
    means = np.array([curve.at(percent[known] - shift)[0] for shift in shifts])
    means -= means.mean(axis=1, keepdims=True)
    like = means @ own / np.maximum(np.linalg.norm(means, axis=1), 1e-12)
    return int(shifts[np.argmax(like)])


def normal_words(band: Band | None) -> str:
    """What a reader must know of the band."""
    if band is None:
        return ""
    return (
        f" The grey band is normal: mean and one standard deviation of {band.description} "
        f"({band.source}), moved along the cycle to go most like the angle."
    )


def unused(band: Band, sections: Iterable[Section]) -> Sentence | None:
    """That a band was given and nothing is drawn before it; None where something is."""
    figures = (
        figure
        for section in sections
        for block in section.blocks
        if isinstance(block, Figures)
        for figure in block.figures.values()
    )
    if any(trace.get("legendgroup") == NORMAL for figure in figures for trace in figure["data"]):
        return None
    return Sentence(
        f"The normal band has {band.told}; no average cycle of this session is of one of these.",
        "warning",
    )
