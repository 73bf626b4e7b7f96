"""The section of the report on what was fitted: clocks, frames, calibration."""

from __future__ import annotations

import numpy as np

from testbench.clock import utc_day
from testbench.frames import STANDARD_GRAVITY
from testbench.records.results.estimate import Estimate
from testbench.reporting.page.page import Section, Sentence
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
)
from testbench.reporting.sections.tuning import parameter_table


def fit_section(estimate: Estimate) -> Section:
    """What was fitted before the errors were taken."""
    section = Section("fits", "Clocks, frames and calibration")
    section.blocks.append(
        _clocks(estimate)
        if _fitted_clock(estimate)
        else Sentence("No clock was fitted: device times are host times.")
    )
    frames = any(
        fit.method != "none"
        for sensor in estimate.sensors.values()
        for fit in sensor.frames.values()
    )
    section.blocks.append(
        _frames(estimate)
        if frames
        else Sentence("No frame was aligned: the earth frame of each filter counts as the world.")
    )
    calibrated = any(sensor.calibration.method != "none" for sensor in estimate.sensors.values())
    section.blocks.append(
        _calibration(estimate)
        if calibrated
        else Sentence("No calibration was fitted to this session's own poses.")
    )
    section.blocks += _stored(estimate)
    if estimate.filter_parameters:
        section.blocks.append(parameter_table(estimate))
    section.blocks += [
        Sentence(f"{name}: {key} was left out because {why}.")
        for name, s in estimate.sensors.items()
        for key, why in s.skipped.items()
    ]
    return section


def _stored(estimate: Estimate) -> list[Sentence]:
    """Which sensors a stored calibration corrected, with which, and what became of the samples of
    the others.
    """
    sentences = []
    for name, sensor in estimate.sensors.items():
        if (stored := sensor.stored_calibration) is not None:
            methods = ", ".join(
                f"{triad} by {method}" for triad, method in stored["methods"].items()
            )
            sentences.append(
                Sentence(
                    f"{name}: the raw samples were first corrected by the stored calibration of "
                    f"{utc_day(stored['calibrated_utc'])}, session {stored['session']} "
                    f"({methods}), from {stored.get('file') or 'memory'}."
                )
            )
    without = {
        name: sensor
        for name, sensor in estimate.sensors.items()
        if sensor.stored_calibration is None
    }
    fitted = [name for name, sensor in without.items() if sensor.calibration.method != "none"]
    raw = [name for name in without if name not in fitted]
    if fitted:
        sentences.append(
            Sentence(
                "Without a stored calibration, corrected by the one above alone: "
                f"{', '.join(fitted)}."
            )
        )
    if raw:
        sentences.append(
            Sentence(
                "Without any calibration, so that the samples went on as recorded: "
                f"{', '.join(raw)}."
            )
        )
    return sentences


def _fitted_clock(estimate: Estimate) -> bool:
    return any(sensor.clock.method != "none" for sensor in estimate.sensors.values())


def _clocks(estimate: Estimate) -> Table:
    rows = []
    for name, sensor in estimate.sensors.items():
        clock = sensor.clock
        rows.append(
            Row(
                [
                    label(name),
                    text(clock.method.replace("_", " ")),
                    number(1e3 * clock.offset_s, 3),
                    number(1e3 * clock.offset_sd_s, 3),
                    number(clock.drift_ppm, 2),
                    number(clock.drift_sd_ppm, 2),
                    significant(clock.residual_deg_s),
                    significant(clock.angle_error_deg),
                ]
            )
        )
    return Table(
        "Clock of each sensor against the host",
        header(
            "sensor",
            "method",
            "offset [ms]",
            "sd [ms]",
            "drift [ppm]",
            "sd [ppm]",
            "residual [deg/s]",
            "angle at peak rate [deg]",
            numbers_from=2,
        ),
        rows,
        "How to read: device time = host time · (1 + drift) + offset, sd is the standard "
        "uncertainty. The residual is the RMS difference of the angular-rate magnitudes after the "
        "fit; the last column is what the uncertainty of the time means at the fastest motion.",
    )


def _frames(estimate: Estimate) -> Table:
    rows = []
    for name, sensor in estimate.sensors.items():
        parts = [("", own) for own in sensor.frames.items()]
        parts += [(", apart", own) for kind in sensor.frames_apart for own in kind.items()]
        for where, (key, fit) in parts:
            rows.append(
                Row(
                    [
                        label(key),
                        text(name),
                        text(fit.method.replace("_", " ") + where),
                        number(fit.heading_deg, 2),
                    ]
                    + [number(value, 3) for value in fit.mounting_deg]
                )
            )
    return Table(
        "Frame alignment of each filter",
        header(
            "filter",
            "sensor",
            "method",
            "heading [deg]",
            "mounting x [deg]",
            "mounting y [deg]",
            "mounting z [deg]",
            numbers_from=3,
        ),
        rows,
        "How to read: heading of the filter's earth frame seen from the world, and the rotation "
        "vector that was left between the believed and the found mounting, in the sensor frame. "
        "Without a magnetometer the heading is where a filter happened to begin; with one, sensors "
        "agree in it as far as the magnetic field is the same where they are. Parts of a "
        "truth that do not fit the rest are aligned apart.",
    )


# One piece: the cells of a row stand beside the titles that they fall under.
def _calibration(estimate: Estimate) -> Table:
    rows = []
    for name, sensor in estimate.sensors.items():
        fit = sensor.calibration
        milli_g = 1e3 / STANDARD_GRAVITY
        bias = [
            f"{digits(milli_g * b, 2)} ± {digits(milli_g * s, 2)}"
            for b, s in zip(fit.acc_bias, fit.acc_bias_sd, strict=True)
        ]
        matrix = np.asarray(fit.acc_matrix, dtype=float)
        gyr = np.degrees(np.asarray(fit.gyr_bias, dtype=float))
        for i, axis in enumerate("xyz"):
            first = [
                label(name),
                text(fit.method.replace("_", " ")),
                number(fit.poses, 0),
                significant(1e3 * fit.residual_m_s2),
            ]
            lead = first if i == 0 else [label(""), Cell(""), Cell(""), Cell("")]
            rows.append(
                Row(
                    [
                        *lead,
                        text(axis),
                        Cell(bias[i], kind="number"),
                        *(number(v, 5) for v in matrix[i]),
                        number(gyr[i], 4),
                    ],
                    "" if i == 0 else "continued",
                )
            )
    return Table(
        "Calibration of each sensor",
        header(
            "sensor",
            "method",
            "poses",
            "residual [mm/s²]",
            "axis",
            "accelerometer bias [mg]",
            "matrix, x",
            "matrix, y",
            "matrix, z",
            "gyroscope bias [deg/s]",
            numbers_from=2,
        ),
        rows,
        "How to read: acceleration = matrix · (raw − bias); rate = raw − gyroscope bias − response "
        "to gravity, turned by the rotation nearest to the matrix; ± is the standard uncertainty. "
        "A perfect sensor has the unit matrix and no bias; the residual is the RMS over the static "
        "poses.",
    )
