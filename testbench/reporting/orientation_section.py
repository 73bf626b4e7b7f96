"""The section of the report on orientations."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.evaluation import Evaluation
from testbench.reporting.decimation import Envelope
from testbench.reporting.figures import Span, time_panels
from testbench.reporting.page import Figures, Section, Sentence
from testbench.reporting.tables import Cell, Row, Table, header, label, number, text

PARTS = {"total": "total [deg]", "inclination": "inclination [deg]", "heading": "heading, signed [deg]"}


def orientation_section(evaluation: Evaluation, colours: dict[str, str], spans: list[Span]) -> Section:
    """Errors of every sensor's orientation by every filter."""
    section = Section("orientation", "Orientation")
    if not evaluation.orientation:
        section.blocks.append(
            Sentence("No orientation was judged in this session: nobody knows the true one, or no filter could run.")
        )
        return section
    section.blocks.append(_table(evaluation))
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        filters = [row.filter for row in evaluation.orientation if row.sensor == sensor]
        series = evaluation.series.get(f"orientation_{sensor}")
        if not series:
            section.blocks.append(Sentence(f"The error signals of {sensor} were not kept: there is no figure over time."))
            continue
        envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series.get("judged"))
        panels = {
            title: {
                name: envelope(np.degrees(series[f"{name}_{part}_rad"])) for name in filters if f"{name}_{part}_rad" in series
            }
            for part, title in PARTS.items()
        }
        section.blocks.append(
            Figures(
                f"Orientation error over time: {sensor}",
                {f"orientation error of {sensor} over time": time_panels(envelope.time, panels, colours, spans)},
                "How to read: total is the angle between estimated and true orientation; heading is its part about the "
                "vertical, inclination the rest. A heading that runs away is a filter without magnetometer. Only judged "
                "samples are drawn; long recordings show the lowest and highest error of each short span.",
            )
        )
    return section


def _table(evaluation: Evaluation) -> Table:
    rows = []
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        own = [row for row in evaluation.orientation if row.sensor == sensor]
        lowest = [min(getattr(row, kind) for row in own) for kind in _KINDS] if len(own) > 1 else [float("nan")] * len(_KINDS)
        for row in own:
            values = [getattr(row, kind) for kind in _KINDS]
            cells: list[Cell] = [number(v, 2, kind="best" if v == low else "") for v, low in zip(values, lowest, strict=True)]
            rows.append(Row([label(row.filter), text(sensor), *cells, number(row.n, 0)]))
    return Table(
        "Orientation error of each sensor by each filter",
        header("filter", "sensor", "total RMS [deg]", "heading RMS [deg]", "inclination RMS [deg]", "largest total [deg]",
               "samples", numbers_from=2),
        rows,
        "How to read: over all judged samples; bold is the lowest of a sensor. Inclination is what gravity can correct, "
        "heading what only a magnetometer or a known start can.",
    )  # fmt: skip


_KINDS = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg", "total_max_deg")
