"""Unit of an accelerometer, and whether it has gravity."""

from __future__ import annotations

import numpy as np

from testbench.consistency.fits import Reading
from testbench.consistency.looked import Looked
from testbench.frames import STANDARD_GRAVITY

GRAVITY_WITHIN = 0.35
"""|acc| at rest may differ from gravity by so much: parts without calibration are wrong by 10 %."""
UNIT_WITHIN = 0.25
"""A unit must bring it so near."""
ONE_G_WITHIN = 0.03
"""|acc| at rest is one of some unit, or so near: gravity in g, if its rests show it, even if
motion does not.
"""
REMOVED_BELOW = 0.35
"""Part of gravity below which it seems to have been removed."""
MOSTLY = 0.5
"""Share of samples that are exactly zero."""
CALM, FEWEST_CALM = 0.4, 4
"""Windows whose vectors scatter by less than this part of the mean, and how many are needed."""
LEAST_TURN = 1.0
"""A window turns if its gyroscope goes through so much [rad]."""
ACC_UNITS = {"g": STANDARD_GRAVITY, "mg": STANDARD_GRAVITY / 1000}


def check_gravity(looked: Looked) -> bool:
    """Unit of the accelerometer, and whether it has gravity; False where it has none."""
    assert looked.rests is not None
    norm, where = looked.rests.norm, "at rest"
    if looked.excerpt.zero_share > MOSTLY:
        looked.tell("no_gravity", norm_m_s2=0.0, when="mostly")
        return False
    turned = _turned_norm(looked.by_gravity)
    if norm is None:
        if not turned:
            looked.unchecked.append("accelerometer: unit")
            return True
        norm, where = turned, "on the average"
    ratio = norm / STANDARD_GRAVITY
    if abs(ratio - 1) <= GRAVITY_WITHIN:
        return True
    fitting = [
        unit
        for unit, factor in ACC_UNITS.items()
        if abs(norm * factor / STANDARD_GRAVITY - 1) < UNIT_WITHIN
    ]
    like_gravity = (
        turned is None
        or ratio > REMOVED_BELOW
        or abs(turned - norm) < UNIT_WITHIN * norm
        or (abs(norm - 1) < ONE_G_WITHIN and looked.rests.show_gravity)
    )
    if fitting and like_gravity:
        looked.tell("acc_unit", norm_m_s2=norm, when=where, unit=fitting[0])
        return True
    if ratio < REMOVED_BELOW:
        looked.tell("no_gravity", norm_m_s2=norm, when=where)
        return False
    looked.tell("acc_norm", norm_m_s2=norm, when=where)
    return True


def _turned_norm(reading: Reading | None) -> float | None:
    """Length of the mean specific force while the sensor turns, in a frame that does not; zero if
    it does not stay where it is, as gravity does; None where nothing turns.
    """
    if reading is None:
        return None
    best, turning = reading.scatter.best, reading.turning > LEAST_TURN
    if turning.sum() < FEWEST_CALM:
        return None
    if not reading.turns:
        return 0.0
    calm = reading.scatter.logs[best][turning] < np.log(CALM**2)
    return float(np.median(reading.scatter.length[best][turning])) if calm.mean() > 0.5 else 0.0
