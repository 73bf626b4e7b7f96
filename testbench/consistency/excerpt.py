"""Excerpt: a whole recording at a rate that tells turning from gravity, small enough to keep.

Samples go by once, in chunks. Each is averaged over about 10 ms; of a long recording the stretches
that turn most are kept, and some that rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.consistency.traits import ABSURD
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ImuSamples

STEPS_PER_S = 100
"""Steps of an excerpt a second, at most about so many: turning at 1000 deg/s is 10 deg a step."""
FINE_STEPS_PER_S, FINE_ABOVE_HZ = 1000, 800.0
"""And where the stamps give so high a rate: they may say 10 times as much as is true."""
HIGHEST_RATE_HZ = 20_000.0
"""Beyond, the unit of time is in doubt: none gives more (ICM-42688-P: 32 kHz, of its gyroscope
alone).
"""
STRETCH_S = 10.24
"""What is kept or dropped together, by the stamps."""
MOST_STEPS = 120 * 1024
"""Steps kept of a recording, 20 min at 100 Hz; the memory of the checks, and their time."""
STUCK = 4
"""So many repetitions of all readings in a row are no measurement, if the sensor seems to turn: a
coarse one at rest, or one without noise, repeats itself.
"""
LONGEST_BRIDGE = 3
"""So many steps in a row that are no measurement are bridged: a row or two that a logger lost. A
straight line over 30 ms is off by far less than a window's mean can show.
"""
SPARSE = 17
"""One of so many samples tells the usual rate."""


@dataclass(frozen=True)
class Excerpt:
    """Steps of a recording, each the mean of some samples; NaN where any was no measurement, but
    for a few in a row, which a straight line bridges.

    Attributes:
        time_ns: Of the first sample of each step, shape (n,), int64.
        gyr: Shape (n, 3), as read.
        acc: Likewise of the accelerometer, shape (n, 3).
        mag: Of the middle sample of each step, shape (n, 3), as read, or None.
        device_q: Of the middle sample of each step, shape (n, 4), or None.
        samples: Averaged to a step.
        follows: Whether a step comes straight after the one before it, shape (n,), bool.
        interval_ns: Usual one between two samples, by their stamps.
        zero_share: Share of all samples whose accelerometer is exactly zero and whose gyroscope
            is not.
    """

    time_ns: np.ndarray
    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray | None
    device_q: np.ndarray | None
    samples: int
    follows: np.ndarray
    interval_ns: float
    zero_share: float


class Thinner:
    """Takes chunks of samples as they go by, and keeps an excerpt of them."""

    def __init__(self) -> None:
        self._each = self._stretch = 0
        self._parts: list[dict[str, np.ndarray]] = []
        self._kept = self._zeros = self._count = 0

    def add(self, chunk: ImuSamples) -> None:
        """Take the next samples."""
        if not self._each:
            self._each, self._stretch = _steps_of(chunk.device_time_ns)
        each = self._each
        count = len(chunk) // each
        # the samples of an incomplete step at the end of a chunk are left out
        if not count:
            return
        self._parts.append(self._steps(chunk, count))
        self._kept += count
        if self._kept > 2 * MOST_STEPS:
            self._prune()

    def _steps(self, chunk: ImuSamples, count: int) -> dict[str, np.ndarray]:
        each = self._each
        size = count * each
        rates = np.ascontiguousarray(chunk.gyr.T, dtype=float)
        some = rates[:, :size:SPARSE]
        some = some[:, (np.abs(some) < ABSURD).all(axis=0)]
        seen = some.shape[1]
        usual = some.mean(axis=1) if seen else np.zeros(3)
        gyr, acc, zeros = _means(
            rates,
            np.ascontiguousarray(chunk.acc.T, dtype=float),
            each,
            usual,
            float(((some - usual[:, None]) ** 2).sum()) / seen / 4 if seen else 0.0,
        )
        self._zeros += int(zeros)
        self._count += size
        follows = np.ones(count, dtype=bool)
        follows[0] = False
        columns = {
            "time_ns": chunk.device_time_ns[:size:each],
            "gyr": gyr,
            "acc": acc,
            "follows": follows,
        }
        if chunk.mag is not None:
            mag = chunk.mag[:size].reshape(count, each, 3)[:, each // 2]
            columns["mag"] = np.where(np.abs(mag) < ABSURD, mag, np.nan)
        if chunk.device_q is not None:
            columns["device_q"] = chunk.device_q[each // 2 : size : each]
        return columns

    def _prune(self) -> None:
        """Keep the stretches that turn most, and of the rest some that are evenly spread."""
        whole = _joined(self._parts)
        stretch = self._stretch
        count = len(whole["time_ns"]) // stretch
        turning = np.linalg.norm(whole["gyr"][: count * stretch], axis=1)
        turning = np.where(np.isfinite(turning), turning, 0.0).reshape(count, -1)
        wanted = MOST_STEPS // stretch
        best = np.argsort(-turning.std(axis=1))[: wanted * 3 // 4]
        others = np.setdiff1d(np.arange(count), best)
        spread = others[np.linspace(0, len(others) - 1, wanted // 4).astype(int)]
        kept = np.unique(np.concatenate([best, spread]))
        rows = (kept[:, None] * stretch + np.arange(stretch)).ravel()
        whole["follows"][::stretch] = False
        self._parts = [{name: values[rows] for name, values in whole.items()}]
        self._kept = len(rows)

    def excerpt(self) -> Excerpt | None:
        """What was kept; None if no samples came."""
        if not self._parts:
            return None
        if self._kept > MOST_STEPS:
            self._prune()
        whole = _joined(self._parts)
        steps = np.diff(whole["time_ns"])[whole["follows"][1:]]
        interval = _usual(steps, 50) / self._each if len(steps) else 0.0
        return Excerpt(
            whole["time_ns"],
            _bridged(whole["gyr"], whole["follows"]),
            _bridged(whole["acc"], whole["follows"]),
            whole.get("mag"),
            whole.get("device_q"),
            self._each,
            whole["follows"],
            interval,
            self._zeros / max(self._count, 1),
        )


def _steps_of(time_ns: np.ndarray) -> tuple[int, int]:
    """How many samples make a step, and how many steps a stretch; a step has one where the rate
    cannot be that of a sensor, so that its unit of time is in doubt.
    """
    span = float(time_ns[-1] - time_ns[0]) if len(time_ns) > 1 else 0.0
    rate = (len(time_ns) - 1) * NANOSECONDS / span if span > 0 else 0.0
    steps = STEPS_PER_S if rate < FINE_ABOVE_HZ else FINE_STEPS_PER_S
    each = max(round(rate / steps), 1) if rate < HIGHEST_RATE_HZ else 1
    return each, round(STRETCH_S * steps)


def thin(chunks: Iterable[ImuSamples]) -> Excerpt | None:
    """The excerpt of chunks of samples.

    Args:
        chunks: In the order of time.
    """
    thinner = Thinner()
    for chunk in chunks:
        thinner.add(chunk)
    return thinner.excerpt()


def _usual(steps: np.ndarray, over: int) -> float:
    """The usual interval, also where several samples bear one stamp: the median of means.

    Args:
        steps: Intervals, shape (n,) [ns].
        over: Of so many each mean is.
    """
    over = min(over, len(steps))
    count = len(steps) // over
    return float(np.median(steps[: count * over].reshape(count, over).mean(axis=1)))


def _bridged(array: np.ndarray, follows: np.ndarray) -> np.ndarray:
    """The same with a straight line over at most `LONGEST_BRIDGE` unknown steps in a row.

    Args:
        array: Shape (n, 3).
        follows: Whether a step comes straight after the one before it, shape (n,), bool.
    """
    lost = np.isnan(array).any(axis=1)
    edges = np.diff(np.concatenate([[0], lost.astype(int), [0]]))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    within = (begins > 0) & (ends < len(array)) & (ends - begins <= LONGEST_BRIDGE)
    begins, ends = begins[within], ends[within]
    broken = np.concatenate([[0], np.cumsum(~follows)])
    whole = broken[ends + 1] == broken[begins]
    if not whole.any():
        return array
    bridged = array.copy()
    for begin, end in zip(begins[whole], ends[whole], strict=True):
        part = (np.arange(begin, end) - begin + 1)[:, None] / (end - begin + 1)
        bridged[begin:end] = (1 - part) * array[begin - 1] + part * array[end]
    return bridged


@njit(cache=True)
def _means(gyr, acc, each, usual, far):  # type: ignore[no-untyped-def]
    """Means over each so many samples, a row an axis; NaN where a sample is no measurement, and the
    number of samples whose accelerometer alone is exactly zero. A triad that is not there is NaN
    throughout. A rate turns if the square of its distance from the usual one is beyond `far`.
    """
    count = gyr.shape[1] // each
    rates, forces = np.empty((count, 3)), np.empty((count, 3))
    zeros = same = 0
    for step in range(count):
        dead = False
        for k in range(3):
            rates[step, k] = forces[step, k] = 0.0
        for at in range(step * each, (step + 1) * each):
            repeated = at > 0
            still = weightless = True
            for k in range(3):
                still &= gyr[k, at] == 0
                weightless &= acc[k, at] == 0
                repeated &= gyr[k, at] == gyr[k, at - 1] and acc[k, at] == acc[k, at - 1]
                rates[step, k] += gyr[k, at] / each if abs(gyr[k, at]) < ABSURD else np.nan
                forces[step, k] += acc[k, at] / each if abs(acc[k, at]) < ABSURD else np.nan
            zeros += weightless and not still
            same = same + 1 if repeated else 0
            # repeated so often, it is no measurement
            if same >= STUCK:
                off = 0.0
                for k in range(3):
                    off += (gyr[k, at] - usual[k]) ** 2
                dead |= off > far
            dead |= still and weightless
        for k in range(3):
            if dead or np.isnan(rates[step].sum()):
                rates[step, k] = np.nan
            if dead or np.isnan(forces[step].sum()):
                forces[step, k] = np.nan
    return rates, forces, zeros


def _joined(parts: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    if len(parts) == 1:
        return parts[0]
    names = [name for name in parts[0] if all(name in part for part in parts)]
    return {name: np.concatenate([part[name] for part in parts]) for name in names}
