"""Rests whose readings are cut off: the noise about a rest piles up at the end of the range.

Noise about a mean, rounded to counts, is a bell; cut off at a count, all that would lie beyond lies
on it. Both are fitted to each rest that reads the largest count of all, by maximum likelihood of
the counts with the mean and, near the usual, the standard deviation free: the censored normal
distribution of Tobin (Econometrica 26, 1958) against the whole one. They have as many parameters,
so that their likelihoods compare as they are (Vuong, Econometrica 57, 1989).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import bdtrc, ndtr

MORE_LIKELY = 10.0
"""Logarithm of the likelihood ratio from which on a rest is cut off: twenty thousand to one."""
FEWEST_AT_END = 5
"""So many readings at the largest count; fewer are the tail of the noise."""
SPREADS = np.array([0.6, 0.75, 0.9, 1.0, 1.15, 1.35, 1.6])
"""Standard deviations that are tried, in that of the other rests."""
MEANS = np.linspace(-4.0, 4.0, 81)
"""Means that are tried, in standard deviations from that of the rest."""
NEAR_END = 2.0
"""Readings so many standard deviations of the noise below the largest are next to it."""
BY_CHANCE = 1e-6
"""Readings at the end of a range that chance explains less often than this are cut off."""
LEAST_STEP = 1e-9
"""Differences between readings below this part of their span are rounding, not a count."""


def cut_off_at(rests: Sequence[np.ndarray]) -> float | None:
    """The reading at which rests are cut off from above; None where none is.

    Args:
        rests: Readings of one axis, one array of shape (n,) for each rest.
    """
    rests = [rest for rest in rests if len(rest) > FEWEST_AT_END]
    if len(rests) < 2:
        return None
    together = np.concatenate(rests)
    largest, step = float(together.max()), count_of(together)
    touching = [rest for rest in rests if rest.max() >= largest - step / 2]
    others = [rest for rest in rests if rest.max() < largest - step / 2]
    at_end = sum(int(np.sum(rest >= largest - step / 2)) for rest in touching)
    usual = usual_noise(others)
    if at_end < FEWEST_AT_END or not usual > 0 or not step > 0:
        return None
    gain = sum(_gain(rest, largest, step, usual) for rest in touching)
    return largest if gain > MORE_LIKELY else None


def cut_off_moving(readings: np.ndarray, noise: float) -> float | None:
    """The reading at which a motion is cut off from above; None where it is not.

    However it moves, its noise makes readings fewer towards the largest: of those within two
    standard deviations of it no larger share can be the largest count than that count is wide.

    Args:
        readings: Of one axis, shape (n,).
        noise: Standard deviation of its readings at rest.
    """
    if len(readings) < FEWEST_AT_END or not noise > 0:
        return None
    largest, step = float(readings.max()), count_of(readings)
    if not 0 < step < noise:
        return None
    at_end = int(np.sum(readings >= largest - step / 2))
    near = int(np.sum(readings >= largest - NEAR_END * noise))
    if at_end < FEWEST_AT_END:
        return None
    chance = float(bdtrc(at_end - 1, near, step / (NEAR_END * noise)))
    return largest if chance < BY_CHANCE else None


def usual_noise(rests: Sequence[np.ndarray]) -> float:
    """Median standard deviation of rests; 0 without any.

    Args:
        rests: Readings of one axis, one array of shape (n,) for each rest.
    """
    spreads = [float(rest.std()) for rest in rests if len(rest) > 1]
    return float(np.median(spreads)) if spreads else 0.0


def count_of(readings: np.ndarray) -> float:
    """The least difference between readings, which is one count; 0 where all are the same.

    Args:
        readings: Of one axis, shape (n,).
    """
    values = np.unique(readings)
    steps = np.diff(values)
    steps = steps[steps > LEAST_STEP * max(float(np.ptp(values)), 1e-300)]
    return float(steps.min()) if len(steps) else 0.0


def _gain(rest: np.ndarray, largest: float, step: float, usual: float) -> float:
    """By how much the cut-off bell is more likely than the whole one, as a logarithm."""
    values, counts = np.unique(rest, return_counts=True)
    sd = usual * SPREADS[:, None, None]
    mean = float(rest.mean()) + MEANS[:, None] * usual
    upper = ndtr((values + step / 2 - mean) / sd)
    lower = ndtr((values - step / 2 - mean) / sd)
    whole = np.maximum(upper - lower, 1e-300)
    cut = whole.copy()
    end = values >= largest - step / 2
    cut[..., end] = np.maximum(1 - lower[..., end], 1e-300)
    likelihood = [float((np.log(bell) @ counts).max()) for bell in (whole, cut)]
    return likelihood[1] - likelihood[0]
