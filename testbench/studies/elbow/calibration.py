"""Accelerometers calibrated as Castellanos Alonso 2023 does and as we do, beside tables 5.4 and 5.5
and annex G.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.methods import get_method
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.prepared import Prepared, prepare
from testbench.estimation.calibration.recording import CalibrationRecording
from testbench.estimation.calibration.rotational import likeness
from testbench.estimation.calibration.validation import validate
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.study import StudyRow, StudyTable, Value
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
CALIBRATION_WHY = (
    "Of which poses theirs are the means is not known to us; ours are eight poses of another "
    "session, with nothing in them but the errors of the part and of the arm. The map R = A' "
    "pinv(B') has no bias, so that a bias is smeared over the map and comes back in other poses, "
    "which can make the published size; how large and in which axis is drawn with the part. With a "
    "bias in the model there is nothing to smear; what is left then is in the rows below theirs. "
    "In 2D the third axis is left as it is: no pose of the plane says anything of it."
)


def calibration_table(session: Session, check: Session, published: PublishedResults) -> StudyTable:
    """Both kinds of sensors and of calibrations, by the published method and by ours.

    Args:
        session: Of elbow_tables, whose calibration sections are fitted.
        check: Of calibration_check: the same parts in poses that are not fitted.
        published: The table that ours stand beside.

    Raises:
        PoorExcitation: A section does not determine the parameters of a method.
    """
    rows = []
    for dimension, (section, segment) in SECTIONS.items():
        for kind, suffix in KINDS.items():
            sensor = segment + suffix
            poses = section_poses(
                session, prepare(CalibrationRecording.of(session, sensor), None), section
            )
            held = prepare(CalibrationRecording.of(check, sensor), None)
            theirs = next(
                r
                for r in published.calibration_bias
                if r.sensor == kind and r.method.startswith(dimension)
            )
            for method in METHODS[dimension]:
                found = get_method(method).function(poses)
                beside = method == METHODS[dimension][0]
                rows.append(
                    StudyRow(
                        f"{dimension}, {kind}, {method}",
                        judge(found, held, dimension, beside),
                        (*theirs.bias_mg, *theirs.sd_mg, max(theirs.bias_mg)) if beside else (),
                    )
                )
    return StudyTable(
        "calibration",
        "Accelerometers after calibration: |bias| and standard deviation in poses that were not "
        "fitted",
        (*(f"|bias| {a} [mg]" for a in AXES), *(f"sd {a} [mg]" for a in AXES), "worst |bias| [mg]"),
        tuple(rows),
        "How to read: fitted to the three poses (2D) or six (3D) of the protocol, evaluated by "
        "eight others. The worst is that of all axes, of our 2D method that of the two axes of the "
        "plane. The standard deviation is that of single readings.",
        CALIBRATION_WHY,
        "5.4 and 5.5",
        (2,) * 7,
        6,
        "Calibration",
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


def judge(
    found: TriadCalibration, held: Prepared, dimension: str, whole: bool
) -> tuple[Value, ...]:
    """|bias| and sd of x, y, z [mg] in held-out poses, and the worst |bias|; `whole` counts the
    axis out of the plane too.
    """
    figures = validate(found, held.poses)
    bias = [abs(figures[f"bias_{axis}_mg"]) for axis in AXES]
    sd = held.calibration_poses(found).sd[1] * MILLI_G
    expected = held.poses.need_expected("validation")
    flat = dimension == "2D" and not whole
    normal = int(np.abs(expected).max(axis=0).argmin()) if flat else None
    return (*bias, *map(float, sd), max(value for i, value in enumerate(bias) if i != normal))


def example_table(published: PublishedTables) -> StudyTable:
    """The worked example of annex G: the map from its readings to its forces."""
    tables = published.tables
    B, forces = (
        np.array([row.values for row in tables[name].rows], dtype=float)
        for name in ("annex G readings", "annex G forces")
    )
    A = STANDARD_GRAVITY * forces
    poses = StaticPoses(B, np.full(B.shape, 1e-6), expected=A)
    mapped = get_method("rotational_3d").function(poses)
    near = likeness(mapped.matrix)
    theirs = tables["annex G"]
    rows = [
        StudyRow(f"row {axis}", tuple(map(float, values)), tuple(theirs.row(axis).values))
        for axis, values in zip(AXES, mapped.matrix, strict=True)
    ]
    rows.append(
        StudyRow(
            "determinant", (near.determinant, None, None), tuple(theirs.row("determinant").values)
        )
    )
    rows.append(StudyRow("distance from the nearest rotation", (near.distance, None, None)))
    for method in ("rotational_3d", "rotational_3d_bias"):
        left = get_method(method).function(poses).apply(B) - A
        rms = np.sqrt(np.mean(left**2, axis=0)) * MILLI_G
        rows.append(StudyRow(f"left by {method}, rms [mg]", tuple(map(float, rms))))
    return StudyTable(
        "annex G",
        "The worked example of the source's annex G: R = A' pinv(B') of its six readings",
        tuple(AXES),
        tuple(rows),
        "How to read: the readings are the published ones, put through our method; the last rows "
        "are what is left of them.",
        "They agree to the last digit printed. R is no rotation: it has taken in scale factors and "
        "a bias of 24 mg in z, and two of the six rows of A are equal.",
        "",
        (4, 4, 4),
        0,
        "Annex G",
    )
