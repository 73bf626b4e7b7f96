"""Triads that were at the end of their range while they were to be calibrated.

A clipped reading is a bound and no measurement. A scale that is fitted to turns whose peaks are cut
off comes out too large, with a small uncertainty, and would be applied to everything that follows.
"""

from __future__ import annotations

import numpy as np

from testbench.consistency.doubtful import SATURATED, Doubts
from testbench.estimation.calibration.pile_up import cut_off_at, cut_off_moving, usual_noise
from testbench.estimation.signals.segmentation import intervals_of
from testbench.frames import STANDARD_GRAVITY
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import AXES, ImuSamples

PLATEAU = 3
"""So many readings in a row at the largest of a recording may be cut off."""
RUNS = 2
"""And so often it happens: one plateau may be a motion at one rate."""
NEAR_STEPS = 5
"""Readings so many steps of the resolution below the largest are next to it."""
MOSTLY = 0.8
"""Where a range cuts off, at least this part of the readings next to the largest are the largest:
noise about a rate would spread them."""
FAR_STEPS = 20
"""The largest reading is so many steps from the usual one; nearer it is noise at rest."""
GRAVITY_WITHIN = 0.15
"""A specific force at rest is as large as gravity, within this part, and cut off by nothing."""
LEAST_MARKED = 3
"""So many readings at full scale are no chance."""
NAMES = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer"}
UNITS = {"acc": (1.0, "m/s^2"), "gyr": (180 / np.pi, "deg/s"), "mag": (1.0, "uT")}


def clipped_triads(samples: ImuSamples, doubts: Doubts, rests: np.ndarray) -> dict[str, Finding]:
    """What is clipped where it is calibrated, by quantity.

    A gyroscope is calibrated from the first rest to the last; the others in the rests alone, and a
    jolt on the way from one to the next harms them nothing.

    Args:
        samples: As recorded.
        doubts: On them.
        rests: Whether each sample is of a rest, shape (n,), bool.
    """
    found: dict[str, Finding] = {}
    if not rests.any():
        return found
    between = np.zeros(len(rests), dtype=bool)
    between[np.argmax(rests) : len(rests) - np.argmax(rests[::-1])] = True
    for key in NAMES:
        readings, used = getattr(samples, key), between if key == "gyr" else rests
        if readings is None or not np.isfinite(readings[used]).any():
            continue
        marked = _marked(samples, doubts, key, used)
        limits = dict.fromkeys(plateaus(readings[used], key))
        limits |= dict.fromkeys(_ends_of_rests(readings, rests))
        size, unit = UNITS[key]
        told = [f"{axis} at {size * value:.4g} {unit}" for axis, value in limits]
        if marked >= LEAST_MARKED and not told:
            told = [f"{marked} readings at full scale"]
        if told:
            found[key] = finding("calibration.clipped", triad=NAMES[key], limits=", ".join(told))
    return found


def clipped_in_motion(samples: ImuSamples, rests: np.ndarray) -> list[Finding]:
    """What is clipped on the way from one rest to the next, of triads that rest by rest calibrate.

    Args:
        samples: As recorded.
        rests: Whether each sample is of a rest, shape (n,), bool.
    """
    found: list[Finding] = []
    parts = intervals_of(rests)
    if not len(parts):
        return found
    moving = ~rests
    moving[: parts[0, 0]] = moving[parts[-1, 1] :] = False
    for key in ("acc", "mag"):
        readings = getattr(samples, key)
        if readings is None:
            continue
        told, (size, unit) = [], UNITS[key]
        still = [fresh(readings[begin:end]) for begin, end in parts]
        on_the_way = fresh(readings[moving])
        for axis in range(3):
            noise = usual_noise([part[:, axis] for part in still])
            for sign in (1.0, -1.0):
                largest = cut_off_moving(sign * on_the_way[:, axis], noise)
                if largest is not None:
                    told.append(f"{AXES[axis]} at {size * sign * largest:.4g} {unit}")
        if told:
            limits = ", ".join(told)
            found.append(finding("calibration.clipped_moving", triad=NAMES[key], limits=limits))
    return found


def _marked(samples: ImuSamples, doubts: Doubts, key: str, used: np.ndarray) -> int:
    """Readings of a triad that sensor or a stated range mark as saturated.

    A sensor marks a sample, not a triad: it is the one that reads the same largest number in them.
    """
    count = 0
    if SATURATED in doubts.flags and key in doubts.quantities[SATURATED]:
        count = int(doubts.flags[SATURATED][used].sum())
    readings = np.abs(getattr(samples, key)[samples.saturated & used])
    if len(readings) < LEAST_MARKED or not np.isfinite(readings).any():
        return count
    at_end = (readings == np.nanmax(readings, axis=0)) & (
        readings >= np.nanmax(np.abs(getattr(samples, key)[used]), axis=0)
    )
    return max(count, int(at_end.sum(axis=0).max()))


def _ends_of_rests(readings: np.ndarray, rests: np.ndarray) -> list[tuple[str, float]]:
    """Axis and reading of ends of ranges that cut off the noise about rests.

    Args:
        readings: Of a triad, shape (n, 3); NaN where unknown.
        rests: Whether each sample is of a rest, shape (n,), bool.
    """
    parts = [fresh(readings[begin:end]) for begin, end in intervals_of(rests)]
    found = []
    for axis in range(3):
        own = [part[:, axis] for part in parts]
        for sign in (1.0, -1.0):
            largest = cut_off_at([sign * part for part in own])
            if largest is not None:
                found.append((AXES[axis], sign * largest))
    return found


def plateaus(readings: np.ndarray, key: str) -> list[tuple[str, float]]:
    """Ends of ranges that cut readings off.

    Args:
        readings: Of a triad, shape (n, 3); NaN where unknown.
        key: "acc", "gyr" or "mag".

    Returns:
        Axis and reading of each.
    """
    known = fresh(readings)
    if len(known) < PLATEAU * RUNS:
        return []
    return [
        (AXES[axis], sign * largest)
        for axis in range(3)
        for sign in (1.0, -1.0)
        if (largest := _cut_off(sign * known[:, axis], key)) is not None
    ]


def fresh(readings: np.ndarray) -> np.ndarray:
    """The known readings that do not only repeat the one before: a field may do so until it is
    read anew.

    Args:
        readings: Of a triad, shape (n, 3); NaN where unknown.
    """
    known = readings[np.isfinite(readings).all(axis=1)]
    anew = np.ones(len(known), dtype=bool)
    anew[1:] = (known[1:] != known[:-1]).any(axis=1)
    return np.asarray(known[anew])


def _cut_off(column: np.ndarray, key: str) -> float | None:
    """The reading that is never exceeded for the range ends there, None if none is."""
    values = np.unique(column)
    if len(values) < 2:
        return None
    largest, step = float(values[-1]), float(np.diff(values).min())
    at_rest = key == "acc" and abs(abs(largest) / STANDARD_GRAVITY - 1) < GRAVITY_WITHIN
    if at_rest or largest - float(np.median(column)) < FAR_STEPS * step:
        return None
    at = column == largest
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(np.int8)))
    lengths = edges[1::2] - edges[::2]
    beside = int(np.sum(column >= largest - NEAR_STEPS * step))
    often = int(np.sum(lengths >= PLATEAU)) >= RUNS
    return largest if often and at.sum() >= MOSTLY * beside else None
