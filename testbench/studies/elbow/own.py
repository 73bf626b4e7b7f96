"""The study's method on a recording or protocol of the user's: what of it there is to ask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.prepared import prepare
from testbench.estimation.calibration.recording import CalibrationRecording
from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY
from testbench.pipeline.analyse import Result
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import StudyCurves, StudyRow, StudyTable, Value
from testbench.records.session.session import Session
from testbench.studies.elbow.distribution import (
    distribution_curves,
    distribution_table,
    pooled_errors,
)
from testbench.studies.elbow.misalignment_session import session_curves, session_table
from testbench.studies.parts import number_with, over_parts
from testbench.studies.result import StudyResult

UNITS = {"acc": "mg", "gyr": "deg/s", "mag": "uT"}
FEWEST_RESTS = 18
"""Nine parameters by every second rest, and as many to judge them."""
WANTED = (
    "a rest of 10 s, for the noise",
    f"{FEWEST_RESTS} rests of one accelerometer, for its calibration",
    "a joint whose true angle is known",
)


def own_study(results: Sequence[Result], source: str) -> StudyResult:
    """Noise, calibration, flexion and its errors of whatever was recorded.

    Args:
        results: The parts, or one recording.
        source: Whose method it is.
    """
    tables: list[StudyTable] = []
    curves: list[StudyCurves] = []
    findings: list[str] = []
    noise = [noise_of(result.evaluation) for result in results]
    if all(table is not None for table in noise):
        tables.append(over_parts([table for table in noise if table is not None]))
        longest = max(row.span_s for row in results[0].evaluation.noise)
        findings.append(f"The noise is that of a rest of {longest:.0f} s.")
    magnitudes = [magnitude_of(result.session) for result in results]
    if all(magnitudes):
        tables.append(over_parts([table for table in magnitudes if table is not None]))
        findings.append(_told(tables[-1]))
    for joint in dict.fromkeys(row.joint for row in results[0].evaluation.joint_angle):
        tables.append(over_parts([flexion_of_steps(r.evaluation, joint) for r in results]))
        errors = pooled_errors(results, joint)
        if errors:
            tables.append(_named(distribution_table(errors, joint), joint))
            curves += distribution_curves(errors, joint)
            findings += [
                f"{joint} by {name}: mean error {np.mean(values):.2f} deg, standard deviation "
                f"{np.std(values):.2f} deg."
                for name, values in errors.items()
            ]
        try:
            tables.append(session_table(results[0].session, results[0].evaluation, joint))
            curves += session_curves(results[0].session, results[0].evaluation, joint)
        except InputError:  # it varies no misalignment
            continue
    return StudyResult(source, tuple(findings), tuple(tables), tuple(curves))


def _named(table: StudyTable, joint: str) -> StudyTable:
    return replace(table, key=f"{table.key} {joint}")


def noise_of(evaluation: Evaluation) -> StudyTable | None:
    """Mean and standard deviation of every axis in the longest rest; None without one."""
    if not evaluation.noise:
        return None
    rows = []
    for sensor in dict.fromkeys(row.sensor for row in evaluation.noise):
        for quantity, unit in UNITS.items():
            found = sorted(
                (r for r in evaluation.noise if (r.sensor, r.quantity) == (sensor, quantity)),
                key=lambda row: row.axis,
            )
            if found:
                values: tuple[Value, ...] = (
                    unit,
                    *(row.mean for row in found),
                    *(row.sd for row in found),
                )
                rows.append(StudyRow(f"{sensor}, {quantity}", values))
    return StudyTable(
        "noise",
        "Mean and standard deviation in the longest rest",
        ("unit", *(f"mean {a}" for a in "xyz"), *(f"sd {a}" for a in "xyz")),
        tuple(rows),
        "How to read: of the raw readings, slow changes of the bias included.",
        decimals=(0, 3, 3, 3, 3, 3, 3),
        short="At rest",
    )


def magnitude_of(session: Session) -> StudyTable | None:
    """Magnitude of gravity before and after a calibration by the norm, in rests held out.

    None where no sensor rests often enough.
    """
    rows = []
    for sensor in session.sensor_names:
        try:
            ready = prepare(CalibrationRecording.of(session, sensor), None)
        except InputError:
            continue
        if len(ready.rests) < FEWEST_RESTS:
            continue
        even = np.arange(len(ready.rests)) % 2 == 0
        try:
            found = norm_only(ready.poses.subset(even))
        except InputError:
            continue
        held = ready.poses.subset(~even)
        gravity = float(np.linalg.norm(ready.gravity))
        for label, readings in (("raw", held.mean), ("calibrated", found.apply(held.mean))):
            off = (np.linalg.norm(readings, axis=1) - gravity) * 1e3 / STANDARD_GRAVITY
            rows.append(
                StudyRow(
                    f"{sensor}, {label}",
                    (
                        len(held),
                        float(np.abs(off).mean()),
                        float(np.sqrt(np.mean(off**2))),
                        float(np.abs(off).max()),
                    ),
                )
            )
    if not rows:
        return None
    return StudyTable(
        "calibration",
        "Magnitude of gravity in rests that were not fitted",
        ("rests", "mean |error| [mg]", "RMS [mg]", "largest [mg]"),
        tuple(rows),
        "How to read: nine parameters by the norm of gravity, fitted to every second rest and "
        "judged by the others; where an arm knows the poses, testbench calibrate judges each axis.",
        decimals=(0, 2, 2, 2),
        short="Calibration",
    )


def _told(table: StudyTable) -> str:
    before, after = (float(row.values[2] or 0.0) for row in table.rows[:2])
    return (
        f"The magnitude of gravity is off by {number_with([before])} mg RMS raw and by "
        f"{number_with([after])} mg calibrated, in rests that were not fitted."
    )


def flexion_of_steps(evaluation: Evaluation, joint: str) -> StudyTable:
    """Errors of a joint's flexion by filter and definition, step by step in the mean."""
    rows = []
    own = [row for row in evaluation.joint_angle if row.joint == joint]
    for name, sequence in dict.fromkeys((row.filter, row.sequence) for row in own):
        found = [row for row in own if (row.filter, row.sequence) == (name, sequence)]
        values = (
            len(found),
            float(np.mean([row.flexion_mean_abs_error_deg for row in found])),
            float(np.max([row.flexion_max_abs_error_deg for row in found])),
            float(np.mean([row.flexion_sd_deg for row in found])),
        )
        rows.append(StudyRow(f"{name}, {sequence}", values))
    return StudyTable(
        f"flexion {joint}",
        f"Flexion errors of {joint} by filter and definition",
        ("steps", "mean |error| [deg]", "largest |error| [deg]", "mean sd within a step [deg]"),
        tuple(rows),
        "How to read: over the steps that are evaluated, or the whole recording.",
        decimals=(0, 3, 3, 4),
        short=f"Flexion of {joint}",
    )
