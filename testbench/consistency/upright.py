"""Which way up is, and what the orientation of a device means."""

from __future__ import annotations

import numpy as np

from testbench.consistency.looked import Looked, Up
from testbench.consistency.orientation import (
    Read,
    has_orientation,
    heading_axis,
    height_of_field,
    read_orientation,
)

LEAST_DIP = np.radians(20)
"""Less than this a field hardly tells up from down: near the magnetic equator, or disturbed."""


def check_up(looked: Looked, up: Up) -> None:
    """Sign of the accelerometer: whatever turns, the opposite of gravity turns likewise. It is told
    by an orientation, or by the field, which points down in the north and up in the south.
    """
    excerpt = looked.excerpt
    if has_orientation(excerpt):
        _check_orientation(looked)
        return
    height = None if excerpt.mag is None else height_of_field(excerpt.acc, excerpt.mag)
    if up.hemisphere is None or height is None or abs(height) < LEAST_DIP:
        if not up.by_truth:
            looked.unchecked.append("accelerometer: sign")
    elif (height < 0) != (up.hemisphere == "north") and not looked.findings:
        points = ("down", "up") if height < 0 else ("up", "down")
        degrees = abs(float(np.degrees(height)))
        looked.tell(
            "acc_or_mag_negated",
            dip_deg=degrees,
            points=points[0],
            expected=points[1],
            hemisphere=up.hemisphere,
        )


def _check_orientation(looked: Looked) -> None:
    """Order, direction and earth of the device's orientation."""
    readings = read_orientation(looked.excerpt, looked.seconds)
    if not readings:
        looked.unchecked.append("orientation")
        return
    plain = readings[0]
    gravity = looked.by_gravity
    trusted = gravity is not None and gravity.turns and gravity.fits_as_is and gravity.scale == 1.0
    if plain.up == "z" and (plain.rates is not False or not trusted):
        if any(one.up == "z" and one.rates is not False for one in readings[1:]):
            looked.unchecked.append("orientation: order or direction")
        return
    good = _fitting(readings, trusted)
    if not good:
        # a format of another earth turns the numbers to ENU, wrongly if it misread them
        good = _fitting(read_orientation(looked.excerpt, looked.seconds, ("NWU", "NED")), trusted)
    if not good:
        if trusted:
            looked.tell("orientation_unlike")
        return
    best = min(good, key=lambda one: (one.up != "z", one.up != "-z", not one.is_plain, one.off))
    _tell_orientation(looked, best)


def _fitting(readings: list[Read], trusted: bool) -> list[Read]:
    """Readings by which an axis of the earth points up, and that turn as the gyroscope does.

    Args:
        readings: All.
        trusted: Whether gyroscope and accelerometer agree.
    """
    return [one for one in readings if one.up and (one.rates is not False or not trusted)]


def _tell_orientation(looked: Looked, best: Read) -> None:
    keys = []
    if best.shift:
        keys.append("order: " + ("xyzw" if best.shift > 0 else "wxyz"))
    if best.inverse:
        keys.append("direction: sensor_from_earth")
    if best.up == "z":
        looked.tell("orientation_reading", keys=keys)
        return
    if best.up == "-z":
        axis = heading_axis(looked.excerpt) if best.is_plain else None
        if axis == "x":
            looked.tell("orientation_ned", keys=keys)
        elif axis == "y":
            looked.tell("acc_negated", keys=keys)
        else:
            looked.tell("orientation_down", keys=keys)
        return
    looked.tell("orientation_earth", up=str(best.up), keys=keys)
