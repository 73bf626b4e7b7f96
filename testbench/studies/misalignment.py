"""What misaligned segments do to a flexion angle: theory, its fits, every sequence; with a session beside them.

Castellanos Alonso 2023, section 4: an arm misaligned by d about X, Y or Z, an elbow that flexes by f about Y. Everything here
comes from the same joint-angle code that sessions are estimated with; no fitted number is stored.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from testbench.model.misalignment import (
    AxisName,
    flexion_index,
    misalignment_errors,
    sensor_errors,
)
from testbench.model.polynomial import PolynomialFit, fit_quadratic, fit_surface
from testbench.records.evaluation import Evaluation
from testbench.records.joint_definition import FlexionAngle
from testbench.records.published import MisalignmentFit, load_published
from testbench.records.session import Session
from testbench.records.strict import EulerSequence
from testbench.studies.misalignment_session import session_figures, session_table
from testbench.studies.results import (
    Cell,
    ResultCurve,
    ResultFigure,
    ResultSurface,
    ResultTable,
    StudyResult,
)

FLEXION_DEG = np.arange(0.0, 71.0, 5.0)
MISALIGNMENT_DEG = np.arange(-20.0, 21.0, 2.0)
"""The grid of the source: 15 flexions by 21 misalignments."""
SEQUENCE = "ZYX"
SURFACE_DEGREES = (4, 2)
"""In flexion and misalignment; the source does not state its own. The next smaller ones leave 2.5 times the residual."""
SEQUENCES: tuple[str, ...] = get_args(EulerSequence)
AXIS_NAMES: tuple[AxisName, ...] = get_args(AxisName)
TURNS = {"X": "roll", "Y": "pitch", "Z": "yaw"}


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
        sequence: Intrinsic Euler sequence whose flexion is judged. flexion_deg, misalignment_deg: Shape (f,), (d,) [deg].
        flexion_about: Axis of the flexion. session, evaluation: A session whose protocol varies the misalignment, to be
        shown beside theory and simulation.

    Raises:
        InputError: The flexion is no single angle of the sequence, or the session varies no misalignment.
    """
    flexion_index(sequence, flexion_about)
    grids = {axis: error_grid(sequence, axis, flexion_deg, misalignment_deg, flexion_about) for axis in AXIS_NAMES}
    surfaces = [
        ResultSurface(
            f"|error| of the {sequence} flexion, misaligned about {axis}",
            "misalignment [deg]", "flexion [deg]", "|error| [deg]", misalignment_deg, flexion_deg, np.abs(grid),
        )
        for axis, grid in grids.items()
    ]  # fmt: skip
    tables = [
        fit_table(np.abs(grids["X"]), flexion_deg, misalignment_deg, sequence, flexion_about),
        surface_table(np.abs(grids["X"]), flexion_deg, misalignment_deg),
        axes_table(grids, misalignment_deg, sequence),
        sequences_table(flexion_deg, misalignment_deg, flexion_about),
        sensor_table(flexion_deg, misalignment_deg, sequence, flexion_about),
    ]
    figures = [_theory_figure(np.abs(grids["X"]), flexion_deg, misalignment_deg, sequence)]
    notes = []
    if session is not None and evaluation is not None:
        for joint in session.analysis.joints:
            figures += session_figures(session, evaluation, joint)
            tables.append(session_table(session, evaluation, joint))
        notes.append(f"The measured points are those of session {session.name}.")
    purpose = "Error of a flexion angle when the proximal segment is misaligned, by theory, simulation and measurement"
    return StudyResult("misalignment", purpose, tables, figures, surfaces, notes)


def error_grid(
    definition: str | FlexionAngle,
    about: AxisName,
    flexion_deg: np.ndarray,
    misalignment_deg: np.ndarray,
    flexion_about: AxisName = "Y",
) -> np.ndarray:
    """Signed error of the flexion [deg], shape (f, d); NaN in gimbal lock."""
    errors = misalignment_errors(definition, about, np.radians(flexion_deg), np.radians(misalignment_deg), flexion_about)
    return np.asarray(np.degrees(errors[..., flexion_index(definition, flexion_about)]))


def fit_table(
    magnitudes: np.ndarray, flexion_deg: np.ndarray, misalignment_deg: np.ndarray, sequence: str, flexion_about: AxisName
) -> ResultTable:
    """Quadratic fits of |error| over the misalignment, one row for each flexion, with the published ones beside them."""
    published = {fit.flexion_deg: fit for fit in load_published().misalignment_fits}
    if (sequence, flexion_about) != (SEQUENCE, "Y") or not np.array_equal(misalignment_deg, MISALIGNMENT_DEG):
        published = {}  # they were made on another grid
    rows: list[list[Cell]] = []
    for flexion, magnitude in zip(flexion_deg, magnitudes, strict=True):
        if np.isfinite(magnitude).all():
            rows.append(_fit_row(float(flexion), fit_quadratic(misalignment_deg, magnitude), published.get(float(flexion))))
    theirs = ["published a", "published c", "published R²", "published RMSE [deg]", "ratio of a"]
    columns = ["flexion [deg]", "a [1/deg]", "a from", "a to", "b", "c [deg]", "R²", "adjusted R²", "RMSE [deg]", *theirs]
    return ResultTable(
        "Quadratic fits a d² + b d + c of |error| over the misalignment d about X",
        columns,
        rows,
        "How to read: a is how fast the error grows with the square of the misalignment, with its 95 % confidence interval. "
        "The residual is the model's, not noise: |error| is no parabola. The ratio is ours over the published value.",
        theirs[:-1],
        load_published().source if published else None,
    )


def _fit_row(flexion: float, fit: PolynomialFit, published: MisalignmentFit | None) -> list[Cell]:
    low, high = fit.interval("a")
    a, b, c = (fit.value(name) for name in "abc")
    theirs: list[Cell] = [None] * 5
    if published is not None:
        theirs = [published.a, published.c, published.r_squared, published.rmse_deg, a / published.a]
    explained: list[Cell] = [fit.r_squared, fit.adjusted_r_squared] if np.isfinite(fit.r_squared) else [None, None]
    return [flexion, a, low, high, b, c, *explained, fit.rmse, *theirs]


def surface_table(
    magnitudes: np.ndarray,
    flexion_deg: np.ndarray,
    misalignment_deg: np.ndarray,
    degrees: tuple[int, int] = SURFACE_DEGREES,
) -> ResultTable:
    """Polynomial surface of |error| over flexion and misalignment about X."""
    flexion, misalignment = np.meshgrid(flexion_deg, misalignment_deg, indexing="ij")
    known = np.isfinite(magnitudes)
    fit = fit_surface(flexion[known], misalignment[known], magnitudes[known], degrees)
    rows: list[list[Cell]] = [[name, fit.value(name), *fit.interval(name)] for name in fit.fit.names]
    (f_mean, d_mean), (f_sd, d_sd) = fit.centre, fit.scale
    return ResultTable(
        f"Surface of |error|, polynomial of degree {degrees[0]} in flexion f and {degrees[1]} in misalignment d",
        ["coefficient", "value [deg]", "from", "to"],
        rows,
        f"How to read: p_ij stands before F^i D^j, F = (f - {f_mean:.4g}) / {f_sd:.4g}, D = (d - {abs(d_mean):.4g}) / "
        f"{d_sd:.4g}, all in degrees. R² {fit.r_squared:.4f}, adjusted {fit.adjusted_r_squared:.4f}, RMSE {fit.rmse:.4g} deg. "
        "The source norms by the same means and deviations (35, 21.64; 0, 12.13); its degrees and coefficients are not known.",
    )


def axes_table(grids: dict[AxisName, np.ndarray], misalignment_deg: np.ndarray, sequence: str) -> ResultTable:
    """How much of a misalignment about each axis arrives in the flexion."""
    rows: list[list[Cell]] = []
    for axis, grid in grids.items():
        passed = np.abs(grid[:, misalignment_deg != 0]) / np.abs(misalignment_deg[misalignment_deg != 0])
        rows.append([axis, float(np.nanmax(np.abs(grid))), float(np.nanmin(passed)), float(np.nanmax(passed))])
    return ResultTable(
        f"Misalignment about each axis, {sequence}",
        ["axis", "largest |error| [deg]", "least passed on [1]", "most passed on [1]"],
        rows,
        "How to read: passed on is |error| over |misalignment|. About the flexion axis it is one whatever the flexion.",
    )


def sequences_table(flexion_deg: np.ndarray, misalignment_deg: np.ndarray, flexion_about: AxisName = "Y") -> ResultTable:
    """The largest error of the flexion for every sequence that has it as an angle of its own."""
    rows: list[list[Cell]] = []
    for sequence in SEQUENCES:
        if sequence.count(flexion_about) != 1:
            continue
        place = ("first", "second", "third")[flexion_index(sequence, flexion_about)]
        largest: list[Cell] = []
        for axis in AXIS_NAMES:
            grid = np.abs(error_grid(sequence, axis, flexion_deg, misalignment_deg, flexion_about))
            largest.append(float(np.nanmax(grid)) if np.isfinite(grid).any() else None)
        rows.append([sequence, place, *largest])
    return ResultTable(
        f"Largest |error| of a flexion about {flexion_about}, every sequence",
        ["sequence", "flexion is its", "about X [deg]", "about Y [deg]", "about Z [deg]"],
        rows,
        f"How to read: misaligned by up to {np.abs(misalignment_deg).max():g} deg, flexed by up to {flexion_deg.max():g} deg. "
        f"A sequence with {flexion_about} twice is left out: there the flexion is a sum of two angles.",
    )


def sensor_table(flexion_deg: np.ndarray, error_deg: np.ndarray, sequence: str, flexion_about: AxisName = "Y") -> ResultTable:
    """Errors of one sensor's orientation in yaw, pitch and roll (eq. 2.21)."""
    rows: list[list[Cell]] = []
    index = flexion_index(sequence, flexion_about)
    sides: tuple[Literal["proximal", "distal"], ...] = ("proximal", "distal")
    for which in sides:
        for axis in reversed(AXIS_NAMES):
            errors = sensor_errors(sequence, axis, np.radians(flexion_deg), np.radians(error_deg), flexion_about, which)
            magnitude = np.degrees(np.abs(errors[..., index]))
            at = [float(magnitude[i, -1]) for i in (0, len(flexion_deg) // 2, -1)]
            rows.append([which, TURNS[axis], *at, float(np.nanmax(magnitude))])
    low, middle, high = flexion_deg[0], flexion_deg[len(flexion_deg) // 2], flexion_deg[-1]
    return ResultTable(
        f"One sensor's orientation wrong by up to {error_deg[-1]:g} deg, {sequence}",
        ["sensor", "error in", *(f"|error| at flexion {f:g} [deg]" for f in (low, middle, high)), "largest |error| [deg]"],
        rows,
        "How to read: the start pose is right, the error comes later. A yaw of one sensor is what a drifting heading does.",
    )


def _theory_figure(
    magnitudes: np.ndarray, flexion_deg: np.ndarray, misalignment_deg: np.ndarray, sequence: str
) -> ResultFigure:
    curves = []
    for flexion, magnitude in zip(flexion_deg, magnitudes, strict=True):
        if not np.isfinite(magnitude).all():
            continue
        curves.append(ResultCurve(f"{flexion:g} deg", misalignment_deg, magnitude, "simulation"))
        if flexion in (60, 70):
            fit = fit_quadratic(misalignment_deg, magnitude)
            curves.append(ResultCurve(f"{flexion:g} deg, parabola", misalignment_deg, fit.at(misalignment_deg), "fit"))
    return ResultFigure(
        f"|error| of the {sequence} flexion over the misalignment about X", "misalignment [deg]", "|error| [deg]", curves
    )
