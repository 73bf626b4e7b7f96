"""Strides: windows from one stance of a foot to the next.

A foot on the ground is at rest, for a third of a second, and turns by a right angle and more in
between, with accelerations of several g. From stance to stance its velocity does not change, so
that the mean specific force, turned back by the rates, is what is read in either stance.
"""

from __future__ import annotations

import numpy as np

from testbench.consistency.angular_rate import Windows, are_whole
from testbench.consistency.excerpt import Excerpt

STILL = 0.1
"""In a stance a foot turns by less than this part of what it does in a swing (90 % quantile), ...
"""
LEVEL_WITHIN = 0.1
"""... and the norm of its specific force differs from the usual one by less than this part."""
SHORTEST_STANCE_S = 0.12
"""Shorter ones are moments."""
USED_S = 0.4
"""Of a stance so much is used, for a swing before and one after it each: gyroscopes drift."""
SHORTEST_SWING_S, LONGEST_SWING_S = 0.25, 2.5
LEAST_SHARE = 0.2
"""A stance lasts for this part of a swing, at least: at the turning point of something that swings,
where accelerations are the largest, rates are that small for 6 % of the time.
"""
DWELL = 0.6
"""A foot turns by less than half of `STILL` for this part of a stance, at least; what comes to a
turning point does for half of it, for its rate goes straight through zero.
"""
MOST_STRIDES = 200


def find_strides(excerpt: Excerpt, seconds: float) -> Windows:
    """Windows from stance to stance; none where the recording has no stances.

    Each has three blocks: the end of a stance, everything from its middle to that of the next, and
    the beginning of that.

    Args:
        excerpt: Of the recording.
        seconds: Of a step.
    """
    known = np.isfinite(excerpt.gyr).all(axis=1) & np.isfinite(excerpt.acc).all(axis=1)
    if not known.any():
        return Windows.none(seconds)
    begins, ends, dwell = _stances(excerpt, known)
    if len(begins) < 2:
        return Windows.none(seconds)
    stance, swing = (ends - begins) * seconds, (begins[1:] - ends[:-1]) * seconds
    long = (stance >= max(SHORTEST_STANCE_S, 4 * seconds)) & (dwell >= DWELL)
    right = (swing >= SHORTEST_SWING_S) & (swing <= LONGEST_SWING_S) & long[1:] & long[:-1]
    right &= np.minimum(stance[1:], stance[:-1]) >= LEAST_SHARE * swing
    middles, used = (begins + ends) // 2, max(round(USED_S / seconds), 1)
    since, until = np.maximum(middles, ends - used)[:-1], np.minimum(middles, begins + used)[1:]
    right &= are_whole(excerpt, known, since, until)
    first = np.flatnonzero(right)
    first = first[:: max(-(-len(first) // MOST_STRIDES), 1)]
    edges = np.stack([since[first], ends[first], begins[first + 1], until[first]], axis=1)
    lengths = np.diff(edges, axis=1)
    weights = np.zeros((len(first), 3, 3))
    weights[:, 0, 0] = weights[:, 2, 2] = 1.0
    weights[:, 1] = lengths / lengths.sum(axis=1, keepdims=True)
    return Windows(edges[:, :-1], edges[:, 1:], weights, seconds, float(len(first)))


def _stances(excerpt: Excerpt, known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First rows of the intervals in which a foot hardly turns and is not shaken, the rows after
    their last, and for which part of each it turns even less, shape (m,) each.
    """
    rates = np.where(known, np.linalg.norm(excerpt.gyr, axis=1), np.inf)
    forces = np.linalg.norm(excerpt.acc, axis=1)
    most = STILL * np.quantile(rates[known], 0.9)
    still = rates < most
    if not still.any():
        nothing = np.zeros(0, dtype=int)
        return nothing, nothing, np.zeros(0)
    usual = np.median(forces[still])
    still &= np.abs(np.where(known, forces, np.inf) - usual) < LEVEL_WITHIN * usual
    edges = np.diff(np.concatenate([[0], still.astype(int), [0]]))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    slow = np.concatenate([[0], np.cumsum(rates < most / 2)])
    return begins, ends, (slow[ends] - slow[begins]) / (ends - begins)
