"""The report of a calibration: one HTML file that works offline."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.clock import utc_shown
from testbench.frames import STANDARD_GRAVITY
from testbench.records.disk.replacing import stored, write_text
from testbench.records.findings.finding import Severity
from testbench.records.results.calibration import MountingCalibration, TriadCalibration
from testbench.records.results.calibration_result import CalibrationResult
from testbench.records.results.fit import Fit
from testbench.records.specs.published import load_published
from testbench.reporting.page.figures import Axis, Curve, error_curves, heat_map
from testbench.reporting.page.page import Block, Figures, Page, Section, Sentence, Tile
from testbench.reporting.page.palette import COLOURS, REFERENCE
from testbench.reporting.page.render import render_page
from testbench.reporting.page.space import sphere
from testbench.reporting.page.tables import (
    Cell,
    Row,
    Table,
    digits,
    header,
    label,
    number,
    significant,
    text,
    to_uncertainty,
    unit_words,
)
from testbench.reporting.sections.calibrated import (
    MILLI_G,
    figure_words,
    gravity_errors,
    sentence,
)
from testbench.reporting.sections.findings import finding_sentences

MOST_CORRELATED = 40
"""A correlation matrix of more parameters is not drawn."""
UNITS = {
    "accelerometer": ("m/s²", 1.0),
    "gyroscope": ("deg/s", 180 / np.pi),
    "magnetometer": ("µT", 1.0),
}


def calibration_report(result: CalibrationResult, path: Path) -> Path:
    """Write the report.

    Args:
        result: The calibration with its evidence.
        path: Of the file.
    """
    calibration = result.calibration
    methods = ", ".join(f"{triad} by {found.method}" for triad, found in calibration.triads.items())
    facts = [
        ("Sensor", calibration.sensor),
        ("Device", calibration.device or ""),
        ("Recorded", utc_shown(calibration.calibrated)),
        ("Session", calibration.session),
        (
            "Temperature",
            "" if calibration.temperature is None else f"{calibration.temperature:.1f} °C",
        ),
        ("Rests by", result.segmentation),
        ("Software", calibration.software),
    ]
    sections = [_model(result), _held_out(result)]
    sections += [_triad(triad, found) for triad, found in calibration.triads.items()]
    if calibration.mounting is not None:
        sections.append(_mounting(calibration.mounting))
    figures = _pose_figures(result)
    sections += [_poses(result, figures[1:]), _segmentation(result)]
    html = render_page(
        Page(
            title=f"Calibration of {calibration.sensor}",
            purpose=methods,
            facts=[fact for fact in facts if fact[1]],
            tiles=_tiles(result),
            sections=sections,
            answer=figures[:1],
            simulated="a model of the sensor, not from a real one" if calibration.simulated else "",
            kind="calibration",
            footer="Rows in italics are published values. All uncertainties are standard "
            "uncertainties unless a column says 95 %.",
        )
    )
    with stored(path, "the calibration is kept"):
        write_text(path, html)
    return path


def _tiles(result: CalibrationResult) -> list[Tile]:
    tiles = []
    acc = _figures(result, "accelerometer")
    if "gravity_norm_rms_mm_s2" in acc:
        tiles.append(
            Tile(
                digits(acc["gravity_norm_rms_mm_s2"], 2),
                "mm/s²",
                "RMS error of |g|, held out",
                result.held_out,
            )
        )
    biases = [abs(acc[f"bias_{axis}_mg"]) for axis in "xyz" if f"bias_{axis}_mg" in acc]
    if biases:
        tiles.append(
            Tile(
                digits(max(biases), 3),
                "mg",
                "largest mean |bias| of an axis, held out",
                "published: up to 26.2 mg",
            )
        )
    gyr = _figures(result, "gyroscope")
    if "gravity_direction_median_deg" in gyr:
        detail = f"{gyr.get('held_out_turns', 0):.0f} turns held out"
        tiles.append(
            Tile(
                digits(gyr["gravity_direction_median_deg"], 3),
                "deg",
                "median error of gravity after a turn",
                detail,
            )
        )
    mag = _figures(result, "magnetometer")
    if "field_norm_rms_ut" in mag:
        tiles.append(
            Tile(
                digits(mag["field_norm_rms_ut"], 3),
                "µT",
                "RMS error of the field's length, held out",
                "",
            )
        )
    return tiles


def _figures(result: CalibrationResult, triad: str) -> dict[str, float]:
    found = result.calibration.triads.get(triad)
    return {} if found is None else found.validation


def _held_out(result: CalibrationResult) -> Section:
    rows = [
        Row(
            [
                label(figure_words(name)[0]),
                text(triad),
                significant(value, 4) if figure_words(name)[1] else number(value, 0),
                text(figure_words(name)[1]),
            ]
        )
        for triad, found in result.calibration.triads.items()
        for name, value in found.validation.items()
    ]
    section = Section("held_out", "Held out")
    if rows:
        section.blocks.append(
            Table(
                f"Figures by {result.held_out}",
                [*header("figure", "triad", "value", numbers_from=2), Cell("unit")],
                rows,
                "How to read: none of these poses and turns was seen by the fit that corrected it. "
                "bias is the mean error of an axis over the poses, error also counts what changes "
                "its sign with the pose.",
            )
        )
    else:
        section.blocks.append(
            Sentence(
                "There are too few poses to hold any out; nothing here judges this calibration."
            )
        )
    section.blocks += _beside_published(result)
    section.blocks += [Sentence(sentence(remark)) for remark in result.remarks]
    return section


def _model(result: CalibrationResult) -> Section:
    """Where the calibration's model ends: warnings first."""
    found = sorted(result.calibration.findings, key=lambda own: own.severity != Severity.WARNING)
    section = Section("model", "Where its model ends")
    if not any(own.severity == Severity.WARNING for own in found):
        section.blocks.append(
            Sentence(
                "Nothing in the residuals speaks against the model: they are no larger than their "
                "noise, and go neither with time nor with temperature, force or direction."
            )
        )
    section.blocks += finding_sentences(found)
    return section


def _beside_published(result: CalibrationResult) -> list[Block]:
    figures = _figures(result, "accelerometer")
    if "bias_x_mg" not in figures:
        return []
    published = load_published()
    own = result.calibration.triads["accelerometer"]
    sd = result.poses.sd[1] * MILLI_G

    def row(name: str, detail: str, bias: list[float], spread: list[float], kind: str = "") -> Row:
        shown = [number(abs(value), 3) for value in bias] + [number(value, 2) for value in spread]
        return Row([label(name), text(detail), *shown], kind)

    rows = [
        row(
            result.calibration.sensor,
            own.method,
            [figures[f"bias_{a}_mg"] for a in "xyz"],
            sd.tolist(),
        )
    ]
    rows += [
        row(
            f"{entry.sensor}, table {entry.table}",
            entry.method,
            entry.bias_mg,
            entry.sd_mg,
            "published",
        )
        for entry in published.calibration_bias
    ]
    return [
        Table(
            "Accelerometer bias after calibration, beside published values",
            header(
                "sensor", "method", "|bias| x [mg]", "y", "z", "sd x [mg]", "y", "z", numbers_from=2
            ),
            rows,
            f"How to read: published rows: {published.source}, judged there on the poses they were "
            "fitted to and without a bias in the model; ours on poses held out. sd is that of "
            "single readings at rest, which a calibration must not change.",
        )
    ]


def _triad(triad: str, found: TriadCalibration) -> Section:
    section = Section(triad, triad.capitalize())
    unit, factor = UNITS[triad]
    bias = [
        Row(
            [
                label(axis),
                *(number(value, 6) for value in found.matrix[i]),
                number(found.bias[i] * factor, 5),
            ]
        )
        for i, axis in enumerate("xyz")
    ]
    section.blocks.append(
        Table(
            f"Corrections by {found.method}",
            header("axis", "matrix x", "matrix y", "matrix z", f"bias [{unit}]"),
            bias,
            "How to read: corrected = matrix · (raw − bias); a perfect sensor has the unit matrix "
            "and no bias."
            + (" The response to force is taken away as well." if found.g_matrix.any() else ""),
        )
    )
    for fit in found.fits:
        section.blocks += [_parameters(fit), *_correlation(fit)]
    section.blocks += [Sentence(sentence(remark)) for remark in found.remarks]
    return section


def _parameters(fit: Fit) -> Table:
    half = fit.half_width()
    rows = [
        Row(
            [
                label(name),
                Cell(to_uncertainty(value, sd), kind="number"),
                significant(sd, 2),
                significant(width, 2),
                text(unit_words(unit)),
            ]
        )
        for name, value, sd, width, unit in zip(
            fit.names, fit.values, fit.sd, half, fit.units, strict=True
        )
    ]
    dof = (
        "known beforehand"
        if not np.isfinite(fit.dof)
        else f"found with {fit.dof:.0f} degrees of freedom"
    )
    left = (
        f"; residuals {fit.residual_rms:.3g} {fit.residual_unit} RMS"
        if np.isfinite(fit.residual_rms)
        else ""
    )
    return Table(
        "Parameters with their uncertainty",
        [*header("parameter", "value", "standard uncertainty", "95 % ±"), Cell("unit")],
        rows,
        f"How to read: the scatter is {dof}{left}; condition number {fit.condition:.3g}. The "
        "interval is Student's.",
    )


def _correlation(fit: Fit) -> list[Block]:
    if not 1 < len(fit.names) <= MOST_CORRELATED:
        return []
    parameters = Axis("", list(fit.names))
    figure = heat_map("", parameters, parameters, np.abs(fit.correlation), "|r|", 1.0)
    figure["layout"]["height"] = 224 + 18 * len(fit.names)
    figure["layout"]["margin"] = {"l": 150, "r": 14, "t": 38, "b": 150}
    for axis in ("xaxis", "yaxis"):
        figure["layout"][axis] |= {
            "tickmode": "array",
            "tickvals": list(fit.names),
            "type": "category",
            "automargin": True,
        }
    figure["layout"]["xaxis"]["tickangle"] = -60
    figure["layout"]["yaxis"]["autorange"] = "reversed"
    return [
        Figures(
            "Correlation of the parameters",
            {"Magnitude of the correlation of each pair of parameters": figure},
            "How to read: 0 are told apart, 1 are not; a bright cell off the diagonal names what "
            "the poses confuse.",
        )
    ]


def _mounting(found: MountingCalibration) -> Section:
    rows = [
        Row([label(name), number(value, 4), number(sd, 4), number(half, 4)])
        for name, value, sd, half in zip(
            "xyz",
            np.degrees(found.fit.values),
            np.degrees(found.fit.sd),
            np.degrees(found.fit.half_width()),
            strict=True,
        )
    ]
    table = Table(
        f"Mounting by {found.method}",
        header("about", "rotation [deg]", "standard uncertainty [deg]", "95 % ± [deg]"),
        rows,
        "How to read: the rotation vector that takes what the sensor reads into the axes in which "
        "it was believed to sit; all triads and the device's orientation are turned by it, after "
        "their own corrections.",
    )
    return Section(
        "mounting", "Mounting", [table, *(Sentence(sentence(remark)) for remark in found.remarks)]
    )


def _pose_figures(result: CalibrationResult) -> list[Block]:
    """The length of gravity before and after, and where in the sensor it pointed."""
    poses = result.poses
    if len(poses.start) < 2:
        return []
    before, after = gravity_errors(poses.raw), gravity_errors(poses.corrected)
    numbers = list(range(1, len(before) + 1))
    curves = [
        Curve(
            f"{name}: mean {digits(float(values.mean()), 2)}, {digits(float(values.min()), 2)} to "
            f"{digits(float(values.max()), 2)} mg",
            numbers,
            values.tolist(),
            colour,
            symbol=symbol,
        )
        for name, values, colour, symbol in (
            ("raw", before, REFERENCE, "circle-open"),
            ("corrected", after, COLOURS[0], "circle"),
        )
    ]
    directions = poses.raw / np.linalg.norm(poses.raw, axis=1, keepdims=True)
    return [
        Figures(
            "Length of gravity in each pose, before and after",
            {
                "error of the length of gravity in each pose": error_curves(
                    curves, "pose", "|g| error [mg]", signed=True
                )
            },
            "How to read: how far the length of the mean reading is from 9.80665 m/s²; after the "
            "correction it is the noise that is left, and what the model does not hold.",
        ),
        Figures(
            "Where the poses lie",
            {
                "directions of gravity in the sensor": sphere(
                    "Direction of gravity in the sensor",
                    directions,
                    after,
                    "|g| error [mg]",
                    "sensor",
                )
            },
            "How to read: a point is a pose; where the sphere is bare the calibration knows "
            "nothing of its own. Colours are what is left after the correction. Drag to turn.",
            folded=True,
        ),
    ]


def _poses(result: CalibrationResult, figures: list[Block]) -> Section:
    poses = result.poses
    rows = []
    for i in range(len(poses.start)):
        left = (
            [Cell("–")] * 3
            if poses.expected is None
            else [number(v, 2) for v in (poses.corrected[i] - poses.expected[i]) * MILLI_G]
        )
        norm = (float(np.linalg.norm(poses.corrected[i])) - STANDARD_GRAVITY) * MILLI_G
        rows.append(
            Row(
                [
                    label(i + 1),
                    number(poses.start[i], 1),
                    number(poses.end[i], 1),
                    *(number(v, 4) for v in poses.raw[i]),
                    *left,
                    number(norm, 2),
                ]
            )
        )
    table = Table(
        "Poses of the accelerometer",
        header(
            "pose",
            "from [s]",
            "to [s]",
            "raw x [m/s²]",
            "y",
            "z",
            "left x [mg]",
            "y",
            "z",
            "|g| error [mg]",
        ),
        rows,
        "How to read: mean raw readings at rest, and what the calibration that was fitted to these "
        "poses leaves of them; the last column is against 9.80665 m/s².",
    )
    return Section("poses", "Poses", [*figures, table])


def _segmentation(result: CalibrationResult) -> Section:
    rows = [
        Row(
            [
                label(f"{a.first} and {a.second}"),
                text(f"{a.counts[0]} and {a.counts[1]}"),
                number(a.matched, 0),
                number(100 * a.iou, 1),
                number(1e3 * a.start_later_s, 0),
                number(1e3 * a.end_later_s, 0),
                number(1e3 * a.border_abs_s, 0),
            ]
        )
        for a in result.agreements
    ]
    table = Table(
        "Where the sensor rested, by independent witnesses",
        header(
            "witnesses",
            "rests",
            "matched",
            "overlap [%]",
            "second begins later [ms]",
            "second ends later [ms]",
            "mean border difference [ms]",
            numbers_from=2,
        ),
        rows,
        "How to read: arm is what the arm reports, gyroscope the spread of the rates, peaks the "
        "plateaus between the moves, variance that of the accelerometer with its threshold found "
        f"automatically. The rests of the {result.segmentation} were used.",
    )
    return Section("segmentation", "Rests", [table])
