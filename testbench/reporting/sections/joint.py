"""The section of the report on joint angles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.evaluation import Evaluation, JointRow
from testbench.records.results.evaluation_rows import JointSummary, OutlierRow
from testbench.records.session.layout import joint_table
from testbench.records.specs.band import Band
from testbench.records.specs.published import PublishedResults
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import (
    Axis,
    Curve,
    Figure,
    Span,
    error_curves,
    heat_map,
    time_panels,
)
from testbench.reporting.page.page import Block, Figures, Heading, Section, Sentence
from testbench.reporting.page.palette import REFERENCE
from testbench.reporting.page.space import surfaces
from testbench.reporting.page.tables import (
    Cell,
    Row,
    Table,
    digits,
    header,
    label,
    mean_of_known,
    number,
    text,
)
from testbench.reporting.sections.cycle import cycle_blocks
from testbench.reporting.sections.findings import finding_sentences
from testbench.reporting.sections.flexion import (
    PoseErrors,
    SweepErrors,
    by_section,
    published_beside,
)
from testbench.reporting.sections.outliers import (
    flexion_outliers,
    flexion_remarks,
    hidden_names,
    how_remarks,
    tops,
)
from testbench.reporting.sections.ranking import (
    REPEATED,
    distribution_table,
    plus_minus,
    ranking_blocks,
    ranking_doubts,
    with_interval,
)
from testbench.reporting.sections.relative_heading import relative_heading_blocks
from testbench.reporting.sections.spread import joint_spread
from testbench.reporting.sections.true_flexion import flexion_blocks

Colours = dict[str, str]
LEAST_MAP = 3
"""Rows and columns from which on a map says more than a table."""


def joint_section(
    evaluation: Evaluation,
    published: Mapping[str, PublishedResults | None],
    colours: Colours,
    spans: list[Span],
    band: Band | None = None,
) -> Section:
    """Errors of every joint, by pose and over time.

    The published ones stand beside those of a joint whose protocol names some, and the normal band
    behind the average cycles of angles that it has.
    """
    section = Section("joints", "Joint angles")
    joints = list(dict.fromkeys(row.joint for row in evaluation.joint_angle))
    for joint in joints:
        rows = [row for row in evaluation.joint_angle if row.joint == joint]
        if len(joints) > 1:
            section.blocks.append(Heading(joint))
        where = f"joint '{joint}'"
        section.blocks += finding_sentences(
            found
            for found in evaluation.findings
            if str(found).startswith((f"{where}:", f"{where}, "))  # planners speak of it, too
        )
        section.blocks += _summaries(joint, rows, evaluation)
        section.blocks += _by_angle(joint, evaluation)
        for name, own in by_section(rows).items():
            section.blocks += ranking_blocks(evaluation, joint, name)
            section.blocks += ranking_doubts(evaluation, joint, name)
            posed = [row for row in own if row.flexion_deg is not None]
            swept = [row for row in own if row.flexion_deg is None]
            if posed:
                section.blocks += _pose_blocks(
                    joint, name, PoseErrors(posed), published.get(joint), colours, evaluation
                )
            if swept:
                section.blocks += _sweep_blocks(joint, name, SweepErrors(swept))
            cycles = {
                i: row
                for i, row in enumerate(evaluation.cycles)
                if (row.joint, row.section) == (joint, name) and row.sequence is not None
            }
            what = f"{joint}, section {name}"
            section.blocks += cycle_blocks(evaluation, cycles, what, colours, band)
        if joint != joints[0]:  # that one is on the first screen
            section.blocks += flexion_blocks(joint, rows, evaluation, colours, spans)
        section.blocks += _time_blocks(joint, rows, evaluation, colours, spans)
        section.blocks += joint_spread(evaluation, joint, colours)
        filters = list(dict.fromkeys(row.filter for row in rows))
        section.blocks += relative_heading_blocks(evaluation, joint, filters, colours, spans)
    if not joints:
        section.blocks.append(Sentence("No joint angle was evaluated in this session."))
    return section


# One piece: the cells of a row stand beside the titles that they fall under.
def _summaries(joint: str, rows: list[JointRow], evaluation: Evaluation) -> list[Block]:
    """One row per section, motion, sequence and filter: the errors, then their spread, delay and
    settling.
    """
    found = [item for item in evaluation.joint_summary if item.joint == joint]
    far = [row for row in evaluation.outliers if row.owner == joint and row.quantity == "flexion"]
    body, spread = [], []
    for item in found:
        e = item.errors
        mine = [
            r
            for r in rows
            if (r.section, r.filter, r.sequence) == (item.section, item.filter, item.sequence)
        ]
        mine = [
            r
            for r in mine
            if item.motion == "all" or (r.kind == "sweep") == (item.motion == "dynamic")
        ]
        others = [mean_of_known([row.other_mean_abs_error_deg[i] for row in mine]) for i in (0, 1)]
        leading = [label(item.filter), text(item.sequence), text(item.section), text(item.motion)]
        mark = (
            [text("outlier" if any(_same_place(row, item) for row in far) else "")] if far else []
        )
        body.append(
            Row(
                [
                    *leading,
                    *mark,
                    number(e.steps, 0),
                    number(e.n, 0),
                    plus_minus(e.mean_error_deg, item.expanded_uncertainty_deg),
                    with_interval(
                        e.mean_abs_error_deg, e.mean_abs_error_ci95_deg, why=e.no_interval
                    ),
                    with_interval(e.rmse_deg, e.rmse_ci95_deg, why=e.no_interval),
                    *(number(value, 2) for value in others),
                ]
            )
        )
        spread.append((leading, e))
    names = ["filter", "sequence", "section", "motion"]
    return [
        Table(
            f"Flexion error e of {joint}, all poses and sweeps",
            header(
                *names,
                *(["remark"] if far else []),
                "poses or sweeps",
                "samples",
                "mean e ± U [deg]",
                "mean |e| [95 % CI] [deg]",
                "RMS e [95 % CI] [deg]",
                "other angle 1 [deg]",
                "other angle 2 [deg]",
                numbers_from=4 + bool(far),
            ),
            body,
            "How to read: e is estimated minus true flexion; every pose or sweep counts alike, "
            "however long it took. ± U is how far the truth itself may be off (k = "
            f"2){_of_magnitudes(found)}; it does not shrink with more poses of the same arm. In "
            f"square brackets: the 95 % confidence interval; it {REPEATED} The "
            "last two columns are the mean absolute errors of the other two angles; a dash means "
            "gimbal lock. The middle angle of a sequence such as ZXZ is the angle between two "
            "axes: it is never negative, so that errors at 0 deg are one-sided, and where one of "
            "the axes is vertical it does not see heading errors; the other two angles do, and so "
            f"does the total error that the filters are ranked by below.{how_remarks(bool(far))}",
        ),
        *flexion_remarks(far),
        distribution_table(
            f"Spread, delay and settling of the flexion error: {joint}", names, spread
        ),
    ]


def _by_angle(joint: str, evaluation: Evaluation) -> list[Block]:
    """Errors of each angle of a joint of a body, with and without what is constant in them."""
    rows = [row for row in evaluation.angle_errors if row.joint == joint]
    if not rows:
        return []
    body = [
        Row(
            [
                label(row.filter),
                text(row.sequence),
                text(row.name),
                number(row.n, 0),
                number(row.mean_error_deg, 2),
                number(row.rmse_deg, 2),
                number(row.rmse_without_mean_deg, 2),
                number(row.correlation, 3),
                number(row.true_range_deg, 1),
            ]
        )
        for row in rows
    ]
    titles = ["mean e [deg]", "RMS e [deg]", "RMS e - mean [deg]", "correlation", "range [deg]"]
    table = Table(
        f"Errors of {joint} by angle",
        header("filter", "sequence", "angle", "samples", *titles, numbers_from=3),
        body,
        "How to read: each angle by itself, over all that is evaluated. RMS e holds all that is "
        "constant in the error, such as a zero that another pose or definition gave the truth; "
        "the column beside it is without the mean. The range is that of the true angle.",
    )
    return [table]


def _same_place(row: OutlierRow, item: JointSummary) -> bool:
    place = (item.section, item.sequence, item.motion, item.filter)
    return (row.section, row.sequence, row.motion, row.filter) == place


def _of_magnitudes(found: list[JointSummary]) -> str:
    """U of the columns that carry none of their own."""
    known = [
        item.expanded_uncertainty_magnitude_deg
        for item in found
        if item.expanded_uncertainty_magnitude_deg is not None
    ]
    return f", and at most {digits(max(known), 3)} deg for the columns without it" if known else ""


def _pose_blocks(
    joint: str,
    section: str,
    errors: PoseErrors,
    published: PublishedResults | None,
    colours: Colours,
    evaluation: Evaluation,
) -> list[Block]:
    where = f"{joint}, section {section}" + (
        f", misalignment {errors.aligned:g} deg" if errors.aligned is not None else ""
    )
    where += f", all values of {' and '.join(errors.pooled)} together" if errors.pooled else ""
    blocks: list[Block] = [_flexion_table(where, errors, published)]
    if len(errors.flexions) > 1:
        far = {s: flexion_outliers(evaluation, joint, section, s) for s in errors.sequences}
        figures = {
            f"mean absolute flexion error over flexion, {s}": _curves(
                errors, s, published, colours, far[s]
            )
            for s in errors.sequences
        }
        blocks.append(
            Figures(
                f"Mean |flexion error| over commanded flexion: {where}",
                figures,
                "How to read: lower is better. The band is one standard deviation of the samples "
                "within a pose, to either side. Where some curves lie far above most of ours, the "
                "vertical axis is logarithmic and without bands."
                f"{_diamonds(published)}"
                f"{hidden_names(name for names in far.values() for name in sorted(names))}",
            )
        )
    if min(len(errors.flexions), len(errors.misalignments)) >= LEAST_MAP:
        for sequence in errors.sequences:
            blocks += _maps(joint, section, sequence, errors, colours)
    return blocks


def _diamonds(published: PublishedResults | None) -> str:
    if published is None:
        return " Click a name to hide or to show it."
    return (
        " The grey diamonds are the published values of the same Euler sequence "
        f"({published.source}). Click a name to hide or to show it; published filters that this "
        "session did not run wait greyed out where there is a nearer one."
    )


# One piece: published rows are placed among ours, each under the filter that it belongs to.
def _flexion_table(where: str, errors: PoseErrors, published: PublishedResults | None) -> Table:
    beside = published_beside(published, errors.flexions)
    body: list[Row] = []
    for sequence in [*errors.sequences, *(s for s in beside if s not in errors.sequences)]:
        filters = errors.filters(sequence)
        title = f"{_kind(sequence)} {sequence}" + ("" if filters else ", published only")
        body.append(Row([Cell(title, head=True, span=len(errors.flexions) + 2)], "group"))
        waiting = list(beside.get(sequence, []))
        best = _lowest(errors, sequence)
        for name in filters:
            found = [errors.at((name, sequence), flexion) for flexion in errors.flexions]
            cells = [
                number(
                    e.mean_abs,
                    2,
                    f"{digits(e.mean_abs, 4)} deg, sd {digits(e.sd, 4)} deg, {e.n} samples",
                    "best" if e.mean_abs == low else "",
                )
                if e
                else number(None)
                for e, low in zip(found, best, strict=True)
            ]
            body.append(
                Row(
                    [
                        label(name),
                        *cells,
                        number(mean_of_known([e.mean_abs if e else None for e in found])),
                    ]
                )
            )
            for row, values in [item for item in waiting if name in item[0].filters]:
                body.append(
                    _published_row(f"Table {row.table}", f"{row.sensor}, {row.method}", values)
                )
                waiting.remove((row, values))
        for row, values in waiting:
            body.append(_published_row(f"Table {row.table}", f"{row.sensor}, {row.method}", values))
    columns = [
        Cell("filter"),
        *(Cell(f"{flexion:g}", kind="number") for flexion in errors.flexions),
        Cell("mean", kind="number"),
    ]
    over = [Cell(""), Cell("commanded flexion [deg]", span=len(errors.flexions)), Cell("")]
    how = (
        "How to read: mean absolute error of all samples in a pose; bold is the lowest of ours in "
        "its column and sequence."
    )
    if published is not None and beside:
        how += (
            f" Rows in italics are published ({published.source}): {published.setup} Each stands "
            "under our row of the same filter and Euler sequence, or at the end of its sequence "
            "where this session did not run that filter."
        )
    return Table(f"Mean |flexion error| [deg]: {where}", columns, body, how, over=over)


def _lowest(errors: PoseErrors, sequence: str) -> list[float]:
    """Lowest mean |error| of each flexion [deg].

    NaN where only one filter ran, so that nothing is marked.
    """
    filters = errors.filters(sequence)
    found = [
        [e.mean_abs for name in filters if (e := errors.at((name, sequence), f))]
        for f in errors.flexions
    ]
    return [min(values) if len(values) > 1 else float("nan") for values in found]


def _published_row(table: str, what: str, values: list[float | None]) -> Row:
    return Row(
        [Cell(table, what, head=True)]
        + [number(value) for value in (*values, mean_of_known(values))],
        "published",
    )


def _curves(
    errors: PoseErrors,
    sequence: str,
    published: PublishedResults | None,
    colours: Colours,
    far: set[str],
) -> Figure:
    curves = []
    for name in errors.filters(sequence):
        found = [
            (flexion, e)
            for flexion in errors.flexions
            if (e := errors.at((name, sequence), flexion))
        ]
        curves.append(
            Curve(
                name,
                [f for f, _ in found],
                [e.mean_abs for _, e in found],
                colours[name],
                [e.sd for _, e in found],
                hidden=name in far,
            )
        )
    beside = published_beside(published, errors.flexions).get(sequence, [])
    ran = [row.table for row, _ in beside if set(row.filters) & set(errors.filters(sequence))]
    for row, values in beside:
        known = [
            (f, value)
            for f, value in zip(errors.flexions, values, strict=True)
            if value is not None
        ]
        x, y = [f for f, _ in known], [value for _, value in known]
        name = f"published, {row.table}: {row.sensor}, {row.filters[0]}"
        curves.append(
            Curve(name, x, y, REFERENCE, dashed=True, hidden=bool(ran) and row.table not in ran)
        )
    return error_curves(curves, "commanded flexion [deg]", f"mean |e| [deg], {sequence}")


def _maps(
    joint: str, section: str, sequence: str, errors: PoseErrors, colours: Colours
) -> list[Block]:
    """The errors over two angles, as maps and as surfaces."""
    grids = {name: errors.grid((name, sequence)) for name in errors.filters(sequence)}
    ends, scale = tops(grids)
    x, y = Axis("misalignment [deg]", errors.misalignments), Axis("flexion [deg]", errors.flexions)
    what, z = (
        f"over misalignment and flexion, {sequence}: {joint}, section {section}",
        "mean |e| [deg]",
    )
    figures = {
        f"error over misalignment and flexion, {name}, {sequence}": heat_map(
            f"{name}, {sequence}", x, y, grid, z, ends[name]
        )
        for name, grid in grids.items()
    }
    best = min(grids, key=lambda name: float(np.nanmean(grids[name])))
    surface = surfaces(sequence, x, y, grids, colours, z, best)
    return [
        Figures(
            f"Mean |flexion error| {what}",
            figures,
            f"How to read: each cell is one pose; {scale}. Stripes along one axis mean that the "
            "error depends on that angle alone.",
            small=True,
        ),
        Figures(
            f"The same in space {what}",
            {f"surface of the error {what}": surface},
            f"How to read: height is the mean error of a pose. The surface of {best}, the lowest, "
            "is shown; click a name to show or to hide another. Drag to turn.",
            folded=True,
        ),
    ]


def _sweep_blocks(joint: str, section: str, errors: SweepErrors) -> list[Block]:
    columns = header(
        *errors.variables,
        "filter",
        "sequence",
        "true amplitude [deg]",
        "frequency [Hz]",
        "samples",
        "mean e [deg]",
        "mean |e| [deg]",
        "RMS e [deg]",
        "max |e| [deg]",
        "correlation",
        "delay [ms]",
    )
    body = [
        Row(
            [
                *(number(v, 2) for v in values),
                label(key[0]),
                text(key[1]),
                *_measured(errors.sweeps[key, values], e.n),
            ]
            + [number(v, 3) for v in (e.mean, e.mean_abs, e.rmse, e.max_abs)]
            + [
                number(
                    mean_of_known([row.flexion_correlation for row in errors.sweeps[key, values]]),
                    4,
                ),
                number(mean_of_known([row.latency_ms for row in errors.sweeps[key, values]]), 1),
            ]
        )
        for (key, values), e in sorted(
            errors.errors.items(), key=lambda item: tuple(v or 0.0 for v in item[0][1])
        )
    ]
    everything = Table(
        f"Sweeps: {joint}, section {section}",
        columns,
        body,
        "How to read: e is estimated minus true flexion while the arm moves, all samples of a "
        "sweep and of the dwells that share its variables. Amplitude and frequency are those of "
        "the true flexion, ramps included; the delay is how far the estimate runs behind it, "
        "beyond what the fit of the sensor's clock took out (negative: ahead).",
        folded=errors.is_grid,
    )
    if not errors.is_grid:
        return [everything]
    return [_sweep_grid(joint, section, errors), _sweep_maps(joint, section, errors), everything]


def _measured(rows: list[JointRow], samples: int) -> list[Cell]:
    """Amplitude and frequency of sweeps as they were, and the samples."""
    amplitude, frequency = (
        mean_of_known([row.amplitude_deg for row in rows]),
        mean_of_known([row.frequency_hz for row in rows]),
    )
    return [number(amplitude, 1), number(frequency, 2), number(samples, 0)]


def _sweep_grid(joint: str, section: str, errors: SweepErrors) -> Table:
    first, second = (_variable_words(name) for name in errors.variables)
    body = []
    for key in errors.keys:
        body.append(
            Row([Cell(f"{key[0]}, {key[1]}", head=True, span=len(errors.values(1)) + 1)], "group")
        )
        for value, line in zip(errors.values(0), errors.grid(key), strict=True):
            body.append(Row([label(f"{value:g}"), *(number(error, 2) for error in line)]))
    return Table(
        f"RMS flexion error [deg] of the sweeps: {joint}, section {section}",
        [Cell(first), *(Cell(f"{value:g}", kind="number") for value in errors.values(1))],
        body,
        f"How to read: one row per {first}, one column per {second}; a filter that keeps up shows "
        "no growth to the right.",
        over=[Cell(""), Cell(second, span=len(errors.values(1)))],
    )


def _variable_words(name: str) -> str:
    """A variable of a protocol with its unit in brackets, where its name ends in one."""
    for suffix, unit in {
        "_deg": "deg",
        "_hz": "Hz",
        "_s": "s",
        "_deg_s": "deg/s",
        "_mm": "mm",
    }.items():
        if name.endswith(suffix) and not (suffix == "_s" and name.endswith("_deg_s")):
            return f"{name.removesuffix(suffix).replace('_', ' ')} [{unit}]"
    return name


def _sweep_maps(joint: str, section: str, errors: SweepErrors) -> Figures:
    grids = {key: errors.grid(key) for key in errors.keys}
    ends, scale = tops({f"{name}, {sequence}": grid for (name, sequence), grid in grids.items()})
    figures = {}
    for (name, sequence), grid in grids.items():
        figures[
            f"RMS error over {errors.variables[1]} and {errors.variables[0]}, {name}, {sequence}"
        ] = heat_map(
            f"{name}, {sequence}",
            Axis(_variable_words(errors.variables[1]), [f"{v:g}" for v in errors.values(1)]),
            Axis(_variable_words(errors.variables[0]), [f"{v:g}" for v in errors.values(0)]),
            grid,
            "RMS e [deg]",
            ends[f"{name}, {sequence}"],
        )
    return Figures(
        f"RMS flexion error over {' and '.join(map(_variable_words, reversed(errors.variables)))}: "
        f"{joint}, section {section}",
        figures,
        f"How to read: each cell is one sweep; {scale}.",
        small=True,
    )


def _time_blocks(
    joint: str, rows: list[JointRow], evaluation: Evaluation, colours: Colours, spans: list[Span]
) -> list[Block]:
    series = evaluation.series.get(joint_table(joint))
    if not series:
        return [
            Sentence(f"The error signals of {joint} were not kept: there is no figure over time.")
        ]
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series.get("judged"))
    panels: dict[str, dict[str, np.ndarray]] = {}
    for name, sequence in dict.fromkeys((row.filter, row.sequence) for row in rows):
        signal = series.get(f"{name}_{sequence}_error_rad")
        if signal is not None:
            panels.setdefault(f"error, {sequence} [deg]", {})[name] = envelope(np.degrees(signal))
    far = sorted(flexion_outliers(evaluation, joint))
    figure = time_panels(envelope.time, panels, colours, spans, far)
    return [
        Figures(
            f"Signed flexion error over time: {joint}",
            {f"signed flexion error of {joint} over time": figure},
            "How to read: estimated minus true flexion, only where it is evaluated; gaps are moves "
            "and calibration. Long recordings show the lowest and highest error of each short "
            f"span, so no peak is lost. Dotted lines begin a section.{hidden_names(far)}",
        )
    ]


def _kind(label: str) -> str:
    return "Euler sequence" if label.isupper() else "definition"
