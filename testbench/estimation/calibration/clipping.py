"""Triads that were at the end of their range while they were to be calibrated.

A clipped reading is a bound and no measurement. A scale that is fitted to turns whose peaks are cut
off comes out too large, with a small uncertainty, and would be applied to everything that follows.
"""

from __future__ import annotations

import numpy as np

from testbench.consistency.doubtful import CLIPPED, SATURATED, Doubts
from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY
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


def clipped_triads(samples: ImuSamples, doubts: Doubts, rests: np.ndarray) -> dict[str, str]:
    """What is clipped where it is calibrated, a sentence by quantity.

    A gyroscope is calibrated from the first rest to the last; the others in the rests alone, and a
    jolt on the way from one to the next harms them nothing.

    Args:
        samples: As recorded.
        doubts: On them.
        rests: Whether each sample is of a rest, shape (n,), bool.
    """
    found: dict[str, str] = {}
    if not rests.any():
        return found
    between = np.zeros(len(rests), dtype=bool)
    between[np.argmax(rests) : len(rests) - np.argmax(rests[::-1])] = True
    for key in NAMES:
        readings, used = getattr(samples, key), between if key == "gyr" else rests
        if readings is None or not np.isfinite(readings[used]).any():
            continue
        readings = readings[used]
        marked = sum(
            int(doubts.flags[reason][used].sum())
            for reason in (CLIPPED, SATURATED)
            if reason in doubts.flags and key in doubts.quantities[reason]
        )
        limits = plateaus(readings, key)
        size, unit = UNITS[key]
        told = [f"{axis} at {size * value:.4g} {unit}" for axis, value in limits]
        if marked >= LEAST_MARKED and not told:
            told = [f"{marked} readings at full scale"]
        if told:
            found[key] = (
                f"the {NAMES[key]} is clipped ({', '.join(told)}): readings at the end of a range "
                "are no measurements, and a calibration by them has wrong scales. Record again "
                "with a wider range, or move more slowly"
            )
    return found


def refuse_clipped(clipped: dict[str, str], key: str) -> None:
    """Refuse to calibrate a clipped triad.

    Args:
        clipped: Sentences by quantity, of `clipped_triads`.
        key: "acc", "gyr" or "mag".

    Raises:
        InputError: It is clipped.
    """
    if key in clipped:
        raise InputError(clipped[key])


def plateaus(readings: np.ndarray, key: str) -> list[tuple[str, float]]:
    """Ends of ranges that cut readings off.

    Args:
        readings: Of a triad, shape (n, 3); NaN where unknown.
        key: "acc", "gyr" or "mag".

    Returns:
        Axis and reading of each.
    """
    known = readings[np.isfinite(readings).all(axis=1)]
    fresh = np.ones(len(known), dtype=bool)
    fresh[1:] = (known[1:] != known[:-1]).any(axis=1)  # a field may repeat until it is read anew
    known = known[fresh]
    if len(known) < PLATEAU * RUNS:
        return []
    return [
        (AXES[axis], sign * largest)
        for axis in range(3)
        for sign in (1.0, -1.0)
        if (largest := _cut_off(sign * known[:, axis], key)) is not None
    ]


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
