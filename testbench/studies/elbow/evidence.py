"""Runs that test what could be behind the published tables: a disturbed field, the order of a
product, the rate of sampling.
"""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.model.joint_angle import joint_angles
from testbench.model.true_segment import true_segment
from testbench.model.truth import truth_at
from testbench.pipeline.analyse import Result
from testbench.records.results.study import StudyReason, StudyRow, StudyTable, Value
from testbench.records.session.session import Session
from testbench.records.specs.joint_definition import FlexionAngle

FIELD, CARRIED, RATES = "field", "carried", "rates"
JOINT = "elbow"
DISTURBED_UT = {"as the preset": 0.5, "50 times as much": 25.0}
"""Standard deviation of the hard iron in elbow_tables and in elbow_disturbed [uT]."""
OF_FIELD = ("ecompass", "triad")
FIELD_SEQUENCES = ("ZXZ", "ZYZ", "YXZ")
FLEXED_DEG, ENDS_DEG = 40.0, (-20.0, 20.0)
"""Flexion at which a misalignment is looked for in the three angles, and the misalignments."""
ORDERS = {"proximal": "conj(q_A) q_F (eq. 2.5)", "world": "q_F conj(q_A) (annexed program)"}


def field_table(tables: Result, disturbed: Result) -> StudyTable:
    """The flexion in a field as assumed and in one that is disturbed 50 times more.

    Args:
        tables: Of elbow_tables.
        disturbed: Of elbow_disturbed, the same parts.
    """
    rows = []
    for (label, hard_iron), result in zip(DISTURBED_UT.items(), (tables, disturbed), strict=True):
        for name in OF_FIELD:
            heading = next(
                row.heading_rmse_deg
                for row in result.evaluation.orientation
                if (row.sensor, row.filter) == ("forearm", name)
            )
            errors = [
                float(
                    np.mean(
                        [
                            row.flexion_mean_abs_error_deg
                            for row in result.evaluation.joint_angle
                            if (row.joint, row.filter, row.sequence) == (JOINT, name, sequence)
                        ]
                    )
                )
                for sequence in FIELD_SEQUENCES
            ]
            rows.append(StudyRow(f"hard iron {label}, {name}", (hard_iron, heading, *errors)))
    return StudyTable(
        FIELD,
        "The flexion by the magnetic field, undisturbed and disturbed",
        (
            "hard iron, sd [uT]",
            "forearm's heading, RMS error [deg]",
            *(f"mean |error| of the flexion, {sequence} [deg]" for sequence in FIELD_SEQUENCES),
        ),
        tuple(rows),
        "How to read: the same parts, poses and filters; magnetometers with 50 times the hard iron "
        "in the lower rows. The field was not calibrated.",
        decimals=(1, 3, 3, 3, 3),
        short="A disturbed field",
    )


def field_reasons(table: StudyTable) -> tuple[StudyReason, ...]:
    """Whether a disturbed field makes the flexion of tables 5.8 and 5.9, by the table's rows."""
    calm, disturbed = table.rows[0].values, table.rows[len(OF_FIELD)].values
    before, after = (float(values[2] or 0.0) for values in (calm, disturbed))
    heading = float(disturbed[1] or 0.0)
    refuted = after < 2 * before + 0.1
    return (
        StudyReason(
            f"The jumps of tables 5.8 and 5.9 are those of a disturbed field: with 50 times the "
            f"hard iron the forearm's heading is off by {heading:.1f} deg RMS, and the flexion by "
            f"ZXZ by {after:.3f} deg, without by {before:.3f} deg.",
            "refuted" if refuted else "candidate",
            FIELD,
        ),
        StudyReason(
            "What made the jumps of up to 5.74 deg from pose to pose in tables 5.8 and 5.9.", "open"
        ),
    )


def carried_table(elbow: Result) -> StudyTable:
    """Which of the three angles a misalignment moves, by either order of the product.

    Args:
        elbow: Of elbow_flexion.
    """
    session = elbow.session
    steps = {
        float(step.variables["misalignment_deg"]): step
        for step in session.steps
        if step.variables.get("flexion_deg") == FLEXED_DEG and "misalignment_deg" in step.variables
    }
    ends = [steps[d] for d in ENDS_DEG]
    at = np.array([(step.settled_ns + step.end_ns) // 2 for step in ends])
    joint = session.analysis.joints[JOINT]
    level = np.array([(steps[0.0].settled_ns + steps[0.0].end_ns) // 2])
    lab = rotation.conjugate(_true(session, joint.proximal, level))
    rows = []
    for name in ("true motion", *sorted(elbow.estimate.sensors[joint.proximal].orientation)):
        pair = [
            _true(session, sensor, at) if name == "true motion" else _seen(elbow, sensor, name, at)
            for sensor in (joint.proximal, joint.distal)
        ]
        arm, forearm = (rotation.multiply(np.broadcast_to(lab, q.shape), q) for q in pair)
        for seen_from, order in ORDERS.items():
            definition = FlexionAngle.model_validate({"sequence": "ZXZ", "seen_from": seen_from})
            angles = np.degrees(joint_angles(arm, forearm, definition))
            moved = np.abs(np.degrees(rotation.wrap(np.radians(angles[1] - angles[0]))))
            rows.append(StudyRow(f"{name}, {order}", tuple(map(float, moved))))
    return StudyTable(
        CARRIED,
        f"By how much each angle of ZXZ moves when the arm turns from {ENDS_DEG[0]:g} to "
        f"{ENDS_DEG[1]:g} deg, at a flexion of {FLEXED_DEG:g} deg",
        ("first [deg]", "second [deg]", "third [deg]"),
        tuple(rows),
        "How to read: in axes that are the arm's without misalignment. An angle that moves by 40 "
        "deg carries the misalignment.",
        "The source finds it in the third angle by quaternion difference (5.3.1) and in the first "
        "by TRIAD (5.3.4).",
        decimals=(2, 2, 2),
        reasons=(
            StudyReason(
                "The tables by quaternion difference were made in the order of the annexed "
                "program: it puts the misalignment into the third angle, that of eq. 2.5 into the "
                "first.",
                "candidate",
                CARRIED,
            ),
        ),
        short="Which angle carries it",
    )


def _true(session: Session, sensor: str, at: np.ndarray) -> np.ndarray:
    """Of the segment, shape (n, 4)."""
    truth = session.truth(sensor)
    assert truth is not None
    return true_segment(session.analysis, sensor, truth_at(truth, at))


def _seen(result: Result, sensor: str, name: str, at: np.ndarray) -> np.ndarray:
    """Of the segment by a filter, shape (n, 4)."""
    own = result.estimate.sensors[sensor]
    q = rotation.interpolate(own.host_time_ns, own.orientation[name], at)
    return true_segment(result.session.analysis, sensor, q)


def rate_table(rates: Result) -> StudyTable:
    """Error over the frequency of the motion, by the sampling rate of one part.

    Args:
        rates: Of elbow_rates.
    """
    found = rates.evaluation.orientation_sweeps
    frequencies = sorted({float(row.variables["frequency_hz"]) for row in found})
    rows = []
    for name in dict.fromkeys(row.filter for row in found):
        for sensor in dict.fromkeys(row.sensor for row in found):
            by_frequency = {
                float(row.variables["frequency_hz"]): float(row.inclination_rmse_deg)
                for row in found
                if (row.filter, row.sensor) == (name, sensor)
            }
            values: tuple[Value, ...] = tuple(by_frequency.get(f) for f in frequencies)
            rows.append(StudyRow(f"{name}, {sensor.removeprefix('rate_')} Hz", values))
    return StudyTable(
        RATES,
        "RMS error of the inclination by sampling rate and by frequency of the motion",
        tuple(f"{frequency:g} Hz [deg]" for frequency in frequencies),
        tuple(rows),
        "How to read: MATRIX presets at four rates that are one part, so that the rate alone "
        "differs, and its noise; the forearm swings by 5 deg, the sensor 90 mm off its axis.",
        "The source names both curves as future work.",
        decimals=(3,) * len(frequencies),
        short="Sampling rate",
    )
