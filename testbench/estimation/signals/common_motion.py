"""Where two logs of one motion fit: the correlation of angular rates over every overlap.

Two logs may have begun minutes apart. Every shift is looked at, and several drifts, and each is
weighed by how long its overlap is: a short one correlates by chance. A motion that repeats itself
fits at several shifts, one that the other log does not hold fits at none; both are said, and
nothing is fitted then.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from testbench.estimation.signals.rates import RateMagnitude

GRID_S = 0.04
"""Rates are compared as means over so long [s]."""
MOST_BINS = 60_000
"""Longer recordings are compared by longer means."""
MOST_DRIFT = 1e-3
"""Drifts that are tried: real oscillators stay within 100 to 200 ppm, poor ones within this [1]."""
SMEAR_S = 0.3
"""Neighbouring drifts that are tried part by so much at the ends of the recording [s]."""
MOST_DRIFTS = 41
LEAST_CORRELATION = 0.6
"""Two records of one motion agree better than this, unless the sensor reads mostly noise [1]."""
LEAST_EVIDENCE = 6.0
"""By so much the log of the likelihood must exceed that of the luckiest of all shifts [1]."""
DECISIVE = 5.0
"""Difference in the log of the likelihood that decides between two shifts; Jeffreys' scale calls
more than 4.6 decisive (Theory of probability, 1961, appendix B) [1].
"""
COMPARABLE = 0.7
"""A shift with less than this part of the best one's overlap is no rival: logs of one motion
overlap as far as they can [1].
"""
LEAST_VARIANCE = 0.02
"""Part of the variance of a whole record that must lie in an overlap [1]."""
MOST_NAMED = 4
"""Rival shifts that are named."""


@dataclass(frozen=True)
class CommonMotion:
    """Where a sensor's record fits the truth's.

    Attributes:
        lag_s: Time of the sensor less that of the truth, at the sensor's first sample [s].
        drift: Of the sensor's clock against the truth's [1].
        correlation: Of the rates there [1].
        candidates_s: All shifts that fit alike, the best first [s]; more than one where the motion
            repeats itself; none where no shift fits.
    """

    lag_s: float = 0.0
    drift: float = 0.0
    correlation: float = 0.0
    candidates_s: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class _Binned:
    """Mean rates over bins of a regular grid, zero mean, 0 where not known.

    Attributes:
        rate: Shape (n,) [rad/s].
        known: 1 where known, else 0, shape (n,).
    """

    rate: np.ndarray
    known: np.ndarray


def find_common_motion(measured: RateMagnitude, true: RateMagnitude) -> CommonMotion:
    """Look for the shift and drift at which a sensor's rates fit the truth's.

    Args:
        measured: By the sensor, on its own clock.
        true: On the host's clock.
    """
    spans = [float(rate.time[-1] - rate.time[0]) for rate in (measured, true)]
    grid = max(GRID_S, sum(spans) / MOST_BINS, measured.width, true.width / 2)
    reference = _binned(true, grid, 0.0)
    memory = _memory(reference, grid)
    steps = min(int(np.ceil(MOST_DRIFT * min(spans) / 2 / SMEAR_S)), MOST_DRIFTS // 2)
    drifts = np.arange(-steps, steps + 1) * min(2 * SMEAR_S / max(min(spans), 1.0), MOST_DRIFT)
    found: tuple[float, float, np.ndarray, np.ndarray, np.ndarray] | None = None
    for drift in sorted(drifts, key=abs):
        lags, r, overlap = _correlations(_binned(measured, grid, drift), reference)
        evidence = _evidence(r, overlap * grid / memory)
        best = float(evidence.max(initial=0.0))
        if found is None or best > found[0] + 0.5:
            found = best, float(drift), lags, r, overlap
    assert found is not None
    best, drift, lags, r, overlap = found
    evidence = _evidence(r, overlap * grid / memory)
    peak = int(np.argmax(evidence))
    independent = max(float(sum(spans)) / memory, 2.0)
    if r[peak] < LEAST_CORRELATION or best < np.log(independent) + LEAST_EVIDENCE:
        return CommonMotion(correlation=float(r[peak]))
    rivals = _rivals(r, overlap * grid / memory, peak, max(int(memory / grid), 1))
    # a bin's place on the truth's grid less its place on the sensor's
    begin = float(true.time[0]) - float(measured.time[0])
    candidates = [-(begin + float(lags[i]) * grid) for i in [peak, *rivals][:MOST_NAMED]]
    return CommonMotion(candidates[0], drift, float(r[peak]), candidates)


def _binned(rate: RateMagnitude, grid: float, drift: float) -> _Binned:
    """Means over bins that begin with the record, its time scaled by 1 / (1 + drift)."""
    time = (rate.time - rate.time[0]) / (1 + drift)
    total = np.concatenate([[0.0], np.cumsum((rate.rate[1:] + rate.rate[:-1]) / 2 * np.diff(time))])
    edges = np.arange(0.0, time[-1] + grid, grid)
    means = np.diff(np.interp(edges, time, total)) / grid
    middles = (edges[1:] + edges[:-1]) / 2
    known = rate.known_at(rate.time[0] + middles * (1 + drift)) & np.isfinite(means)
    if not known.any():
        return _Binned(np.zeros(len(middles)), np.zeros(len(middles)))
    # Fast motion is no better a witness than slow one, and single spikes are none.
    values = np.sqrt(np.maximum(np.where(known, means, 0.0), 0.0))
    centred = np.where(known, values - values[known].mean(), 0.0)
    return _Binned(centred, known.astype(float))


def _memory(record: _Binned, grid: float) -> float:
    """How long a record is like itself [s]: two of them that have nothing in common correlate as so
    many independent values do (Bartlett 1935).
    """
    size = 1 << (2 * len(record.rate)).bit_length()
    spectrum = np.fft.rfft(record.rate, size)
    own = np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(record.rate)]
    below = np.flatnonzero(own < 0.1 * own[0])
    first = own[: below[0] if len(below) else len(own)] / max(float(own[0]), 1e-30)
    return max(grid * float(2 * np.sum(first**2) - 1), 0.3)


def _correlations(a: _Binned, b: _Binned) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pearson's correlation at every shift, over what both know there.

    Args:
        a: The sensor.
        b: The truth.

    Returns:
        Shifts of a along b in bins, the correlation (0 where the overlap tells nothing), and the
        bins of the overlap, shape (m,) each.
    """
    size = 1 << (len(a.rate) + len(b.rate)).bit_length()
    ones, rate, square = (np.conj(np.fft.rfft(x, size)) for x in (a.known, a.rate, a.rate**2))
    b_ones, b_rate, b_square = (np.fft.rfft(x, size) for x in (b.known, b.rate, b.rate**2))
    lags = np.arange(-len(a.rate) + 1, len(b.rate))

    def at(product: np.ndarray) -> np.ndarray:
        return np.asarray(np.fft.irfft(product, size)[lags])

    n = np.maximum(np.round(at(ones * b_ones)), 1.0)
    sum_a, sum_b = at(rate * b_ones), at(ones * b_rate)
    var_a = at(square * b_ones) / n - (sum_a / n) ** 2
    var_b = at(ones * b_square) / n - (sum_b / n) ** 2
    least_a = LEAST_VARIANCE * float(np.mean(a.rate**2)) + 1e-12
    least_b = LEAST_VARIANCE * float(np.mean(b.rate**2)) + 1e-12
    telling = (var_a > least_a) & (var_b > least_b)
    covariance = at(rate * b_rate) / n - sum_a * sum_b / n**2
    r = np.zeros(len(lags))
    r[telling] = covariance[telling] / np.sqrt(var_a[telling] * var_b[telling])
    return lags, np.clip(r, -0.9999, 0.9999), n


def _evidence(r: np.ndarray, independent: np.ndarray) -> np.ndarray:
    """Log of the likelihood ratio of a correlation against none, shape (m,)."""
    squared = np.where(r > 0, r, 0.0) ** 2
    return np.asarray(-0.5 * np.maximum(independent - 2, 0.0) * np.log1p(-squared))


def _rivals(r: np.ndarray, independent: np.ndarray, peak: int, width: int) -> list[int]:
    """Other peaks that fit nearly as well over a comparable overlap, the nearest first."""
    unexplained = 1 - np.where(r > 0, r, 0.0) ** 2
    shorter = np.minimum(independent, independent[peak])
    worse = 0.5 * shorter * np.log(unexplained / unexplained[peak])
    open_to = (worse < DECISIVE) & (independent > COMPARABLE * independent[peak])
    # The best one's own slope is no rival.
    left = peak - int(np.argmax(np.append(~open_to[peak::-1], True)))
    right = peak + int(np.argmax(np.append(~open_to[peak:], True)))
    open_to[max(left - width, 0) : right + width + 1] = False
    found = []
    while open_to.any():
        best = int(np.argmin(np.where(open_to, worse, np.inf)))
        found.append(best)
        open_to[max(best - 2 * width, 0) : best + 2 * width + 1] = False
    return sorted(found, key=lambda i: abs(i - peak))
