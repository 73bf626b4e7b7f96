"""The section of the report on orientations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.evaluation import Evaluation, OrientationRow
from testbench.records.results.evaluation_rows import (
    GyroscopeBiasRow,
    Interval,
    OrientationSummary,
    OrientationSweepRow,
)
from testbench.records.session.layout import orientation_table
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Span, time_panels
from testbench.reporting.page.page import Block, Figures, Section, Sentence
from testbench.reporting.page.tables import Cell, Row, Table, digits, header, label, number, text
from testbench.reporting.sections.magnetic import magnetic_blocks
from testbench.reporting.sections.outliers import hidden_names, how_remarks, outliers_of, remark
from testbench.reporting.sections.ranking import (
    REPEATED,
    distribution_table,
    plus_minus,
    ranking_blocks,
    ranking_doubts,
    with_interval,
)
from testbench.reporting.sections.spread import heading_spread

PARTS = {
    "total": "total [deg]",
    "inclination": "inclination [deg]",
    "heading": "heading, signed [deg]",
}

Summaries = dict[tuple[str, str, str, str], OrientationSummary]
"""By sensor, filter, motion and part of the error."""


def orientation_section(
    evaluation: Evaluation, colours: dict[str, str], spans: list[Span]
) -> Section:
    """Errors of every sensor's orientation by every filter."""
    section = Section("orientation", "Orientation")
    if not evaluation.orientation:
        section.blocks.append(
            Sentence(
                "No orientation was evaluated in this session: nobody knows the true one, or no "
                "filter could run."
            )
        )
        return section
    section.blocks += _tables(evaluation)
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        section.blocks += ranking_blocks(evaluation, sensor)
        section.blocks += ranking_doubts(evaluation, sensor)
        filters = [row.filter for row in evaluation.orientation if row.sensor == sensor]
        series = evaluation.series.get(orientation_table(sensor))
        if not series:
            section.blocks.append(
                Sentence(
                    f"The error signals of {sensor} were not kept: there is no figure over time."
                )
            )
            continue
        section.blocks.append(_over_time(evaluation, sensor, filters, colours, spans))
        section.blocks += heading_spread(evaluation, sensor, colours)
        section.blocks += magnetic_blocks(evaluation, sensor, colours, spans)
    return section


def _over_time(
    evaluation: Evaluation,
    sensor: str,
    filters: list[str],
    colours: dict[str, str],
    spans: list[Span],
) -> Figures:
    """The parts of the error of a sensor's orientation."""
    series = evaluation.series[orientation_table(sensor)]
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series.get("judged"))
    panels = {
        title: {
            name: envelope(np.degrees(series[f"{name}_{part}_rad"]))
            for name in filters
            if f"{name}_{part}_rad" in series
        }
        for part, title in PARTS.items()
    }
    far = outliers_of(evaluation, sensor, motion="all")
    figure = time_panels(envelope.time, panels, colours, spans, far)
    return Figures(
        f"Orientation error over time: {sensor}",
        {f"orientation error of {sensor} over time": figure},
        "How to read: total is the angle between estimated and true orientation; heading is its "
        "part about the vertical, inclination the rest. A heading that runs away is that of a "
        "filter without magnetometer, or of one that is still turning to a field other than that "
        "of the reference pose. Only evaluated samples are drawn; long recordings show the lowest "
        "and highest error of each short span." + hidden_names(far),
    )


def _tables(evaluation: Evaluation) -> list[Block]:
    """Errors by sensor and filter; then apart at rest and in motion, and their spread."""
    found = {
        (item.sensor, item.filter, item.motion, item.part): item
        for item in evaluation.orientation_summary
    }
    blocks: list[Block] = [_by_filter(evaluation, found)]
    apart = _by_motion(evaluation, found)
    if apart.rows:
        blocks.append(apart)
    spread = [
        ([label(item.filter), text(item.sensor), text(item.motion), text(item.part)], item.errors)
        for item in evaluation.orientation_summary
    ]
    blocks.append(
        distribution_table(
            "Spread, delay and settling of the orientation error",
            ["filter", "sensor", "motion", "part"],
            spread,
            " Total and inclination have no sign; the delay is that of the whole orientation.",
        )
    )
    if evaluation.orientation_sweeps:
        blocks.append(_sweeps(evaluation.orientation_sweeps))
    if evaluation.gyroscope_bias:
        blocks.append(_bias(evaluation.gyroscope_bias))
    return blocks


def _by_filter(evaluation: Evaluation, found: Summaries) -> Table:
    rows = []
    far = {
        row.sensor: outliers_of(evaluation, row.sensor, motion="all")
        for row in evaluation.orientation
    }
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        own = [row for row in evaluation.orientation if row.sensor == sensor]
        lowest = [
            min(getattr(row, kind) for row in own) if len(own) > 1 else float("nan")
            for kind in _KINDS
        ]
        for row in own:
            heading = found.get((sensor, row.filter, "all", "heading"))
            cells = [
                _best(
                    with_interval(getattr(row, kind), *_interval(found, row, part)),
                    getattr(row, kind) == low,
                )
                for kind, part, low in zip(_KINDS, (*_PARTS, None), lowest, strict=True)
            ]
            mean = (
                number(None)
                if heading is None
                else plus_minus(heading.errors.mean_error_deg, heading.expanded_uncertainty_deg, 2)
            )
            beside = [remark(far[sensor].get(row.filter, []))] if any(far.values()) else []
            rows.append(
                Row([label(row.filter), text(sensor), *cells, mean, number(row.n, 0), *beside])
            )
    titles = header(
        "filter",
        "sensor",
        "total RMS [deg]",
        "heading RMS [deg]",
        "inclination RMS [deg]",
        "largest total [deg]",
        "mean heading ± U [deg]",
        "samples",
        numbers_from=2,
    )
    return Table(
        "Orientation error of each sensor by each filter",
        titles + ([Cell("remark")] if any(far.values()) else []),
        rows,
        "How to read: over all evaluated samples; bold is the lowest of a sensor. In square "
        f"brackets: the 95 % confidence interval; it {REPEATED} Inclination is "
        "what gravity can correct, heading what only a magnetometer or a known start can. "
        f"{_stated(evaluation)}" + how_remarks(any(far.values())),
    )


def _by_motion(evaluation: Evaluation, found: Summaries) -> Table:
    """At rest and in motion, of sensors that were both."""
    rows = []
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        for row in evaluation.orientation:
            if row.sensor != sensor or (sensor, row.filter, "static", "total") not in found:
                continue
            for motion in ("static", "dynamic"):
                parts = [found.get((sensor, row.filter, motion, part)) for part in _PARTS]
                known = [item.errors for item in parts if item is not None]
                if known:
                    cells = [
                        number(None)
                        if item is None
                        else with_interval(
                            item.errors.rmse_deg,
                            item.errors.rmse_ci95_deg,
                            2,
                            item.errors.no_interval,
                        )
                        for item in parts
                    ]
                    lead = [label(row.filter), text(sensor), text(motion)]
                    rows.append(Row([*lead, *cells, number(known[0].n, 0)]))
    return Table(
        "Orientation error at rest and in motion",
        header(
            "filter",
            "sensor",
            "motion",
            "total RMS [deg]",
            "heading RMS [deg]",
            "inclination RMS [deg]",
            "samples",
            numbers_from=3,
        ),
        rows,
        "How to read: static are the evaluated samples at which the sensor was at rest by its own "
        "gyroscope, dynamic the others.",
        folded=True,
    )


def _interval(
    found: Summaries,
    row: OrientationRow,
    part: str | None,
) -> tuple[Interval, int, str | None]:
    """Of an RMS: its interval, the digits to show, and why it is missing."""
    own = None if part is None else found.get((row.sensor, row.filter, "all", part))
    if own is None:
        return None, 2, None
    return own.errors.rmse_ci95_deg, 2, own.errors.no_interval


def _best(cell: Cell, lowest: bool) -> Cell:
    return replace(cell, kind=f"{cell.kind} best") if lowest else cell


def _stated(evaluation: Evaluation) -> str:
    """How far the truth of each sensor may be off."""
    said = [
        f"{budget.owner} {digits(budget.expanded_magnitude_deg, 2)} deg"
        for budget in evaluation.uncertainty
        if budget.quantity == "total" and budget.expanded_magnitude_deg is not None
    ]
    if not said:
        return "How far the truth itself may be off is not known, so no U is given."
    return f"The truth itself may be off (U of the total, 95 %) by up to: {', '.join(said)}."


def _sweeps(sweeps: list[OrientationSweepRow]) -> Table:
    variables = list(dict.fromkeys(name for row in sweeps for name in row.variables))
    body = [
        Row(
            [label(row.filter), text(row.sensor), text(row.section), number(row.step, 0)]
            + [number(row.variables.get(name), 2) for name in variables]
            + [number(row.amplitude_deg, 1), number(row.frequency_hz, 2)]
            + [
                number(value, 3)
                for value in (row.total_rmse_deg, row.heading_rmse_deg, row.inclination_rmse_deg)
            ]
        )
        for row in sweeps
    ]
    return Table(
        "Orientation error of each sweep",
        header(
            "filter",
            "sensor",
            "section",
            "step",
            *variables,
            "true amplitude [deg]",
            "frequency [Hz]",
            "total RMS [deg]",
            "heading RMS [deg]",
            "inclination RMS [deg]",
            numbers_from=3,
        ),
        body,
        "How to read: amplitude and frequency are those of the sensor's true turning about its "
        "main axis; a dash is a sensor that the sweep did not turn.",
        folded=True,
    )


def _bias(rows: list[GyroscopeBiasRow]) -> Table:
    body = [
        Row(
            [
                label(row.sensor),
                text(row.axis),
                number(row.estimated_deg_s, 4),
                number(row.estimated_sd_deg_s, 4),
                plus_minus(
                    row.error_deg_s,
                    None if row.error_sd_deg_s is None else 2 * row.error_sd_deg_s,
                    4,
                ),
                number(row.samples, 0),
            ]
        )
        for row in rows
    ]
    return Table(
        "Error of the calibrated gyroscope's bias",
        header(
            "sensor",
            "axis",
            "bias by the calibration [deg/s]",
            "its standard uncertainty [deg/s]",
            "what is left at rest [deg/s]",
            "samples",
            numbers_from=2,
        ),
        body,
        "How to read: what the calibrated gyroscope still reads in dwells that the calibration did "
        "not use, ± twice its standard error; the true rate is zero there. It holds what drifted "
        "since, and the response to gravity that the calibration missed. Filters that estimate a "
        "bias of their own start from here.",
        folded=True,
    )


_PARTS = ("total", "heading", "inclination")
_KINDS = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg", "total_max_deg")
