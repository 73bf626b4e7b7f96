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
MOST_RIVALS = 30
"""Rival shifts that are looked at, the likeliest ones: those of a motion that repeats itself."""
COARSE = 0.05
"""Part of the variance that the grid of shifts and drifts leaves unexplained of a motion that
swings once a second; rivals that part by less are fitted before one is believed [1].
"""
MOST_COARSE = 40.0
"""As many values count as independent meanwhile, for what the grid leaves is the same all along."""


@dataclass(frozen=True)
class Shift:
    """A shift at which two records fit.

    Attributes:
        lag_s: Time of the sensor less that of the truth, at the sensor's first sample [s].
        drift: Of the sensor's clock against the truth's [1].
    """

    lag_s: float
    drift: float


@dataclass(frozen=True)
class CommonMotion:
    """Where a sensor's record fits the truth's.

    Attributes:
        correlation: Of the rates where they fit best [1].
        independent: Values there that are independent of one another [1].
        shifts: All at which they fit alike, the best first; more than one where the motion repeats
            itself; none where nothing fits.
    """

    correlation: float = 0.0
    independent: float = 0.0
    shifts: list[Shift] = field(default_factory=list)


@dataclass(frozen=True)
class _Peaks:
    """Largest correlations of two records among neighbouring shifts.

    Attributes:
        lag: Bins of the sensor along the truth, with fractions, shape (k,).
        drift: At which they were found, shape (k,) [1].
        r: The correlations, shape (k,).
        independent: Values in the overlap that are independent of one another, shape (k,).
    """

    lag: np.ndarray
    drift: np.ndarray
    r: np.ndarray
    independent: np.ndarray

    @staticmethod
    def of(lags: np.ndarray, r: np.ndarray, independent: np.ndarray, drift: float) -> _Peaks:
        """Those of correlations at one drift; each is the vertex of a parabola through three."""
        at = np.flatnonzero((r[1:-1] >= r[:-2]) & (r[1:-1] > r[2:]) & (r[1:-1] > 0)) + 1
        left, top, right = r[at - 1], r[at], r[at + 1]
        off = 0.5 * (left - right) / np.minimum(left - 2 * top + right, -1e-30)
        vertex = np.minimum(top - 0.25 * (left - right) * off, 0.99999)
        return _Peaks(lags[at] + off, np.full(len(at), drift), vertex, independent[at])

    def some(self, rows: np.ndarray) -> _Peaks:
        """Some of them."""
        return _Peaks(self.lag[rows], self.drift[rows], self.r[rows], self.independent[rows])


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
    """Look for the shifts and drifts at which a sensor's rates fit the truth's.

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
    peaks: list[_Peaks] = []
    best, lobe = _Peaks(*np.zeros((4, 0))), 0.0
    likeliest = 0.0
    for drift in sorted(drifts, key=abs):
        lags, r, overlap = _correlations(_binned(measured, grid, drift), reference)
        own = _Peaks.of(lags, r, overlap * grid / memory, float(drift))
        peaks.append(own)
        evidence = _evidence(own.r, own.independent)
        if len(evidence) and (not len(best.r) or evidence.max() > likeliest + 0.5):
            row = int(np.argmax(evidence))
            likeliest, best = float(evidence[row]), own.some(np.array([row]))
            lobe = _lobe(r, int(np.argmin(np.abs(lags - best.lag[0]))))
    independent = max(float(sum(spans)) / memory, 2.0)
    if not len(best.r) or best.r[0] < LEAST_CORRELATION:
        return CommonMotion(float(best.r[0]) if len(best.r) else 0.0)
    if likeliest < np.log(independent) + LEAST_EVIDENCE:
        return CommonMotion(float(best.r[0]))
    found = [best, *_rivals(peaks, best, lobe, spans[0] / grid)]
    # a bin's place on the truth's grid less its place on the sensor's
    begin = float(true.time[0]) - float(measured.time[0])
    shifts = [Shift(-(begin + float(own.lag[0]) * grid), float(own.drift[0])) for own in found]
    return CommonMotion(float(best.r[0]), float(best.independent[0]), shifts)


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


def _lobe(r: np.ndarray, peak: int) -> float:
    """Bins from a peak to the valley beside it, on the farther side."""
    rises_right = np.flatnonzero(np.diff(r[peak:]) > 0)
    rises_left = np.flatnonzero(np.diff(r[peak::-1]) > 0)
    sides = [int(rises[0]) if len(rises) else len(r) for rises in (rises_left, rises_right)]
    return float(max(sides))


def worse_by(unexplained: np.ndarray, least: float, independent: np.ndarray) -> np.ndarray:
    """By how much the log of the likelihood is less, of fits that leave more unexplained, shape
    (k,).

    Args:
        unexplained: Parts of the variance, shape (k,).
        least: That of the best one.
        independent: Values that are independent of one another, shape (k,).
    """
    return np.asarray(0.5 * independent * np.log(unexplained / least))


def _rivals(peaks: list[_Peaks], best: _Peaks, lobe: float, length: float) -> list[_Peaks]:
    """Other peaks that may fit as well over a comparable overlap, at whatever drift, the likeliest
    ones, ordered by their distance.

    Args:
        peaks: At each drift.
        best: The one that fits best.
        lobe: Half its width [bins].
        length: Of the sensor's record [bins].
    """
    every = _Peaks(
        *(
            np.concatenate([getattr(own, name) for own in peaks])
            for name in ("lag", "drift", "r", "independent")
        )
    )
    # the same alignment has other lags at other drifts, but not in the middle
    middle = every.lag - every.drift * length / 2 - (best.lag[0] - best.drift[0] * length / 2)
    shorter = np.minimum(every.independent, min(float(best.independent[0]), MOST_COARSE))
    least = 1 - float(best.r[0]) ** 2 + COARSE
    worse = worse_by(1 - every.r**2 + COARSE, least, shorter)
    is_open = (worse < DECISIVE) & (every.independent > COMPARABLE * best.independent[0])
    is_open &= np.abs(middle) > lobe
    found: list[int] = []
    while is_open.any() and len(found) < MOST_RIVALS:
        likeliest = int(np.argmin(np.where(is_open, worse, np.inf)))
        found.append(likeliest)
        is_open &= np.abs(middle - middle[likeliest]) > lobe
    found.sort(key=lambda i: abs(float(middle[i])))
    return [every.some(np.array([i])) for i in found]
