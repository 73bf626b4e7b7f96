"""Segmentation: when a sensor is at rest, by its own gyroscope, or by its accelerometer alone."""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.model.windows import moving_mean

WINDOW_S = 0.2
LEAST_SPREAD = np.radians(0.3)
"""A spread below this counts as rest however quiet the sensor is [rad/s]."""
NOISE_FACTOR = 3.0
MOST_BIAS = np.radians(2.0)
"""A steady reading at rest may differ by this from the quietest [rad/s]: biases move with pose."""
FORCE_WINDOW_S = 1.0
"""Of an accelerometer alone; gravity moves little in a shorter window of a slow turn."""
LEAST_FORCE_SPREAD, MOST_FORCE_SPREAD = 0.05, 0.3
"""A spread of the specific force below the first counts as rest however quiet the sensor is; above
the second nothing does, for a sensor that never rests has a quietest tenth as well [m/s^2].
"""


def detect_static(gyr: np.ndarray, interval: float, real: np.ndarray | None = None) -> np.ndarray:
    """Samples at which the sensor is at rest.

    The RMS of the angular rate about its own mean, over a window, must stay below three times its
    quietest tenth, and the mean close to the quietest one; a turn that is both steady and slower
    than 2 deg/s is taken for a bias. The borders of each still interval are drawn in by half a
    window, so that no transient is let in.

    Args:
        gyr: Shape (n, 3) [rad/s].
        interval: Between samples [s].
        real: Rows that were measured, not filled in, shape (k,); all if None. A straight line over
            a gap is quieter than any sensor and must not set the measure.

    Returns:
        Shape (n,), bool.
    """
    window = min(max(round(WINDOW_S / interval), 3), max(len(gyr), 1))
    mean = moving_mean(gyr, window)
    variance = moving_mean(np.sum((gyr - mean) ** 2, axis=1), window)
    spread = np.sqrt(np.maximum(variance, 0))  # a running sum may round below 0
    measured = np.arange(len(gyr)) if real is None else real
    measured = measured[np.isfinite(spread[measured])]
    if not len(measured):
        return np.zeros(len(gyr), dtype=bool)
    quietest = float(np.quantile(spread[measured], 0.1))
    centre = np.median(mean[measured][spread[measured] <= quietest], axis=0)
    steady = spread <= max(NOISE_FACTOR * quietest, LEAST_SPREAD)
    moving = ~steady | (rotation.lengths(mean - centre) > MOST_BIAS)
    return moving_mean(moving, window) == 0


def detect_static_by_force(
    acc: np.ndarray, interval: float, real: np.ndarray | None = None
) -> np.ndarray:
    """Samples at which a sensor without a gyroscope is at rest.

    The RMS of the specific force about its own mean, over a second, must stay below three times its
    quietest tenth. Turns about the vertical, and such as take minutes, do not show.

    Args:
        acc: Shape (n, 3) [m/s^2].
        interval: Between samples [s].
        real: Rows that were measured, shape (k,); see `detect_static`.

    Returns:
        Shape (n,), bool.
    """
    window = min(max(round(FORCE_WINDOW_S / interval), 3), max(len(acc), 1))
    level = np.nan_to_num(acc)
    mean = moving_mean(level, window)
    spread = np.sqrt(np.maximum(moving_mean(np.sum((level - mean) ** 2, axis=1), window), 0))
    measured = np.arange(len(acc)) if real is None else real
    measured = measured[np.isfinite(acc[measured]).all(axis=1)]
    if not len(measured):
        return np.zeros(len(acc), dtype=bool)
    quietest = float(np.quantile(spread[measured], 0.1))
    most = min(max(NOISE_FACTOR * quietest, LEAST_FORCE_SPREAD), MOST_FORCE_SPREAD)
    return moving_mean(spread > most, window) == 0


def intervals_of(resting: np.ndarray, least: int = 1) -> np.ndarray:
    """Runs of True, begin and end (exclusive), shape (k, 2).

    Args:
        resting: Whether each sample is at rest, shape (n,), bool.
        least: Shortest run [samples].
    """
    steps = np.diff(np.concatenate([[0], np.asarray(resting).astype(np.int8), [0]]))
    runs = np.column_stack([np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)])
    return np.asarray(runs[runs[:, 1] - runs[:, 0] >= least])
