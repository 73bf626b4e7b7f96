"""Errors as a series in time, and what may be inferred although they last.

Sensor errors last: samples a hundredth of a second apart say nearly the same, and so may
neighbouring poses. How long they last is estimated from all samples of a section, in seconds and
beyond its steps: from the power of the first cosines of the series (a Whittle likelihood; Whittle
1953), under two laws of memory. The variance of the mean is the average power of the lowest
cosines, each put to that of the mean by the law found, and Student's t with as many degrees of
freedom gives the interval: the fixed-smoothing inference of Müller (2007) and of Lazarus, Lewis,
Stock & Watson (2018), whose critical values are those of t exactly. Where the series may hold few
memories only, nothing is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import stdtrit

MOST_PIECES = 192
"""A longer series is first averaged over equal runs: the cosines ask for no finer time."""
MOST_COSINES = 32
"""More would follow the law of the errors within a memory, which is known least."""
FEWEST_COSINES = 8
"""With fewer samples than this nobody can see how long errors last."""
TAUS = 32
"""Correlation times that are tried."""
SHORTEST, LONGEST = 1 / 2000, 2.0
"""The first and the last of them, as shares of the section. The shorter ones look all alike to the
cosines, and so do the longer ones.
"""
DOUBT = 0.8
"""The longest memory is taken whose log-likelihood falls short of the largest by no more: nine in
ten true ones are no longer (Wilks 1938: twice the difference is chi-square of one, to one side).
"""
LIKELY = 0.1
"""The same for the variance of a mean over another stretch: two in three true memories are no
longer. Measured: by the likeliest law intervals of differences between sessions hold 93 %.
"""
LEAST_SHARE = 0.35
"""Cosines with a smaller share of the power at zero would say more of the law than of the mean."""
FEWEST_MEMORIES = 4.9
"""Of the longest memory taken; a section of ten true memories shows as many in six of ten draws,
one of twenty in 96 of 100, and a random walk in one of twenty.
"""
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Layout:
    """When errors count, and what errors with memory would show there.

    Attributes:
        rows: Those that count, in the order of time, shape (n,).
        starts: First of each piece within them, shape (m,).
        sizes: Rows of each piece, shape (m,).
        weight: Of each piece in the mean, summing to one, shape (m,).
        duration_s: From the first row to the last [s].
        basis: Weights times cosines of the part of the weight that has passed, shape (j, m).
        memory_s: Of the laws that are tried, increasing: integral of the autocorrelation over all
            lags [s], shape (g,).
        power: Variance of the mean of errors of unit variance by each law, shape (g,).
        shares: Power that each cosine has by each law, over that of the mean, shape (g, j).
    """

    rows: np.ndarray
    starts: np.ndarray
    sizes: np.ndarray
    weight: np.ndarray
    duration_s: float
    basis: np.ndarray
    memory_s: np.ndarray
    power: np.ndarray
    shares: np.ndarray

    def pieces(self, errors: np.ndarray) -> np.ndarray:
        """Mean over each piece, shape (m,).

        Args:
            errors: Of every row, those too that do not count, shape (n,).
        """
        return np.asarray(np.add.reduceat(errors[self.rows], self.starts) / self.sizes)

    def pieces_in(self, memory_s: float) -> int:
        """How many pieces a memory lasts, at least one."""
        return max(int(np.ceil(memory_s / self.duration_s * len(self.weight))), 1)


def layout(time_s: np.ndarray, steps: Sequence[np.ndarray], equally: bool) -> Layout | None:
    """The layout of a section.

    Args:
        time_s: Of every row, increasing, shape (n,) [s].
        steps: Rows of each step, in the order of time, shape (rows of the step,) each; all rows as
            one without a protocol.
        equally: Every step counts alike, else every row.

    Returns:
        None for too few rows.
    """
    rows = np.concatenate([*steps, np.empty(0, dtype=int)]).astype(int)
    if len(rows) <= FEWEST_COSINES:
        return None
    whole = max(len(rows) / MOST_PIECES, 1.0)
    runs = [max(round(len(own) / whole), 1) for own in steps]
    sizes = np.concatenate(
        [
            len(own) // count + (np.arange(count) < len(own) % count)
            for own, count in zip(steps, runs, strict=True)
        ]
    )
    counted = np.repeat([1.0 / len(own) for own in steps], runs) if equally else np.ones(len(sizes))
    weight = sizes * counted / np.sum(sizes * counted)
    starts = np.cumsum(sizes) - sizes
    middle = np.add.reduceat(time_s[rows], starts) / sizes
    duration = float(time_s[rows[-1]] - time_s[rows[0]])
    if not duration > 0 or len(sizes) <= FEWEST_COSINES:
        return None
    passed = np.cumsum(weight) - weight / 2
    orders = np.arange(1, min(MOST_COSINES, len(sizes) - 1) + 1)
    cosines = np.cos(np.pi * orders[:, None] * passed)
    # blind to the mean, and of the mean's variance where errors are forgotten at once
    basis = np.sqrt(2) * weight * (cosines - (cosines @ weight)[:, None])
    taus = duration * np.geomspace(SHORTEST, LONGEST, TAUS)
    powers = _powers(np.vstack([weight, basis]), np.diff(middle, prepend=middle[0]), taus)
    if not (powers > 0).all():  # rows that go back in time
        return None
    shares = powers[:, 1:] / powers[:, :1]
    memories = np.repeat(2 * taus, 2)
    return Layout(rows, starts, sizes, weight, duration, basis, memories, powers[:, 0], shares)


@njit(cache=True)
def _powers(vectors: np.ndarray, gaps: np.ndarray, taus: np.ndarray) -> np.ndarray:
    """Variance of weighted sums of a series of unit variance, by two laws for each time.

    The first law is that of first order, R(t) = exp(-t / tau); the second the maximally flat one of
    second order, R(t) = exp(-t / tau) (cos(t / tau) + sin(t / tau)), the real part of
    (1 - i) exp(-(1 - i) t / tau). The memory of both is 2 tau.

    Args:
        vectors: Weights, shape (k, m).
        gaps: Time since the value before, shape (m,) [s].
        taus: Shape (g,) [s].

    Returns:
        Shape (2 g, k), both laws of each time after one another.
    """
    result = np.zeros((2 * len(taus), vectors.shape[0]))
    real, imaginary = np.empty(vectors.shape[0]), np.empty(vectors.shape[0])
    columns = vectors.T.copy()
    for g in range(len(taus)):
        for second in range(2):
            real[:], imaginary[:] = 0.0, 0.0  # what is held of earlier values
            total = result[2 * g + second]
            decays = np.exp(-gaps / taus[g])
            for i in range(len(columns)):
                now = columns[i]
                turn = second * gaps[i] / taus[g]
                c, s = decays[i] * np.cos(turn), decays[i] * np.sin(turn)
                for k in range(len(now)):
                    x = c * real[k] - s * imaginary[k]
                    y = s * real[k] + c * imaginary[k]
                    total[k] += now[k] * (now[k] + 2.0 * (x + second * y))
                    real[k], imaginary[k] = x + now[k], y
    return result


@dataclass(frozen=True)
class Means:
    """Means of k series of one layout, and how well they are known.

    Attributes:
        mean: Shape (k,).
        error: Standard errors, shape (k,).
        freedom: Degrees of freedom of these, shape (k,).
        memory_s: The longest memory that the series does not speak against, shape (k,) [s].
        memories: How many of them the section holds, shape (k,); 0 for values that are no numbers.
    """

    mean: np.ndarray
    error: np.ndarray
    freedom: np.ndarray
    memory_s: np.ndarray
    memories: np.ndarray


def means(own: Layout, values: np.ndarray) -> Means:
    """Means of series, with standard errors that respect their memory.

    Args:
        own: Their layout.
        values: Of each piece, shape (k, m).
    """
    sound = np.isfinite(values).all(axis=1)
    values = np.where(sound[:, None], values, 0.0)
    mean = values @ own.weight
    power = (values @ own.basis.T) ** 2
    constant = power.sum(axis=1) <= 1e-24 * np.maximum(np.mean(values**2, axis=1), 1e-300)
    power[constant] = 1.0
    likelihood, _ = _whittle(own, power)
    near = likelihood >= likelihood.max(axis=1, keepdims=True) - DOUBT
    law = near.shape[1] - 1 - np.argmax(near[:, ::-1], axis=1)
    shares = own.shares[law]
    low = np.cumprod(shares >= LEAST_SHARE, axis=1).astype(bool)
    freedom = np.maximum(low.sum(axis=1), 1)
    low[:, 0] = True
    variance = np.where(low, power / shares, 0.0).sum(axis=1) / freedom
    memory = np.where(constant, 0.0, own.memory_s[law])
    memories = np.where(
        constant, np.inf, np.divide(own.duration_s, memory, where=~constant, out=memory * 0)
    )
    return Means(
        np.where(sound, mean, np.nan),
        np.where(constant, 0.0, np.sqrt(variance)),
        freedom,
        memory,
        np.where(sound, memories, 0.0),
    )


def _whittle(own: Layout, power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whittle's likelihood of each law, and the variance of the mean by each, shape (k, g) each.

    Args:
        own: The layout.
        power: Of the cosines of k series, shape (k, j).
    """
    # the level at its best for each law
    level = power @ (1 / own.shares).T / own.shares.shape[1]
    likelihood = -0.5 * (own.shares.shape[1] * np.log(level) + np.log(own.shares).sum(axis=1))
    return likelihood, level


def variance_elsewhere(own: Layout, values: np.ndarray, duration_s: float) -> float:
    """Variance of the mean of the same errors over another stretch, by a likely law of theirs.

    Args:
        own: Layout of where they were seen.
        values: Of each piece, shape (m,).
        duration_s: Of the other stretch, which counts evenly [s].

    Returns:
        In the square of their unit; 0 of errors that do not change.
    """
    power = (values @ own.basis.T)[None] ** 2
    if power.sum() <= 1e-24 * max(float(np.mean(values**2)), 1e-300):
        return 0.0
    likelihood, level = _whittle(own, power)
    law = int(np.flatnonzero(likelihood[0] >= likelihood[0].max() - LIKELY)[-1])
    even = np.full((1, MOST_PIECES), 1 / MOST_PIECES)
    gaps = np.full(MOST_PIECES, duration_s / MOST_PIECES)
    there = _powers(even, gaps, own.memory_s[law : law + 1] / 2)[law % 2, 0]
    return float(level[0, law] * there / own.power[law])


@dataclass(frozen=True)
class ErrorSeries:
    """Errors of one layout.

    Attributes:
        layout: When they count.
        mean: Mean of e over each piece, shape (m,).
        absolute: That of |e|, shape (m,).
        square: That of e², shape (m,).
        signed: Signed errors behind one without sign, shape (k, m): a magnitude forgets faster than
            what it is the magnitude of.
    """

    layout: Layout
    mean: np.ndarray
    absolute: np.ndarray
    square: np.ndarray
    signed: np.ndarray


def fewest_memories(series: Sequence[ErrorSeries]) -> list[float]:
    """How many memories the section holds of each of several errors of one layout."""
    rows = [np.vstack([own.mean, own.signed]) for own in series]
    found = means(series[0].layout, np.vstack(rows)).memories
    ends = np.cumsum([len(own) for own in rows])
    return [float(own.min()) for own in np.split(found, ends[:-1])]


def error_series(own: Layout, errors: np.ndarray, *signed: np.ndarray) -> ErrorSeries:
    """The series of errors.

    Args:
        own: Their layout.
        errors: Shape (n,), in any unit.
        signed: Further errors whose memory counts too, shape (n,) each.
    """
    return ErrorSeries(
        own,
        own.pieces(errors),
        own.pieces(np.abs(errors)),
        own.pieces(errors**2),
        np.array([own.pieces(values) for values in signed]).reshape(-1, len(own.weight)),
    )


@dataclass(frozen=True)
class Intervals:
    """95 % confidence intervals, None where they are not known from this session.

    Attributes:
        mean: Both ends for the signed mean.
        absolute: Both ends for the mean magnitude.
        rms: Both ends for the RMS.
        memories: Whole memories that the section holds.
        memory_s: Longest memory that the errors do not speak against [s].
        reason: Why one is missing, else None.
    """

    mean: list[float] | None
    absolute: list[float] | None
    rms: list[float] | None
    memories: int
    memory_s: float
    reason: str | None


def intervals(series: ErrorSeries) -> Intervals:
    """Confidence intervals of a section.

    That of the signed mean is symmetric; those of the mean magnitude and the RMS are symmetric in
    their logarithm, as they cannot be negative (Cox & Hinkley 1974, section 9.2: the delta method).
    """
    found = means(
        series.layout, np.vstack([series.mean, series.absolute, series.square, series.signed])
    )
    held = min(found.memories[0], *found.memories[3:], np.inf)
    enough = np.minimum(found.memories[:3], held) >= FEWEST_MEMORIES
    half = (stdtrit(found.freedom, (1 + CONFIDENCE) / 2) * found.error).tolist()
    mean, absolute, square = found.mean[:3].tolist()
    ends = [
        [mean - half[0], mean + half[0]],
        _stretched(absolute, half[1]),
        [float(np.sqrt(end)) for end in _stretched(square, half[2])],
    ]
    of_mean, of_magnitude, of_rms = (
        end if known else None for end, known in zip(ends, enough, strict=True)
    )
    memory = min(float(found.memory_s.max()), series.layout.duration_s)
    return Intervals(
        of_mean,
        of_magnitude,
        of_rms,
        int(min(found.memories.min(), len(series.layout.rows))),
        memory,
        None if enough.all() else too_few(series.layout.duration_s, memory),
    )


def _stretched(value: float, half: float) -> list[float]:
    """Both ends about a value that is not negative, symmetric in its logarithm."""
    if not value > 0:
        return [value, value]
    factor = float(np.exp(half / value))
    return [value / factor, value * factor]


def too_few(duration_s: float, memory_s: float) -> str:
    """Why nothing is inferred from a section."""
    return (
        f"not known from this session: errors may hang together over {memory_s:.3g} s "
        f"of the {duration_s:.3g} s evaluated"
    )
