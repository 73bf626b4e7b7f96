"""The Allan deviation of each sensor over its longest rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import allan_table
from testbench.reporting.page.figures import Figure
from testbench.reporting.page.log_log import Banded, log_log
from testbench.reporting.page.page import Block, Figures
from testbench.reporting.page.palette import AXES_COLOURS
from testbench.reporting.page.tables import unit_words

QUANTITIES = {"gyr": "angular rate", "acc": "specific force", "mag": "magnetic field"}
GUIDES = {
    "white": "white noise, slope −1/2",
    "flicker": "bias instability, slope 0",
    "walk": "random walk of the rate, slope +1/2",
}


def allan_blocks(evaluation: Evaluation) -> list[Block]:
    """One row of small figures a sensor; nothing of sensors without a rest that is long enough."""
    blocks: list[Block] = []
    for sensor in dict.fromkeys(row.sensor for row in evaluation.noise):
        series = evaluation.series.get(allan_table(sensor))
        figures = {} if not series else _figures(sensor, series, evaluation)
        if figures:
            blocks.append(
                Figures(
                    f"Allan deviation at rest: {sensor}",
                    figures,
                    "How to read: how far two neighbouring means lie apart, over the time that "
                    "each is taken over; the bands are their 68 % confidence. Averaging lowers it "
                    "along white noise, no further than the bias instability, and wandering "
                    "raises it again. The straight lines are the parts that the fit found, RMS of "
                    "the axes; one that it did not find is not drawn.",
                    small=True,
                )
            )
    return blocks


def _figures(
    sensor: str, series: Mapping[str, np.ndarray], evaluation: Evaluation
) -> dict[str, Figure]:
    figures = {}
    for quantity, words in QUANTITIES.items():
        row = next(
            (r for r in evaluation.noise if (r.sensor, r.quantity) == (sensor, quantity)), None
        )
        curves = {
            axis: Banded(*(series[f"{quantity}_{axis}{end}"] for end in ("", "_lower", "_upper")))
            for axis in AXES_COLOURS
            if f"{quantity}_{axis}" in series
        }
        if row is None or not curves:
            continue
        guides = {
            title: values
            for part, title in GUIDES.items()
            if (values := _rms([series[f"{quantity}_{axis}_{part}"] for axis in curves]))
            is not None
        }
        figures[f"Allan deviation of the {words} of {sensor}"] = log_log(
            words,
            series["tau_s"],
            curves,
            guides,
            AXES_COLOURS,
            ("averaging time [s]", f"Allan deviation [{unit_words(row.bias_instability_unit)}]"),
        )
    return figures


def _rms(lines: list[np.ndarray]) -> np.ndarray | None:
    """Of the lines that were found, shape (k,); None where none was."""
    found = [line for line in lines if np.isfinite(line).all()]
    return np.sqrt(np.mean(np.square(found), axis=0)) if found else None
