"""Figures of the study `reference-5`: those of the source that carry a result; first part."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.study import (
    BoxNumbers,
    CurveKind,
    StudyBoxes,
    StudyCurve,
    StudyCurves,
)
from testbench.studies.chain import words
from testbench.studies.chain.comparison import (
    AXES,
    FOURIER,
    KINEMATIC,
    First,
    Moved,
    Reference5,
)
from testbench.studies.chain.motions import PENDULUM, SQUAT, VARIED

SHOWN_S = 4.0
"""Of a motion over time, from the middle of what is judged on [s]."""
SHOWN_SAMPLES = 300
"""Of a curve, about."""
MEASURED: CurveKind = "measurement"
FITTED_TO: CurveKind = "fit"
NUMBERS = {PENDULUM.name: "4.3 to 4.6", SQUAT.name: "4.7 to 4.14", VARIED.name: "4.16 to 4.35"}
"""Figures of the source that ours stand for."""


def figures(found: Reference5) -> tuple[StudyCurves, ...]:
    """Readings and joint angles of each motion, and errors by the number of harmonics."""
    own = {PENDULUM.name: found.rigs, SQUAT.name: found.rigs, VARIED.name: found.walks}
    drawn = [
        curves
        for name, moved in own.items()
        for curves in (*signal_curves(moved[name]), *angle_curves(moved[name]))
    ]
    return (*drawn, harmonic_curves(found))


def boxes(found: Reference5) -> StudyBoxes:
    """Errors of the seven axes of the varying walk by both states, as figure 4.37."""
    first = found.walks[VARIED.name].first
    drawn = {}
    for state in (KINEMATIC, FOURIER):
        errors = first.errors[state]
        for (joint, axis), name in AXES.items():
            judged = np.degrees(errors[f"{name}_error_rad"][errors["judged"]])
            drawn[f"{state}, {joint} {axis}"] = BoxNumbers.of(judged[::5])
    return StudyBoxes(words.BOXES, "error of the angle [deg]", drawn, {}, words.BOXES_HOW)


def angle_curves(own: Moved) -> tuple[StudyCurves, ...]:
    """Angle of each joint of the source over time, by both states and by the arm."""
    first = own.first
    joints = list(AXES.values()) if own.motion.protocol == "gait" else own.joints
    return tuple(_angle(own, first, joint) for joint in joints)


def _angle(own: Moved, first: First, joint: str) -> StudyCurves:
    column = first.estimates[FOURIER].joints.index(joint)
    time = first.estimates[FOURIER].host_time_ns
    rows = _shown(time, first.errors[FOURIER]["judged"])
    seconds = (time[rows] - time[rows[0]]) / NANOSECONDS
    true = first.arm.q_measured[:, first.arm.joint_names.index(joint)]
    measured = np.degrees(np.interp(time[rows], first.arm.host_time_ns, true))
    curves = [StudyCurve("arm", seconds, measured, "truth")]
    for state in (KINEMATIC, FOURIER):
        angle = np.degrees(first.estimates[state].mean[rows, 0, column])
        curves.append(StudyCurve(state, seconds, angle, "measurement"))
    return StudyCurves(
        f"{joint}, {own.motion.name} (figures {NUMBERS[own.motion.name]})",
        "time [s]",
        "angle [deg]",
        tuple(curves),
        words.ANGLES_HOW,
    )


def signal_curves(own: Moved) -> tuple[StudyCurves, ...]:
    """Rate and force of each sensor over time: measured, and by the motion that the filter found.

    Of the three axes of each the one that changes most.
    """
    first, found = own.first, []
    section, estimate = first.section, first.estimates[FOURIER]
    time = estimate.host_time_ns
    rows = _shown(time, first.errors[FOURIER]["judged"])
    seconds = (time[rows] - time[rows[0]]) / NANOSECONDS
    predicted = np.array([section.chain.readings(*estimate.mean[row])[0] for row in rows])
    samples = section.samples
    for s, sensor in enumerate(section.chain.sensors):
        mine = samples.sensor == s
        at = time[rows] / NANOSECONDS
        for name, unit, begin in (("rate", "deg/s", 0), ("force", "m/s²", 3)):
            factor = float(np.degrees(1.0)) if begin == 0 else 1.0
            read = np.column_stack(
                [
                    np.interp(at, samples.time[mine], samples.reading[mine, begin + axis])
                    for axis in range(3)
                ]
            )
            axis = int(np.argmax(read.std(axis=0)))
            measured = factor * read[:, axis]
            computed = factor * predicted[:, s, begin + axis]
            found.append(
                StudyCurves(
                    f"{sensor}, {name} about {'xyz'[axis]}, {own.motion.name} "
                    f"(figures {NUMBERS[own.motion.name]})".replace("force about", "force along"),
                    "time [s]",
                    f"{name} [{unit}]",
                    (
                        StudyCurve("measured", seconds, measured, "truth"),
                        StudyCurve("by the Fourier state", seconds, computed, "measurement"),
                    ),
                    words.SIGNALS_HOW,
                )
            )
    return tuple(found)


def harmonic_curves(found: Reference5) -> StudyCurves:
    """Errors by the number of harmonics, as figures 3.2 to 3.4."""
    curves = []
    for name in found.walks:
        for label, kind, own in (
            ("by the filter", MEASURED, found.harmonics[name]),
            ("series alone", FITTED_TO, found.series[name]),
        ):
            x, y = np.array(list(own), float), np.array(list(own.values()))
            curves.append(StudyCurve(f"{name}, {label}", x, y, kind, name))
    return StudyCurves(
        "RMS over the seven axes by the number of harmonics (figures 3.2 to 3.4)",
        "harmonics",
        "RMS [deg]",
        tuple(curves),
        words.HARMONICS_HOW,
        logarithmic=True,
    )


def _shown(time_ns: np.ndarray, judged: np.ndarray) -> np.ndarray:
    """Rows of some seconds from the middle of what is judged on."""
    rows = np.flatnonzero(judged)
    middle = rows[len(rows) // 2]
    end = int(np.searchsorted(time_ns, time_ns[middle] + round(SHOWN_S * NANOSECONDS)))
    return np.arange(middle, max(end, middle + 2))[:: max((end - middle) // SHOWN_SAMPLES, 1)]
