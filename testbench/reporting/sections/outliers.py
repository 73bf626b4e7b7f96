"""Filters that are far from all others: the remark beside their rows, and what they do not do to
the scale of a figure.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from testbench.model.statistics.robust import far_ones
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import OutlierRow
from testbench.reporting.page.page import Sentence
from testbench.reporting.page.tables import Cell, digits, text

RULE = (
    "beyond the upper quartile of all filters by three quartile ranges, and by 1 deg above their "
    "median"
)
FAR_BEYOND = 1.5
"""The largest cell of several maps over that which 98 % stay below, from which it does not set
their colours.
"""
OWN_SCALE = 3.0
"""Maps whose upper ends differ by more than this factor have each their own colours."""
SHARED = "; filters whose median cell is an outlier do not count"
SCALE = (
    ". The colours end at the largest value, or at the one that 98 % of the cells stay below where "
    "the largest is over half as much again. A cell beyond that end is crossed, and its value "
    "shows on hovering"
)
HIDDEN = " Outliers begin hidden, so that the others can be seen: {names}. Click a name to show it."


def outliers_of(
    evaluation: Evaluation,
    owner: str,
    section: str | None = None,
    sequence: str | None = None,
    quantity: str = "",
    motion: str = "",
) -> dict[str, list[OutlierRow]]:
    """Rows by filter; an empty quantity or motion stands for all of them."""
    return _by_filter(
        row
        for row in evaluation.outliers
        if (row.owner, row.section, row.sequence) == (owner, section, sequence)
        and quantity in ("", row.quantity)
        and motion in ("", row.motion)
    )


def remark(rows: Iterable[OutlierRow]) -> Cell:
    """In a column of remarks: that the filter is an outlier in what, and why where that is
    known.
    """
    rows = list(rows)
    if not rows:
        return text("")
    found = [
        f"{row.quantity} {digits(row.value_deg, 1)} deg: outlier, above {digits(row.fence_deg, 1)} "
        "deg"
        for row in rows
    ]
    known = next((row.known for row in rows if row.known), "")
    return text("; ".join(found) + (f". {known}" if known else ""), f"outlier: {RULE}", kind="wide")


def flexion_remarks(rows: Iterable[OutlierRow]) -> list[Sentence]:
    """Sentences on the filters whose flexion is an outlier, below a table that has no room for
    them.
    """
    result = []
    for name, own in _by_filter(rows).items():
        where = "; ".join(
            f"{row.sequence}, {row.section}, {row.motion}: {digits(row.value_deg, 1)} deg, above "
            f"{digits(row.fence_deg, 1)} deg"
            for row in own
        )
        result.append(Sentence(f"Outlier {name} ({where}). {own[0].known}".strip()))
    return result


def _by_filter(rows: Iterable[OutlierRow]) -> dict[str, list[OutlierRow]]:
    result: dict[str, list[OutlierRow]] = {}
    for row in rows:
        result.setdefault(row.filter, []).append(row)
    return result


def how_remarks(any_remark: bool) -> str:
    """What a table's reader must know of the remarks."""
    return f" An outlier is {RULE}; what is known of the filter follows." if any_remark else ""


def flexion_outliers(
    evaluation: Evaluation, joint: str, section: str | None = None, sequence: str | None = None
) -> set[str]:
    """Filters whose flexion of a joint is an outlier, in one section and sequence or in any."""
    return {
        row.filter
        for row in evaluation.outliers
        if row.owner == joint
        and row.quantity == "flexion"
        and section in (None, row.section)
        and sequence in (None, row.sequence)
    }


def hidden_names(names: Iterable[str]) -> str:
    """That some curves begin hidden."""
    names = list(dict.fromkeys(names))
    return HIDDEN.format(names=", ".join(names)) if names else ""


def tops(grids: Mapping[str, np.ndarray]) -> tuple[dict[str, float], str]:
    """Upper end of the colours of each of several maps, and how to read them.

    All share one, but where their own differ by more than a factor: then each has its own, or the
    small ones would be dark throughout.

    Args:
        grids: By filter, shape (n, m) each, in one unit; NaN where there is nothing.
    """
    own = {name: common_top({name: grid}) for name, grid in grids.items()}
    if max(own.values()) > OWN_SCALE * min(own.values()):
        return (
            own,
            f"each map has colours of its own, for they differ {OWN_SCALE:g}-fold or more{SCALE}",
        )
    return dict.fromkeys(grids, common_top(grids)), f"all maps share their colours{SHARED}{SCALE}"


def common_top(grids: Mapping[str, np.ndarray]) -> float:
    """Upper end of the colours that several maps share.

    It is the largest cell of the filters that are no outliers, or the value that 98 % of these
    cells lie below where the largest is far beyond it.

    Args:
        grids: By filter, shape (n, m) each, in one unit; NaN where there is nothing.
    """
    middles = {
        name: float(np.median(grid[np.isfinite(grid)]))
        for name, grid in grids.items()
        if np.isfinite(grid).any()
    }
    far = far_ones(middles)
    known = [
        grid[np.isfinite(grid)]
        for name, grid in grids.items()
        if name in middles and name not in far
    ]
    if not known:
        return 1.0
    cells = np.concatenate(known)
    usual, largest = float(np.quantile(cells, 0.98)), float(cells.max())
    return max(largest if largest <= FAR_BEYOND * usual else usual, 1e-3)
