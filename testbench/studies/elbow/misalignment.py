"""What misaligned segments do to a flexion angle: theory, its fits, every sequence; with a session
beside them.

Castellanos Alonso 2023, section 4: an arm misaligned by d about X, Y or Z, an elbow that flexes by
f about Y. Everything here comes from the same joint-angle code that sessions are estimated with; no
fitted number is stored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from testbench.model.misalignment import (
    AxisName,
    flexion_index,
    misalignment_errors,
    sensor_errors,
    start_pose_errors,
)
from testbench.model.statistics.polynomial import PolynomialFit, fit_quadratic, fit_surface
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import (
    StudyCurve,
    StudyCurves,
    StudyRecord,
    StudyRow,
    StudySurface,
    StudyTable,
    Value,
)
from testbench.records.session.session import Session
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.published import PublishedTables, load_published_tables
from testbench.records.specs.strict import EulerSequence
from testbench.studies.bench import StudyBench
from testbench.studies.elbow.misalignment_session import (
    MEASURED,
    session_curves,
    session_table,
)
from testbench.studies.parts import over_parts
from testbench.studies.result import StudyResult

FLEXION_DEG = np.arange(0.0, 71.0, 5.0)
MISALIGNMENT_DEG = np.arange(-20.0, 21.0, 2.0)
"""The grid of the source: 15 flexions by 21 misalignments."""
SHOWN_EVERY_DEG = 10
"""Flexions that are multiples of this have a curve in the figure."""
SEQUENCE = "ZYX"
SURFACE_DEGREES = (4, 2)
"""In flexion and misalignment; the source does not state its own. The next smaller ones leave 2.5
times the residual.
"""
SEQUENCES: tuple[str, ...] = get_args(EulerSequence)
AXIS_NAMES: tuple[AxisName, ...] = get_args(AxisName)
TURNS = {"X": "roll", "Y": "pitch", "Z": "yaw"}
SIDES = {"proximal": "arm", "distal": "forearm"}
ALL_AXES_DEG = (5.0, 5.0, 7.0)
"""Yaw, pitch and roll of the annex, together."""

PROTOCOL, FILTERS = "elbow_flexion", ("device", "vqf_6d")
"""The session, and the filters that stand for the sensors in it."""
QUESTION = (
    "How wrong does a misaligned segment make a flexion angle, by which sequence, and how much of "
    "a session's error is that?"
)


def run(bench: StudyBench) -> StudyRecord:
    """Run the elbow under misalignment, or ask a session of it, and put the theory beside it."""
    started = bench.now()
    results = bench.results(PROTOCOL, None if bench.own else FILTERS)
    bench.say("theory, fits and tables")
    first = results[0]
    study = misalignment_study(session=first.session, evaluation=first.evaluation)
    measured = [
        over_parts([session_table(each.session, each.evaluation, joint) for each in results])
        for joint in first.session.analysis.joints
    ]
    tables = tuple(table for table in study.tables if not table.key.endswith(MEASURED))
    found = tuple(
        f"{row.label}: the definition is wrong by {row.values[1]:.3f} deg in the mean and "
        f"{row.values[2]:.2f} deg at most, what was measured by {row.values[3]:.3f} and "
        f"{row.values[4]:.2f} deg{over(len(results))}."
        for table in measured
        for row in table.rows
    )
    settings = {**bench.settings(PROTOCOL), "filters": ", ".join(FILTERS)}
    return replace(study, findings=study.findings + found, tables=(*tables, *measured)).record(
        "misalignment",
        "Misaligned segments",
        QUESTION,
        started,
        settings,
        [str(each.session.path) for each in results],
        "They give what is called simulation and measurement in the figures of the elbow, of the "
        "first, and its table; the rest is theory.",
    )


def over(parts: int) -> str:
    """Of how many parts a mean is."""
    return f", means of {parts} parts" if parts > 1 else ""


def misalignment_study(
    sequence: str = SEQUENCE,
    flexion_deg: np.ndarray = FLEXION_DEG,
    misalignment_deg: np.ndarray = MISALIGNMENT_DEG,
    flexion_about: AxisName = "Y",
    session: Session | None = None,
    evaluation: Evaluation | None = None,
) -> StudyResult:
    """The whole study.

    Args:
        sequence: Intrinsic Euler sequence whose flexion is judged.
        flexion_deg: Rows of the grid, shape (f,) [deg].
        misalignment_deg: Columns of the grid, shape (d,) [deg].
        flexion_about: Axis of the flexion.
        session: A session whose protocol varies the misalignment, to be shown beside theory and
            simulation.
        evaluation: Of that session.

    Raises:
        InputError: The flexion is no single angle of the sequence, or the session varies no
            misalignment.
    """
    published = load_published_tables("reference_1_theory")
    grids = {
        axis: error_grid(sequence, axis, flexion_deg, misalignment_deg, flexion_about)
        for axis in AXIS_NAMES
    }
    magnitudes = np.abs(grids["X"])
    surfaces = tuple(
        StudySurface(
            f"|error| of the {sequence} flexion, misaligned about {axis}",
            "misalignment [deg]",
            "flexion [deg]",
            "|error| [deg]",
            misalignment_deg,
            flexion_deg,
            np.abs(grid),
        )
        for axis, grid in grids.items()
    )
    same = (sequence, flexion_about) == (SEQUENCE, "Y") and np.array_equal(
        misalignment_deg, MISALIGNMENT_DEG
    )
    tables = [
        fit_table(magnitudes, flexion_deg, misalignment_deg, published if same else None),
        surface_table(magnitudes, flexion_deg, misalignment_deg),
        axes_table(grids, misalignment_deg, sequence),
        sequences_table(flexion_deg, misalignment_deg, flexion_about),
        sides_table(flexion_deg, misalignment_deg, sequence, flexion_about),
        sensor_table(flexion_deg, misalignment_deg, sequence, flexion_about),
    ]
    curves = [_theory_curves(magnitudes, flexion_deg, misalignment_deg, sequence)]
    if session is not None and evaluation is not None:
        for joint in session.analysis.joints:
            curves += session_curves(session, evaluation, joint)
            tables.append(session_table(session, evaluation, joint))
    return StudyResult(
        published.source,
        _findings(grids, flexion_deg, sequence),
        tuple(tables),
        tuple(curves),
        surfaces,
    )


def error_grid(
    definition: str | FlexionAngle,
    about: AxisName,
    flexion_deg: np.ndarray,
    misalignment_deg: np.ndarray,
    flexion_about: AxisName = "Y",
) -> np.ndarray:
    """Signed error of the flexion by a misalignment.

    Args:
        definition: Of the flexion.
        about: Axis of the misalignment.
        flexion_deg: Rows of the grid, shape (f,) [deg].
        misalignment_deg: Columns of the grid, shape (d,) [deg].
        flexion_about: Axis of the flexion.

    Returns:
        Shape (f, d) [deg]; NaN in gimbal lock.
    """
    index = flexion_index(definition, flexion_about)
    errors = misalignment_errors(
        definition, about, np.radians(flexion_deg), np.radians(misalignment_deg), flexion_about
    )
    return np.asarray(np.degrees(errors[..., index]))


def fit_table(
    magnitudes: np.ndarray,
    flexion_deg: np.ndarray,
    misalignment_deg: np.ndarray,
    published: PublishedTables | None,
) -> StudyTable:
    """Quadratic fits of |error| over the misalignment, one row for each flexion.

    Args:
        magnitudes: Of the error, shape (f, d) [deg].
        flexion_deg: Rows of the grid, shape (f,) [deg].
        misalignment_deg: Columns of the grid, shape (d,) [deg].
        published: Fits on the same grid, or None.
    """
    theirs = {row.label: row for row in published.tables["misalignment"].rows} if published else {}
    remarks = [f"At {label} deg {row.remark}." for label, row in theirs.items() if row.remark]
    rows = []
    for flexion, magnitude in zip(flexion_deg, magnitudes, strict=True):
        if np.isfinite(magnitude).all():
            beside = theirs.get(f"{flexion:g}")
            values = _fit_values(fit_quadratic(misalignment_deg, magnitude))
            rows.append(
                StudyRow(f"{flexion:g} deg", values, tuple(beside.values) if beside else ())
            )
    return StudyTable(
        "fits",
        "Quadratic fits a d² + b d + c of |error| over the misalignment d about X, by flexion",
        (
            "a [1/deg]",
            "a from",
            "a to",
            "b",
            "b from",
            "b to",
            "c [deg]",
            "c from",
            "c to",
            "R²",
            "adjusted R²",
            "RMSE [deg]",
        ),
        tuple(rows),
        "How to read: a is how fast the error grows with the square of the misalignment; from and "
        "to are ends of 95 % confidence intervals. The residual is the model's, not noise: |error| "
        "is no parabola.",
        " ".join(["They agree to the last digit printed.", *remarks]) if theirs else "",
        decimals=(5, 5, 5, 1, 6, 6, 5, 5, 5, 4, 4, 5),
        ratio_column=0,
        short="Quadratic fits",
    )


def _fit_values(fit: PolynomialFit) -> tuple[Value, ...]:
    explained: tuple[Value, Value] = (None, None)
    if np.isfinite(fit.r_squared):
        explained = (fit.r_squared, fit.adjusted_r_squared)
    return (
        fit.value("a"),
        *fit.interval("a"),
        fit.value("b"),
        *fit.interval("b"),
        fit.value("c"),
        *fit.interval("c"),
        *explained,
        fit.rmse,
    )


def surface_table(
    magnitudes: np.ndarray,
    flexion_deg: np.ndarray,
    misalignment_deg: np.ndarray,
    degrees: tuple[int, int] = SURFACE_DEGREES,
) -> StudyTable:
    """Polynomial surface of |error| over flexion and misalignment about X.

    Args:
        magnitudes: Of the error, shape (f, d) [deg].
        flexion_deg: Rows of the grid, shape (f,) [deg].
        misalignment_deg: Columns of the grid, shape (d,) [deg].
        degrees: Of the polynomial in flexion and in misalignment.
    """
    flexion, misalignment = np.meshgrid(flexion_deg, misalignment_deg, indexing="ij")
    known = np.isfinite(magnitudes)
    fit = fit_surface(flexion[known], misalignment[known], magnitudes[known], degrees)
    (f_mean, d_mean), (f_sd, d_sd) = fit.centre, fit.scale
    return StudyTable(
        "surface",
        f"Surface of |error|, polynomial of degree {degrees[0]} in flexion f and {degrees[1]} in "
        "misalignment d",
        ("value [deg]", "from", "to"),
        tuple(StudyRow(name, (fit.value(name), *fit.interval(name))) for name in fit.fit.names),
        f"How to read: p_ij stands before F^i D^j, F = (f - {f_mean:.4g}) / {f_sd:.4g}, D = (d - "
        f"{abs(d_mean):.4g}) / {d_sd:.4g}, all in degrees. R² {fit.r_squared:.4f}, adjusted "
        f"{fit.adjusted_r_squared:.4f}, RMSE {fit.rmse:.4g} deg.",
        "The source norms by the same means and deviations (35, 21.64; 0, 12.13); its degrees and "
        "coefficients are not known.",
        decimals=(4, 4, 4),
        short="Surface",
    )


def axes_table(
    grids: Mapping[AxisName, np.ndarray], misalignment_deg: np.ndarray, sequence: str
) -> StudyTable:
    """How much of a misalignment about each axis arrives in the flexion.

    Args:
        grids: Signed error of the flexion by the axis of the misalignment, shape (f, d) each [deg].
        misalignment_deg: Columns of the grids, shape (d,) [deg].
        sequence: Intrinsic Euler sequence whose flexion is judged.
    """
    rows = []
    for axis, grid in grids.items():
        passed = np.abs(grid[:, misalignment_deg != 0]) / np.abs(
            misalignment_deg[misalignment_deg != 0]
        )
        rows.append(
            StudyRow(
                axis,
                (
                    float(np.nanmax(np.abs(grid))),
                    float(np.nanmin(passed)),
                    float(np.nanmax(passed)),
                ),
            )
        )
    return StudyTable(
        "axes",
        f"Misalignment about each axis, {sequence}",
        ("largest |error| [deg]", "least passed on [1]", "most passed on [1]"),
        tuple(rows),
        "How to read: passed on is |error| over |misalignment|. About the flexion axis it is one "
        "whatever the flexion.",
        decimals=(3, 3, 3),
    )


def sequences_table(
    flexion_deg: np.ndarray, misalignment_deg: np.ndarray, flexion_about: AxisName = "Y"
) -> StudyTable:
    """The largest error of the flexion for every sequence that has it as an angle of its own.

    Args:
        flexion_deg: Rows of the grid, shape (f,) [deg].
        misalignment_deg: Columns of the grid, shape (d,) [deg].
        flexion_about: Axis of the flexion.
    """
    rows = []
    for sequence in SEQUENCES:
        if sequence.count(flexion_about) != 1:
            continue
        largest: list[Value] = []
        for axis in AXIS_NAMES:
            grid = np.abs(error_grid(sequence, axis, flexion_deg, misalignment_deg, flexion_about))
            largest.append(float(np.nanmax(grid)) if np.isfinite(grid).any() else None)
        place = ("first", "second", "third")[flexion_index(sequence, flexion_about)]
        rows.append(StudyRow(sequence, (place, *largest)))
    return StudyTable(
        "sequences",
        f"Largest |error| of a flexion about {flexion_about}, every sequence",
        ("flexion is its", "about X [deg]", "about Y [deg]", "about Z [deg]"),
        tuple(rows),
        f"How to read: misaligned by up to {np.abs(misalignment_deg).max():g} deg, flexed by up to "
        f"{flexion_deg.max():g} deg. A sequence with {flexion_about} twice is left out: there the "
        "flexion is a sum of two angles.",
        decimals=(0, 3, 3, 3),
    )


def sides_table(
    flexion_deg: np.ndarray,
    misalignment_deg: np.ndarray,
    sequence: str,
    flexion_about: AxisName = "Y",
) -> StudyTable:
    """Arm or forearm misaligned at the start (eqs 2.18, 2.20), one axis at a time and all together.

    Args:
        flexion_deg: Shape (f,) [deg].
        misalignment_deg: Increasing, shape (d,) [deg].
        sequence: Intrinsic Euler sequence whose flexion is judged.
        flexion_about: Axis of the flexion.
    """
    index = flexion_index(sequence, flexion_about)
    rows = []
    sides: tuple[Literal["proximal", "distal"], ...] = ("proximal", "distal")
    for which in sides:
        for axis in AXIS_NAMES:
            errors = misalignment_errors(
                sequence,
                axis,
                np.radians(flexion_deg),
                np.radians(misalignment_deg),
                flexion_about,
                which,
            )
            magnitude = np.degrees(np.abs(errors[..., index]))
            ends = [float(magnitude[i, -1]) for i in (0, len(flexion_deg) // 2, -1)]
            rows.append(
                StudyRow(f"{SIDES[which]}, about {axis}", (*ends, float(np.nanmax(magnitude))))
            )
        together = start_pose_errors(
            sequence, np.radians(flexion_deg), np.radians(ALL_AXES_DEG), flexion_about, which
        )
        magnitude = np.degrees(np.abs(together[:, index]))
        ends = [float(magnitude[i]) for i in (0, len(flexion_deg) // 2, -1)]
        row = (*ends, float(np.nanmax(magnitude)))
        rows.append(StudyRow(f"{SIDES[which]}, yaw, pitch, roll of 5, 5, 7 deg", row))
    shown = (flexion_deg[0], flexion_deg[len(flexion_deg) // 2], flexion_deg[-1])
    return StudyTable(
        "sides",
        f"Arm or forearm misaligned at the start by {misalignment_deg[-1]:g} deg, {sequence}",
        (*(f"|error| at flexion {f:g} [deg]" for f in shown), "largest |error| [deg]"),
        tuple(rows),
        "How to read: the segment is taken to start level and does not (eq. 2.18 of the arm, 2.20 "
        "of the forearm); yaw, pitch and roll together are those of the annex (eq. 2.19).",
        decimals=(3, 3, 3, 3),
        short="Arm and forearm",
    )


def sensor_table(
    flexion_deg: np.ndarray, error_deg: np.ndarray, sequence: str, flexion_about: AxisName = "Y"
) -> StudyTable:
    """Errors of one sensor's orientation in yaw, pitch and roll (eq. 2.21).

    Args:
        flexion_deg: Shape (f,) [deg].
        error_deg: Of the orientation, increasing, shape (d,) [deg].
        sequence: Intrinsic Euler sequence whose flexion is judged.
        flexion_about: Axis of the flexion.
    """
    rows = []
    index = flexion_index(sequence, flexion_about)
    sides: tuple[Literal["proximal", "distal"], ...] = ("proximal", "distal")
    for which in sides:
        for axis in reversed(AXIS_NAMES):
            errors = sensor_errors(
                sequence, axis, np.radians(flexion_deg), np.radians(error_deg), flexion_about, which
            )
            magnitude = np.degrees(np.abs(errors[..., index]))
            at = [float(magnitude[i, -1]) for i in (0, len(flexion_deg) // 2, -1)]
            rows.append(StudyRow(f"{which}, {TURNS[axis]}", (*at, float(np.nanmax(magnitude)))))
    shown = (flexion_deg[0], flexion_deg[len(flexion_deg) // 2], flexion_deg[-1])
    return StudyTable(
        "sensors",
        f"One sensor's orientation wrong by up to {error_deg[-1]:g} deg, {sequence}",
        (*(f"|error| at flexion {f:g} [deg]" for f in shown), "largest |error| [deg]"),
        tuple(rows),
        "How to read: the start pose is right, the error comes later. A yaw of one sensor is what "
        "a drifting heading does.",
        decimals=(3, 3, 3, 3),
    )


def _theory_curves(
    magnitudes: np.ndarray, flexion_deg: np.ndarray, misalignment_deg: np.ndarray, sequence: str
) -> StudyCurves:
    curves = []
    for flexion, magnitude in zip(flexion_deg, magnitudes, strict=True):
        if not np.isfinite(magnitude).all() or flexion % SHOWN_EVERY_DEG:
            continue
        group = f"{flexion:g} deg"
        curves.append(StudyCurve(group, misalignment_deg, magnitude, "simulation", group))
        if flexion in (60, 70):
            fit = fit_quadratic(misalignment_deg, magnitude)
            curves.append(
                StudyCurve(
                    f"{group}, parabola", misalignment_deg, fit.at(misalignment_deg), "fit", group
                )
            )
    caption = f"|error| of the {sequence} flexion over the misalignment about X, by flexion"
    how = (
        "How to read: points are the joint-angle code on simulated quaternions, lines the "
        "parabolas fitted to them."
    )
    return StudyCurves(
        caption, "misalignment [deg]", "|error| [deg]", tuple(curves), how, ordered=True
    )


def _findings(
    grids: Mapping[AxisName, np.ndarray], flexion_deg: np.ndarray, sequence: str
) -> tuple[str, ...]:
    return tuple(
        f"{sequence}: misaligned about {axis}, a flexion of up to {flexion_deg.max():g} deg is "
        f"wrong by up to {np.nanmax(np.abs(grid)):.2f} deg without any error of a sensor."
        for axis, grid in grids.items()
    )
