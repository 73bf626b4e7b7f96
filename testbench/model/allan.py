"""Allan deviation of a signal at rest, and the noise parameters that data sheets state.

Overlapping Allan deviation with confidence from the equivalent degrees of freedom of the noise type
that the local slope shows (Riley, Handbook of Frequency Stability Analysis, NIST SP 1065, 2008, eq.
11 and table 5); noise coefficients by weighted least squares of sigma^2(tau) = Q^2 3/tau^2 +
N^2/tau + B^2 2 ln 2/pi + K^2 tau/3 (IEEE Std 952-1997, annex C).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import chdtri

FLICKER = 2 * np.log(2) / np.pi
FEWEST_DIFFERENCES = 8
"""Averaging times with fewer independent spans than this in the record are left out."""


@dataclass(frozen=True)
class AllanCurve:
    """Overlapping Allan deviation.

    Attributes:
        tau: Averaging times, shape (k,) [s].
        deviation: At each averaging time, shape (k,) [unit of the signal].
        lower: Lower end of the 68.3 % confidence interval, shape (k,) [unit of the signal].
        upper: Upper end of the 68.3 % confidence interval, shape (k,) [unit of the signal].
        edf: Equivalent degrees of freedom, shape (k,).
    """

    tau: np.ndarray
    deviation: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    edf: np.ndarray


@dataclass(frozen=True)
class Coefficient:
    """A noise coefficient and its standard uncertainty.

    Attributes:
        value: In the unit that `NoiseCoefficients` states.
        sd: Standard uncertainty, same unit.
    """

    value: float
    sd: float

    @property
    def found(self) -> bool:
        """Whether the value stands out of its uncertainty: it is more than twice as large."""
        return self.value > 2 * self.sd


@dataclass(frozen=True)
class NoiseCoefficients:
    """What an Allan curve says of a signal whose unit is u.

    Attributes:
        white: N, angle or velocity random walk [u s/sqrt(s)]; the noise density of a data sheet,
            whose spectrum is one-sided, is sqrt(2) N [u/sqrt(Hz)].
        bias_instability: B [u].
        rate_random_walk: K [u/sqrt(s)].
    """

    white: Coefficient
    bias_instability: Coefficient
    rate_random_walk: Coefficient


def averaging_factors(count: int, per_decade: int = 10) -> np.ndarray:
    """Whole averaging factors, evenly spaced in their logarithm.

    Args:
        count: Samples of the record; the longest averages have `FEWEST_DIFFERENCES` independent
            spans.
        per_decade: Factors in each decade.

    Returns:
        Increasing, shape (k,).
    """
    largest = max(count // FEWEST_DIFFERENCES, 1)
    return np.unique(
        np.round(
            np.logspace(0, np.log10(largest), max(int(per_decade * np.log10(largest)), 1) + 1)
        ).astype(int)
    )


def allan_deviation(
    signal: np.ndarray, rate: float, factors: np.ndarray | None = None
) -> AllanCurve:
    """Overlapping Allan deviation of a rate-like signal.

    Args:
        signal: Evenly sampled, shape (n,), in any unit.
        rate: Samples a second [Hz].
        factors: Averaging times in samples, shape (k,); ten a decade if None.

    Raises:
        ValueError: Fewer than 3 samples.
    """
    if len(signal) < 3:
        raise ValueError(f"an Allan deviation needs at least 3 samples, not {len(signal)}")
    factors = averaging_factors(len(signal)) if factors is None else factors
    phase = np.zeros(len(signal) + 1)
    np.cumsum(signal - signal.mean(), out=phase[1:])
    phase /= rate
    deviation = np.array(
        [np.sqrt(_mean_square_of_second_differences(phase, int(m)) / 2) * rate / m for m in factors]
    )
    tau = factors / rate
    slope = _smooth_slope(np.log(tau), np.log(np.maximum(deviation, 1e-300)))
    edf = np.array([_edf(len(phase), int(m), s) for m, s in zip(factors, slope, strict=True)])
    lower = deviation * np.sqrt(edf / chdtri(edf, 0.1585))
    upper = deviation * np.sqrt(edf / chdtri(edf, 0.8415))
    return AllanCurve(tau, deviation, lower, upper, edf)


@njit(cache=True)
def _mean_square_of_second_differences(phase: np.ndarray, m: int) -> float:
    """Mean of (x[i + 2m] - 2 x[i + m] + x[i])^2 over the phase, shape (n,).

    A compiled sum: NumPy's dot product would start the threads of BLAS, which spin for longer than
    it takes.
    """
    count = len(phase) - 2 * m
    total = 0.0
    for i in range(count):
        total += (phase[i + 2 * m] - 2 * phase[i + m] + phase[i]) ** 2
    return total / count


def fit_noise(curve: AllanCurve) -> NoiseCoefficients:
    """Noise coefficients of an Allan curve, with their standard uncertainties; none is negative."""
    tau, variance = curve.tau, curve.deviation**2
    design = np.column_stack([3 / tau**2, 1 / tau, np.full(len(tau), FLICKER), tau / 3])
    expected = variance
    solution = np.zeros(4)
    covariance = np.eye(4)
    for _ in range(
        3
    ):  # weights from the fit, not from the scatter: a low estimate must not weigh more
        weight = np.sqrt(curve.edf / 2) / expected
        scale = np.linalg.norm(design * weight[:, None], axis=0)
        solution = _nonnegative(design * weight[:, None] / scale, variance * weight) / scale
        expected = np.clip(design @ solution, variance / 2, variance * 2)
        weighted = design * (np.sqrt(curve.edf / 2) / expected)[:, None]
        # Averaging times share their data: the scatter of fits is that of three points in two
        # decades.
        shared = (
            max(len(tau) / max(1.5 * np.log10(tau[-1] / tau[0]), 1), 1) if len(tau) > 1 else 1.0
        )
        size = np.linalg.norm(weighted, axis=0)
        covariance = (
            np.linalg.pinv((weighted / size).T @ (weighted / size)) / np.outer(size, size) * shared
        )
    values = np.sqrt(solution[1:])
    sds = np.sqrt(np.diag(covariance)[1:])
    # sd of a root: sd / (2 root), or the root of the sd where the value itself is nil
    roots = [
        float(sd / (2 * value)) if value**2 > sd else float(np.sqrt(sd))
        for value, sd in zip(values, sds, strict=True)
    ]
    white, flicker, walk = (Coefficient(float(v), sd) for v, sd in zip(values, roots, strict=True))
    return NoiseCoefficients(white, flicker, walk)


def _nonnegative(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The x without negative parts that makes |A x - b| least, shapes (n, k) and (n,) to (k,).

    Lawson & Hanson, Solving Least Squares Problems, 1974, section 23.3.

    `scipy.optimize.nnls` does the same, in a package that takes a quarter of a second to load.
    """
    count = A.shape[1]
    x, free = np.zeros(count), np.zeros(count, dtype=bool)
    least = 1e-12 * float(np.abs(A.T @ b).max())
    for _ in range(3 * count):
        gain = np.where(free, -np.inf, A.T @ (b - A @ x))
        if not gain.max() > least:
            break
        free[np.argmax(gain)] = True
        while True:
            wanted = np.zeros(count)
            wanted[free] = np.linalg.lstsq(A[:, free], b, rcond=None)[0]
            negative = free & (wanted <= 0)
            if not negative.any():
                break
            # As far towards what is wanted as no part becomes negative; the first to vanish stays.
            share = x[negative] / (x[negative] - wanted[negative])
            x += share.min() * (wanted - x)
            free &= ~(negative & (x <= 1e-15 * float(np.abs(x).max())))
        x = wanted
    return x


def _smooth_slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Slope of y over x about each point, over a decade, shapes (k,).

    Single points scatter too much to tell a noise type.
    """
    if len(x) < 3:
        return np.full(len(x), -0.5)
    near = np.abs(x[:, None] - x[None, :]) <= max(np.log(10) / 2, 1.5 * float(np.max(np.diff(x))))
    weight = near / near.sum(axis=1, keepdims=True)
    centred = x[None, :] - (weight @ x)[:, None]
    return np.asarray(np.sum(weight * centred * y, axis=1) / np.sum(weight * centred**2, axis=1))


def _edf(phases: int, m: int, slope: float) -> float:
    """Equivalent degrees of freedom of the overlapping estimate (NIST SP 1065, table 5).

    Args:
        phases: Samples of the integrated signal.
        m: Averaging factor.
        slope: Of the logarithm of the deviation, which tells the noise type.
    """
    n = phases
    if (
        slope < -0.75 and m < 10
    ):  # quantisation or white phase noise, which only short averages show
        edf = (n + 1) * (n - 2 * m) / (2 * (n - m))
    elif slope < -0.25:  # white noise of the signal
        edf = (3 * (n - 1) / (2 * m) - 2 * (n - 2) / n) * 4 * m**2 / (4 * m**2 + 5)
    elif slope < 0.25:  # flicker
        edf = 2 * (n - 2) ** 2 / (2.3 * n - 4.9) if m == 1 else 5 * n**2 / (4 * m * (n + 3 * m))
    else:  # random walk of the signal
        edf = (n - 2) / m * ((n - 1) ** 2 - 3 * m * (n - 1) + 4 * m**2) / (n - 3) ** 2
    return max(float(edf), 1.0)
