"""Rests of a recording, whatever the units of its numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.consistency.excerpt import Excerpt

WINDOW_S = 0.5
SPREAD = 0.03
"""No axis of an accelerometer at rest varies by more than this part of the norm (standard
deviation), ...
"""
LEAST_SPREAD = 0.1
"""... or than this [m/s^2]: where gravity was removed, the norm is but noise."""
RATE_SPREAD = 0.05
"""Nor one of a gyroscope by more than this part of what it does in motion (90 % quantile), ..."""
LEAST_RATE_SPREAD = 0.03
"""... or than this [rad/s]."""
LEAST_KNOWN = 0.5
"""A window with gaps tells by what it has if this part of it is known."""
FEWEST = 2
AGREE = 0.01
"""Rests tell the bias if what they read differs by less (median deviation) [rad/s]; steady slow
turning passes for a rest.
"""
OTHER_WAY = np.radians(20.0)
"""Rests in poses that differ by so much show gravity from another side [rad]."""
AS_LONG = 0.1
"""Part of the norm by which half of the rests may differ: parts are off by 10 % uncalibrated."""


@dataclass(frozen=True)
class Rests:
    """What was read at rest.

    Attributes:
        acc: Means over windows at rest, shape (m, 3).
        gyr: Likewise, shape (m, 3).
    """

    acc: np.ndarray
    gyr: np.ndarray

    @property
    def norm(self) -> float | None:
        """Usual |acc|, None if it is never at rest."""
        known = np.isfinite(self.acc).all(axis=1)
        if not known.any():
            return None
        return float(np.median(np.linalg.norm(self.acc[known], axis=1)))

    @property
    def show_gravity(self) -> bool:
        """Whether gravity shows: in some rests the reading points another way, and in all it is
        about as long. A bias points the same way in every pose, and what motion adds to it has no
        usual length.
        """
        known = self.acc[np.isfinite(self.acc).all(axis=1)]
        if len(known) < FEWEST:
            return False
        usual, norms = np.median(known, axis=0), np.linalg.norm(known, axis=1)
        low, middle, high = np.quantile(norms, [0.25, 0.5, 0.75])
        turned = known @ usual < np.cos(OTHER_WAY) * norms * np.linalg.norm(usual)
        return bool(turned.any() and high - low < AS_LONG * middle)

    @property
    def bias(self) -> np.ndarray | None:
        """What the gyroscope reads, shape (3,); None if it is hardly ever at rest, or its rests do
        not agree.
        """
        gyr = self.gyr[np.isfinite(self.gyr).all(axis=1)]
        if len(gyr) < FEWEST:
            return None
        usual = np.median(gyr, axis=0)
        agree = bool((np.median(np.abs(gyr - usual), axis=0) <= AGREE).all())
        return np.asarray(usual) if agree else None


def find_rests(excerpt: Excerpt, seconds: float) -> Rests:
    """The windows in which neither triad varies.

    Args:
        excerpt: Of the recording.
        seconds: Of a step.
    """
    size = max(round(WINDOW_S / seconds), 4)
    count = len(excerpt.acc) // size
    acc, gyr = (
        array[: count * size].reshape(count, size, 3) for array in (excerpt.acc, excerpt.gyr)
    )
    (mean, spread), (rate, turning) = _moments(acc), _moments(gyr)
    norm = np.linalg.norm(mean, axis=1)
    has_acc, has_gyr = np.isfinite(excerpt.acc).any(), np.isfinite(excerpt.gyr).any()
    still = np.ones(count, dtype=bool)
    if has_acc:
        still &= spread <= np.maximum(SPREAD * norm, LEAST_SPREAD)
    if has_gyr:
        known = turning[np.isfinite(turning)]
        most = float(np.quantile(known, 0.9)) if len(known) else 0.0
        still &= turning <= max(RATE_SPREAD * most, LEAST_RATE_SPREAD)
    return Rests(mean[still], rate[still])


def _moments(windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means of windows, shape (m, 3), and the largest standard deviation of an axis, shape (m,), by
    the rows that are known; NaN where they are too few.

    Args:
        windows: Shape (m, k, 3).
    """
    known = np.isfinite(windows).all(axis=2)[:, :, None]
    count = known.sum(axis=1)
    enough = count >= LEAST_KNOWN * windows.shape[1]
    count = np.where(enough, count, 1)
    mean = np.where(known, windows, 0.0).sum(axis=1) / count
    off = np.where(known, windows - mean[:, None], 0.0)
    spread = np.sqrt((off**2).sum(axis=1) / count).max(axis=1)
    return np.where(enough, mean, np.nan), np.where(enough[:, 0], spread, np.nan)
