"""When a worn sensor stands still: the detector SHOE (Skog et al. 2010).

I. Skog, P. Händel, J.-O. Nilsson, J. Rantakokko: Zero-velocity detection - an algorithm evaluation,
IEEE Transactions on Biomedical Engineering 57(11), 2010. The generalised likelihood-ratio test of
"the specific force has the length of gravity and no direction of its own, the angular rate is 0"
against "anything".
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.signals.segmentation import intervals_of
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.windows import moving_mean

WINDOW_S = 0.05
"""Length of the window W of the test."""
FORCE_SD = 0.5
"""sigma_a: what specific force does within the stance of a walking foot [m/s^2].

Not the sensor's noise (Skog et al. take 0.01 m/s^2 and a threshold to match): shoe and skin move.
With 20 deg/s beside it, the quietest moment of every stance of the two recordings at hand (three
feet) stays below 1.8.
"""
RATE_SD = np.radians(20.0)
"""sigma_omega: what the angular rate does within the stance of a walking foot [rad/s]."""
THRESHOLD = 4.0
"""gamma: below it the foot is taken for standing [1].

Stride lengths of the two recordings at hand change by less than 1 mm between 1.5 and 10: how much
each sample says is weighed by its own rate, see `foot.stance_sd`.
"""
QUIET, QUIETEST = 10.0, 0.3
"""A stance is what lies below so many times its own least statistic, but never below the latter
[1]: a slow foot reads little while it still moves.
"""
SHORTEST_S = 0.03
"""Shorter intervals below the threshold are chance [s]."""
JOINED_S = 0.08
"""Breaks shorter than this do not end a stance [s]."""


def still_test(gyr: np.ndarray, acc: np.ndarray, interval: float) -> np.ndarray:
    """The test statistic T of SHOE (Skog et al. 2010, eq. 13), 1 where the two deviations together
    are as large as `FORCE_SD` and `RATE_SD`.

    T = mean over W of |a - g ā / |ā||^2 / sigma_a^2 + |omega|^2 / sigma_omega^2

    Args:
        gyr: Angular rate without bias, shape (n, 3) [rad/s].
        acc: Specific force, shape (n, 3) [m/s^2].
        interval: Between samples [s].

    Returns:
        Shape (n,) [1]; infinite where a reading is missing.
    """
    size = min(max(round(WINDOW_S / interval), 3), max(len(gyr), 1))
    known = np.isfinite(acc).all(axis=1) & np.isfinite(gyr).all(axis=1)
    force, rate = np.where(known[:, None], acc, 0.0), np.where(known[:, None], gyr, 0.0)
    mean = moving_mean(force, size, "held")
    # mean |a - g u|^2 = mean |a|^2 - 2 g |ā| + g^2 with u = ā / |ā|
    squares = moving_mean(np.einsum("ij,ij->i", force, force), size, "held")
    off = squares - 2 * STANDARD_GRAVITY * rotation.lengths(mean) + STANDARD_GRAVITY**2
    turning = moving_mean(np.einsum("ij,ij->i", rate, rate), size, "held")
    whole = moving_mean(known.astype(float), size, "held") > 1 - 0.5 / size
    test = np.maximum(off, 0) / FORCE_SD**2 + np.maximum(turning, 0) / RATE_SD**2
    return np.where(whole, test, np.inf)


def stances(test: np.ndarray, interval: float) -> np.ndarray:
    """Intervals in which the foot stands, begin and end (exclusive), shape (k, 2).

    Args:
        test: As of `still_test`, shape (n,).
        interval: Between samples [s].
    """
    runs = intervals_of(test < THRESHOLD)
    if not len(runs):
        return runs
    breaks = (runs[1:, 0] - runs[:-1, 1]) * interval
    first = np.flatnonzero(np.concatenate([[True], breaks >= JOINED_S]))
    last = np.append(first[1:] - 1, len(runs) - 1)
    joined = np.column_stack([runs[first, 0], runs[last, 1]])
    long = joined[(joined[:, 1] - joined[:, 0]) * interval >= SHORTEST_S]
    return np.array([_quiet(test, begin, end) for begin, end in long], dtype=int).reshape(-1, 2)


def _quiet(test: np.ndarray, begin: int, end: int) -> tuple[int, int]:
    """A stance without its borders, where a foot that walks slowly still comes to rest."""
    own = test[begin:end]
    limit = min(max(QUIET * float(own.min()), QUIETEST), THRESHOLD)
    rows = np.flatnonzero(own < limit)
    return begin + int(rows[0]), begin + int(rows[-1]) + 1
