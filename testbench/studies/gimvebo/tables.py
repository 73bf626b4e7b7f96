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
)
from testbench.estimation.calibration.turn_integration import TurnIntegration
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.integrators import Stages, get_integrator
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.study import BoxNumbers, StudyRow, StudyTable, Value
from testbench.records.specs.published import PublishedRow, PublishedTables
from testbench.studies.gimvebo import words
from testbench.studies.gimvebo.recording import NONE, Part, bias_of

BOX = ("Q1", "median", "Q3", "IQR", "lower whisker", "upper whisker", "outliers")
INTEGRATORS = {"rk4": "4.3", "cg4": "4.4", "tustin": "4.5"}
"""The integrators of the publication, and the tables of their angles."""
TITLES = {
    "rk4": "RK4",
    "cg4": "Crouch-Grossman 4",
    "tustin": "Tustin (implicit)",
    "trapezoid": "Heun (explicit trapezoid)",
    "euler": "Euler",
    "midpoint": "exponential midpoint",
}
RUNS = 5
MOST_OUTLIERS = 6
THINNED = (1, 2, 4)
"""One sample of so many, in the table of sampling intervals."""
OF_FITTED = "of turns that were fitted"
OTHER_MACHINE = "in MATLAB on a machine of 1.70 GHz"


@dataclass(frozen=True)
class Calibrated:
    """The gyroscope of a part, calibrated with one integrator on the turns that are not held out.

    Attributes:
        nine: Scales, misalignments and biases.
        with_g: The response to specific force too; None where no force was recorded in motion.
    """

    nine: TriadCalibration
    with_g: TriadCalibration | None

    def named(self) -> list[tuple[str, TriadCalibration]]:
        """Those that there are, with words for them."""
        both = (("nine parameters", self.nine), ("with g-sensitivity", self.with_g))
        return [(name, found) for name, found in both if found is not None]


def calibrate(part: Part, integrator: str) -> Calibrated:
    """Fit the gyroscope to the turns that are not held out."""
    stages = stages_of(part, integrator)
    return Calibrated(
        gravity_turns(part.fit, integrator, stages),
        gravity_turns(part.fit, integrator, stages, g_sensitivity=True)
        if part.knows_force
        else None,
    )


def stages_of(part: Part, integrator: str) -> Stages:
    """Where an integrator gets the rates inside a step: as asked, or its best where it cannot."""
    method = get_integrator(integrator)
    if part.stages is None or (
        part.stages == "measured" and any(node not in (0.0, 0.5, 1.0) for node in method.nodes)
    ):
        return method.best_stages
    return part.stages


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
        Shape (m,) [deg].
    """
    turns = (part.held_out_raw if raw else part.held_out).turns
    by = stages or stages_of(part, integrator)
    return np.degrees(gravity_direction_errors(calibration, turns, integrator, by))


def heading_errors(part: Part, calibration: TriadCalibration, integrator: str) -> np.ndarray:
    """By how much integration misses the heading after each held-out turn.

    Gravity says nothing of it: the true turn must be known.

    Args:
        part: With true turns.
        calibration: Of the gyroscope.
        integrator: Its name.

    Returns:
        Magnitude of the error about the vertical, shape (m,) [deg].
    """
    assert part.true_turns is not None
    turns = part.held_out.turns
    ends = TurnIntegration(turns, get_integrator(integrator), stages_of(part, integrator)).run(
        calibration.matrix, calibration.bias, calibration.g_matrix
    )
    missed = rotation.to_rotation_vector(
        rotation.multiply(rotation.conjugate(part.true_turns), ends.q_before_from_after)
    )
    up = np.array([turn.up_after for turn in turns], dtype=float)
    return np.asarray(np.degrees(np.abs(np.sum(missed * up, axis=1))))


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
            ours = (*box_values(BoxNumbers.of(values), 4), error)
            rows.append(StudyRow(name, ours, theirs, other=_other_samples(label, name)))
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


def _other_samples(label: str, name: str) -> str:
    """What the published magnitudes are of, where that is not what ours are."""
    if "means" in name:
        return "of 500 samples, single or not is not said"
    return "of 500 samples, of which the noise was taken" if label == "calibrated" else ""


def norms_of_turns(part: Part, integrator: str, bias: np.ndarray) -> list[np.ndarray]:
    """Norm of the quaternion after each step of each held-out turn, in rad/s.

    Args:
        part: Of the study.
        integrator: Its name.
        bias: Taken from the rates, shape (3,) [rad/s].
    """
    method, stages, found = get_integrator(integrator), stages_of(part, integrator), []
    for turn in part.held_out.turns:
        n = len(turn.gyr) - (stages == "measured" and len(turn.gyr) % 2 == 0)
        q = method.integrate((turn.gyr - bias)[:n], turn.interval, stages=stages)
        found.append(np.linalg.norm(q[1:], axis=1))
    return found


def norm_table(part: Part, published: PublishedTables, bias: np.ndarray) -> StudyTable:
    """Table 4.2: the norm of the quaternion, by correct integrators.

    Args:
        part: Of the study.
        published: Tables of the source.
        bias: Taken from the rates, shape (3,) [rad/s].
    """
    rows = []
    for name in ("rk4", "tustin", "cg4", "trapezoid", "midpoint", "euler_raw"):
        turns = norms_of_turns(part, name, bias)
        values = np.concatenate(turns)
        largest = float(np.abs(values - 1).max())
        ends = float(max(abs(turn[-1] - 1) for turn in turns))
        theirs = (
            (*published_box(published.tables["4.2"].row(name))[:6], None, None)
            if name in INTEGRATORS
            else ()
        )
        label = "Euler, not scaled back" if name == "euler_raw" else TITLES[name]
        row = (*box_values(BoxNumbers.of(values))[:6], largest, ends)
        rows.append(StudyRow(label, row, theirs))
    return StudyTable(
        "4.2",
        "Norm of the quaternion after each step, never scaled back",
        (*BOX[:6], "largest deviation from 1", "the same after the turn"),
        tuple(rows),
        "How to read: rates in rad/s, all held-out turns; 1 means that the quaternion is still "
        "a rotation.",
        words.NORM,
        "4.2",
        (5, 5, 5, 5, 5, 5, 15, 15),
        1,
    )


def angle_table(
    part: Part, published: PublishedTables, integrator: str, calibrated: Calibrated
) -> StudyTable:
    """Tables 4.3 to 4.5: gravity after the turn, with and without calibration."""
    number = INTEGRATORS[integrator]
    beside = published.tables[number]
    found: list[tuple[str, np.ndarray, str]] = [
        (
            "accelerometer and gyroscope calibrated",
            angles(part, calibrated.nine, integrator),
            "both",
        ),
        ("accelerometer alone calibrated", angles(part, NONE, integrator), "accelerometer"),
        ("neither calibrated", angles(part, NONE, integrator, raw=True), "none"),
    ]
    if calibrated.with_g is not None:
        with_g = angles(part, calibrated.with_g, integrator)
        found.append(("both calibrated, gyroscope with g-sensitivity", with_g, ""))
    by_bias = angles(part, bias_of(part), integrator)
    found.append(("accelerometer calibrated, bias alone of the gyroscope", by_bias, ""))
    rows = tuple(
        StudyRow(
            label,
            box_values(BoxNumbers.of(values), 3),
            published_box(beside.row(theirs)) if theirs else (),
            other=OF_FITTED if theirs else "",
        )
        for label, values, theirs in found
    )
    return StudyTable(
        number,
        f"Angle between gravity by the accelerometer and by {TITLES[integrator]}, after the turn",
        tuple(f"{title} [deg]" for title in BOX),
        rows,
        f"{words.BOX_HOW} {_turned(part)}",
        words.ANGLES,
        number,
        (3,) * 7,
    )


def _turned(part: Part) -> str:
    """How many turns judge, of what length."""
    turns = part.held_out.turns
    lasting = float(np.median([(len(turn.gyr) - 1) * turn.interval for turn in turns]))
    which = "turns that were fitted" if part.fitted else "held-out turns"
    return f"{len(turns)} {which}, of {lasting:.0f} s."


def others_table(part: Part, calibrated: Mapping[str, Calibrated]) -> StudyTable:
    """The same angle by integrators that the publication does not have."""
    rows = [
        StudyRow(
            f"{TITLES[name]}, {label}",
            box_values(BoxNumbers.of(angles(part, calibration, name)), 3),
        )
        for name, found in calibrated.items()
        if name not in INTEGRATORS
        for label, calibration in found.named()
    ]
    return StudyTable(
        "others",
        "The same angle by other integrators, everything calibrated",
        tuple(f"{title} [deg]" for title in BOX),
        tuple(rows),
        f"{words.BOX_HOW} {_turned(part)}",
        decimals=(3,) * 7,
    )


def heading_table(part: Part, calibrated: Mapping[str, Calibrated]) -> StudyTable:
    """What gravity cannot see: the heading after each turn, by the arm."""
    rows = []
    for name, found in calibrated.items():
        for label, calibration in found.named():
            values = BoxNumbers.of(heading_errors(part, calibration, name))
            rows.append(StudyRow(f"{TITLES[name]}, {label}", box_values(values, 3)))
    return StudyTable(
        "heading",
        "Error of the heading after the turn",
        tuple(f"{title} [deg]" for title in BOX),
        tuple(rows),
        f"{words.BOX_HOW} {_turned(part)} By the angles of the gimbal, which gravity is blind to; "
        "the axes are those of the calibrated accelerometer.",
        words.HEADING,
        decimals=(3,) * 7,
        short="Heading",
    )


def interval_table(part: Part) -> StudyTable:
    """The angle by longer sampling intervals, and by where the rates inside a step come from."""
    rows = []
    ways: Sequence[tuple[str, Stages]] = (
        ("rk4", "measured"),
        ("rk4", "interpolated"),
        ("rk4", "constant"),
        ("cg4", "interpolated"),
        ("tustin", "interpolated"),
        ("euler", "interpolated"),
    )
    for name, stages in ways:
        values = [_median_with_g(part.every(count), name, stages) for count in THINNED]
        rows.append(StudyRow(f"{TITLES[name]}, rate {stages}", tuple(values)))
    return StudyTable(
        "intervals",
        "Median of the angle by sampling interval",
        tuple(f"{1e3 * count * part.interval:.0f} ms [deg]" for count in THINNED),
        tuple(rows),
        "How to read: the same turns, of which only every second or fourth sample is taken; "
        "calibrated and evaluated with the integrator and the interval of the cell, g-sensitivity "
        "fitted where the force is known.",
        words.INTERVALS,
        decimals=(4,) * len(THINNED),
        short="Sampling interval",
    )


def _median_with_g(part: Part, integrator: str, stages: Stages) -> float | None:
    """Of the angle, calibrated and judged alike; None where the turns do not determine it."""
    try:
        found = gravity_turns(part.fit, integrator, stages, g_sensitivity=part.knows_force)
    except InputError:
        return None
    return float(np.median(angles(part, found, integrator, stages=stages)))


def stages_table(part: Part, published: PublishedTables) -> StudyTable:
    """Table 4.6: what the rate in the middle of a step is worth."""
    rows = []
    settings: Sequence[Stages] = ("constant", "measured", "interpolated")
    for stages in settings:
        found = gravity_turns(part.fit, "rk4", stages, g_sensitivity=part.knows_force)
        box = BoxNumbers.of(angles(part, found, "rk4", stages=stages))
        theirs = (
            published_box(published.tables["4.6"].row(stages)) if stages != "interpolated" else ()
        )
        other = OF_FITTED if theirs else ""
        label = f"rate {stages} over the step"
        rows.append(StudyRow(label, box_values(box, 4), theirs, other=other))
    return StudyTable(
        "4.6",
        "RK4 with a constant and with a measured rate in the middle of the step, the same angle",
        tuple(f"{title} [deg]" for title in BOX),
        tuple(rows),
        f"{words.BOX_HOW} With g-sensitivity, whose error would hide the difference, where the "
        "force is known.",
        words.STAGES,
        "4.6",
        (4,) * 7,
    )


def time_table(part: Part, published: PublishedTables, clock: Clock) -> StudyTable:
    """Table 4.7: how long the whole calibration of the gyroscope takes."""
    measured = np.array(
        [[_timed(part, name, clock) for name in INTEGRATORS] for _ in range(RUNS)]
    ).reshape(RUNS, -1)
    theirs = np.array(
        [published.tables["4.7"].row(f"run {i + 1}").values for i in range(RUNS)], dtype=float
    )
    named = [(f"run {i + 1}", measured[i], theirs[i]) for i in range(RUNS)]
    named.append(("mean", measured.mean(axis=0), theirs.mean(axis=0)))
    rows = [
        StudyRow(label, tuple(own.tolist()), tuple(other.tolist()), other=OTHER_MACHINE)
        for label, own, other in named
    ]
    return StudyTable(
        "4.7",
        "Run time of the whole calibration of the gyroscope",
        tuple(f"{TITLES[name]}, {kind} [s]" for name in INTEGRATORS for kind in ("elapsed", "CPU")),
        tuple(rows),
        words.TIME_HOW,
        words.TIME,
        "4.7",
        (4,) * 6,
    )


def _timed(part: Part, integrator: str, clock: Clock) -> tuple[float, float]:
    """Elapsed and processor time of one calibration [s]."""
    begin, processor = clock.monotonic_ns(), time.process_time()
    gravity_turns(part.fit, integrator)
    return (clock.monotonic_ns() - begin) / NANOSECONDS, time.process_time() - processor
