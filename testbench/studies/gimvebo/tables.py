"""Tables 4.1 to 4.7 of Botina & Vergara 2018, computed from a part on the gimbal."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from testbench.clock import Clock
from testbench.estimation.calibration.gyroscope import (
    gravity_direction_errors,
    gravity_turns,
    static_bias,
)
from testbench.frames import NANOSECONDS
from testbench.model.integrators import Stages, get_integrator
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.study import BoxNumbers, StudyRow, StudyTable, Value
from testbench.records.specs.published import PublishedRow, PublishedTables
from testbench.studies.gimvebo import words
from testbench.studies.gimvebo.recording import NONE, Part

BOX = ("Q1", "median", "Q3", "IQR", "lower whisker", "upper whisker", "outliers")
INTEGRATORS = {"rk4": "4.3", "cg4": "4.4", "trapezoid": "4.5"}
"""The integrators of the publication, and the tables of their angles."""
TITLES = {
    "rk4": "RK4",
    "cg4": "Crouch-Grossman 4",
    "trapezoid": "Tustin (trapezoid)",
    "euler": "Euler",
    "midpoint": "exponential midpoint",
}
RUNS = 5
MOST_OUTLIERS = 6


@dataclass(frozen=True)
class Calibrated:
    """The gyroscope of a part, calibrated with one integrator on the section `fit`: nine
    parameters, or g-sensitivity too.
    """

    nine: TriadCalibration
    with_g: TriadCalibration


def calibrate(part: Part, integrator: str) -> Calibrated:
    """Fit the gyroscope to the turns of the section `fit`."""
    return Calibrated(
        gravity_turns(part.fit, integrator), gravity_turns(part.fit, integrator, g_sensitivity=True)
    )


def angles(
    part: Part,
    calibration: TriadCalibration,
    integrator: str,
    raw: bool = False,
    stages: Stages | None = None,
) -> np.ndarray:
    """Angle between gravity by the accelerometer and by integration after each held-out turn.

    Args:
        part: Of the study.
        calibration: Of the gyroscope.
        integrator: Its name, as `get_integrator` takes it.
        raw: Gravity by the raw accelerometer.
        stages: Where the integrator gets the rates between samples; its best if None.

    Returns:
        Shape (10,) [deg].
    """
    turns = (part.held_out_raw if raw else part.held_out).turns
    return np.degrees(gravity_direction_errors(calibration, turns, integrator, stages))


def box_values(box: BoxNumbers, decimals: int = 2) -> tuple[Value, ...]:
    """A box plot as the cells of a row."""
    several = len(box.outliers) > MOST_OUTLIERS
    outliers = (
        f"{len(box.outliers)} values"
        if several
        else ", ".join(f"{value:.{decimals}f}" for value in box.outliers)
    )
    return box.q1, box.median, box.q3, box.iqr, box.lower, box.upper, outliers or None


def published_box(row: PublishedRow) -> tuple[Value, ...]:
    """A published box plot, q1, median, q3, iqr, min and max first, as the cells of a row."""
    outliers = ", ".join(f"{value:g}" for value in row.outliers)
    if row.outlier_count:
        outliers = f"{row.outlier_count} values"
    return (*row.values[:6], outliers or None)


def magnitude_table(part: Part, published: PublishedTables) -> StudyTable:
    """Table 4.1: the accelerometer."""
    rows = []
    for label, calibration in (("raw", NONE), ("calibrated", part.accelerometer)):
        single = np.concatenate(
            [np.linalg.norm(calibration.apply(rest), axis=1) for rest in part.held_out_rests]
        )
        means = np.array(
            [np.linalg.norm(calibration.apply(rest).mean(axis=0)) for rest in part.held_out_rests]
        )
        beside = published.tables["4.1"].row(label)
        for name, values in (
            (f"{label}, {len(single)} single samples", single),
            (f"{label}, means of the {len(means)} rests", means),
        ):
            theirs = (*published_box(beside), beside.values[6])
            error = float(np.mean((values - part.gravity) ** 2))
            rows.append(StudyRow(name, (*box_values(BoxNumbers.of(values), 4), error), theirs))
    noise = 1000 * float(np.mean([rest.std(axis=0, ddof=1).mean() for rest in part.held_out_rests]))
    return StudyTable(
        "4.1",
        "Magnitude of the acceleration at rest",
        (*(f"{title} [m/s²]" for title in BOX), "mean squared error [(m/s²)²]"),
        tuple(rows),
        f"{words.BOX_HOW} Local gravity is {part.gravity:g} m/s². Ours are held-out rests.",
        words.MAGNITUDE.format(noise=noise),
        "4.1",
        (4, 4, 4, 4, 4, 4, 0, 7),
        7,
    )


def norm_table(part: Part, published: PublishedTables, bias: np.ndarray) -> StudyTable:
    """Table 4.2: the norm of the quaternion, by correct integrators.

    Args:
        part: Of the study.
        published: Tables of the source.
        bias: Taken from the rates, shape (3,) [rad/s].
    """
    rows, worst = [], {}
    for name in ("rk4", "trapezoid", "cg4", "midpoint", "euler_raw"):
        integrator = get_integrator(name)
        stages, found = integrator.best_stages, []
        for turn in part.held_out.turns:
            rates = (turn.gyr - bias)[
                : len(turn.gyr) - (stages == "measured" and len(turn.gyr) % 2 == 0)
            ]
            found.append(
                np.linalg.norm(
                    integrator.integrate(rates, turn.interval, stages=stages)[1:], axis=1
                )
            )
        values = np.concatenate(found)
        worst[name] = float(np.abs(values - 1).max())
        theirs = (
            (*published_box(published.tables["4.2"].row(name))[:6], None)
            if name in INTEGRATORS
            else ()
        )
        label = "Euler, not scaled back" if name == "euler_raw" else TITLES[name]
        rows.append(
            StudyRow(label, (*box_values(BoxNumbers.of(values))[:6], f"{worst[name]:.1e}"), theirs)
        )
    return StudyTable(
        "4.2",
        "Norm of the quaternion after each step, never scaled back",
        (*BOX[:6], "largest deviation from 1"),
        tuple(rows),
        "How to read: rates in rad/s, all ten held-out turns; 1 means that the quaternion is still "
        "a rotation.",
        words.NORM.format(**worst),
        "4.2",
        (5, 5, 5, 5, 5, 5, 0),
        1,
    )


def angle_table(
    part: Part, published: PublishedTables, integrator: str, calibrated: Calibrated
) -> StudyTable:
    """Tables 4.3 to 4.5: gravity after the turn, with and without calibration."""
    number = INTEGRATORS[integrator]
    beside = published.tables[number]
    found = (
        (
            "accelerometer and gyroscope calibrated",
            angles(part, calibrated.nine, integrator),
            "both",
        ),
        ("accelerometer alone calibrated", angles(part, NONE, integrator), "accelerometer"),
        ("neither calibrated", angles(part, NONE, integrator, raw=True), "none"),
        (
            "both calibrated, gyroscope with g-sensitivity",
            angles(part, calibrated.with_g, integrator),
            "",
        ),
        (
            "accelerometer calibrated, bias alone of the gyroscope",
            angles(part, static_bias(part.fit), integrator),
            "",
        ),
    )
    rows = tuple(
        StudyRow(
            label,
            box_values(BoxNumbers.of(values), 3),
            published_box(beside.row(theirs)) if theirs else (),
        )
        for label, values, theirs in found
    )
    return StudyTable(
        number,
        f"Angle between gravity by the accelerometer and by {TITLES[integrator]}, after the turn",
        tuple(f"{title} [deg]" for title in BOX),
        rows,
        f"{words.BOX_HOW} Ten held-out turns of 4 s.",
        words.ANGLES[integrator],
        number,
        (3,) * 7,
        1,
    )


def others_table(part: Part, calibrated: Mapping[str, Calibrated]) -> StudyTable:
    """The same angle by integrators that the publication does not have."""
    rows = [
        StudyRow(
            f"{TITLES[name]}, {label}",
            box_values(BoxNumbers.of(angles(part, calibration, name)), 3),
        )
        for name, found in calibrated.items()
        if name not in INTEGRATORS
        for label, calibration in (
            ("nine parameters", found.nine),
            ("with g-sensitivity", found.with_g),
        )
    ]
    return StudyTable(
        "others",
        "The same angle by other integrators, everything calibrated",
        tuple(f"{title} [deg]" for title in BOX),
        tuple(rows),
        f"{words.BOX_HOW} Ten held-out turns of 4 s.",
        decimals=(3,) * 7,
    )


def stages_table(part: Part, published: PublishedTables) -> StudyTable:
    """Table 4.6: what the rate in the middle of a step is worth."""
    rows = []
    settings: Sequence[Stages] = ("constant", "measured", "interpolated")
    for stages in settings:
        found = gravity_turns(part.fit, "rk4", stages, g_sensitivity=True)
        box = BoxNumbers.of(angles(part, found, "rk4", stages=stages))
        theirs = (
            published_box(published.tables["4.6"].row(stages)) if stages != "interpolated" else ()
        )
        rows.append(StudyRow(f"rate {stages} over the step", box_values(box, 4), theirs))
    return StudyTable(
        "4.6",
        "RK4 with a constant and with a measured rate in the middle of the step, the same angle",
        tuple(f"{title} [deg]" for title in BOX),
        tuple(rows),
        f"{words.BOX_HOW} With g-sensitivity, whose error would hide the difference.",
        words.STAGES,
        "4.6",
        (4,) * 7,
        1,
    )


def time_table(part: Part, published: PublishedTables, clock: Clock) -> StudyTable:
    """Table 4.7: how long the whole calibration of the gyroscope takes."""
    measured = np.array(
        [[_timed(part, name, clock) for name in INTEGRATORS] for _ in range(RUNS)]
    ).reshape(RUNS, -1)
    theirs = np.array(
        [published.tables["4.7"].row(f"run {i + 1}").values for i in range(RUNS)], dtype=float
    )
    rows = [
        StudyRow(f"run {i + 1}", tuple(measured[i].tolist()), tuple(theirs[i].tolist()))
        for i in range(RUNS)
    ]
    rows.append(
        StudyRow("mean", tuple(measured.mean(axis=0).tolist()), tuple(theirs.mean(axis=0).tolist()))
    )
    return StudyTable(
        "4.7",
        "Run time of the whole calibration of the gyroscope",
        tuple(f"{TITLES[name]}, {kind} [s]" for name in INTEGRATORS for kind in ("elapsed", "CPU")),
        tuple(rows),
        words.TIME_HOW,
        words.TIME,
        "4.7",
        (4,) * 6,
        0,
    )


def _timed(part: Part, integrator: str, clock: Clock) -> tuple[float, float]:
    """Elapsed and processor time of one calibration [s]."""
    begin, processor = clock.monotonic_ns(), time.process_time()
    gravity_turns(part.fit, integrator)
    return (clock.monotonic_ns() - begin) / NANOSECONDS, time.process_time() - processor


def parts_table(parts: Sequence[Part]) -> StudyTable:
    """How much hangs on the part: the same for several sensors off the line."""
    rows = []
    for part in parts:
        values: list[Value] = []
        for name in ("rk4", "cg4"):
            found = calibrate(part, name)
            for calibration in (found.nine, found.with_g):
                errors = angles(part, calibration, name)
                values += [float(np.median(errors)), float(errors.max())]
        rows.append(StudyRow(part.session, tuple(values)))
    titles = tuple(
        f"{name}, {kind}, {figure} [deg]"
        for name in ("RK4", "CG4")
        for kind in ("nine parameters", "with g")
        for figure in ("median", "largest")
    )
    return StudyTable(
        "parts",
        "The same for other parts of the same kind",
        titles,
        tuple(rows),
        "How to read: each row is a session with a part of its own errors; angle after the ten "
        "held-out turns, everything calibrated. The first row is the part of the tables above.",
        decimals=(3,) * len(titles),
    )
