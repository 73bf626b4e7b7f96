"""Angular rates by whatever a recording has: gyroscope, device orientation, or truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.windows import moving_mean
from testbench.records.session.samples import ImuSamples, Truth

WIDEST = 2.5
"""Orientations further apart than this many median intervals do not give a rate between them."""


LOST_S = 0.25
"""Between samples further apart nobody knows how a sensor turned [s]."""
SMALL_BIAS = np.radians(1.0)
"""A smaller reading is a bias, whatever a truth with noise says of it [rad/s]."""
LARGEST_BIAS = np.radians(10.0)
"""A larger reading is motion, where nothing else tells that it is a bias [rad/s]."""
LEAST_SPAN_S = 0.05
"""Orientations closer than this give a rate that is mostly their noise: it is taken over so long
[s].
"""


@dataclass(frozen=True)
class RateMagnitude:
    """Magnitude of the angular rate over time.

    Attributes:
        time: Increasing, shape (n,) [s].
        rate: Shape (n,) [rad/s].
        width: The rate is a mean over this long [s].
        gap: Longest distance between neighbours that may be interpolated over [s].
    """

    time: np.ndarray
    rate: np.ndarray
    width: float
    gap: float

    def thinned(self, most: int) -> RateMagnitude:
        """At most so many of its points, evenly spread."""
        step = -(-len(self.time) // most)
        return self if step <= 1 else replace(self, time=self.time[::step], rate=self.rate[::step])

    def smoothed(self, span: float) -> RateMagnitude:
        """Its means over a span, twice, where it has no gap.

        Args:
            span: Length of each of both windows [s].
        """
        usual = float(np.median(np.diff(self.time)))
        count = round(span / usual) // 2 * 2 + 1
        if count < 3 or len(self.time) <= 2 * count:
            return self
        rate = moving_mean(moving_mean(self.rate, count, "held"), count, "held")
        reach = count - 1
        whole = np.zeros(len(rate), dtype=bool)
        lasted = self.time[2 * reach :] - self.time[: len(rate) - 2 * reach]
        whole[reach : len(rate) - reach] = lasted <= 2 * reach * usual + self.gap
        return replace(self, time=self.time[whole], rate=rate[whole])

    def known_at(self, time: np.ndarray) -> np.ndarray:
        """Whether times lie within the record and not in one of its gaps, shape (m,), bool.

        Args:
            time: Shape (m,) [s].
        """
        index = np.clip(np.searchsorted(self.time, time, side="right"), 1, len(self.time) - 1)
        inside = (time > self.time[0]) & (time < self.time[-1])
        return np.asarray(inside & (self.time[index] - self.time[index - 1] <= self.gap))


def truth_rate(truth: Truth) -> RateMagnitude:
    """Angular-rate magnitude of the truth, by its rates, else between its orientations."""
    time = truth.host_time_ns / NANOSECONDS
    if truth.rate is not None:
        rate, interval = rotation.lengths(truth.rate), median_interval(time)
        known = np.isfinite(truth.rate).all(axis=1)
        return RateMagnitude(time[known], rate[known], 0.0, WIDEST * interval)
    return _from_orientations(time, truth.q_world_from_sensor)


def sensor_rate(samples: ImuSamples) -> RateMagnitude:
    """Angular-rate magnitude on the sensor's clock: by gyroscope, else by device orientation."""
    time = samples.device_time_ns / NANOSECONDS
    known = np.isfinite(samples.gyr).all(axis=1)
    if known.any():
        gyr, time = samples.gyr[known], time[known]
        usual = median_interval(time)
        gap = max(LOST_S, WIDEST * usual)
        return RateMagnitude(time, rotation.lengths(gyr - rest_reading(gyr)), 0.0, gap)
    if samples.device_q is not None:
        return _from_orientations(time, samples.device_q)
    return RateMagnitude(np.zeros(0), np.zeros(0), 0.0, np.inf)


def rest_reading(gyr: np.ndarray, stays: Callable[[np.ndarray], bool] | None = None) -> np.ndarray:
    """What a gyroscope reads at rest, shape (3,) [rad/s].

    That is the median over the tenth of the record that varies least.

    Args:
        gyr: Shape (n, 3) [rad/s].
        stays: Tells whether it rested, from the first and last row of stretches, shape (k, 2);
            where nobody knows, large readings are motion.
    """
    size = 25
    if len(gyr) < 4 * size:
        return np.zeros(3)
    blocks = gyr[: len(gyr) // size * size].reshape(-1, size, 3)
    spread = blocks.var(axis=1).sum(axis=1)
    chosen = np.flatnonzero(spread <= np.quantile(spread, 0.1))
    reading = np.asarray(np.median(blocks[chosen].reshape(-1, 3), axis=0))
    if np.linalg.norm(reading) < (LARGEST_BIAS if stays is None else SMALL_BIAS):
        return reading
    ends = np.column_stack([chosen * size, chosen * size + size - 1])
    return reading if stays is not None and stays(ends) else np.zeros(3)


def angle_rate(time_ns: np.ndarray, angles: np.ndarray) -> RateMagnitude:
    """Length of the rates of some angles over time.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        angles: Shape (n, k) [rad]; NaN where not known.
    """

    def between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return rotation.lengths(rotation.wrap(second - first))

    return _between_rows(time_ns / NANOSECONDS, angles, between)


def _from_orientations(time: np.ndarray, q: np.ndarray) -> RateMagnitude:
    def between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return rotation.angle(rotation.multiply(rotation.conjugate(first), second))

    return _between_rows(time, q, between)


def _between_rows(
    time: np.ndarray, rows: np.ndarray, between: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> RateMagnitude:
    """Rates from how far rows lie apart that follow one another.

    Args:
        time: Not decreasing, shape (n,) [s].
        rows: Shape (n, k); NaN where not known.
        between: How far rows lie apart, each shape (m, k), gives shape (m,) [rad].
    """
    known = np.isfinite(rows).all(axis=1)
    time, rows = time[known], rows[known]
    fresh = np.diff(time, prepend=-np.inf) > 0
    time, rows = time[fresh], rows[fresh]
    if len(time) < 3:
        return RateMagnitude(np.zeros(0), np.zeros(0), 0.0, 0.0)
    usual = median_interval(time)
    apart = min(max(round(LEAST_SPAN_S / usual), 1), len(time) - 2)
    interval = time[apart:] - time[:-apart]
    angle = between(rows[:-apart], rows[apart:])
    close = interval <= (apart + WIDEST - 1) * usual
    return RateMagnitude(
        (time[:-apart] + interval / 2)[close],
        (angle / interval)[close],
        apart * usual,
        (apart + WIDEST - 1) * usual,
    )
