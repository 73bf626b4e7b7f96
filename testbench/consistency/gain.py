"""How many times what a gyroscope reads it truly turned, by what gravity did: any number.

Range settings and units are wrong by factors that can be listed. A rate that is 128 Hz where it
was 100, or a part that was never calibrated, is wrong by any factor, which no list has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.consistency.fits import (
    FEW_WINDOWS,
    FLOOR,
    PRIOR_BIAS,
    WELL_EXPLAINED,
    Pair,
    explained,
    is_clear,
)

RANGE = (0.4, 2.5)
"""Gains that are looked among; beyond, they are those of another range, or rate."""
COARSE = 1.1
"""Ratio of neighbouring gains that are tried first."""
GAIN_WITHIN = 0.08
"""Parts are right to this without calibration: 3 % and 2 % more over temperature by the data sheet
of the MPU-6050 (RM-MPU-6000A), and as much again for axes that are not at right angles.
"""
LEAST_ERRORS = 4.0
"""A gain is another one if it differs by so many of its standard errors."""
ROUNDS = 3
STILL = 0.1
"""A gain has settled when a round changes it by less than so many of its standard errors."""


@dataclass(frozen=True)
class Gain:
    """How many times what it reads a gyroscope turned.

    Attributes:
        value: The number.
        error: Its standard error.
        is_other: Whether it is clearly another one than 1.
    """

    value: float
    error: float
    is_other: bool


def find_gain(pair: Pair, bias: np.ndarray) -> Gain | None:
    """The gain with which gravity stays where it is best; None where none does.

    Args:
        pair: Gyroscope and accelerometer, the axes as they are.
        bias: That the rates have, or 0, shape (3,) [rad/s].
    """
    plain, begin = np.eye(3)[None], _coarse(pair.some(FEW_WINDOWS), bias)
    if begin is None:
        return None
    gain, own_bias, error = _refined(pair, begin, bias)
    if not RANGE[0] < gain < RANGE[1]:
        return None
    if abs(np.log(gain)) <= np.log1p(GAIN_WITHIN) + LEAST_ERRORS * error:
        return Gain(gain, error, False)
    as_is = pair.fitted_bias(1.0, np.eye(3), bias)
    worse = pair.scatter(1.0, as_is, plain).logs[0]
    found = pair.scatter(gain, own_bias, plain)
    return Gain(gain, error, is_clear(worse, found.logs[0], found.independent))


def _coarse(pair: Pair, bias: np.ndarray) -> float | None:
    """Where to look for the gain: 1 if it fits well and better than those beside it, else the best
    of all; None if that is at an end.
    """
    plain = np.eye(3)[None]

    def left(gain: float) -> np.ndarray:
        return np.asarray(pair.scatter(gain, bias, plain).logs[0])

    as_is, nothing = left(1.0), left(0.0)
    least = float(as_is.mean())
    well = explained(nothing, as_is) >= WELL_EXPLAINED
    if well and all(float(left(gain).mean()) > least for gain in (1 / COARSE, COARSE)):
        return 1.0
    steps = int(np.log(RANGE[1] / RANGE[0]) / np.log(COARSE))
    tried = RANGE[0] * COARSE ** np.arange(steps + 1)
    at = int(np.argmin([float(left(gain).mean()) for gain in tried]))
    return None if at in (0, len(tried) - 1) else float(tried[at])


def _refined(pair: Pair, gain: float, bias: np.ndarray) -> tuple[float, np.ndarray, float]:
    """Gain and bias by least squares from where they are, and the error of the gain's logarithm."""
    step = 0.005
    begun, error, plain = bias, np.inf, np.eye(3)
    for _ in range(ROUNDS):
        now = pair.deviations(gain, plain, bias)
        turned = (pair.deviations(gain * (1 + step), plain, bias) - now) / step
        slopes = [(pair.deviations(gain, plain, bias + step * axis) - now) / step for axis in plain]
        slope = np.stack([turned, *slopes], axis=-1)
        # windows that something shakes count less
        variance = np.sum(now**2, axis=(1, 2)) / now.shape[1] + (FLOOR * pair.usual) ** 2
        weight = pair.windows.independent / len(variance) / variance
        left = np.einsum("w,wbik,wbil->kl", weight, slope, slope)
        left[1:, 1:] += np.eye(3) / PRIOR_BIAS**2
        right = np.einsum("w,wbik,wbi->k", weight, slope, now)
        right[1:] += (bias - begun) / PRIOR_BIAS**2
        change = -np.linalg.solve(left, right)
        gain *= float(np.exp(np.clip(change[0], -0.2, 0.2)))
        bias = bias + change[1:]
        error = float(np.sqrt(np.linalg.inv(left)[0, 0]))
        if abs(change[0]) < STILL * error:
            break
    return gain, bias, error
