"""Lengths of gait cycles by a known distance: a_H and b_H of E. Muñoz 2016 for one walker."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.exceptions import InputError

LEAST_APART = 0.02
"""Mean swings of several walks that differ by less than this part tell no slope [1]."""


def fit_lengths(
    swings_deg: Sequence[np.ndarray], distances_m: Sequence[float], slope_m_deg: float | None = None
) -> tuple[float, float]:
    """Slope [m/deg] and intercept [m] of the line that gives known distances.

    Args:
        swings_deg: Of each walk, the swing of every cycle, shape (k,) [deg].
        distances_m: Of each walk [m].
        slope_m_deg: As known; fitted too if None, which takes walks of different speeds.

    Raises:
        InputError: A walk has no cycle, or the walks do not tell the slope.
    """
    counts = np.array([len(swings) for swings in swings_deg], float)
    if not len(counts) or not counts.all():
        raise InputError("a walk without a gait cycle tells no length")
    sums = np.array([float(np.sum(swings)) for swings in swings_deg])
    known = np.asarray(distances_m, float)
    if slope_m_deg is not None:
        # eq. 2.28 summed over the cycles: D = a_H sum(swing) + b_H n
        return slope_m_deg, float((known - slope_m_deg * sums).sum() / counts.sum())
    means = sums / counts
    if len(counts) < 2 or np.ptp(means) < LEAST_APART * means.mean():
        raise InputError(
            "a slope takes two walks or more of different speeds: their mean swings are "
            + ", ".join(f"{mean:.1f} deg" for mean in means)
        )
    solved, *_ = np.linalg.lstsq(np.column_stack([sums, counts]), known, rcond=None)
    return float(solved[0]), float(solved[1])
