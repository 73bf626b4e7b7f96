"""The first screen of a report: what was found, over time, and filter beside filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.findings.finding import Severity
from testbench.records.results.answer import answers
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import JointSummary, OrientationSummary
from testbench.records.session.layout import joint_table, orientation_table
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Bar, Figure, Span, dots, time_panels
from testbench.reporting.page.page import Block, Figures, Sentence
from testbench.reporting.page.palette import REFERENCE, filter_colours
from testbench.reporting.page.tables import digits
from testbench.reporting.sections.findings import finding_sentences
from testbench.reporting.sections.outliers import flexion_outliers, hidden_names
from testbench.reporting.sections.true_flexion import TRUE

MOST_RANKED = 4
"""More figures of filters beside one another than this are left to their chapters."""


def answer_blocks(
    evaluation: Evaluation, colours: Mapping[str, str], spans: Sequence[Span]
) -> list[Block]:
    """What was found, in sentences and in two kinds of figures.

    Args:
        evaluation: Of the session.
        colours: By filter.
        spans: Sections of the protocol.
    """
    blocks: list[Block] = [
        Sentence(answer.text, "" if answer.outcome is None else answer.outcome.value)
        for answer in answers(evaluation)
    ]
    blocks += finding_sentences(
        found for found in evaluation.findings if found.severity is Severity.WARNING
    )
    main = over_time(evaluation, colours, spans)
    ranked = beside(evaluation, colours)
    return [*blocks, *([main] if main else []), *([ranked] if ranked else [])]


def over_time(
    evaluation: Evaluation, colours: Mapping[str, str], spans: Sequence[Span]
) -> Figures | None:
    """Truth and estimates of the first joint over the whole run, their errors below; of the first
    sensor where no joint was evaluated.
    """
    if evaluation.joint_angle:
        return _joint_over_time(evaluation, colours, spans)
    if evaluation.chain:
        return _chain_joints(evaluation)
    if evaluation.orientation:
        return _sensor_over_time(evaluation, colours, spans)
    return None


def _joint_over_time(
    evaluation: Evaluation, colours: Mapping[str, str], spans: Sequence[Span]
) -> Figures | None:
    joint, own = evaluation.joint_angle[0].joint, evaluation.joint_angle[0].sequence
    series = evaluation.series.get(joint_table(joint))
    if not series:
        return None
    time = series["host_time_ns"] / NANOSECONDS
    whole, evaluated = Envelope(time), Envelope(time, series.get("judged"))
    names = dict.fromkeys(row.filter for row in evaluation.joint_angle if row.joint == joint)
    angles = {TRUE: whole(np.degrees(series["reference_rad"]))}
    errors: dict[str, np.ndarray] = {}
    for name in names:
        flexion = series.get(f"{name}_{own}_flexion_rad")
        if flexion is not None:
            angles[name] = whole(np.degrees(flexion))
            errors[name] = evaluated(np.degrees(series[f"{name}_{own}_error_rad"]))
    far = sorted(flexion_outliers(evaluation, joint))
    figure = time_panels(
        whole.time,
        {f"flexion, {own} [deg]": angles, "error [deg]": errors},
        {**colours, TRUE: REFERENCE},
        spans,
        far,
    )
    for drawn in figure["data"]:
        if drawn["name"] == TRUE:
            drawn["line"] |= {"width": 2.6, "dash": "dot"}
    return Figures(
        f"True and estimated flexion of {joint}",
        {f"true and estimated flexion of {joint} over the whole run, and the errors": figure},
        "How to read: above, the dotted line is the truth and the others are the estimates; below, "
        "estimate less truth where it is evaluated. Dotted uprights begin a section. Drag over a "
        f"stretch to see it closer.{hidden_names(far)}",
    )


def _chain_joints(evaluation: Evaluation) -> Figures:
    """The joints of a chain beside one another, in its first section, by each state."""
    section = evaluation.chain[0].section
    rows = [row for row in evaluation.chain if row.section == section]
    states = list(dict.fromkeys(row.state for row in rows))
    figures = {}
    for state, colour in filter_colours(states).items():
        own = sorted((r for r in rows if r.state == state), key=lambda row: row.rmse_deg)
        known = [r.expanded_uncertainty_magnitude_deg for r in own]
        figures[f"RMS error of each joint angle, {state} state"] = _with_line(
            f"{section}, {state} state",
            {row.joint: Bar(row.rmse_deg) for row in own},
            dict.fromkeys((row.joint for row in own), colour),
            "RMS error [deg]",
            known,
        )
    return Figures(
        "Error of each joint angle of the chain",
        figures,
        "How to read: root mean square of estimate less truth, the smallest above. What lies left "
        "of the dashed line, U, is smaller than the truth of the worst known joint is known to.",
        small=len(figures) > 1,
    )


def _sensor_over_time(
    evaluation: Evaluation, colours: Mapping[str, str], spans: Sequence[Span]
) -> Figures | None:
    sensor = evaluation.orientation[0].sensor
    series = evaluation.series.get(orientation_table(sensor))
    if not series:
        return None
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series.get("judged"))
    panels = {
        f"{part} error [deg]": {
            row.filter: envelope(np.degrees(series[f"{row.filter}_{part}_rad"]))
            for row in evaluation.orientation
            if row.sensor == sensor and f"{row.filter}_{part}_rad" in series
        }
        for part in ("heading", "inclination")
    }
    panels = {title: signals for title, signals in panels.items() if signals}
    if not panels:
        return None
    return Figures(
        f"Orientation error of {sensor}",
        {
            f"orientation error of {sensor} over time": time_panels(
                envelope.time, panels, colours, spans
            )
        },
        "How to read: estimate less truth, where it is evaluated: heading about the vertical, and "
        "inclination. Drag over a stretch to see it closer.",
    )


def beside(evaluation: Evaluation, colours: Mapping[str, str]) -> Figures | None:
    """The filters beside one another: of each joint's section, or of each sensor."""
    if evaluation.chain:
        return None
    groups: dict[str, list[JointSummary | OrientationSummary]] = {}
    if evaluation.joint_angle:
        own = {row.joint: row.sequence for row in reversed(evaluation.joint_angle)}
        for row in evaluation.joint_summary:
            if row.sequence == own[row.joint] and row.motion != "all":
                groups.setdefault(f"{row.joint}, {row.section} ({row.motion})", []).append(row)
    else:
        for sensor_row in evaluation.orientation_summary:
            if (sensor_row.motion, sensor_row.part) == ("all", "total"):
                groups.setdefault(sensor_row.sensor, []).append(sensor_row)
    groups = {where: rows for where, rows in groups.items() if len(rows) > 1}
    if not groups:
        return None
    what = "flexion" if evaluation.joint_angle else "orientation"
    shown = list(groups)[:MOST_RANKED]
    left = (
        f" {len(groups) - len(shown)} more stand in the chapters."
        if len(groups) > len(shown)
        else ""
    )
    return Figures(
        f"Mean {what} error of each filter",
        {
            f"mean {what} error of each filter, {where}": _dots(where, groups[where], colours)
            for where in shown
        },
        "How to read: mean magnitude of the error, the smallest above; a line through a dot is its "
        "95 % confidence interval for this session repeated on the same part, where that is known. "
        "What lies left of the dashed line, U, is smaller than the truth is known to: there the "
        f"order of the dots says nothing.{left}",
        small=len(shown) > 1,
    )


def _dots(
    where: str, rows: Sequence[JointSummary | OrientationSummary], colours: Mapping[str, str]
) -> Figure:
    bars = {
        row.filter: Bar(row.errors.mean_abs_error_deg, row.errors.mean_abs_error_ci95_deg)
        for row in sorted(rows, key=lambda row: row.errors.mean_abs_error_deg)
    }
    known = [row.expanded_uncertainty_magnitude_deg for row in rows]
    return _with_line(where, bars, colours, "mean |error| [deg]", known)


def _with_line(
    title: str,
    bars: Mapping[str, Bar],
    colours: Mapping[str, str],
    x_title: str,
    known: Sequence[float | None],
) -> Figure:
    """Dots, and a line at the largest of what the truth is known to [deg]."""
    limit = max((value for value in known if value is not None), default=None)
    name = f"U = {digits(limit, 2)} deg" if limit is not None else ""
    return dots(title, bars, colours, x_title, limit, name)
