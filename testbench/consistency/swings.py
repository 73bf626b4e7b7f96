"""Accelerations of a body that swings about a pivot, which go with its turning as gravity does.

Of a free pendulum of length L a sensor at a distance r from the pivot reads a tangential force of
g sin(angle) (1 - r / L): gravity seems to turn 1 - r / L times as far as the gyroscope says. What
a lever adds to the specific force is linear in it, d(omega)/dt x r + omega x (omega x r) (Woodman
2007, 3), so that the lever with which a gain fits best is found by least squares.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.consistency.fits import (
    FEW_WINDOWS,
    FLOOR,
    Pair,
    Scatter,
    is_clear,
)

USUAL_LEVER_M = 0.7
"""A sensor on a limb, a hand-held stick or a pendulum is so far from what it turns about (standard
deviation of each axis).
"""
ROUNDS = 2
NEARER = ((1.2, 6), (1.08, 2), (1.02, 3))
"""Ratios of the factors that are tried, and how many of them on either side: a third to three times
one first.
"""


def is_explained(pair: Pair, gain: float, bias: np.ndarray) -> bool:
    """Whether some lever makes the rates as they are fit no worse than another gain, with the lever
    that suits it.

    Args:
        pair: Gyroscope and accelerometer, the axes as they are.
        gain: The rates are so many times what is read, if it is not a lever.
        bias: That the rates have, or 0, shape (3,) [rad/s].
    """
    some = pair.some(FEW_WINDOWS)
    own, other = (scatter_with_lever(some, one, bias) for one in (1.0, gain))
    return not is_clear(own.logs[0], other.logs[0], some.windows.independent)


def factor_with_lever(pair: Pair, factor: float, bias: np.ndarray) -> float:
    """The factor near one with which the rates fit best, each with the lever that suits it.

    Args:
        pair: Gyroscope and accelerometer, the axes as they are, in few windows.
        factor: That fits best without one.
        bias: That the rates have, or 0, shape (3,) [rad/s].
    """
    for ratio, steps in NEARER:
        near = factor * ratio ** np.arange(-steps, steps + 1)
        left = [scatter_with_lever(pair, float(one), bias).logs[0].mean() for one in near]
        factor = float(near[int(np.argmin(left))])
    return factor


def scatter_with_lever(pair: Pair, gain: float, bias: np.ndarray) -> Scatter:
    """The scatter of the axes as they are with the lever and the bias that fit a gain best.

    Args:
        pair: Gyroscope and accelerometer.
        gain: Rates are taken so many times.
        bias: To begin with, shape (3,) [rad/s].
    """
    plain = np.eye(3)[None]
    free = pair
    for _ in range(ROUNDS):
        slopes = _slopes(gain * (pair.gyr - bias), pair.windows.seconds)
        lever = _fitted(pair, slopes, gain, bias)
        free = replace(pair, vectors=pair.vectors - slopes @ lever)
        bias = free.fitted_bias(gain, np.eye(3), bias)
    return free.scatter(gain, bias, plain)


def _slopes(rates: np.ndarray, seconds: float) -> np.ndarray:
    """What a lever of 1 m along each axis adds to the specific force, shape (n, 3, 3) [1/s^2].

    Args:
        rates: Shape (n, 3) [rad/s].
        seconds: Of a step.
    """
    faster = np.gradient(rates, seconds, axis=0)
    square = np.sum(rates**2, axis=1)[:, None, None]
    inward = rates[:, :, None] * rates[:, None, :] - square * np.eye(3)
    # the columns of [v x] are v x e_k
    skew = np.cross(faster[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)
    return np.asarray(np.nan_to_num(skew + inward))


def _fitted(pair: Pair, slopes: np.ndarray, gain: float, bias: np.ndarray) -> np.ndarray:
    """The lever that leaves least, shape (3,) [m]."""
    plain = np.eye(3)
    now = pair.deviations(gain, plain, bias)
    each = [replace(pair, vectors=slopes[:, :, k]).deviations(gain, plain, bias) for k in range(3)]
    slope = np.stack(each, axis=-1)
    lever = np.zeros(3)
    for _ in range(ROUNDS):
        left_over = now - slope @ lever
        # windows that something shakes count less
        variance = np.sum(left_over**2, axis=(1, 2)) / now.shape[1] + (FLOOR * pair.usual) ** 2
        weight = pair.windows.independent / len(variance) / variance
        left = np.einsum("w,wbik,wbil->kl", weight, slope, slope)
        right = np.einsum("w,wbik,wbi->k", weight, slope, now)
        lever = np.linalg.solve(left + np.eye(3) / USUAL_LEVER_M**2, right)
    return lever
