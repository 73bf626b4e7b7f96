"""Whether a sensor's quantities agree with one another: what is seen is told by findings."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from testbench.consistency.excerpt import HIGHEST_RATE_HZ, Excerpt
from testbench.consistency.factors import DEG, LIKE, NEAR, names_of_factor
from testbench.consistency.fits import FEWER_WINDOWS, NEIGHBOURS, Reading, is_clear, read_against
from testbench.consistency.gain import Gain, find_gain
from testbench.consistency.orientation import (
    Read,
    has_orientation,
    heading_axis,
    height_of_field,
    read_orientation,
)
from testbench.consistency.rests import Rests, find_rests
from testbench.consistency.swings import factor_with_lever, is_explained, scatter_with_lever
from testbench.consistency.times import FACTORS, USUAL_RATES_HZ, read_at_other_times
from testbench.consistency.turning import IDENTITY, MAPS, names_of
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

LOWEST_RATE_HZ = 1.0
"""Below, a rate is asked about: turns cannot be followed at less."""
FEWEST, CLEARLY_MORE = 3.0, 0.05
"""Another unit of time must fit in so many windows that do not overlap, and explain so much more
than another unit of the gyroscope does.
"""
TIME_UNITS = {1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
GRAVITY_WITHIN = 0.35
"""|acc| at rest may differ from gravity by so much: parts without calibration are wrong by 10 %."""
UNIT_WITHIN = 0.25
"""A unit must bring it so near."""
ONE_G_WITHIN = 0.03
"""|acc| at rest is one of some unit, or so near: gravity in g, even if motion does not show it."""
REMOVED_BELOW = 0.35
"""Part of gravity below which it seems to have been removed."""
MOSTLY = 0.5
"""Share of samples that are exactly zero."""
CALM, FEWEST_CALM = 0.4, 4
"""Windows whose vectors scatter by less than this part of the mean, and how many are needed."""
LEAST_TURN = 1.0
"""A window turns if its gyroscope goes through so much [rad]."""
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
EARTH_FIELD_UT = (22.0, 67.0)
"""Least and most field at the surface of the earth (World Magnetic Model 2025) [uT]."""
FIELD_BETWEEN_UT = (8.0, 200.0)
"""Between these, iron near the sensor may explain a reading [uT]."""
MAG_UNITS = {"nT": 1e-3, "mT": 1e3, "G": 100.0, "mG": 0.1}
LEAST_DIP = np.radians(20)
"""Less than this a field hardly tells up from down: near the magnetic equator, or disturbed."""
ACC_UNITS = {"g": STANDARD_GRAVITY, "mg": STANDARD_GRAVITY / 1000}
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


@dataclass(frozen=True)
class Up:
    """What is known of the vertical beside the samples of a sensor.

    Attributes:
        hemisphere: Where they were recorded, None where nobody says.
        by_truth: Whether they are compared with a truth, which tells up from down.
    """

    hemisphere: Literal["north", "south"] | None = None
    by_truth: bool = False


UNKNOWN_UP = Up()


@dataclass
class Looked:
    """What a recording showed, and what is still to be looked at.

    Attributes:
        excerpt: Of the recording.
        seconds: Of a step, by the sensor's stamps.
        findings: So far.
        unchecked: What its motion does not show.
    """

    excerpt: Excerpt
    seconds: float
    findings: list[Finding]
    unchecked: list[str]
    rests: Rests | None = None
    by_gravity: Reading | None = None
    gain: Gain | None = None

    def tell(self, code: str, **values: str | float | list[str]) -> None:
        """Add a finding."""
        self.findings.append(finding(f"consistency.{code}", "", **values))


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
            looked.gain = _gain(looked, looked.by_gravity)
    if has_acc and not _check_gravity(looked):
        return looked.findings
    if has_acc and has_gyr:
        _check_gyroscope(looked)
    if excerpt.mag is not None and np.isfinite(excerpt.mag).any():
        _check_field(looked, has_gyr)
    if has_acc:
        _check_up(looked, up)
    return _with_unchecked(looked)


def _with_unchecked(looked: Looked) -> list[Finding]:
    if looked.unchecked:
        looked.tell("unchecked", what=looked.unchecked, in_short=_in_short(looked.unchecked))
    return looked.findings


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


def _check_gyroscope(looked: Looked) -> None:
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


def _gain(looked: Looked, reading: Reading) -> Gain | None:
    """How far gravity turns for what the gyroscope says, where its axes are in doubt by nothing
    else.
    """
    assert looked.rests is not None
    of_units = reading.scale not in (1.0, *NEIGHBOURS)
    if of_units or reading.one_axis or (reading.turns and not reading.fits_as_is):
        return None
    return find_gain(reading.pair, np.zeros(3) if looked.rests.bias is None else looked.rests.bias)


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
    """The scale that fits best if a lever may explain what turning does not; that of a unit where
    it fits no worse.
    """
    pair, bias = reading.pair.some(FEWER_WINDOWS), reading.bias
    best = factor_with_lever(pair, reading.scale, bias)
    left = scatter_with_lever(pair, best, bias)
    for one in UNITS_OF_RATE:
        if abs(np.log(one / best)) < BLUR:
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


def _check_gravity(looked: Looked) -> bool:
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
        or abs(norm - 1) < ONE_G_WITHIN
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


def _check_field(looked: Looked, has_gyr: bool) -> None:
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
    reading = read_against(looked.excerpt, mag, looked.seconds, looked.rests.bias)
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


def _check_up(looked: Looked, up: Up) -> None:
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
    fits_rates = [one for one in readings if one.rates or not trusted or one.rates is None]
    if plain.up == "z" and (plain.rates is not False or not trusted):
        if any(one.up == "z" and one.rates is not False for one in readings[1:]):
            looked.unchecked.append("orientation: order or direction")
        return
    good = [one for one in fits_rates if one.up is not None]
    if not good:
        if trusted:
            looked.tell("orientation_unlike")
        return
    best = min(good, key=lambda one: (one.up != "z", one.up != "-z", not one.is_plain, one.off))
    _tell_orientation(looked, best)


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
