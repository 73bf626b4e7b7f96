"""Signals that the source draws: accelerations at rest and in the poses of a calibration, and the
three angles over the whole series of misalignments.
"""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.pipeline.analyse import Result
from testbench.records.results.study import StudyCurve, StudyCurves
from testbench.records.session.plan import judged_steps
from testbench.studies.elbow.calibration import AXES, MILLI_G, Calibrated
from testbench.studies.elbow.evidence import ENDS_DEG, JOINT

MOST_POINTS = 1500
"""Of a curve; of more samples only some are drawn."""
NAMES = {"dot": "Xsens DOT", "matrix": "MATRIX"}
ANGLES = ("first", "second", "third")
SHOWN = ("device", "triad")
"""Filters whose angles are drawn: by quaternion difference, and by TRIAD."""


def rest_curves(rest: Result) -> tuple[StudyCurves, ...]:
    """Acceleration at rest with its mean, sensor by sensor: figures 5.1 to 5.4.

    Args:
        rest: Of static_noise.
    """
    figures = []
    step = judged_steps(rest.session.steps)[-1]
    for sensor, title in NAMES.items():
        samples = rest.session.imu(sensor)
        inside = (samples.host_time_ns > step.settled_ns) & (samples.host_time_ns < step.end_ns)
        time = (samples.host_time_ns[inside] - step.settled_ns) / NANOSECONDS
        force = samples.acc[inside]
        drawn = _some(len(time))
        curves = []
        for i, axis in enumerate(AXES):
            curves.append(StudyCurve(axis, time[drawn], force[drawn, i], "line", axis))
            mean = np.full(2, float(force[:, i].mean()))
            curves.append(StudyCurve(f"mean of {axis}", time[[0, -1]], mean, "fit", axis))
        figures.append(
            StudyCurves(
                f"Acceleration at rest, {title} (as figures 5.1 to 5.4)",
                "time [s]",
                "acceleration [m/s²]",
                tuple(curves),
                "How to read: single readings of the first part, dotted their mean.",
            )
        )
    return tuple(figures)


def calibration_curves(found: list[Calibrated]) -> tuple[StudyCurves, ...]:
    """Accelerations in the poses before and after the published map: figures 5.5 to 5.8.

    Args:
        found: Of the first part.
    """
    figures = []
    for each in found:
        if each.settings != "published":
            continue
        raw, expected = each.poses.mean * MILLI_G, each.poses.need_expected("curves") * MILLI_G
        after = each.found.apply(each.poses.mean) * MILLI_G
        pose = np.arange(1.0, len(raw) + 1)
        curves = []
        for i, axis in enumerate(AXES):
            curves += [
                StudyCurve(f"{axis}, raw", pose, raw[:, i] - expected[:, i], "measurement", axis),
                StudyCurve(
                    f"{axis}, calibrated", pose, after[:, i] - expected[:, i], "simulation", axis
                ),
            ]
        figures.append(
            StudyCurves(
                f"Acceleration less that of the pose, {each.label} (as figures 5.5 to 5.8)",
                "pose",
                "error [mg]",
                tuple(curves),
                "How to read: means of the poses that were fitted, filled marks raw and rings "
                "calibrated, of the first part.",
            )
        )
    return tuple(figures)


def angle_curves(elbow: Result) -> tuple[StudyCurves, ...]:
    """The three angles over all misalignments, and over the first, middle and last of them: figures
    5.9 to 5.18.

    Args:
        elbow: Of elbow_flexion.
    """
    estimate = elbow.estimate.joints[JOINT]
    steps = [
        step
        for step in judged_steps(elbow.session.steps)
        if step.variables.get("misalignment_deg") is not None
    ]
    whole = (steps[0].start_ns, steps[-1].end_ns)
    parts = {"all misalignments": whole}
    for d in (ENDS_DEG[0], 0.0, ENDS_DEG[1]):
        own = [step for step in steps if step.variables["misalignment_deg"] == d]
        parts[f"misaligned by {d:g} deg"] = (own[0].start_ns, own[-1].end_ns)
    figures = []
    for (name, sequence), angles in estimate.angles.items():
        if name not in SHOWN:
            continue
        for what, (begin, end) in parts.items():
            inside = np.flatnonzero((estimate.host_time_ns > begin) & (estimate.host_time_ns < end))
            rows = inside[_some(len(inside))]
            time = (estimate.host_time_ns[rows] - begin) / NANOSECONDS
            curves = tuple(
                StudyCurve(f"{word} angle", time, np.degrees(np.unwrap(angles[rows, i])), "line")
                for i, word in enumerate(ANGLES)
            )
            figures.append(
                StudyCurves(
                    f"Three angles by {name}, {sequence}, {what} (as figures 5.9 to 5.18)",
                    "time [s]",
                    "angle [deg]",
                    curves,
                    "How to read: fifteen flexions from 0 to 70 deg at each misalignment, of the "
                    "first part; the misalignment is a staircase in the angle that carries it.",
                )
            )
    return tuple(figures)


def _some(count: int) -> slice:
    """At most so many of a series, evenly."""
    return slice(None, None, max(-(-count // MOST_POINTS), 1))
