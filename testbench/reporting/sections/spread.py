"""How errors are spread: histograms with the normal density of the same mean and deviation, and box
plots of the filters beside one another.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import BoxNumbers
from testbench.records.session.layout import joint_table, orientation_table
from testbench.reporting.page.distributions import histogram
from testbench.reporting.page.figures import box_plots
from testbench.reporting.page.page import Block, Figures

MOST_HISTOGRAMS = 6
"""Of more filters those with the smallest errors."""
FEWEST = 50
"""Errors from which on their spread is drawn."""
WHISKERS = (2.5, 97.5)
"""Percentiles that whiskers end at: of thousands of samples thousands lie beyond Tukey's."""


def joint_spread(evaluation: Evaluation, joint: str, colours: Mapping[str, str]) -> list[Block]:
    """Of the flexion errors of a joint, by its own definition."""
    own = next((row.sequence for row in evaluation.joint_angle if row.joint == joint), None)
    names = dict.fromkeys(r.filter for r in evaluation.joint_angle if r.joint == joint)
    columns = {name: f"{name}_{own}_error_rad" for name in names}
    errors = _errors(evaluation.series.get(joint_table(joint), {}), columns)
    return _blocks(f"flexion error of {joint}, {own}", "flexion error [deg]", errors, colours)


def heading_spread(evaluation: Evaluation, sensor: str, colours: Mapping[str, str]) -> list[Block]:
    """Of the heading errors of a sensor, the part of an orientation error that has a sign."""
    names = [row.filter for row in evaluation.orientation if row.sensor == sensor]
    columns = {name: f"{name}_heading_rad" for name in names}
    errors = _errors(evaluation.series.get(orientation_table(sensor), {}), columns)
    return _blocks(f"heading error of {sensor}", "heading error [deg]", errors, colours)


def _errors(series: Mapping[str, np.ndarray], columns: Mapping[str, str]) -> dict[str, np.ndarray]:
    """By filter, the errors that were evaluated [deg], those with the smallest RMS first."""
    found = {}
    for name, column in columns.items():
        if column not in series:
            continue
        values = np.degrees(np.asarray(series[column], dtype=float))
        rows = np.isfinite(values) & np.asarray(series.get("judged", True))
        if np.count_nonzero(rows) >= FEWEST and np.ptp(values[rows]) > 0:
            found[name] = values[rows]
    return dict(sorted(found.items(), key=lambda item: float(np.mean(item[1] ** 2))))


def _blocks(
    what: str, x_title: str, errors: Mapping[str, np.ndarray], colours: Mapping[str, str]
) -> list[Block]:
    if not errors:
        return []
    shown = list(errors)[:MOST_HISTOGRAMS]
    figures = {
        f"histogram of the {what}, {name}": histogram(
            f"{name}: {values.mean():.2f} ± {values.std(ddof=1):.2f} deg",
            values,
            colours[name],
            x_title,
        )
        for name, values in errors.items()
        if name in shown
    }
    left = (
        f" Of {len(errors)} filters those with the smallest RMS."
        if len(errors) > len(shown)
        else ""
    )
    blocks: list[Block] = [
        Figures(
            f"How the {what} is spread",
            figures,
            "How to read: how often an error occurs, with the normal density of the same mean and "
            "standard deviation, which the title states. Where the bars do not follow it, a mean "
            "and a deviation do not tell the whole; neighbouring samples are much alike, so that "
            f"their number says nothing of how sure a mean is.{left}",
            small=True,
            folded=True,
        )
    ]
    if len(errors) > 1:
        boxes = {name: _box(values) for name, values in errors.items()}
        blocks.append(
            Figures(
                f"Box plot of the {what}",
                {f"box plot of the {what}": box_plots(boxes, colours, x_title)},
                "How to read: the box holds the middle half of all samples, the line in it is the "
                f"median, and the whiskers hold {WHISKERS[1] - WHISKERS[0]:g} %.",
                folded=True,
            )
        )
    return blocks


def _box(values: np.ndarray) -> BoxNumbers:
    low, q1, median, q3, high = np.percentile(values, [WHISKERS[0], 25, 50, 75, WHISKERS[1]])
    return BoxNumbers(float(low), float(q1), float(median), float(q3), float(high))
