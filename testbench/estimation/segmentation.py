"""Segmentation: when a sensor is at rest, by its own gyroscope."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

WINDOW_S = 0.2
LEAST_RATE = np.radians(0.3)
"""Rates below this count as rest however quiet the sensor is [rad/s]."""
NOISE_FACTOR = 3.0


def detect_static(gyr: np.ndarray, interval: float) -> np.ndarray:
    """Samples at which the sensor is at rest.

    The windowed RMS of the angular rate about its quietest reading must stay below three times its quietest tenth; the
    borders of
    each rest are drawn in by half a window, so that no transient is let in.

    Args:
        gyr: Shape (n, 3) [rad/s]. interval: [s].

    Returns:
        Shape (n,), bool.
    """
    window = min(max(round(WINDOW_S / interval), 3), max(len(gyr), 1))
    mean = uniform_filter1d(gyr, window, axis=0)
    spread = np.maximum(uniform_filter1d(np.sum((gyr - mean) ** 2, axis=1), window), 0)
    quiet = spread <= np.quantile(spread, 0.1)
    centred = gyr - np.median(mean[quiet], axis=0)
    rms = np.sqrt(np.maximum(uniform_filter1d(np.sum(centred**2, axis=1), window), 0))  # a running sum may round below 0
    threshold = max(NOISE_FACTOR * float(np.quantile(rms, 0.1)), LEAST_RATE)
    moving = maximum_filter1d((rms > threshold).astype(np.int8), window)
    return np.asarray(moving == 0)
