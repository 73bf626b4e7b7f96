"""Sensors at rest and the elbow's flexion, beside tables 5.1 and 5.6 to 5.10 of Castellanos Alonso
2023.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from testbench.frames import STANDARD_GRAVITY
from testbench.model.misalignment import middle_angle_error
from testbench.pipeline.analyse import Result
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import StudyCurve, StudyCurves, StudyRow, StudyTable, Value
from testbench.records.session.session import Session
from testbench.records.specs.published import FlexionErrors, PublishedResults, PublishedTables
from testbench.reporting.page.tables import mean_of_known

UNITS = {"acc": "mg", "gyr": "deg/s", "mag": "uT"}
TRIADS = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer"}
TITLES = {"dot": "Xsens DOT", "matrix": "MATRIX"}
JOINTS = {"Xsens DOT": "elbow", "MATRIX": "elbow_matrix"}
GROWING = "5.7"
"""The published table whose error grows with the flexion."""
MODEL_POINTS = 281
"""Of its line in the figure: every quarter of a degree."""
DIFFERENCES = {
    "5.6": "theirs grows with the flexion, to 0.46 deg; why is not known, for gravity holds this "
    "inclination at rest, whatever the gyroscope's scale. Our `device` is an error model of a "
    "vendor's filter and not the filter: it says nothing of theirs",
    "5.7": "theirs is consistent with a heading error between the sensors, see the next table; "
    "ours is aligned in the reference pose",
    "5.8": "theirs jumps by degrees from pose to pose, as a field would make it that is disturbed "
    "more than the one assumed of ours; this angle is an inclination and hardly sees a heading",
    "5.9": "as 5.8, for both methods see the same vectors",
    "5.10": "theirs may hold what was left of the bias after calibration: 10 to 26 mg are 0.6 to "
    "1.5 deg",
}
FLEXION_WHY = (
    "Theirs come from two sensors whose relative heading is unknown and changes with each "
    "power-up, and no reference pose aligns them; ours are aligned in one. Flexion by ZXZ and ZYZ "
    "is the angle between two axes of the segments, here an inclination that does not see the "
    "heading at all; by YXZ a heading error enters and grows with the flexion. What is left of "
    "ours is noise, the rest of the bias, the arm's repeatability, and by YXZ what a filter loses "
    "of the heading."
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
    """Mean specific force at rest, and how wrong its norm is."""
    assert session.robot is not None  # the protocol ran on an arm
    gravity = float(np.linalg.norm(session.robot.gravity))
    rows = []
    for sensor, title in TITLES.items():
        found = sorted(
            (r for r in evaluation.noise if (r.sensor, r.quantity) == (sensor, "acc")),
            key=lambda row: row.axis,
        )
        mean = [row.mean * 1e-3 * STANDARD_GRAVITY for row in found]
        error = 100 * abs(float(np.linalg.norm(mean)) / gravity - 1)
        rows.append(
            StudyRow(title, (*mean, error), tuple(published.tables["rest"].row(sensor).values))
        )
    return StudyTable(
        "rest",
        "Mean specific force at rest, uncalibrated",
        (*(f"{axis} [m/s²]" for axis in "xyz"), "error of the norm [%]"),
        tuple(rows),
        f"How to read: the norm beside local gravity, {gravity:.4f} m/s².",
        "Other parts in other poses: one part has one bias, drawn here from the data sheet's range "
        "by the seed. Along the vertical axis 1 % is a bias of 10 mg; the published parts are at "
        "20 and 38 mg.",
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


def flexion_table(evaluation: Evaluation, published: PublishedResults) -> StudyTable:
    """Tables 5.6 to 5.10: every filter and sequence for both kinds of sensors."""
    flexions = published.flexion_deg
    rows = []
    for title, joint in JOINTS.items():
        keys = dict.fromkeys(
            (row.filter, row.sequence) for row in evaluation.joint_angle if row.joint == joint
        )
        for name, sequence in sorted(keys, key=lambda key: list(keys).index(key)):
            errors = flexion_errors(evaluation, joint, name, sequence)
            theirs = _published(published, title, name, sequence)
            values = [errors.get(f) for f in flexions]
            printed: tuple[Value, ...] = ()
            note = ""
            if theirs is not None:
                printed = (*theirs.mean_abs_error_deg, _printed_mean(theirs))
                note = f"beside table {theirs.table}"
            rows.append(
                StudyRow(
                    f"{title}, {name}, {sequence}", (*values, mean_of_known(values)), printed, note
                )
            )
    return StudyTable(
        "flexion",
        "Mean |error| of the flexion [deg] by commanded flexion, without misalignment",
        (*(f"{f:g}°" for f in flexions), "mean"),
        tuple(rows),
        "How to read: a row of ours for each sensor, filter and sequence; the published row stands "
        "beneath the one it belongs to, its mean over the flexions computed here.",
        f"{FLEXION_WHY} One by one: "
        f"{'; '.join(f'table {number}: {text}' for number, text in DIFFERENCES.items())}.",
        "5.6 to 5.10",
        (2,) * (len(flexions) + 1),
        len(flexions),
        "Tables 5.6 to 5.10",
    )


def _published(
    published: PublishedResults, title: str, name: str, sequence: str
) -> FlexionErrors | None:
    for row in published.flexion_mean_abs_error:
        if (row.sensor, row.sequence) == (title, sequence) and name in row.filters:
            return row
    return None


def _printed_mean(row: FlexionErrors) -> float:
    """Mean over the flexions, with the two decimals of the source."""
    return round(mean_of_known(row.mean_abs_error_deg) or 0.0, 2)


def heading_model(flexion_deg: np.ndarray, offset_deg: float, heading_deg: float) -> np.ndarray:
    """|error| of the middle angle of YXZ with an elbow that starts off zero and one turned sensor.

    The angle is asin(sin(f + o) cos h), as of a misalignment h (Castellanos Alonso 2023, section
    4), judged by f.

    Args:
        flexion_deg: f, shape (f,) [deg].
        offset_deg: o, where the elbow starts [deg].
        heading_deg: h, by which one sensor is turned about the vertical [deg].

    Returns:
        Shape (f,) [deg].
    """
    start = np.radians(flexion_deg + offset_deg)
    wrong = middle_angle_error(start, np.full(len(flexion_deg), np.radians(heading_deg)))
    return np.abs(np.degrees(wrong) + offset_deg)


@dataclass(frozen=True)
class HeadingFit:
    """The parameters of `heading_model` nearest to a published table, and what they leave of it.

    Attributes:
        offset_deg: Where the elbow starts [deg].
        heading_deg: Size of the angle between the sensors' headings [deg].
        residual_deg: Model less published by flexion, shape (f,) [deg].
        largest_at_deg: Flexion of the largest residual [deg].
    """

    offset_deg: float
    heading_deg: float
    residual_deg: np.ndarray
    largest_at_deg: float

    @property
    def rms_deg(self) -> float:
        """Of the residuals."""
        return float(np.sqrt(np.mean(self.residual_deg**2)))

    @property
    def largest_deg(self) -> float:
        """Magnitude of the largest residual."""
        return float(np.abs(self.residual_deg).max())


def heading_fit(published: PublishedResults) -> HeadingFit:
    """Offset and heading that come nearest to the growing table, by least squares."""
    theirs = np.array(_growing(published).mean_abs_error_deg, dtype=float)
    flexion = np.array(published.flexion_deg)
    found = least_squares(lambda x: heading_model(flexion, x[0], x[1]) - theirs, [theirs[0], 20.0])
    offset, heading = found.x
    return HeadingFit(
        float(offset), abs(float(heading)), found.fun, float(flexion[np.abs(found.fun).argmax()])
    )


def _growing(published: PublishedResults) -> FlexionErrors:
    return next(row for row in published.flexion_mean_abs_error if row.table == GROWING)


def heading_table(published: PublishedResults) -> StudyTable:
    """What an offset and a heading error make of the flexion by YXZ, beside the table that
    grows.
    """
    fit, theirs = heading_fit(published), _growing(published)
    flexions = published.flexion_deg
    model = heading_model(np.array(flexions), fit.offset_deg, fit.heading_deg).tolist()
    residual = fit.residual_deg.tolist()
    return StudyTable(
        "heading",
        "A model of table 5.7: an elbow that starts off zero, and two sensors apart in heading",
        (*(f"{f:g}°" for f in flexions), "mean"),
        (
            StudyRow(
                "model",
                (*model, mean_of_known(model)),
                (*theirs.mean_abs_error_deg, _printed_mean(theirs)),
            ),
            StudyRow("model less published", (*residual, mean_of_known(residual))),
        ),
        f"How to read: |asin(sin(f + o) cos h) - f| with o = {fit.offset_deg:.2f} deg and h = "
        f"{fit.heading_deg:.2f} deg, two parameters fitted to the fifteen published values; it "
        f"leaves {fit.rms_deg:.3f} deg RMS and {fit.largest_deg:.3f} deg at most, at a flexion of "
        f"{fit.largest_at_deg:g} deg.",
        "The minimum near 40 deg, where offset and growth cancel, and the growth beyond it are "
        "both in the model, and if it holds, neither is an error of the filter. That two fitted "
        "parameters come near to fifteen values shows that it can be so; the publication has "
        "nothing to test it with.",
        GROWING,
        (2,) * (len(flexions) + 1),
        len(flexions),
        "A model of table 5.7",
    )


def flexion_curves(evaluation: Evaluation, published: PublishedResults) -> StudyCurves:
    """Published and measured errors over the flexion, by YXZ and ZXZ, with the model of table 5.7
    as a line.
    """
    flexions, fit = np.array(published.flexion_deg), heading_fit(published)
    fine = np.linspace(flexions[0], flexions[-1], MODEL_POINTS)
    model = heading_model(fine, fit.offset_deg, fit.heading_deg)
    curves = [StudyCurve("model of table 5.7", fine, model, "theory", GROWING)]
    for row in published.flexion_mean_abs_error:
        label = f"table {row.table}: {row.filters[0]}, {row.sequence}"
        curves.append(
            StudyCurve(
                label,
                flexions,
                np.array(row.mean_abs_error_deg, dtype=float),
                "measurement",
                row.table,
            )
        )
        errors = flexion_errors(evaluation, JOINTS[row.sensor], row.filters[0], row.sequence)
        ours = np.array([errors.get(f, np.nan) for f in published.flexion_deg])
        curves.append(
            StudyCurve(
                f"ours: {row.sensor}, {row.filters[0]}, {row.sequence}",
                flexions,
                ours,
                "measurement",
                row.table,
            )
        )
    return StudyCurves(
        "Mean |error| of the flexion: published, ours, and a model of table 5.7",
        "flexion [deg]",
        "|error| [deg]",
        tuple(curves),
        "How to read: circles are published, diamonds of the same colour ours by the same method; "
        "the line is that of two sensors apart in heading. The axis is logarithmic and has no "
        "place for an error of zero.",
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
        "The published table 5.7 has no misalignment, and grows in the same way to 8.29 deg: a "
        "heading error between the two sensors would act as a misalignment does.",
        "",
        (2,) * (len(flexions) + 1),
        None,
        "Growth",
    )
