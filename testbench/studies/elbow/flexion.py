"""Sensors at rest and the elbow's flexion, beside tables 5.1 and 5.6 to 5.10 of Castellanos Alonso
2023.
"""

from __future__ import annotations

import numpy as np

from testbench.frames import STANDARD_GRAVITY
from testbench.model.misalignment import middle_angle_error
from testbench.pipeline.analyse import Result
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import (
    Settings,
    StudyCurve,
    StudyCurves,
    StudyRow,
    StudyTable,
    Value,
)
from testbench.records.session.session import Session
from testbench.records.specs.published import FlexionErrors, PublishedResults, PublishedTables
from testbench.reporting.page.tables import mean_of_known
from testbench.studies.elbow.models import (
    GROWING,
    SLOW,
    apart,
    fit_model,
    heading_fits,
    tilted,
)

UNITS = {"acc": "mg", "gyr": "deg/s", "mag": "uT"}
TRIADS = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer"}
TITLES = {"dot": "Xsens DOT", "matrix": "MATRIX"}
JOINTS = {"Xsens DOT": "elbow", "MATRIX": "elbow_matrix"}
MODEL_POINTS = 281
"""Of the lines of models in the figure: every quarter of a degree."""
TUNED = "imufilter"
"""The filter that the protocols run with a setting of ours."""
WITHIN_A_POSE = (0.001, 0.17)
"""Standard deviations within a pose that the source prints with tables 5.6 to 5.10 [deg]."""
FLEXION_WHY = (
    "Theirs come from two sensors whose relative heading is unknown and changes with each "
    "power-up, and no reference pose aligns them; ours are aligned in one. Flexion by ZXZ and ZYZ "
    "is the angle between two axes of the segments, here an inclination that does not see the "
    "heading at all; by YXZ a heading error enters and grows with the flexion. Of MATLAB's "
    "imufilter the source names no setting: its rows run with the default variance of the linear "
    "acceleration, 0.0096 (m/s²)², the other ones with 1.0, which the protocol sets so that a move "
    "of the arm is not taken for an offset of the gyroscope. Our device is an error model of a "
    "vendor's filter and not the filter. Captions of the source contradict its text: figure 5.11 "
    "says ZXZ where table 5.7 says YXZ, table 5.9 says imufilter where its heading says another."
)


def noise_table(evaluation: Evaluation, published: PublishedTables) -> StudyTable:
    """Standard deviations at rest, axis by axis."""
    rows = []
    for sensor, title in TITLES.items():
        for triad, unit in UNITS.items():
            found = [
                row for row in evaluation.noise if (row.sensor, row.quantity) == (sensor, triad)
            ]
            if found:
                theirs = published.tables["5.1"].row(f"{sensor} {triad}")
                values: tuple[Value, ...] = (
                    unit,
                    *(row.sd for row in sorted(found, key=lambda row: row.axis)),
                )
                rows.append(
                    StudyRow(
                        f"{title}, {TRIADS[triad]}", values, (unit, *theirs.values), theirs.remark
                    )
                )
    return StudyTable(
        "noise",
        "Standard deviation over a minute at rest",
        ("unit", "x", "y", "z"),
        tuple(rows),
        "How to read: of the raw readings, slow changes of the bias included.",
        "The presets of the simulated sensors were made after the data sheets and these numbers: "
        "where they agree, the simulator does what its presets say, and no more is shown. The "
        "gyroscope of the MATRIX is an exception: 0.72 deg/s is of one part only.",
        "5.1",
        (0, 3, 3, 3),
        1,
        "At rest",
    )


def rest_table(session: Session, evaluation: Evaluation, published: PublishedTables) -> StudyTable:
    """Mean specific force at rest, and how wrong the axis is that stands upright (eqs 5.1 to
    5.3).
    """
    assert session.robot is not None  # the protocol ran on an arm
    gravity = float(np.linalg.norm(session.robot.gravity))
    rows = []
    for sensor, title in TITLES.items():
        found = sorted(
            (r for r in evaluation.noise if (r.sensor, r.quantity) == (sensor, "acc")),
            key=lambda row: row.axis,
        )
        mean = [row.mean * 1e-3 * STANDARD_GRAVITY for row in found]
        upright = max(abs(value) for value in mean)
        error = 100 * abs(upright / gravity - 1)
        rows.append(
            StudyRow(title, (*mean, error), tuple(published.tables["rest"].row(sensor).values))
        )
    return StudyTable(
        "rest",
        "Mean specific force at rest, uncalibrated",
        (*(f"{axis} [m/s²]" for axis in "xyz"), "error of the vertical axis [%]"),
        tuple(rows),
        f"How to read: the axis that stands upright beside local gravity, {gravity:.4f} m/s²; the "
        "published ones beside 9.81 m/s². Which axis that is differs with how a sensor lies.",
        "Other parts in other poses: each part has one bias, drawn here from the data sheet's "
        "range. 1 % of the upright axis is 10 mg; the published parts are at 20 and 38 mg.",
        "",
        (4, 4, 4, 2),
        3,
        "Mean at rest",
    )


def flexion_errors(
    evaluation: Evaluation,
    joint: str,
    name: str,
    sequence: str,
    misalignment_deg: float | None = None,
) -> dict[float, float]:
    """Mean |error| of the flexion [deg] in static poses, by commanded flexion [deg]."""
    return {
        float(row.flexion_deg): row.flexion_mean_abs_error_deg
        for row in evaluation.joint_angle
        if (row.joint, row.filter, row.sequence, row.misalignment_deg)
        == (joint, name, sequence, misalignment_deg)
        and row.kind != "sweep"
        and row.flexion_deg is not None
    }


def flexion_table(
    evaluation: Evaluation, untuned: Evaluation, published: PublishedResults
) -> StudyTable:
    """Tables 5.6 to 5.10: every filter and sequence for both kinds of sensors.

    Args:
        evaluation: Of elbow_tables as its protocol says.
        untuned: Of the same session, imufilter with MATLAB's defaults.
        published: The tables that ours stand beside.
    """
    flexions = published.flexion_deg
    rows = []
    for title, joint in JOINTS.items():
        for name, sequence, settings, source in _runs(evaluation, untuned, joint):
            errors = flexion_errors(source, joint, name, sequence)
            theirs = _published(published, title, name, sequence) if settings != "ours" else None
            values = [errors.get(f) for f in flexions]
            printed: tuple[Value, ...] = ()
            note = ""
            if theirs is not None:
                printed = (*theirs.mean_abs_error_deg, _printed_mean(theirs))
                note = f"beside table {theirs.table}"
            rows.append(
                StudyRow(
                    f"{title}, {name}, {sequence}",
                    (*values, mean_of_known(values)),
                    printed,
                    note,
                    settings=settings,
                    other=OF_A_DEVICE if name == "device" and printed else "",
                )
            )
    return StudyTable(
        "flexion",
        "Mean |error| of the flexion [deg] by commanded flexion, without misalignment",
        (*(f"{f:g}°" for f in flexions), "mean"),
        tuple(rows),
        "How to read: a row of ours for each sensor, filter and sequence; the published row stands "
        "beneath the one it belongs to, its mean over the flexions computed here.",
        FLEXION_WHY,
        "5.6 to 5.10",
        (2,) * (len(flexions) + 1),
        len(flexions),
        "Tables 5.6 to 5.10",
    )


OF_A_DEVICE = "of the vendor's filter, ours is an error model of it"


def _runs(
    evaluation: Evaluation, untuned: Evaluation, joint: str
) -> list[tuple[str, str, Settings, Evaluation]]:
    """Filters and sequences of a joint; the tuned one twice, with either setting."""
    keys = dict.fromkeys(
        (row.filter, row.sequence) for row in evaluation.joint_angle if row.joint == joint
    )
    found: list[tuple[str, str, Settings, Evaluation]] = []
    for name, sequence in keys:
        if name == TUNED:
            found.append((name, sequence, "published", untuned))
            found.append((name, sequence, "ours", evaluation))
        else:
            found.append((name, sequence, "", evaluation))
    return found


def steadiness_table(evaluation: Evaluation, untuned: Evaluation) -> StudyTable:
    """How much the flexion moves within a pose: the row 10 sigma of tables 5.6 to 5.10."""
    rows = []
    for title, joint in JOINTS.items():
        for name, sequence, settings, source in _runs(evaluation, untuned, joint):
            sd = [
                row.flexion_sd_deg
                for row in source.joint_angle
                if (row.joint, row.filter, row.sequence) == (joint, name, sequence)
                and row.kind != "sweep"
                and row.flexion_deg is not None
            ]
            values = (float(np.mean(sd)), float(min(sd)), float(max(sd)))
            rows.append(StudyRow(f"{title}, {name}, {sequence}", values, settings=settings))
    rows.append(StudyRow("tables 5.6 to 5.10, all", (None, None, None), (None, *WITHIN_A_POSE)))
    return StudyTable(
        "steadiness",
        "Standard deviation of the flexion within a pose of 2 s",
        ("mean [deg]", "least [deg]", "largest [deg]"),
        tuple(rows),
        "How to read: over the fifteen poses. Of the published ones the range over all tables is "
        "shown.",
        decimals=(4, 4, 4),
        short="Within a pose",
    )


def _published(
    published: PublishedResults, title: str, name: str, sequence: str
) -> FlexionErrors | None:
    for row in published.flexion_mean_abs_error:
        if (row.sensor, row.sequence) == (title, sequence) and name in row.filters:
            return row
    return None


def _printed_mean(theirs: FlexionErrors) -> float | None:
    return mean_of_known(theirs.mean_abs_error_deg)


def flexion_curves(table: StudyTable, published: PublishedResults) -> StudyCurves:
    """Published and measured errors over the flexion, with the models of tables 5.6 and 5.7."""
    flexions = np.array(published.flexion_deg)
    fine = np.linspace(flexions[0], flexions[-1], MODEL_POINTS)
    offset, heading = heading_fits(published)[0].values
    tilt = fit_model(published, SLOW, tilted, (-0.05, 6.0)).values
    curves = [
        StudyCurve("model of table 5.7", fine, apart(fine, offset, heading), "theory", GROWING),
        StudyCurve("model of table 5.6", fine, tilted(fine, *tilt), "theory", SLOW),
    ]
    for row in published.flexion_mean_abs_error:
        label = f"{row.filters[0]}, {row.sequence}"
        theirs = np.array(row.mean_abs_error_deg, dtype=float)
        curves.append(
            StudyCurve(f"table {row.table}: {label}", flexions, theirs, "published", row.table)
        )
        for own in table.rows:
            if own.label == f"{row.sensor}, {label}":
                ours = np.array(own.values[:-1], dtype=float)
                title = f"ours: {own.title}"
                curves.append(StudyCurve(title, flexions, ours, "measurement", row.table))
    return StudyCurves(
        "Mean |error| of the flexion: published, ours, and models of tables 5.6 and 5.7",
        "flexion [deg]",
        "|error| [deg]",
        tuple(curves),
        "How to read: circles are published, other marks of the same colour ours by the same "
        "method; lines are models that were fitted. The axis is logarithmic and has no place for "
        "an error of zero.",
        logarithmic=True,
    )


def growth_table(elbow: Result, misalignment_deg: float) -> StudyTable:
    """Error over the flexion at one misalignment: theory, and each filter, by both sequences of
    elbow_flexion.
    """
    evaluation, joint = elbow.evaluation, "elbow"
    flexions = sorted(
        {float(row.flexion_deg) for row in evaluation.joint_angle if row.flexion_deg is not None}
    )
    theory = np.degrees(
        np.abs(
            middle_angle_error(
                np.radians(flexions), np.full(len(flexions), np.radians(misalignment_deg))
            )
        )
    )
    rows = []
    for sequence, expected in (("YXZ", theory), ("ZXZ", np.zeros(len(flexions)))):
        rows.append(StudyRow(f"{sequence}, theory", (*expected.tolist(), float(expected.mean()))))
        for name in dict.fromkeys(row.filter for row in evaluation.joint_angle):
            errors = flexion_errors(evaluation, joint, name, sequence, misalignment_deg)
            values = [errors.get(f) for f in flexions]
            rows.append(StudyRow(f"{sequence}, {name}", (*values, mean_of_known(values))))
    return StudyTable(
        "growth",
        f"Mean |error| of the flexion [deg], misaligned by {misalignment_deg:g} deg",
        (*(f"{f:g}°" for f in flexions), "mean"),
        tuple(rows),
        "How to read: YXZ takes the misalignment for flexion, the more the larger it is; ZXZ does "
        "not.",
        "",
        "",
        (2,) * (len(flexions) + 1),
        None,
        "Growth",
    )
