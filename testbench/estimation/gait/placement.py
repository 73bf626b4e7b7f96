"""Where a worn sensor sits: told by its name or by its motion, and left open where neither does."""

from __future__ import annotations

import re

import numpy as np

from testbench.estimation.gait.foot import FootWalk
from testbench.estimation.gait.readings import Readings
from testbench.estimation.gait.zero_velocity import THRESHOLD
from testbench.model import rotation
from testbench.records.results.gait import Place

WORDS: dict[Place, tuple[str, ...]] = {
    "foot": ("foot", "feet", "shoe", "instep", "toe", "heel", "calcn", "pie"),
    "shank": ("shank", "shin", "tibia", "ankle", "calf", "lowerleg"),
    "wrist": ("wrist", "hand", "watch", "forearm"),
    "chest": ("chest", "sternum", "trunk", "torso", "necklace"),
}
"""Words in a sensor's name that say where it sits."""
SIDES = {
    "left": r"(^|_)(l|left|lt)(_|$)|^left|^L(?=[A-Z])|left$",
    "right": r"(^|_)(r|right|rt)(_|$)|^right|^R(?=[A-Z])|right$",
}
SWINGS = np.radians(150.0)
"""A foot swings faster than this; the chest of a walker never turns so fast [rad/s]."""
SLOW = np.radians(80.0)
"""The chest of a walker turns more slowly than this [rad/s]."""
SHAKEN = 1.0
"""RMS of the force about its mean that a walker's chest feels at least [m/s^2]."""
LEAST_STRIDES = 3
MOST_OF_THEM = 0.8
"""Part of the strides that must swing as fast as a foot does."""
STANCE_SHARE = 0.15
"""Least part of its strides that a foot is still in [1]: .36 and more in the recordings at hand; a
shank or a wrist slows down for an instant at most.
"""
SHORTEST_S, LONGEST_S = 0.5, 3.0
"""A stride of a walk takes so long; between longer ones is a rest [s]."""


def place_by_name(name: str) -> Place | None:
    """Where a sensor of this name sits, None where its name does not say."""
    plain = re.sub(r"[^a-z]", "", name.lower())
    found: list[Place] = [place for place, words in WORDS.items() if any(w in plain for w in words)]
    return found[0] if len(found) == 1 else None


def side_by_name(name: str) -> str:
    """The side that a sensor's name says, "left" or "right"; else ""."""
    found = [
        side
        for side, pattern in SIDES.items()
        if re.search(pattern, name) or re.search(pattern, name.lower())
    ]
    return found[0] if len(found) == 1 else ""


def place_by_motion(readings: Readings, walked: FootWalk | None) -> Place | None:
    """Where a sensor sits by what it feels, None where that does not tell.

    Only a foot stands still within a walk, for a fifth of each stride and more; only a trunk turns
    slowly throughout while every step shakes it. Shank, thigh and wrist swing alike.

    Args:
        readings: Of the sensor.
        walked: What it would say if it were on a foot.
    """
    if walked is not None and _stands_between_swings(readings, walked):
        return "foot"
    rate = rotation.lengths(readings.rate)
    force = readings.acc[np.isfinite(readings.acc).all(axis=1)]
    if not len(force):
        return None
    shaken = float(np.sqrt(np.mean(np.var(force, axis=0).sum())))
    stands = walked is not None and len(walked.moves) >= LEAST_STRIDES  # a foot that shuffles
    if not stands and np.quantile(rate, 0.99) < SLOW and shaken > SHAKEN:
        return "chest"
    return None


def _stands_between_swings(readings: Readings, walked: FootWalk) -> bool:
    """Whether the sensor swings fast and is still for long enough in nearly all of its strides."""
    rate = rotation.lengths(readings.rate)
    still = walked.test < THRESHOLD
    fast = stood = lasted = strides = 0
    for move in walked.moves:
        rows = slice(move.begin, move.end)
        time = (move.end - move.begin) * readings.interval
        if SHORTEST_S <= time <= LONGEST_S:
            strides += 1
            fast += bool(rate[rows].max() > SWINGS)
            stood += int(still[rows].sum())
            lasted += move.end - move.begin
    if strides < max(LEAST_STRIDES, len(walked.moves) / 2):
        return False
    return fast >= MOST_OF_THEM * strides and stood > STANCE_SHARE * lasted
