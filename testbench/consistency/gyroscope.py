"""Axes, signs and scale of a gyroscope against the direction of gravity."""

from __future__ import annotations

from itertools import product

import numpy as np

from testbench.consistency.angular_rate import IDENTITY, MAPS, names_of
from testbench.consistency.factors import DEG, LIKE, NEAR, names_of_factor
from testbench.consistency.fits import FEWER_WINDOWS, NEIGHBOURS, Reading, is_clear
from testbench.consistency.gain import Gain, find_gain
from testbench.consistency.looked import Looked
from testbench.consistency.swings import factor_with_lever, is_explained, scatter_with_lever
from testbench.consistency.times import FACTORS, USUAL_RATES_HZ

EXACT = 0.99
"""A scale is what it seems if turning explains this part of the scatter, whatever swings."""
BLUR = 0.35
"""Logarithm of the ratio by which accelerations of a swinging body may blur a scale that is fitted
with a lever.
"""
UNITS_OF_RATE = {DEG: "deg/s", 1 / DEG: "rad/s", DEG / 1000: "mdeg/s"}
"""Units by the scale of rates that were in them and are taken for others."""
SCALE = "gyroscope against accelerometer: scale"
LIKE_NEIGHBOUR = 0.1
"""Logarithm of a gain over that of a neighbouring range setting which parts may have."""


def _find(matrix: np.ndarray) -> int:
    return int(np.flatnonzero((matrix == MAPS).all(axis=(1, 2)))[0])


def _flipped(*axes: int) -> int:
    signs = np.ones(3)
    signs[list(axes)] = -1
    return _find(np.diag(signs))


def _swapped(a: int, b: int) -> set[int]:
    order = np.arange(3)
    order[[a, b]] = b, a
    return {_find(np.diag(signs)[order]) for signs in product((1.0, -1.0), repeat=3)}


KINDS: dict[str, set[int]] = {
    "sign of x": {_flipped(0)},
    "sign of y": {_flipped(1)},
    "sign of z": {_flipped(2)},
    "signs of two axes": {_flipped(0, 1), _flipped(1, 2), _flipped(0, 2)},
    "sign of all": {_flipped(0, 1, 2)},
    "x and y": _swapped(0, 1),
    "y and z": _swapped(1, 2),
    "x and z": _swapped(0, 2),
}
"""Maps by what is wrong if one of them fits."""


def gain_of(looked: Looked, reading: Reading) -> Gain | None:
    """How far gravity turns for what the gyroscope says, where its axes are in doubt by nothing
    else.
    """
    assert looked.rests is not None
    of_units = reading.scale not in (1.0, *NEIGHBOURS)
    if of_units or reading.one_axis or (reading.turns and not reading.fits_as_is):
        return None
    return find_gain(reading.pair, np.zeros(3) if looked.rests.bias is None else looked.rests.bias)


def check_gyroscope(looked: Looked) -> None:
    """Axes, signs and scale of the gyroscope against the direction of gravity."""
    reading = looked.by_gravity
    if reading is None:
        looked.unchecked += [f"gyroscope against accelerometer: {one}" for one in KINDS]
        return
    swings = _swings(looked, reading)
    if swings:
        looked.unchecked.append(SCALE)
    elif reading.scale != 1.0 and reading.turns:
        _tell_scale(looked, reading)
    elif looked.gain is not None and looked.gain.is_other:
        gain, rate = looked.gain.value, looked.excerpt.samples / looked.seconds
        looked.tell("gain_or_rate", gain=gain, rate_hz=rate, other_rate_hz=rate / gain)
    scatter = reading.scatter
    if not reading.fits_as_is and reading.turns and not reading.one_axis:
        _tell_axes(looked, reading)
    if reading.one_axis:
        looked.unchecked += [f"gyroscope against accelerometer: {one}" for one in KINDS]
        if not reading.fits_as_is:
            looked.unchecked.append(SCALE)
        return
    open_maps = {i for i in range(1, len(MAPS)) if not scatter.better(IDENTITY, i)}
    if reading.fits_as_is and open_maps:
        looked.unchecked += [
            f"gyroscope against accelerometer: {name}"
            for name, maps in KINDS.items()
            if maps & open_maps
        ]
    if not swings and (not reading.turns or (reading.scale == 1.0 and reading.scale_open)):
        looked.unchecked.append(SCALE)


def _swings(looked: Looked, reading: Reading) -> bool:
    """Whether another gain seems to fit, and the accelerations of a swinging body explain
    it as well.
    """
    own = looked.gain
    if reading.turns and reading.scale != 1.0:
        gain = reading.scale
    elif own is not None and own.is_other:
        gain = own.value
    else:
        return False
    return is_explained(reading.pair, gain, reading.bias)


def _tell_scale(looked: Looked, reading: Reading) -> None:
    scale, rate = reading.scale, looked.excerpt.samples / looked.seconds
    if NEAR[0] < scale < NEAR[1]:
        gain = looked.gain
        if gain is not None and abs(np.log(gain.value / scale)) > LIKE_NEIGHBOUR + 2 * gain.error:
            scale = gain.value
        looked.tell("scale_or_rate", scale=scale, rate_hz=rate, other_rate_hz=rate / scale)
        return
    blurred = scale
    if reading.explained < EXACT and scale not in UNITS_OF_RATE:
        blurred, scale = scale, _unblurred(reading)
    unit = UNITS_OF_RATE.get(scale)
    if unit is not None:
        looked.tell(
            "gyr_unit",
            times=1 / scale if scale < 1 else scale,
            how="too far" if scale < 1 else "too little",
            unit=unit,
            read={"deg/s": "rad/s", "rad/s": "deg/s", "mdeg/s": "rad/s"}[unit],
        )
        return
    lowest, highest = USUAL_RATES_HZ
    if scale in FACTORS and lowest <= rate / scale <= highest:
        looked.tell("gyr_or_time_unit", factor=scale, rate_hz=rate, other_rate_hz=rate / scale)
        return
    is_exact = abs(np.log(blurred / scale)) < LIKE
    names = names_of_factor(scale, LIKE if is_exact else BLUR)
    means = f"it looks like {' or '.join(names)}" if names else "that is no unit or range known"
    if is_exact:
        mends = f"the key gyr.scale: {scale:.4g} of the mapping, or the right gyr.unit, mends it"
    else:
        means += f", but the body swings, which blurs the number: {blurred:.3g} fits as well"
        mends = (
            "turn it by hand with rests between, which tells the number, and state it by the key "
            "gyr.scale of the mapping, or the unit by gyr.unit"
        )
    looked.tell("gyr_factor", factor=scale, means=means, mends=mends)


def _unblurred(reading: Reading) -> float:
    """The scale that fits best if a lever may explain what turning does not; that of a unit, of
    rates or of time, where it fits no worse.
    """
    pair, bias = reading.pair.some(FEWER_WINDOWS), reading.bias
    best = factor_with_lever(pair, reading.scale, bias)
    left = scatter_with_lever(pair, best, bias)
    for one in (*UNITS_OF_RATE, *FACTORS):
        if min(abs(np.log(one / near)) for near in (best, reading.scale)) < BLUR:
            worse = scatter_with_lever(pair, one, bias).logs[0]
            if not is_clear(worse, left.logs[0], left.independent):
                return one
    return best


def _tell_axes(looked: Looked, reading: Reading) -> None:
    rivals = [MAPS[i] for i in reading.scatter.rivals]
    best = rivals[0]
    gyr = [names_of(one) for one in rivals[:3]]
    if len(rivals) > 3:
        looked.tell("gyr_axes_unclear", axes=gyr)
    elif np.array_equal(best, -np.eye(3)):
        looked.tell("gyr_negated", axes=gyr)
    elif np.linalg.det(best) < 0:
        looked.tell("gyr_mirrored", axes=gyr)
    else:
        acc = [names_of(sign * best.T) for sign in (1, -1)]
        looked.tell("gyr_or_acc_axes", axes=gyr, acc_axes=acc)
