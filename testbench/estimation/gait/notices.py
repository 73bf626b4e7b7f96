"""What is odd about a walk, as findings."""

from __future__ import annotations

import numpy as np

from testbench.estimation.gait.foot import FootWalk
from testbench.estimation.gait.readings import Readings
from testbench.estimation.gait.strides import USUAL
from testbench.estimation.gait.wearing import FOUND
from testbench.frames import STANDARD_GRAVITY
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.gait import SensorGait

LEAST_RATE_HZ = 100.0
"""Below it the impact of the heel falls into a sample or two [Hz]. Thinned out by means, straight
strides of two feet err by 16 and 14 mm RMS at 205 Hz, 20 and 26 at 102, 29 and 38 at 51.
"""
LEAST_REGRESSION_HZ = 25.0
"""A swing of half a second has a dozen samples."""
LATE_S = 3.0
"""The way begins with the first stand; what lies before is missed if it is longer."""
MOST_DOUBTFUL = 0.3
"""Of the strides of a walk no more have a hole or no stand [1]."""
MOST_SCALE = 0.02
"""Gravity of a standing foot is standard gravity to this part [1]."""

NO_NAME = "none of level, frontal and lateral"
"""A mounting that has no name."""


def notices_on_foot(own: SensorGait, readings: Readings, walked: FootWalk) -> list[Finding]:
    """On a walk by a sensor on the foot.

    Args:
        own: With its strides.
        readings: Of the sensor.
        walked: What was reckoned from them.
    """
    name, found = own.sensor, []
    if readings.derived:
        found.append(finding("gait.derived", name))
    if not len(readings.rests):
        found.append(finding("gait.no_rest", name))
    if own.floor == "level":
        found.append(finding("gait.level", name))
    late = float(readings.time[walked.first] - readings.time[0])
    if late > LATE_S:
        found.append(finding("gait.late", name, late_s=late))
    clipped = sum(_clipped(readings, walked, i) for i in range(len(walked.moves)))
    if clipped:
        found.append(finding("gait.clipped", name, strides=clipped, of=len(walked.moves)))
    set_down = sum(move.set_down for move in walked.moves)
    if set_down:
        found.append(finding("gait.set_down", name, times=set_down))
    found += _low_rate(name, readings, LEAST_RATE_HZ)
    force = np.concatenate(
        [readings.acc[begin:end] for begin, end in readings.rests] or [np.zeros((0, 3))]
    )
    if len(force):
        size = float(np.linalg.norm(np.nanmean(force, axis=0)))
        if abs(size / STANDARD_GRAVITY - 1) > MOST_SCALE:
            found.append(finding("gait.gravity", name, force_m_s2=size))
    if walked.track.refused.any():
        found.append(finding("gait.refused", name))
    return found + _left_out(own)


def notices_on_regression(own: SensorGait, readings: Readings, mounting: str) -> list[Finding]:
    """On a walk by the regression.

    Args:
        own: With its cycles.
        readings: Of the sensor.
        mounting: As asked for.
    """
    found = [finding("gait.regression", own.sensor, parameters=own.parameters)]
    if readings.derived:
        found.append(finding("gait.derived", own.sensor))
    if mounting == FOUND:
        worn = NO_NAME if own.mounting == FOUND else own.mounting
        found.append(finding("gait.mounting", own.sensor, mounting=worn))
    if not len(readings.rests):
        found.append(finding("gait.no_rest", own.sensor))
    return found + _low_rate(own.sensor, readings, LEAST_REGRESSION_HZ)


def _clipped(readings: Readings, walked: FootWalk, i: int) -> bool:
    move = walked.moves[i]
    return bool(readings.clipped[move.begin : move.end + 1].any())


def _low_rate(name: str, readings: Readings, least: float) -> list[Finding]:
    rate = 1 / readings.interval
    if rate >= least:
        return []
    return [finding("gait.rate_low", name, rate_hz=rate, least_hz=least)]


def _left_out(own: SensorGait) -> list[Finding]:
    """Strides that are in no mean, by why; turns and first steps are usual and only noted."""
    reasons = [stride.left_out for stride in own.strides if stride.left_out]
    doubtful = sum(why not in USUAL for why in reasons)
    found = []
    if doubtful > MOST_DOUBTFUL * len(own.strides):
        found.append(finding("gait.doubtful", own.sensor, count=doubtful, of=len(own.strides)))
    for why in dict.fromkeys(reasons):
        code = "gait.usual" if why in USUAL else "gait.left_out"
        found.append(finding(code, own.sensor, count=reasons.count(why), why=why))
    return found
