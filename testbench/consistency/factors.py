"""By which number a gyroscope is wrong, among all numbers, and what such a number may mean."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

LEAST_ANGLE, MOST_ANGLE = 0.3, 40.0
"""Factors are looked among by which the windows that turn most turn by so much [rad]: slower turns
do not show, and faster ones are none of a person or an arm.
"""
COARSE = 1.08
"""Ratio of neighbouring factors that are tried first: a turn by 3 rad is off by half of 0.24 at
most.
"""
NEAR = (0.3, 3.0)
"""Scales between these are those of a neighbouring range setting or another rate, or seem to be
where a body swings.
"""
FINE = (1.02, 1.005)
LIKE = 0.05
"""Logarithm of a factor over one that has a name, if it is that: parts are off by 3 %."""
DEG = np.pi / 180
RANGES = (2.0, 4.0, 8.0, 16.0)
"""Ratios of range settings: they go by twos."""
LSB_PER_DEG_S = (16.4, 32.8, 65.5, 131.0)
"""Counts of a deg/s at 2000, 1000, 500 and 250 deg/s (MPU-6050, RM-MPU-6000A, 6.1)."""


def _named() -> dict[str, float]:
    """What may be wrong, by how many times what it reads the gyroscope then turned."""
    names = {f"a range {ratio:g} times too small taken": ratio for ratio in RANGES}
    names |= {f"a range {ratio:g} times too large taken": 1 / ratio for ratio in RANGES}
    names |= {
        "deg/s taken for rad/s": DEG,
        "rad/s taken for deg/s": 1 / DEG,
        "mdeg/s taken for deg/s": 1e-3,
        "deg/s taken for mdeg/s": 1e3,
        "mdeg/s taken for rad/s": DEG / 1000,
    }
    for counts in LSB_PER_DEG_S:
        names[f"counts of {counts:g} to a deg/s taken for deg/s"] = 1 / counts
        names[f"counts of {counts:g} to a deg/s taken for rad/s"] = DEG / counts
    return names


NAMED = _named()


def names_of_factor(factor: float, within: float = LIKE) -> list[str]:
    """What a factor may mean, the nearest first; none if it is that of nothing known.

    Args:
        factor: The gyroscope turned so many times what it reads.
        within: Logarithm of its ratio to one that has a name.
    """
    off = {name: abs(np.log(factor / one)) for name, one in NAMED.items()}
    return sorted((name for name in off if off[name] < within), key=lambda name: off[name])


def best_factors(
    coarse: Callable[[float], np.ndarray], fine: Callable[[float], np.ndarray], angle: float
) -> list[float]:
    """The factors far from 1 that fit better than 1 and than those near them, the best first.

    Args:
        coarse: Logarithms of the scatter that a factor leaves in a few windows, shape (v,).
        fine: Likewise in more windows, shape (w,).
        angle: That the gyroscope says of the windows that turn most [rad].
    """
    if not angle > 0:
        return []
    steps = int(np.log(MOST_ANGLE / LEAST_ANGLE) / np.log(COARSE))
    tried = LEAST_ANGLE / angle * COARSE ** np.arange(steps + 1)
    tried = tried[(tried < NEAR[0]) | (tried > NEAR[1])]
    left = np.array([float(coarse(factor).mean()) for factor in tried])
    around = np.concatenate([[np.inf], left, [np.inf]])
    lowest = (left < around[:-2]) & (left <= around[2:]) & (left < coarse(1.0).mean())
    found = np.flatnonzero(lowest)
    return [_refined(fine, float(tried[at])) for at in found[np.argsort(left[found])][:2]]


def _refined(logs_of: Callable[[float], np.ndarray], factor: float) -> float:
    """The best factor near one."""
    for ratio in FINE:
        near = factor * ratio ** np.arange(-4, 5)
        factor = float(near[int(np.argmin([logs_of(one).mean() for one in near]))])
    return factor
