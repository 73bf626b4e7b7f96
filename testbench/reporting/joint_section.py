"""The section of the report on joint angles."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.evaluation import Evaluation, JointRow
from testbench.records.published import PublishedResults
from testbench.reporting.decimation import Envelope
from testbench.reporting.figures import Curve, Figure, Span, error_curves, heat_map, time_panels
from testbench.reporting.flexion import Key, PoseErrors, SweepErrors, by_section, published_beside
from testbench.reporting.page import Block, Figures, Heading, Section, Sentence
from testbench.reporting.palette import REFERENCE
from testbench.reporting.tables import Cell, Row, Table, digits, header, label, number, text

Colours = dict[str, str]


def joint_section(evaluation: Evaluation, published: PublishedResults, colours: Colours, spans: list[Span]) -> Section:
    """Errors of every joint, by pose and over time."""
    section = Section("joints", "Joint angles")
    joints = list(dict.fromkeys(row.joint for row in evaluation.joint_angle))
    for joint in joints:
        rows = [row for row in evaluation.joint_angle if row.joint == joint]
        if len(joints) > 1:
            section.blocks.append(Heading(joint))
        section.blocks.append(_summary(joint, rows, evaluation))
        for name, own in by_section(rows).items():
            posed = [row for row in own if row.flexion_deg is not None]
            swept = [row for row in own if row.flexion_deg is None]
            if posed:
                section.blocks += _pose_blocks(joint, name, PoseErrors(posed), published, colours)
            if swept:
                section.blocks += _sweep_blocks(joint, name, SweepErrors(swept))
        section.blocks += _time_blocks(joint, rows, evaluation, colours, spans)
    if not joints:
        section.blocks.append(Sentence("No joint angle was judged in this session."))
    return section


def _summary(joint: str, rows: list[JointRow], evaluation: Evaluation) -> Table:
    """One row per section, sequence and filter, from the metrics that the verdict rests on."""
    metrics = {
        (m.name.partition(".")[2], m.filter, m.sequence, m.section): m.value
        for m in evaluation.metrics
        if m.name.startswith(f"{joint}.")
    }
    body = []
    for section, own in by_section(rows).items():
        keys = sorted({(row.sequence, row.filter) for row in own}, key=[(r.sequence, r.filter) for r in own].index)
        for sequence, name in keys:
            mine = [row for row in own if (row.sequence, row.filter) == (sequence, name)]
            others = [_mean([row.other_mean_abs_error_deg[i] for row in mine]) for i in (0, 1)]
            kinds = ("flexion_mean_error_deg", "flexion_mean_abs_error_deg", "flexion_rmse_deg", "flexion_max_abs_error_deg")
            values = [metrics.get((kind, name, sequence, section)) for kind in kinds]
            body.append(
                Row([label(name), text(sequence), text(section), number(len(mine), 0), number(sum(row.n for row in mine), 0)]
                    + [number(value, 3) for value in (*values, *others)])
            )  # fmt: skip
    columns = header(
        "filter", "sequence", "section", "poses or sweeps", "samples", "mean e [deg]", "mean |e| [deg]", "RMS e [deg]",
        "max |e| [deg]", "other angle 1 [deg]", "other angle 2 [deg]", numbers_from=3,
    )  # fmt: skip
    return Table(
        f"Flexion error e of {joint}, all poses and sweeps",
        columns,
        body,
        "How to read: e is estimated minus true flexion; every pose or sweep counts alike, however long it took. The last "
        "two columns are the mean absolute errors of the other two angles; a dash means gimbal lock. The middle angle "
        "of a sequence such as ZXZ is the angle between two axes: it is never negative, so that errors at 0 deg are one-sided, "
        "and where one of the axes is vertical it does not see heading errors; the other two angles do.",
    )


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _pose_blocks(joint: str, section: str, errors: PoseErrors, published: PublishedResults, colours: Colours) -> list[Block]:
    where = f"{joint}, section {section}" + (f", misalignment {errors.aligned:g} deg" if errors.aligned is not None else "")
    blocks: list[Block] = [_flexion_table(where, errors, published)]
    if len(errors.flexions) > 1:
        figures = {
            f"mean absolute flexion error over flexion, {s}": _curves(errors, s, published, colours) for s in errors.sequences
        }
        blocks.append(
            Figures(
                f"Mean |flexion error| over commanded flexion: {where}",
                figures,
                "How to read: lower is better. The band is one standard deviation of the samples within a pose, to either "
                f"side; the grey diamonds are the published values of the same Euler sequence ({published.source}). Click a "
                "name to hide or to show it; published filters that this session did not run wait greyed out where there is "
                "a nearer one.",
            )
        )
    if len(errors.flexions) > 1 and len(errors.misalignments) > 1:
        blocks += [_maps(joint, section, sequence, errors) for sequence in errors.sequences]
    else:
        what = "misalignment" if len(errors.misalignments) < 2 else "flexion"
        blocks.append(Sentence(f"Section {section} varies no {what}: there is no map of the error over both."))
    return blocks


def _flexion_table(where: str, errors: PoseErrors, published: PublishedResults) -> Table:
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
                number(e.mean_abs, 2, f"{digits(e.mean_abs, 4)} deg, sd {digits(e.sd, 4)} deg, {e.n} samples",
                       "best" if e.mean_abs == low else "") if e else number(None)
                for e, low in zip(found, best, strict=True)
            ]  # fmt: skip
            body.append(Row([label(name), *cells, number(_mean([e.mean_abs if e else None for e in found]))]))
            for row, values in [item for item in waiting if name in item[0].filters]:
                body.append(_published_row(f"Table {row.table}", f"{row.sensor}, {row.method}", values))
                waiting.remove((row, values))
        for row, values in waiting:
            body.append(_published_row(f"Table {row.table}", f"{row.sensor}, {row.method}", values))
    columns = [
        Cell("filter"),
        *(Cell(f"{flexion:g}", kind="number") for flexion in errors.flexions),
        Cell("mean", kind="number"),
    ]
    over = [Cell(""), Cell("commanded flexion [deg]", span=len(errors.flexions)), Cell("")]
    how = "How to read: mean absolute error of all samples in a pose; bold is the lowest of ours in its column and sequence."
    if beside:
        how += (
            f" Rows in italics are published ({published.source}): {published.setup} Each stands under our row of the same "
            "filter and Euler sequence, or at the end of its sequence where this session did not run that filter."
        )
    return Table(f"Mean |flexion error| [deg]: {where}", columns, body, how, over=over)


def _lowest(errors: PoseErrors, sequence: str) -> list[float]:
    """Lowest mean |error| of each flexion [deg]; NaN where only one filter ran, so that nothing is marked."""
    filters = errors.filters(sequence)
    found = [[e.mean_abs for name in filters if (e := errors.at((name, sequence), f))] for f in errors.flexions]
    return [min(values) if len(values) > 1 else float("nan") for values in found]


def _published_row(table: str, what: str, values: list[float | None]) -> Row:
    return Row([Cell(table, what, head=True)] + [number(value) for value in (*values, _mean(values))], "published")


def _curves(errors: PoseErrors, sequence: str, published: PublishedResults, colours: Colours) -> Figure:
    curves = []
    for name in errors.filters(sequence):
        found = [(flexion, e) for flexion in errors.flexions if (e := errors.at((name, sequence), flexion))]
        curves.append(
            Curve(name, [f for f, _ in found], [e.mean_abs for _, e in found], colours[name], [e.sd for _, e in found])
        )
    beside = published_beside(published, errors.flexions).get(sequence, [])
    ran = [row.table for row, _ in beside if set(row.filters) & set(errors.filters(sequence))]
    for row, values in beside:
        known = [(f, value) for f, value in zip(errors.flexions, values, strict=True) if value is not None]
        x, y = [f for f, _ in known], [value for _, value in known]
        name = f"published, {row.table}: {row.sensor}, {row.filters[0]}"
        curves.append(Curve(name, x, y, REFERENCE, dashed=True, hidden=bool(ran) and row.table not in ran))
    return error_curves(curves, "commanded flexion [deg]", f"mean |e| [deg], {sequence}")


def _maps(joint: str, section: str, sequence: str, errors: PoseErrors) -> Figures:
    grids: dict[Key, np.ndarray] = {(name, sequence): errors.grid((name, sequence)) for name in errors.filters(sequence)}
    top = _top(list(grids.values()))
    figures = {}
    for (name, _), grid in grids.items():
        figures[f"error over misalignment and flexion, {name}, {sequence}"] = heat_map(
            f"{name}, {sequence}", errors.misalignments, errors.flexions, grid, "misalignment [deg]", "flexion [deg]",
            "mean |e| [deg]", top,
        )  # fmt: skip
    return Figures(
        f"Mean |flexion error| over misalignment and flexion, {sequence}: {joint}, section {section}",
        figures,
        "How to read: each cell is one pose; all maps of this Euler sequence share their colours, which end at the value "
        "that 98 % of their cells stay below. Stripes along one axis mean that the error depends on that angle alone.",
        small=True,
    )


def _top(grids: list[np.ndarray]) -> float:
    """Upper end of a common colour scale."""
    known = np.concatenate([grid[np.isfinite(grid)] for grid in grids])
    return max(float(np.quantile(known, 0.98)), 1e-3) if len(known) else 1.0


def _sweep_blocks(joint: str, section: str, errors: SweepErrors) -> list[Block]:
    columns = header(*errors.variables, "filter", "sequence", "samples", "mean e [deg]", "mean |e| [deg]", "sd [deg]",
                     "RMS e [deg]", "max |e| [deg]")  # fmt: skip
    body = [
        Row([*(number(v, 2) for v in values), label(key[0]), text(key[1]), number(e.n, 0)]
            + [number(v, 3) for v in (e.mean, e.mean_abs, e.sd, e.rmse, e.max_abs)])
        for (key, values), e in sorted(errors.errors.items(), key=lambda item: tuple(v or 0.0 for v in item[0][1]))
    ]  # fmt: skip
    everything = Table(
        f"Sweeps: {joint}, section {section}",
        columns,
        body,
        "How to read: e is estimated minus true flexion while the arm moves, all samples of a sweep and of the dwells that "
        "share its variables.",
        folded=errors.is_grid,
    )
    if not errors.is_grid:
        return [everything]
    return [_sweep_grid(joint, section, errors), _sweep_maps(joint, section, errors), everything]


def _sweep_grid(joint: str, section: str, errors: SweepErrors) -> Table:
    first, second = errors.variables
    body = []
    for key in errors.keys:
        body.append(Row([Cell(f"{key[0]}, {key[1]}", head=True, span=len(errors.values(1)) + 1)], "group"))
        for value, line in zip(errors.values(0), errors.grid(key), strict=True):
            body.append(Row([label(f"{value:g}"), *(number(error, 2) for error in line)]))
    return Table(
        f"RMS flexion error [deg] of the sweeps: {joint}, section {section}",
        [Cell(first), *(Cell(f"{value:g}", kind="number") for value in errors.values(1))],
        body,
        f"How to read: one row per {first}, one column per {second}; a filter that keeps up shows no growth to the right.",
        over=[Cell(""), Cell(second, span=len(errors.values(1)))],
    )


def _sweep_maps(joint: str, section: str, errors: SweepErrors) -> Figures:
    grids = {key: errors.grid(key) for key in errors.keys}
    top = _top(list(grids.values()))
    figures = {}
    for (name, sequence), grid in grids.items():
        figures[f"RMS error over {errors.variables[1]} and {errors.variables[0]}, {name}, {sequence}"] = heat_map(
            f"{name}, {sequence}", [f"{v:g}" for v in errors.values(1)], [f"{v:g}" for v in errors.values(0)], grid,
            errors.variables[1], errors.variables[0], "RMS e [deg]", top,
        )  # fmt: skip
    return Figures(
        f"RMS flexion error over {errors.variables[1]} and {errors.variables[0]}: {joint}, section {section}",
        figures,
        "How to read: each cell is one sweep; all maps share their colours, which end at the value that 98 % of the cells "
        "stay below.",
        small=True,
    )


def _time_blocks(joint: str, rows: list[JointRow], evaluation: Evaluation, colours: Colours, spans: list[Span]) -> list[Block]:
    series = evaluation.series.get(f"joint_{joint}")
    if not series:
        return [Sentence(f"The error signals of {joint} were not kept: there is no figure over time.")]
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series.get("judged"))
    panels: dict[str, dict[str, np.ndarray]] = {}
    for name, sequence in dict.fromkeys((row.filter, row.sequence) for row in rows):
        signal = series.get(f"{name}_{sequence}_error_rad")
        if signal is not None:
            panels.setdefault(f"error, {sequence} [deg]", {})[name] = envelope(np.degrees(signal))
    figure = time_panels(envelope.time, panels, colours, spans)
    return [
        Figures(
            f"Signed flexion error over time: {joint}",
            {f"signed flexion error of {joint} over time": figure},
            "How to read: estimated minus true flexion, only where it is judged; gaps are moves and calibration. Long "
            "recordings show the lowest and highest error of each short span, so no peak is lost. Dotted lines begin a "
            "section.",
        )
    ]


def _kind(label: str) -> str:
    return "Euler sequence" if label.isupper() else "definition"
