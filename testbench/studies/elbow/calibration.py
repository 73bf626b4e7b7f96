"""Accelerometers calibrated as Castellanos Alonso 2023 does and as we do, beside tables 5.4 and 5.5
and annex G.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.axis_model import orthogonality
from testbench.estimation.calibration.methods import get_method
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.prepared import Prepared, prepare
from testbench.estimation.calibration.recording import CalibrationRecording
from testbench.estimation.calibration.rotational import likeness
from testbench.estimation.calibration.validation import validate
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.study import Settings, StudyRow, StudyTable, Value
from testbench.records.session.session import Session
from testbench.records.specs.published import PublishedResults, PublishedTables

MILLI_G = 1e3 / STANDARD_GRAVITY
AXES = "xyz"
SECTIONS = {"2D": ("calibration_2d", "arm"), "3D": ("calibration_3d", "forearm")}
"""Poses that each kind of calibration is made from, and the segment whose sensor it is (tables 3.3
and 3.4 of the source).
"""
METHODS = {"2D": ("rotational_2d", "rotational_2d_bias"), "3D": ("rotational_3d", "attitude_aided")}
"""The published method, and ours."""
KINDS = {"Xsens DOT": "", "MATRIX": "_matrix"}
"""What the names of the sensors end in."""
ONE_POSE, HELD_OUT = "in the pose with the main axis up", "mean over eight held-out poses"
CALIBRATION_WHY = (
    "The source's bias is |(0, 0, 1000) mg - measured|, of one pose with the main axis up, which "
    "the map was fitted to. A mean of signed errors over poses with the axis up and down, as in "
    "our other rows, takes out what one pose shows. The map R = A' pinv(B') has no bias, so that a "
    "bias is smeared over the map and comes back in other poses; with a bias in the model there is "
    "nothing to smear. In 2D the third axis is left as it is: no pose of the plane says anything "
    "of it."
)


@dataclass(frozen=True)
class Calibrated:
    """One sensor, calibrated by one method from one section.

    Attributes:
        dimension: "2D" or "3D".
        kind: Of the sensor.
        method: Its name.
        settings: Whose method it is.
        found: The correction.
        poses: That it was fitted to.
        fitted: The recording they are of.
        held: Poses that it was not fitted to.
    """

    dimension: str
    kind: str
    method: str
    settings: Settings
    found: TriadCalibration
    poses: StaticPoses
    fitted: Prepared
    held: Prepared

    @property
    def label(self) -> str:
        """For rows."""
        return f"{self.dimension}, {self.kind}, {self.method}"


def calibrated(session: Session, check: Session) -> list[Calibrated]:
    """Both kinds of sensors and of calibrations, by the published method and by ours.

    Args:
        session: Of elbow_tables, whose calibration sections are fitted.
        check: Of calibration_check: the same parts in poses that are not fitted.

    Raises:
        PoorExcitation: A section does not determine the parameters of a method.
    """
    found = []
    for dimension, (section, segment) in SECTIONS.items():
        for kind, suffix in KINDS.items():
            sensor = segment + suffix
            fitted = prepare(CalibrationRecording.of(session, sensor), None)
            poses = section_poses(session, fitted, section)
            held = prepare(CalibrationRecording.of(check, sensor), None)
            for method, settings in zip(METHODS[dimension], _WHOSE, strict=True):
                made = get_method(method).function(poses)
                found.append(
                    Calibrated(dimension, kind, method, settings, made, poses, fitted, held)
                )
    return found


_WHOSE: tuple[Settings, Settings] = ("published", "ours")


def calibration_table(found: list[Calibrated], published: PublishedResults) -> StudyTable:
    """Tables 5.4 and 5.5 by the source's definition, and beside it the same over held-out poses."""
    rows = []
    for each in found:
        theirs = next(
            r
            for r in published.calibration_bias
            if r.sensor == each.kind and r.method.startswith(each.dimension)
        )
        printed = (*theirs.bias_mg, *theirs.sd_mg, max(theirs.bias_mg))
        beside = printed if each.settings == "published" else ()
        one = one_pose(each)
        rows.append(StudyRow(f"{each.label}, {ONE_POSE}", one, beside, settings=each.settings))
        rows.append(
            StudyRow(f"{each.label}, {HELD_OUT}", in_held_out(each), settings=each.settings)
        )
    return StudyTable(
        "calibration",
        "Accelerometers after calibration: |bias| and standard deviation",
        (*(f"|bias| {a} [mg]" for a in AXES), *(f"sd {a} [mg]" for a in AXES), "worst |bias| [mg]"),
        tuple(rows),
        "How to read: fitted to the three poses (2D) or six (3D) of the protocol. The worst is "
        "that of all axes; of our 2D method in held-out poses that of the two axes of the plane. "
        "The standard deviation is that of single readings.",
        CALIBRATION_WHY,
        "5.4 and 5.5",
        (2,) * 7,
        6,
        "Calibration",
    )


def one_pose(each: Calibrated) -> tuple[Value, ...]:
    """|bias| and sd by the source's definition: of the fitted pose whose main axis is up."""
    expected = each.poses.need_expected("one_pose")
    flat = expected / np.linalg.norm(expected, axis=1, keepdims=True)
    pose = int(flat.max(axis=1).argmax()) if each.dimension == "2D" else int(flat[:, 2].argmax())
    bias = np.abs(each.found.apply(each.poses.mean[pose : pose + 1])[0] - expected[pose]) * MILLI_G
    sd = each.fitted.calibration_poses(each.found).sd[1] * MILLI_G
    return (*map(float, bias), *map(float, sd), float(bias.max()))


def in_held_out(each: Calibrated) -> tuple[Value, ...]:
    """|mean error| and sd in poses that were not fitted, and the worst of the axes that count."""
    figures = validate(each.found, each.held.poses)
    bias = [abs(figures[f"bias_{axis}_mg"]) for axis in AXES]
    sd = each.held.calibration_poses(each.found).sd[1] * MILLI_G
    normal = None
    if each.dimension == "2D" and each.settings == "ours":
        expected = each.held.poses.need_expected("validation")
        normal = int(np.abs(expected).max(axis=0).argmin())
    counted = [value for i, value in enumerate(bias) if i != normal]
    return (*bias, *map(float, sd), max(counted))


def spread_ratio(each: Calibrated) -> float:
    """Standard deviation of single readings after the calibration over that before it."""
    before, after = each.held.calibration_poses(each.found).sd
    return float(np.mean(after) / np.mean(before))


def matrix_table(found: list[Calibrated], published: PublishedTables) -> StudyTable:
    """The maps themselves, beside what is known of matrices (5.7) to (5.10).

    Args:
        found: All calibrations of one part.
        published: Has what the printed maps come to.
    """
    rows = []
    for each in found:
        if each.settings != "published":
            continue
        near = likeness(each.found.matrix)
        rows.append(
            StudyRow(
                each.label,
                (
                    *map(float, each.found.matrix.ravel()),
                    near.determinant,
                    near.distance,
                    near.orthogonality,
                ),
                settings=each.settings,
            )
        )
    elements = [f"R {a}{b}" for a in AXES for b in AXES]
    none = (None,) * len(elements)
    for row in published.tables["maps"].rows:
        rows.append(
            StudyRow(f"map {row.label}", (*none, None, None, None), (*none, *row.values, None))
        )
    return StudyTable(
        "matrices",
        "The maps R = A' pinv(B') of the calibrations above",
        (*elements, "determinant", "distance from a rotation", "largest of R'R - 1"),
        tuple(rows),
        "How to read: row by row; the distance is the Frobenius norm of what is left beside the "
        "nearest rotation. In 2D the third axis is left as it is.",
        "The elements of the source's four maps are those of other parts, mounted otherwise; what "
        "can be compared is how far each is from a rotation.",
        decimals=(4,) * 9 + (4, 4, 4),
        short="Maps",
    )


def section_poses(session: Session, prepared: Prepared, section: str) -> StaticPoses:
    """Those poses of a session that were held in one section."""
    steps = [step for step in session.steps if step.section.split("/")[0] == section]
    begin, end = (
        min(step.start_ns for step in steps) / NANOSECONDS,
        max(step.end_ns for step in steps) / NANOSECONDS,
    )
    poses = prepared.poses
    assert poses.start is not None
    assert poses.end is not None
    middle = (poses.start + poses.end) / 2
    return poses.subset((middle > begin) & (middle < end))


# One piece: a row of the table after another.
def example_table(published: PublishedTables) -> StudyTable:
    """The worked example of annex G: the map from its readings to its forces."""
    tables = published.tables
    B, forces = (
        np.array([row.values for row in tables[name].rows], dtype=float)
        for name in ("annex G readings", "annex G forces")
    )
    A = STANDARD_GRAVITY * forces
    poses = StaticPoses(B, np.full(B.shape, 1e-6), expected=A)
    R = get_method("rotational_3d").function(poses).matrix
    near = likeness(R)
    theirs, squared = tables["annex G"], tables["annex G squared"]

    def vector(label: str, values: np.ndarray, printed: tuple[Value, ...] = ()) -> StudyRow:
        return StudyRow(label, tuple(map(float, values)), printed)

    rows = [
        vector(f"row {axis}", values, tuple(theirs.row(axis).values))
        for axis, values in zip(AXES, R, strict=True)
    ]
    rows.append(
        StudyRow(
            "determinant", (near.determinant, None, None), tuple(theirs.row("determinant").values)
        )
    )
    rows.append(StudyRow("distance from the nearest rotation", (near.distance, None, None)))
    first = tuple(squared.row("R'R, row x").values)
    rows += [
        vector(f"R'R, row {axis}", values, first if axis == "x" else ())
        for axis, values in zip(AXES, R.T @ R, strict=True)
    ]
    inverse = np.linalg.inv(R)
    rows += [vector(f"inverse, row {a}", values) for a, values in zip(AXES, inverse, strict=True)]
    rows += [
        vector(f"error matrix R'R - 1, row {axis}", values)
        for axis, values in zip(AXES, R.T @ R - np.eye(3), strict=True)
    ]
    rows.append(
        StudyRow(
            "mean of the error matrix",
            (float((R.T @ R - np.eye(3)).mean()), None, None),
            tuple(squared.row("mean of the error matrix").values),
            other="of a matrix that is not defined in words",
        )
    )
    for method in ("rotational_3d", "rotational_3d_bias"):
        left = get_method(method).function(poses).apply(B) - A
        rows.append(
            vector(f"left by {method}, rms [mg]", np.sqrt(np.mean(left**2, axis=0)) * MILLI_G)
        )
    return StudyTable(
        "annex G",
        "The worked example of the source's annex G: R = A' pinv(B') of its six readings",
        tuple(AXES),
        tuple(rows),
        "How to read: the readings are the published ones, put through our method; the last rows "
        "are what is left of them.",
        "R, its determinant and R'R agree to the last digit printed. R is no rotation: it has "
        "taken in scale factors and a bias of 24 mg in z, and two of the six rows of A are equal.",
        "",
        (4, 4, 4),
        0,
        "Annex G",
    )


def orthogonality_table(session: Session, published: PublishedTables) -> StudyTable:
    """Axes by six turns of 60 deg: of one axis as the source states it, and of two as we do.

    Args:
        session: Of the protocol orthogonality.
        published: Has the source's vector.
    """
    (sensor,) = session.sensor_names
    poses = prepare(CalibrationRecording.of(session, sensor), None).poses
    found = orthogonality(poses)
    angle, sd = np.degrees(found.angle), np.degrees(found.angle_sd)
    rows = []
    for axis, fit in zip(found.axes, found.fits, strict=True):
        scaled = dict.fromkeys(AXES, 0.0) | dict(zip(found.axes, fit.values[:2], strict=True))
        s = float(np.hypot(*fit.values[:2]))
        u = [float(scaled[name]) / s for name in AXES]
        rows.append(StudyRow(f"axis {axis}", (s, *u, float(fit.values[2]), None, None)))
    rows.append(StudyRow(f"between {found.axes[0]} and {found.axes[1]}", _angle(angle, sd)))
    printed = (*published.tables["orthogonality"].row("dot").values, None, None)
    rows.append(StudyRow("published, of one axis", (None,) * 7, printed))
    return StudyTable(
        "orthogonality",
        "Scale, direction and offset of the axes by six turns of 60 deg",
        ("s", "u x", "u y", "u z", "o [m/s²]", "angle [deg]", "standard uncertainty [deg]"),
        tuple(rows),
        "How to read: each axis reads s (f · u) + o of the force f, |u| = 1, in the sensor's axes "
        "as believed; the third axis is level throughout and seen by none.",
        "The source's answer of a good sensor is a tautology: annex F sets the reading that is "
        "fitted from a column of the matrix that it is fitted by, which gives 0, 0, 1 and 0 of any "
        "sensor.",
        decimals=(5, 5, 5, 5, 4, 3, 3),
        short="Orthogonality",
    )


def _angle(angle: float, sd: float) -> tuple[Value, ...]:
    return (None, None, None, None, None, float(angle), float(sd))
