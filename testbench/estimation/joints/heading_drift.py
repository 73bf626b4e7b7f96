"""How far the heading of a filter without a magnetometer has turned from where it was.

Such a filter's heading is the integral of the rate about the vertical less the bias that the filter
believes in. A rest shows the bias; what the filter turned by beside the measured rate shows what it
believed in. The integral of the difference is how far its heading went astray, for instance while a
filter that began in the middle of a motion still looked for its bias. How well the rest shows the
bias is uncertain, and grows with the time since.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.signals.segmentation import intervals_of
from testbench.frames import NANOSECONDS
from testbench.model import rotation

LEAST_REST_S = 1.0
"""A shorter rest shows no bias [s]."""
LONGEST_STEP = 5.0
"""Over an interval of more than so many usual ones nothing is integrated [1]."""


@dataclass(frozen=True)
class HeadingDrift:
    """Of one sensor by one filter.

    Attributes:
        astray: How far the heading has turned beside the measured rate, shape (n,) [rad].
        rate_sd: Standard uncertainty of the bias that the rest shows [rad/s].
        walk: Of the integral of the rate's noise [rad / sqrt(s)].
    """

    astray: np.ndarray
    rate_sd: float
    walk: float


def heading_drift(
    time_ns: np.ndarray, q_earth_from_sensor: np.ndarray, rate: np.ndarray, resting: np.ndarray
) -> HeadingDrift | None:
    """How far a filter's heading went astray; None where the sensor never rests for a second.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        q_earth_from_sensor: By the filter, shape (n, 4); NaN where it is lost.
        rate: Calibrated, of the interval before each sample, shape (n, 3) [rad/s]; NaN where
            nothing was measured.
        resting: Whether the sensor rests, shape (n,), bool.
    """
    steps = np.diff(time_ns) / NANOSECONDS
    usual = float(np.median(steps))
    known = np.isfinite(rate).all(axis=1)
    rests = intervals_of(resting & known, max(round(LEAST_REST_S / usual), 3))
    if not len(rests):
        return None
    steady = np.concatenate([np.diff(rate[first:end], axis=0) for first, end in rests])
    walk = float(np.max(np.std(steady, axis=0))) * np.sqrt(usual / 2)
    biases, sds = zip(*(_bias(rate[first:end], usual, walk) for first, end in rests), strict=True)
    weights = 1 / np.array(sds) ** 2
    bias = np.average(biases, axis=0, weights=weights)
    turned = rotation.turn_between(q_earth_from_sensor[:-1], q_earth_from_sensor[1:])[:, 2]
    measured = rotation.rotate(q_earth_from_sensor[1:], rate[1:] - bias)[:, 2] * steps
    apart = np.where(steps <= LONGEST_STEP * usual, measured - turned, 0.0)
    astray = np.concatenate([[0.0], np.cumsum(np.nan_to_num(apart))])
    return HeadingDrift(astray, float(1 / np.sqrt(weights.sum())), walk)


def _bias(rate: np.ndarray, interval: float, walk: float) -> tuple[np.ndarray, float]:
    """Mean rate of a rest, and its standard uncertainty about each axis [rad/s].

    That of the noise, and that of a body that sways: where it is at either end of the rest is known
    to the spread of the angle that the mean rate leaves.
    """
    mean, seconds = rate.mean(axis=0), len(rate) * interval
    angle = np.cumsum(rate - mean, axis=0) * interval
    sway = float(np.sqrt(np.mean(np.var(angle, axis=0)))) * np.sqrt(2)
    return mean, float(np.hypot(walk / np.sqrt(seconds), sway / seconds)) + 1e-9
