"""Unit and axes of a magnetometer."""

from __future__ import annotations

import numpy as np

from testbench.consistency.angular_rate import IDENTITY, MAPS, names_of
from testbench.consistency.fits import Reading, read_against
from testbench.consistency.looked import Looked

EARTH_FIELD_UT = (22.0, 67.0)
"""Least and most field at the surface of the earth (World Magnetic Model 2025) [uT]."""
FIELD_BETWEEN_UT = (8.0, 200.0)
"""Between these, iron near the sensor may explain a reading [uT]."""
MAG_UNITS = {"nT": 1e-3, "mT": 1e3, "G": 100.0, "mG": 0.1}


def check_field(looked: Looked, has_gyr: bool) -> None:
    """Unit and axes of the magnetometer."""
    mag = looked.excerpt.mag
    assert mag is not None
    assert looked.rests is not None
    norms = np.linalg.norm(mag, axis=1)
    norms = norms[np.isfinite(norms)]
    if not len(norms):
        return
    norm = float(np.median(norms))
    if not FIELD_BETWEEN_UT[0] <= norm <= FIELD_BETWEEN_UT[1]:
        fitting = [
            unit
            for unit, factor in MAG_UNITS.items()
            if EARTH_FIELD_UT[0] <= norm * factor <= EARTH_FIELD_UT[1]
        ]
        if fitting:
            looked.tell("mag_unit", norm_ut=norm, unit=fitting[0])
        else:
            looked.tell("mag_norm", norm_ut=norm)
    gravity = looked.by_gravity
    if not has_gyr or (gravity is not None and gravity.scale != 1.0):
        return
    known = gravity is not None and gravity.turns
    reading = read_against(
        looked.excerpt, mag, looked.seconds, looked.rests.bias, scale_known=known
    )
    if reading is None:
        looked.unchecked.append("magnetometer: axes")
        return
    _judge_field(looked, reading, gravity)


def _judge_field(looked: Looked, reading: Reading, gravity: Reading | None) -> None:
    scatter = reading.scatter
    if reading.fits_as_is or not reading.turns or reading.scale != 1.0:
        open_maps = [
            i
            for i in range(1, len(MAPS))
            if np.linalg.det(MAPS[i]) > 0 and not scatter.better(IDENTITY, i)
        ]
        if open_maps:
            looked.unchecked.append("magnetometer: axes")
        return
    best = MAPS[scatter.best]
    by_gravity = None if gravity is None or not gravity.turns else MAPS[gravity.scatter.best]
    if by_gravity is not None and np.array_equal(best, by_gravity):
        return  # what the accelerometer says of the gyroscope, too
    if np.linalg.det(best) > 0:
        looked.tell("mag_axes", axes=[names_of(sign * best.T) for sign in (1, -1)])
