"""Whether a sensor's quantities agree with one another: what is seen is told by findings."""

from __future__ import annotations

import numpy as np

from testbench.consistency.excerpt import HIGHEST_RATE_HZ, Excerpt
from testbench.consistency.factors import DEG
from testbench.consistency.field import check_field
from testbench.consistency.fits import read_against
from testbench.consistency.gain import find_gain
from testbench.consistency.gravity import check_gravity
from testbench.consistency.gyroscope import KINDS, check_gyroscope, gain_of
from testbench.consistency.looked import UNKNOWN_UP, Looked, Up
from testbench.consistency.orientation import has_orientation
from testbench.consistency.still_intervals import find_rests
from testbench.consistency.times import read_at_other_times
from testbench.consistency.upright import check_up
from testbench.frames import NANOSECONDS
from testbench.records.findings.finding import Finding

LOWEST_RATE_HZ = 1.0
"""Below, a rate is asked about: turns cannot be followed at less."""
FEWEST, CLEARLY_MORE = 3.0, 0.05
"""Another unit of time must fit in so many windows that do not overlap, and explain so much more
than another unit of the gyroscope does.
"""
TIME_UNITS = {1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
CONTRADICTIONS = {
    "consistency.time_unit": {"time"},
    "consistency.rate": {"time"},
    "consistency.acc_unit": {"acc"},
    "consistency.acc_norm": {"acc"},
    "consistency.no_gravity": {"acc"},
    "consistency.gyr_unit": {"gyr"},
    "consistency.gyr_or_time_unit": {"gyr", "time"},
    "consistency.gyr_factor": {"gyr"},
    "consistency.scale_or_rate": {"gyr", "time"},
}
"""Findings on what cannot be right, and the quantities whose unit, if a person states it, confirms
it all the same.
"""


# Complex by the quantities that may be missing, each of which ends a check.
def check_excerpt(excerpt: Excerpt, up: Up = UNKNOWN_UP) -> list[Finding]:
    """What does not agree in an excerpt of a recording.

    Args:
        excerpt: Of it, in the units of a session.
        up: What is known of the vertical beside the samples.
    """
    looked = Looked(excerpt, excerpt.interval_ns * excerpt.samples / NANOSECONDS, [], [])
    has_acc = bool(np.isfinite(excerpt.acc).any())
    has_gyr = bool(np.isfinite(excerpt.gyr).any())
    if looked.seconds <= 0:
        return []
    if not has_acc and has_orientation(excerpt):
        looked.unchecked.append("orientation")
    if not (has_acc or has_gyr):
        return _with_unchecked(looked)
    if not check_time(looked):
        return looked.findings
    looked.rests = find_rests(excerpt, looked.seconds)
    if has_acc and has_gyr:
        looked.by_gravity = read_against(excerpt, excerpt.acc, looked.seconds, looked.rests.bias)
        if _tell_other_time(looked):
            return looked.findings
        if looked.by_gravity is not None:
            looked.gain = gain_of(looked, looked.by_gravity)
    if has_acc and not check_gravity(looked):
        return looked.findings
    if has_acc and has_gyr:
        check_gyroscope(looked)
    if excerpt.mag is not None and np.isfinite(excerpt.mag).any():
        check_field(looked, has_gyr)
    if has_acc:
        check_up(looked, up)
    return _with_unchecked(looked)


def _with_unchecked(looked: Looked) -> list[Finding]:
    if looked.unchecked:
        looked.tell("unchecked", what=looked.unchecked, in_short=_in_short(looked.unchecked))
    return looked.findings


def _in_short(unchecked: list[str]) -> str:
    """What is unchecked, each subject once: with its parts, unless these are all there are."""
    parts: dict[str, list[str]] = {}
    for text in dict.fromkeys(unchecked):
        subject, _, part = text.partition(": ")
        parts.setdefault(subject, []).append(part)
    return "; ".join(
        subject if not any(own) or set(own) >= set(KINDS) else f"{subject} ({', '.join(own)})"
        for subject, own in parts.items()
    )


def check_time(looked: Looked) -> bool:
    """Whether the rate can be one of a sensor; else what its time is, by the turns, is told."""
    rate = looked.excerpt.samples / looked.seconds
    if LOWEST_RATE_HZ <= rate <= HIGHEST_RATE_HZ:
        return True
    readings = read_at_other_times(looked.excerpt, looked.seconds)
    fitting = [factor for factor, one in readings.items() if one.turns and one.scale in (1.0, DEG)]
    if len(fitting) == 1:
        factor = fitting[0]
        looked.tell(
            "time_unit",
            rate_hz=rate,
            factor=factor,
            true_rate_hz=rate / factor,
            unit=TIME_UNITS.get(factor, "UNIT"),
        )
    else:
        looked.tell("rate", rate_hz=rate)
    return False


def _tell_other_time(looked: Looked) -> bool:
    """Tell of a unit of time in which gravity turns as the gyroscope says, where it does not in
    that which was taken, and whether there is one.
    """
    own = looked.by_gravity
    if own is not None and own.turns and (own.scale == 1.0 or own.explained > 1 - CLEARLY_MORE):
        return False
    readings = read_at_other_times(looked.excerpt, looked.seconds)
    fitting = {
        factor: one.explained
        for factor, one in readings.items()
        if one.turns
        and one.scale == 1.0
        and one.fits_as_is
        and one.scatter.independent >= FEWEST
        # a unit of time is wrong by a power of ten, and no other number near it
        and not ((gain := find_gain(one.pair, one.bias)) and gain.is_other)
    }
    if not fitting:
        return False
    factor = max(fitting, key=lambda one: fitting[one])
    if own is not None and own.turns and fitting[factor] < own.explained + CLEARLY_MORE:
        return False
    rate = looked.excerpt.samples / looked.seconds
    looked.tell("gyr_or_time_unit", factor=factor, rate_hz=rate, other_rate_hz=rate / factor)
    return True
