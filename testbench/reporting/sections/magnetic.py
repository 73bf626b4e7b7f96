"""The magnetic field at a sensor, and what its disturbance did to the heading of each filter."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import magnetic_table
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Curve, Span, error_curves, time_panels
from testbench.reporting.page.page import Block, Figures, Sentence
from testbench.reporting.page.palette import REFERENCE
from testbench.reporting.page.tables import Cell, Row, Table, digits, header, label, number, text
from testbench.reporting.sections.outliers import hidden_names, outliers_of
from testbench.reporting.sections.ranking import with_interval

FIELD = "field"
PANELS = {"norm [%]": "norm_percent", "dip [deg]": "dip_rad", "heading [deg]": "heading_rad"}
QUANTITIES = {
    "heading": "field's heading [deg]",
    "norm": "field's norm [%]",
    "dip": "field's dip [deg]",
}
"""Deviations, by quantity."""


def magnetic_blocks(
    evaluation: Evaluation, sensor: str, colours: dict[str, str], spans: list[Span]
) -> list[Block]:
    """How far the field was disturbed, over time and against the heading errors.

    Nothing without a magnetometer.
    """
    rows = [row for row in evaluation.magnetic_field if row.sensor == sensor]
    if not rows:
        return []
    field = [
        Row(
            [
                label(row.motion),
                number(row.n, 0),
                number(row.norm_rms_percent, 1),
                number(row.norm_p95_percent, 1),
                number(row.field_dip_rms_deg, 1),
                number(row.field_dip_p95_deg, 1),
                number(row.field_heading_rms_deg, 1),
                number(row.field_heading_p95_deg, 1),
            ]
        )
        for row in rows
    ]
    reference = f"{digits(rows[0].norm_uT, 1)} µT, dip {digits(rows[0].dip_deg, 1)} deg"
    blocks: list[Block] = [
        Table(
            f"Magnetic field at {sensor} against that of the reference pose ({reference})",
            header(
                "motion",
                "samples",
                "norm, RMS [%]",
                "95 % of norm below [%]",
                "dip, RMS [deg]",
                "95 % of dip below [deg]",
                "heading, RMS [deg]",
                "95 % of heading below [deg]",
            ),
            field,
            "How to read: the measured field, turned into the world by the true orientation. Its "
            "heading is what a compass errs by; a filter with gyroscope and magnetometer follows "
            "it where it stays, and may ride out what passes.",
        )
    ]
    return [
        *blocks,
        *_following(evaluation, sensor),
        *_against(evaluation, sensor, colours),
        *_over_time(evaluation, sensor, spans),
    ]


def _following(evaluation: Evaluation, sensor: str) -> list[Block]:
    """How much of the field's heading each filter follows, or why that cannot be told."""
    found = [row for row in evaluation.magnetic_following if row.sensor == sensor]
    if not found:
        return []
    change = digits(found[0].field_change_deg, 2)
    if all(row.followed is None for row in found):
        return [
            Sentence(
                f"How much of the field's heading each filter follows at {sensor} cannot be told: "
                f"against its mean over the minute around, the heading changes by {change} deg "
                f"(SD) over {found[0].n / 2:.0f} s of evaluated samples. It takes 0.2 deg and "
                "three minutes. On the simulated bench, what the field costs is seen by another "
                "run with the same seed and environment: {arm_magnetism: false}."
            )
        ]
    rows = [
        Row(
            [
                label(row.filter),
                with_interval(row.followed, row.followed_ci95, 2),
                number(row.blocks, 0),
            ]
        )
        for row in found
    ]
    return [
        Table(
            f"How much of the field's heading each filter follows: {sensor}, where it changes by "
            f"{change} deg (SD)",
            header("filter", "part followed", "independent stretches"),
            rows,
            "How to read: slope of the filter's heading error on the error that the field would "
            "give a compass, both against their means over the minute around: 1 follows what "
            "passes wholly, 0 rides it out. A disturbance that stays longer is followed more. In "
            "square brackets: the 95 % confidence interval, with the memory of the errors, made "
            "wider by what a gyroscope's own errors may do in the pace of the field (0.1 deg): a "
            "filter without magnetometer should have 0 in it. A compass may have less than 1 where "
            "accelerations turn it, too.",
        )
    ]


def _against(evaluation: Evaluation, sensor: str, colours: dict[str, str]) -> list[Block]:
    """Heading errors by classes of disturbance."""
    found = [row for row in evaluation.magnetic_errors if row.sensor == sensor]
    filters = list(dict.fromkeys(row.filter for row in found))
    far = outliers_of(evaluation, sensor, quantity="heading", motion="all")
    figures, body = {}, []
    for quantity, title in QUANTITIES.items():
        own = [row for row in found if row.quantity == quantity]
        classes = sorted({(row.low, row.high, row.n) for row in own})
        if len(classes) < 2:
            continue
        curves = []
        for name in filters:
            mine = [row for row in own if row.filter == name]
            x, y = [row.mean for row in mine], [row.heading_rmse_deg for row in mine]
            curves.append(Curve(name, x, y, colours[name], hidden=name in far))
        figures[f"heading error of each filter over {title}"] = error_curves(
            curves, f"deviation of the {title}", "RMS heading error [deg]"
        )
        for low, high, n in classes:
            errors = {row.filter: row.heading_rmse_deg for row in own if row.low == low}
            span = f"{low:g} to {high:g}" if high is not None else f"above {low:g}"
            cells = [number(errors.get(name), 2) for name in filters]
            body.append(Row([label(title), text(span), number(n, 0), *cells]))
    if not figures:
        return []
    table = Table(
        f"RMS heading error [deg] by how far the field was disturbed: {sensor}",
        [Cell("disturbance"), Cell("from to"), *header("samples", *filters, numbers_from=0)],
        body,
        "How to read: all evaluated samples, in classes of the deviation from the field of the "
        "reference pose.",
        folded=True,
    )
    beside = Figures(
        f"Heading error over magnetic disturbance: {sensor}",
        figures,
        "How to read: a filter that takes the field as it comes errs by as much as the field's "
        "heading; one that stays below rejects it, averages over it, or uses no magnetometer. The "
        "norm and the dip are all that a filter can tell a disturbance by; where they say nothing, "
        f"only averaging helps.{hidden_names(far)}",
        small=True,
    )
    return [beside, table]


def _over_time(evaluation: Evaluation, sensor: str, spans: list[Span]) -> list[Block]:
    series = evaluation.series.get(magnetic_table(sensor))
    if not series:
        return []
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series.get("judged"))
    panels = {
        title: {
            FIELD: envelope(
                series[column] if column.endswith("percent") else np.degrees(series[column])
            )
        }
        for title, column in PANELS.items()
    }
    return [
        Figures(
            f"Magnetic field over time: {sensor}",
            {
                f"magnetic field of {sensor} over time": time_panels(
                    envelope.time, panels, {FIELD: REFERENCE}, spans
                )
            },
            "How to read: deviations of norm, dip and heading of the field from those of the "
            "reference pose, by the true orientation; only evaluated samples are drawn.",
        )
    ]
