"""Timing audit: what the time stamps and the counter of a recording say of its sampling."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.results.estimate import TimingAudit
from testbench.records.session.samples import ImuSamples

GAP_FACTOR = 1.5
"""Intervals longer than this many median ones are gaps."""
SMOOTH = 5
MOST_LAG = 30
LEAST_LIKENESS = 0.9
"""Correlation of the two signals below which their lag says nothing: noise or linear acceleration
is most of one of them.
"""
STRETCHES = 10
"""Parts of a recording whose scatter tells how sure the lag is."""
STRETCH = 300_000
"""Consecutive samples of a longer recording, those with most motion, that tell whether the
accelerometer lags.
"""


def audit_timing(
    samples: ImuSamples, nominal_rate: float | None, rate_age: float = 0.0
) -> TimingAudit:
    """Audit a sensor's sampling, by its own clock.

    Args:
        samples: As recorded.
        nominal_rate: As the data sheet or file says [Hz], or None.
        rate_age: How much older than its stamp a rate is by the data sheet, against the force [s]:
            half an interval where both are integrated over it and the force is seen in the axes at
            its end.
    """
    if len(samples) < 2:
        return TimingAudit(samples=len(samples), nominal_rate_hz=nominal_rate)
    median = usual_interval(np.diff(samples.device_time_ns))
    intervals = IntervalAudit(median)
    intervals.add(samples.device_time_ns, samples.counter)
    lag = asynchrony(samples, median).later_by(rate_age)
    return intervals.audit(nominal_rate, arrival_jitter(samples), lag)


def usual_interval(steps_ns: np.ndarray) -> float:
    """Median of the intervals that are longer than nothing [s]; NaN where there is none.

    Args:
        steps_ns: Intervals, shape (n,) [ns].
    """
    moving = steps_ns[steps_ns > 0]
    return float(np.median(moving)) / NANOSECONDS if len(moving) else float("nan")


class IntervalAudit:
    """Intervals between time stamps and steps of the counter, counted chunk by chunk.

    Args:
        median: The usual interval [s].
    """

    def __init__(self, median: float):
        self.median = median
        self._samples = self._repeated = self._backward = self._gaps = self._lost = (
            self._regular
        ) = 0
        self._sum = self._squares = self._longest = 0.0
        self._first = self._last = self._counter = 0

    def add(self, device_time_ns: np.ndarray, counter: np.ndarray) -> None:
        """Count the next samples.

        Args:
            device_time_ns: Their time stamps, shape (n,) [ns].
            counter: Their numbers, shape (n,).
        """
        if not len(counter):
            return
        if not self._samples:
            self._first, self._last, self._counter = (
                int(device_time_ns[0]),
                int(device_time_ns[0]),
                int(counter[0]),
            )
            self._samples, device_time_ns, counter = 1, device_time_ns[1:], counter[1:]
            if not len(counter):
                return
        intervals = np.diff(device_time_ns, prepend=self._last) / NANOSECONDS
        is_gap = intervals > GAP_FACTOR * self.median
        excess = intervals[(intervals > 0) & ~is_gap] - self.median
        steps = np.diff(counter, prepend=self._counter)
        self._samples += len(intervals)
        self._repeated += int(np.sum(intervals == 0))
        self._backward += int(np.sum(intervals < 0))
        self._gaps += int(is_gap.sum())
        self._longest = max(self._longest, float(intervals[is_gap].max(initial=0.0)))
        self._lost += int(np.sum(steps[steps > 1] - 1))
        self._regular += len(excess)
        self._sum += float(excess.sum())
        self._squares += float(excess @ excess)
        self._last, self._counter = int(device_time_ns[-1]), int(counter[-1])

    def audit(self, nominal_rate: float | None, jitter: float, lag: Lag) -> TimingAudit:
        """The audit.

        Args:
            nominal_rate: As the data sheet or file says [Hz], or None.
            jitter: Of the arrival [s].
            lag: How much later than the gyroscope the accelerometer is.
        """
        n, span = self._samples, (self._last - self._first) / NANOSECONDS
        mean = self._sum / self._regular if self._regular else float("nan")
        variance = (
            max(self._squares / self._regular - mean**2, 0.0) if self._regular else float("nan")
        )
        return TimingAudit(
            samples=n,
            nominal_rate_hz=nominal_rate,
            effective_rate_hz=(n - 1) / span if span > 0 else float("nan"),
            sampling_rate_hz=1 / (self.median + mean),
            interval_median_ms=1e3 * self.median,
            jitter_ms=1e3 * variance**0.5,
            repeated_stamps=self._repeated,
            backward_stamps=self._backward,
            gaps=self._gaps,
            longest_gap_ms=1e3 * self._longest,
            lost_packets=self._lost,
            lost_percent=100 * self._lost / (n + self._lost),
            arrival_jitter_ms=1e3 * jitter,
            acc_after_gyr_ms=1e3 * lag.seconds,
            acc_after_gyr_sd_ms=1e3 * lag.sd,
        )


def arrival_jitter(samples: ImuSamples) -> float:
    """Standard deviation of the arrivals about a straight line over the device's time [s]."""
    time = (samples.device_time_ns - samples.device_time_ns.mean()) / NANOSECONDS
    delay = (samples.host_time_ns - samples.device_time_ns) / NANOSECONDS
    delay -= delay.mean()
    spread = float(time @ time)
    return float(np.std(delay - time * (float(time @ delay) / spread if spread > 0 else 0.0)))


@dataclass(frozen=True)
class Lag:
    """How much later the accelerometer sees a turn than the gyroscope.

    Attributes:
        seconds: NaN if nothing tells.
        sd: Its standard uncertainty [s], by the scatter between stretches of the recording.
    """

    seconds: float = float("nan")
    sd: float = float("nan")

    def later_by(self, seconds: float) -> Lag:
        """The same, so much later."""
        return Lag(self.seconds + seconds, self.sd)


# Longer than a screen: both signals, their correlation, and what leaving parts out does to it.
def asynchrony(samples: ImuSamples, interval: float) -> Lag:
    """How much later the accelerometer sees a turn than the gyroscope.

    While turning, gravity's direction u in the sensor moves as du/dt = -omega x u: the magnitudes
    of both sides are correlated. The uncertainty is that of leaving one stretch out after the other
    (jackknife: Efron & Tibshirani, An Introduction to the Bootstrap, 1993, eq. 11.5). What is the
    same in every stretch, such as what linear acceleration adds to a motion that repeats, is not in
    it.

    Args:
        samples: As recorded.
        interval: Between them [s].
    """
    if (
        not np.isfinite(samples.acc).all()
        or not np.isfinite(samples.gyr).all()
        or len(samples) < 20 * MOST_LAG
    ):
        return Lag()
    if len(samples) > STRETCH:
        samples = _most_active(samples)
    kernel = np.ones(SMOOTH) / SMOOTH

    def smooth(columns: np.ndarray) -> np.ndarray:
        return np.column_stack([np.convolve(column, kernel, mode="same") for column in columns.T])

    # |du/dt| as the accelerometer sees it, and |omega x u| as the gyroscope does
    u = smooth(samples.acc)
    u = u / np.maximum(rotation.lengths(u), 1e-9)[:, None]
    seen = rotation.lengths(np.gradient(u, interval, axis=0))
    expected = rotation.lengths(np.cross(smooth(samples.gyr), u))
    if np.percentile(expected, 95) < np.radians(10):
        return Lag()
    a, b = seen - seen.mean(), expected - expected.mean()
    lags = np.arange(-MOST_LAG, MOST_LAG + 1)
    begin, end = MOST_LAG, len(a) - MOST_LAG
    ends = np.linspace(begin, end, STRETCHES + 1).astype(int)
    # of each stretch, shape (stretches, lags)
    parts = np.array(
        [
            [np.einsum("i,i->", a[low + lag : high + lag], b[low:high]) for lag in lags]
            for low, high in pairwise(ends)
        ]
    )
    correlation = parts.sum(axis=0)
    k = int(np.argmax(correlation))
    begin_k, end_k = begin + lags[k], end + lags[k]
    likeness = correlation[k] / np.sqrt(np.sum(a[begin_k:end_k] ** 2) * np.sum(b[begin:end] ** 2))
    if k in (0, len(lags) - 1) or not likeness > LEAST_LIKENESS:
        return Lag()
    without = np.array([_vertex(correlation - part, k) for part in parts])
    sd = np.sqrt((STRETCHES - 1) / STRETCHES * np.sum((without - without.mean()) ** 2))
    return Lag(float(lags[k] + _vertex(correlation, k)) * interval, float(sd) * interval)


def _vertex(correlation: np.ndarray, k: int) -> float:
    """How far beside the k-th point the parabola through three points has its vertex."""
    left, top, right = correlation[k - 1 : k + 2]
    return float(0.5 * (left - right) / (left - 2 * top + right))


def _most_active(samples: ImuSamples) -> ImuSamples:
    """The `STRETCH` consecutive samples in which the sensor turns most."""
    turned = (
        np.abs(samples.gyr[: len(samples) // 1000 * 1000]).sum(axis=1).reshape(-1, 1000).sum(axis=1)
    )
    total = np.concatenate([[0.0], np.cumsum(turned)])
    size = STRETCH // 1000
    begin = 1000 * int(np.argmax(total[size:] - total[:-size]))
    part = slice(begin, begin + STRETCH)
    return ImuSamples.from_groups(
        {key: column[part] for key, column in vars(samples).items() if column is not None}
    )
