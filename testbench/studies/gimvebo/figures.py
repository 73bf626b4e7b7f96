"""Figures 4.2 to 4.11 of Botina & Vergara 2018, of one part or one recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.estimation.calibration.gyroscope import gravity_turns
from testbench.model.integrators import Stages
from testbench.records.results.study import BoxNumbers, StudyBoxes, StudyCurve, StudyCurves
from testbench.records.specs.published import PublishedTables
from testbench.studies.gimvebo.diagnosis import box_of
from testbench.studies.gimvebo.recording import NONE, Part, bias_of
from testbench.studies.gimvebo.tables import (
    INTEGRATORS,
    TITLES,
    Calibrated,
    angles,
    norms_of_turns,
)

AXES = "xyz"
SHOWN = 500
"""Samples of the figures of the magnitude, as in the source."""
BOX_HOW = (
    "How to read: boxes from the lower to the upper quartile with the median, whiskers to the "
    "farthest value within 1.5 interquartile ranges."
)


# One piece: four figures of one part, their captions most of it.
def curves(part: Part) -> tuple[StudyCurves, ...]:
    """Waveforms, magnitudes and norms over time: figures 4.2, 4.3, 4.4 and 4.7."""
    turn = part.held_out.turns[0]
    time = turn.interval * np.arange(len(turn.gyr))
    rest = np.concatenate(part.held_out_rests)[:SHOWN]
    at = np.arange(len(rest), dtype=float)
    acceleration = [StudyCurve(axis, at, rest[:, i], "line") for i, axis in enumerate(AXES)]
    rates = [
        StudyCurve(axis, time, np.degrees(turn.gyr[:, i]), "line") for i, axis in enumerate(AXES)
    ]
    magnitudes = [
        StudyCurve(label, at, np.linalg.norm(calibration.apply(rest), axis=1), "line")
        for label, calibration in (("raw", NONE), ("calibrated", part.accelerometer))
    ]
    magnitudes.append(StudyCurve("local gravity", at, np.full(len(at), part.gravity), "truth"))
    bias = bias_of(part).bias
    norms = []
    for name in INTEGRATORS:
        found = norms_of_turns(part, name, bias)[0]
        each = time[-1] / len(found)
        norms.append(
            StudyCurve(TITLES[name], each * np.arange(1, len(found) + 1), found - 1, "line")
        )
    return (
        StudyCurves(
            "Acceleration in the rests, raw (as figure 4.2)",
            "sample",
            "acceleration [m/s²]",
            tuple(acceleration),
            "How to read: rest after rest, without the moves between them.",
        ),
        StudyCurves(
            "Angular rate in the first turn, raw (as figure 4.3)",
            "time [s]",
            "angular rate [deg/s]",
            tuple(rates),
            "How to read: from rest to rest; what it reads at rest is its bias.",
        ),
        StudyCurves(
            "Magnitude of the acceleration before and after calibration (as figure 4.4)",
            "sample",
            "magnitude [m/s²]",
            tuple(magnitudes),
            "How to read: steps are from rest to rest, the rest is the sensor's noise, which no "
            "calibration takes away.",
        ),
        StudyCurves(
            "Norm of the quaternion over the first turn, less 1 (as figure 4.7)",
            "time [s]",
            "norm less 1",
            tuple(norms),
            "How to read: rates in rad/s, never scaled back. The implicit rule is below 1 while "
            "the sensor turns and comes back to it.",
        ),
    )


def boxes(
    part: Part, calibrated: Mapping[str, Calibrated], published: PublishedTables
) -> tuple[StudyBoxes, ...]:
    """Box plots: figures 4.5, 4.6 and 4.8 to 4.11."""
    rest = np.concatenate(part.held_out_rests)
    magnitude = {
        label: BoxNumbers.of(np.linalg.norm(calibration.apply(rest), axis=1))
        for label, calibration in (("raw", NONE), ("calibrated", part.accelerometer))
    }
    theirs = published.tables["4.1"]
    bias = bias_of(part).bias
    norms = {
        TITLES[name]: BoxNumbers.of(np.concatenate(norms_of_turns(part, name, bias)))
        for name in INTEGRATORS
    }
    return (
        StudyBoxes(
            "Magnitude of the acceleration (as figure 4.5)",
            "magnitude [m/s²]",
            magnitude,
            {f"{label}, published": box_of(theirs.row(label)) for label in magnitude},
            BOX_HOW,
        ),
        StudyBoxes(
            "Norm of the quaternion (as figure 4.6)",
            "norm",
            norms,
            {
                f"{TITLES[name]}, published": box_of(published.tables["4.2"].row(name))
                for name in INTEGRATORS
            },
            BOX_HOW,
        ),
        *(
            _configurations(part, name, calibrated[name], published, number)
            for name, number in zip(INTEGRATORS, ("4.8", "4.9", "4.10"), strict=True)
        ),
        _middles(part, published),
    )


def _configurations(
    part: Part, name: str, found: Calibrated, published: PublishedTables, figure: str
) -> StudyBoxes:
    """The angle with neither, one and both sensors calibrated."""
    ours = {
        "neither calibrated": angles(part, NONE, name, raw=True),
        "accelerometer calibrated": angles(part, NONE, name),
    }
    for label, calibration in found.named():
        ours[f"both calibrated, {label}"] = angles(part, calibration, name)
    beside = published.tables[INTEGRATORS[name]]
    keys = {"neither": "none", "accelerometer": "accelerometer", "both": "both"}
    return StudyBoxes(
        f"Angle after the turn by {TITLES[name]} (as figure {figure})",
        "angle [deg]",
        {label: BoxNumbers.of(values) for label, values in ours.items()},
        {f"{label}, published": box_of(beside.row(key)) for label, key in keys.items()},
        f"{BOX_HOW} The axis is logarithmic.",
        logarithmic=True,
    )


def _middles(part: Part, published: PublishedTables) -> StudyBoxes:
    """RK4 with a constant and a measured rate in the middle of the step."""
    ways: Sequence[Stages] = ("constant", "measured")
    ours = {
        f"rate {stages}": BoxNumbers.of(
            angles(
                part,
                gravity_turns(part.fit, "rk4", stages, g_sensitivity=part.knows_force),
                "rk4",
                stages=stages,
            )
        )
        for stages in ways
    }
    return StudyBoxes(
        "Angle after the turn by RK4, rate constant or measured (as figure 4.11)",
        "angle [deg]",
        ours,
        {
            f"rate {stages}, published": box_of(published.tables["4.6"].row(stages))
            for stages in ways
        },
        f"{BOX_HOW} The axis is logarithmic.",
        logarithmic=True,
    )
