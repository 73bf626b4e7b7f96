"""What wrong placement does to the chain filter, computed beside it; compiled.

Friedland, Treatment of bias in recursive filtering, IEEE Transactions on Automatic Control 14
(1969), 359-367: a filter that knows nothing of p constants errs by its own covariance plus V times
the constants, with F the transition, K the gain and H, H_c the derivatives of the readings by
state and constants,

    V = F V        s = H V + H_c        V = V - K s

and its innovations tell of the constants by a regression on s. It is the joint estimate of both,
linearised about the constants that the filter holds, for n p in place of n^2 operations a reading.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class PlacementEffect(NamedTuple):
    """What p constants of placement that the filter holds at zero do to it, and what it tells of
    them.

    Attributes:
        sensitivity: Of the state's error to the constants, shape (n, p); updated.
        information: What the innovations told of them, shape (p, p); added to.
        score: The same times their most likely values, shape (p,); added to.
        swing: Sum over samples of the outer product of each angle's sensitivity, shape (m, p, p);
            added to.
        covariance: Of the constants, which the standard deviations of the joints include, shape
            (p, p); or empty, shape (0, 0).
        lengths: Which constant the relative length before each joint is, -1 for none, shape (s, k).
    """

    sensitivity: np.ndarray
    information: np.ndarray
    score: np.ndarray
    swing: np.ndarray
    covariance: np.ndarray
    lengths: np.ndarray


def no_effect(n: int, m: int, carried: tuple[int, int]) -> PlacementEffect:
    """Of no constants.

    Args:
        n: States.
        m: Joints.
        carried: Sensors, and joints that carry one at most.
    """
    none = np.zeros((0, 0))
    return PlacementEffect(
        np.zeros((n, 0)),
        none,
        np.zeros(0),
        np.zeros((m, 0, 0)),
        none,
        np.full(carried, -1, dtype=np.int64),
    )


@njit(cache=True)
def learn(
    effect: PlacementEffect,
    s: int,
    by_place: np.ndarray,
    h: np.ndarray,
    Ph: np.ndarray,
    innovation: float,
    S: float,
) -> None:
    """What one innovation tells of the constants, and what its update leaves of their effect.

    Args:
        effect: Updated.
        s: Which sensor it is of.
        by_place: Derivative of the reading by that sensor's six and the lengths before it, shape
            (6 + k,).
        h: Row of H, shape (n,).
        Ph: P times that before the update, shape (n,).
        innovation: Of the reading.
        S: Its variance.
    """
    V, told, score = effect.sensitivity, effect.information, effect.score
    n, p = V.shape
    # s = H V + H_c
    row = _by_constants(effect, s, by_place, h)
    for r in range(p):
        # the regression of the innovation on s: s s' / S and s innovation / S are added
        weight = row[r] / S
        score[r] += weight * innovation
        for c in range(p):
            told[r, c] += weight * row[c]
    for t in range(n):
        # V = V - K s
        gain = Ph[t] / S
        for c in range(p):
            V[t, c] -= gain * row[c]


@njit(cache=True)
def _by_constants(
    effect: PlacementEffect, s: int, by_place: np.ndarray, h: np.ndarray
) -> np.ndarray:
    """Derivative of an innovation by the constants, shape (p,): directly, and by the state's error.

    Arguments are those of `learn`.
    """
    V = effect.sensitivity
    row = np.zeros(V.shape[1])
    # H_c: of its own placement, and of the lengths before it
    row[6 * s : 6 * s + 6] = by_place[:6]
    for k in range(effect.lengths.shape[1]):
        if effect.lengths[s, k] >= 0:
            row[effect.lengths[s, k]] = by_place[6 + k]
    for t in range(len(h)):
        if h[t] != 0.0:
            # H V
            for c in range(len(row)):
                row[c] += h[t] * V[t, c]
    return row


@njit(cache=True)
def follow(
    effect: PlacementEffect, index: np.ndarray, slope: np.ndarray, Ph: np.ndarray, part: float
) -> None:
    """What is left of the effect after an angle was brought back within its limits.

    The mean of a density that is cut off follows the mean of the whole one by the ratio of their
    variances.

    Args:
        effect: Its sensitivity is updated.
        index: States that the angle depends on, shape (k,).
        slope: Its derivatives by them, shape (k,).
        Ph: P times those, shape (n,).
        part: What the limits take of a change of the angle, over its variance [1/rad^2].
    """
    V = effect.sensitivity
    # V = V - K (h V), as after a reading of that angle
    for c in range(V.shape[1]):
        moved = 0.0
        for t in range(len(index)):
            moved += slope[t] * V[index[t], c]
        for t in range(V.shape[0]):
            V[t, c] -= Ph[t] * moved * part


@njit(cache=True)
def add_effect(
    effect: PlacementEffect,
    indices: np.ndarray,
    slopes: np.ndarray,
    variances: np.ndarray,
    row: np.ndarray,
) -> None:
    """Count how far the constants move the joints, and add what is unknown of them.

    Args:
        effect: Its swing is added to.
        indices: States that each joint depends on, shape (m, k).
        slopes: Derivatives of angle, rate and acceleration by them, shape (3, m, k).
        variances: Of the three, shape (3, m); added to where the constants have a covariance.
        row: Space for a derivative by the constants, shape (p,).
    """
    V, swing, covariance = effect.sensitivity, effect.swing, effect.covariance
    fitted, p = covariance.shape[0] > 0, V.shape[1]
    for order in range(3 if fitted else 1):
        for j in range(indices.shape[0]):
            row[:] = 0.0
            for t in range(indices.shape[1]):
                for c in range(p):
                    # what a change of each constant does to the angle, rate or acceleration
                    row[c] += slopes[order, j, t] * V[indices[j, t], c]
            for r in range(p):
                for c in range(p):
                    if order == 0:
                        swing[j, r, c] += row[r] * row[c]
                    if fitted:
                        # r' C r of the constants' covariance C
                        variances[order, j] += row[r] * covariance[r, c] * row[c]
