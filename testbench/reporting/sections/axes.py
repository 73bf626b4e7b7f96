"""The section of the report on the axes of each sensor: which is which, and the limit tests of its
Euler angles.
"""

from __future__ import annotations

from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import EulerRangeRow, Evaluation
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

TRIADS = {
    "gyr": "gyroscope",
    "acc": "accelerometer",
    "mag": "magnetometer",
    "device_q": "quaternion",
}


def axes_section(estimate: Estimate, evaluation: Evaluation | None) -> Section | None:
    """What the motion says of the axes; None where it says nothing."""
    if not any(sensor.axes for sensor in estimate.sensors.values()):
        return None
    section = Section("axes", "Axes")
    section.blocks.append(_findings(estimate))
    for name, sensor in estimate.sensors.items():
        unseen = {
            TRIADS[triad]: f.unseen
            for triad, f in sensor.axes.items()
            if f.unseen and f.axes is None
        }
        if unseen:
            told = "; ".join(
                f"{triad}: too little about {', '.join(axes)}" for triad, axes in unseen.items()
            )
            section.blocks.append(
                Sentence(f"{name}: the motion does not tell every axis ({told}).")
            )
    if evaluation is not None and evaluation.euler_ranges:
        section.blocks.append(_ranges(evaluation.euler_ranges))
    return section


def _findings(estimate: Estimate) -> Table:
    hands = {True: "right", False: "left", None: ""}
    rows = [
        Row(
            [
                label(name),
                text(TRIADS[triad]),
                text(finding.axes),
                text(hands[finding.right_handed]),
                significant(finding.gain, 4),
                number(finding.crooked_deg, 2),
                number(finding.agreement, 5),
                number(finding.field_dip_deg, 1),
            ]
        )
        for name, sensor in estimate.sensors.items()
        for triad, finding in sensor.axes.items()
    ]
    return Table(
        "Axes of each sensor, as the motion shows them",
        header(
            "sensor",
            "triad",
            "axes",
            "hand",
            "reading over truth",
            "crooked [deg]",
            "agreement",
            "dip [deg]",
            numbers_from=4,
        ),
        rows,
        "How to read: which axis of the recording is each axis of the sensor as mounted; x: +x, y: "
        "+y, z: +z is as it should be, another map is what `testbench import --axes` takes. "
        "Reading over truth is 1 for right units; crooked is the rotation left between the map and "
        "the mounting; agreement is the part of the variance that the motion explains. The dip is "
        "how far the field points below the horizon if the magnetometer's map holds; the same map "
        "with all signs reversed fits as well, and reverses the dip.",
    )


def _ranges(rows: list[EulerRangeRow]) -> Table:
    def pair(true: float | None, estimated: float | None) -> Cell:
        return Cell(
            f"{digits(true, 1)} / {digits(estimated, 1)}" if true is not None else "–",
            kind="number",
        )

    body = [
        Row(
            [
                label(row.section),
                text(row.sensor),
                text(row.filter),
                text(row.sequence),
                *(pair(t, e) for t, e in zip(row.true_deg, row.estimated_deg, strict=True)),
                pair(row.outer_true_deg, row.outer_estimated_deg),
                number(row.locked_percent, 0),
            ]
        )
        for row in rows
    ]
    return Table(
        "Limit tests: range of each Euler angle over a section, true / estimated [deg]",
        header(
            "section",
            "sensor",
            "filter",
            "sequence",
            "first",
            "second",
            "third",
            "outer together",
            "locked [%]",
            numbers_from=4,
        ),
        body,
        "How to read: an angle that should stay has a true range near 0; what the estimate shows "
        "beyond it leaked in. Within 10 deg of gimbal lock the outer two angles are not defined "
        "apart, by any sensor; there their sum or difference, the one that is defined, stands "
        "under outer together.",
    )
