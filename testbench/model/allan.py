"""Allan deviation of a signal at rest, and the noise parameters that data sheets state.

Overlapping Allan deviation with confidence from the equivalent degrees of freedom of the noise type
that the local slope shows (Riley, Handbook of Frequency Stability Analysis, NIST SP 1065, 2008, eq.
11 and table 5); noise coefficients by weighted least squares of sigma^2(tau) = Q^2 3/tau^2 +
N^2/tau + B^2 2 ln 2/pi + K^2 tau/3 (IEEE Std 952-1997, annex C).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.special import chdtri

FLICKER = 2 * np.log(2) / np.pi
LEAST_GAIN = 10.0
"""A low pass is taken where it raises twice the log-likelihood by so much: one more parameter does
by chance once in 600 (Wilks, Ann. Math. Stat. 9, 1938)."""
LONGEST_LOW_PASS_S = 1.0
"""Slower ones than 0.16 Hz are no low pass of a sensor, but a wandering bias [s]."""
LOW_PASSES_PER_DECADE = 25
GAIN_OF_ORDER = 6.0
"""And one of another order than the first by so much more: three others are tried, which one of
them does by chance once in 25."""
COARSE = 3
"""One of so many time constants is tried first."""
FEWEST_FOR_LOW_PASS = 10
"""Averaging times from which on the beginning of a curve has a shape."""
ORDERS = (1, 2, 4, 0)
"""Of the low passes that are tried: an RC, the filters on chips, a sharp one, and a mean."""
HALF_POWER_OF_MEAN = 2 * np.pi * 0.44295
"""Length of a mean in time constants: sinc(f T)^2 is 1/2 at f T = 0.44295."""
DIFFERENCE = 1.05
"""Factor of a time constant by which its derivative is taken: where samples are counted, as in a
mean, a smaller one may change nothing."""
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
        bandwidth_hz: Of the low pass that the white noise went through, None where the curve shows
            none [Hz].
    """

    white: Coefficient
    bias_instability: Coefficient
    rate_random_walk: Coefficient
    bandwidth_hz: float | None = None


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
        # overlapping: every start, not every m-th
        total += (phase[i + 2 * m] - 2 * phase[i + m] + phase[i]) ** 2
    return total / count


def fit_noise(curve: AllanCurve) -> NoiseCoefficients:
    """Noise coefficients of an Allan curve, with their standard uncertainties; none is negative.

    The white noise may have gone through a low pass, which bends the beginning of the curve; that
    is taken where the curve fits clearly better with one. Its shape is a Butterworth filter's of
    some order, or that of a mean over an interval, whichever fits best.
    """
    best = _fitted(curve, LowPass(0.0))
    if best.misfit > LEAST_GAIN:  # else there is not so much to gain
        found = [own for order in ORDERS if (own := _best_low_pass(curve, order)) is not None]
        passed = min(found, key=_with_order, default=best)
        best = passed if passed.misfit < best.misfit - LEAST_GAIN else best
    values = np.sqrt(best.solution[1:])
    sds = np.sqrt(np.diag(best.covariance(curve))[1:4])
    # sd of a root: sd / (2 root), or the root of the sd where the value itself is nil
    roots = [
        float(sd / (2 * value)) if value**2 > sd else float(np.sqrt(sd))
        for value, sd in zip(values, sds, strict=True)
    ]
    white, flicker, walk = (Coefficient(float(v), sd) for v, sd in zip(values, roots, strict=True))
    constant = best.low_pass.time_constant
    bandwidth = 1 / (2 * np.pi * constant) if constant > 0 and white.found else None
    return NoiseCoefficients(white, flicker, walk, bandwidth)


def _with_order(own: _Fitted) -> float:
    """The misfit by which orders are compared: another than the first must show clearly."""
    return own.misfit + (0.0 if own.low_pass.order == 1 else GAIN_OF_ORDER)


def _best_low_pass(curve: AllanCurve, order: int) -> _Fitted | None:
    """The fit with the best low pass of an order; None where the curve is too short for any.

    Every third time constant is tried, and those beside the best of them.
    """
    constants = _time_constants(curve)
    if not len(constants):
        return None
    coarse = range(0, len(constants), COARSE)
    fits = {i: _fitted(curve, LowPass(float(constants[i]), order)) for i in coarse}
    least = min(fits, key=lambda i: fits[i].misfit)
    beside = range(max(least - COARSE + 1, 0), min(least + COARSE, len(constants)))
    fits |= {i: _fitted(curve, LowPass(float(constants[i]), order)) for i in beside}
    return min(fits.values(), key=lambda own: own.misfit)


@dataclass(frozen=True)
class LowPass:
    """A low pass of a sensor.

    Attributes:
        time_constant: 1 / (2 pi f) of the frequency f at which the power is half [s]; 0 for none.
        order: Of a Butterworth filter; 0 for a mean over an interval, as of samples that are
            decimated.
    """

    time_constant: float
    order: int = 1

    @property
    def lasts(self) -> float:
        """How long noise behind it remembers [s]."""
        return (HALF_POWER_OF_MEAN if self.order == 0 else 12.0 * self.order) * self.time_constant

    def autocovariance(self, lag: np.ndarray) -> np.ndarray:
        """Of white noise behind it, 1 at lag 0.

        For Butterworth filters the Fourier transform of 1 / (1 + (w T)^2n) by its residues at the
        poles p above the real axis, -i pi / n sum p exp(i p t); of a mean a triangle.

        Args:
            lag: Times, shape (k,), none below 0 [s].
        """
        t = np.asarray(lag) / self.time_constant
        if self.order == 0:
            return np.asarray(np.maximum(1 - t / HALF_POWER_OF_MEAN, 0.0))
        n = self.order
        poles = np.exp(1j * np.pi * (2 * np.arange(1, n + 1) - 1) / (2 * n))
        value = (-1j * (np.exp(1j * np.multiply.outer(t, poles)) @ poles)).real
        return np.asarray(value / (-1j * poles.sum()).real)


@dataclass(frozen=True)
class _Fitted:
    """The squares of Q, N, B and K for one low pass, and minus twice their log-likelihood."""

    low_pass: LowPass
    solution: np.ndarray
    misfit: float

    def covariance(self, curve: AllanCurve) -> np.ndarray:
        """Of the squares, and of the logarithm of the time constant where there is a low pass."""
        design = _design(curve, self.low_pass)
        expected = np.clip(design @ self.solution, curve.deviation**2 / 2, curve.deviation**2 * 2)
        if self.low_pass.time_constant > 0:
            other = replace(self.low_pass, time_constant=self.low_pass.time_constant * DIFFERENCE)
            slope = (_design(curve, other) - design) @ self.solution / (DIFFERENCE - 1)
            design = np.column_stack([design, slope])
        weighted = design * (np.sqrt(curve.edf / 2) / expected)[:, None]
        size = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
        inverse = np.linalg.pinv((weighted / size).T @ (weighted / size))
        return np.asarray(inverse / np.outer(size, size) * _shared(curve))


def _fitted(curve: AllanCurve, low_pass: LowPass) -> _Fitted:
    design, variance = _design(curve, low_pass), curve.deviation**2
    expected, solution = variance, np.zeros(4)
    for _ in range(
        3
    ):  # weights from the fit, not from the scatter: a low estimate must not weigh more
        weight = np.sqrt(curve.edf / 2) / expected
        scale = np.linalg.norm(design * weight[:, None], axis=0)
        solution = _nonnegative(design * weight[:, None] / scale, variance * weight) / scale
        expected = np.clip(design @ solution, variance / 2, variance * 2)
    ratio = variance / np.maximum(design @ solution, 1e-300)
    misfit = float(np.sum(curve.edf * (ratio - np.log(ratio) - 1))) / _shared(curve)
    return _Fitted(low_pass, solution, misfit)


def _design(curve: AllanCurve, low_pass: LowPass) -> np.ndarray:
    """Allan variance of unit coefficients, shape (k, 4)."""
    tau = curve.tau
    white = 1 / tau * _through_low_pass(tau, float(tau[0]), low_pass)
    return np.column_stack([3 / tau**2, white, np.full(len(tau), FLICKER), tau / 3])


def _through_low_pass(tau: np.ndarray, interval: float, low_pass: LowPass) -> np.ndarray:
    """Allan variance of white noise behind a low pass, as part of that without it.

    Samples of autocovariance r_k, k intervals apart, have sums over m of the variance V(m) = m r_0
    + 2 sum_k (m - k) r_k, and the mean over two neighbouring sums the Allan variance (4 V(m) - V(2
    m)) / (2 m^2). Long averages see the density at 0 Hz, V(m) / m, with all that the sampling folds
    back, and that is 1 here.

    Args:
        tau: Averaging times, shape (k,) [s].
        interval: Between samples [s].
        low_pass: That the noise went through.
    """
    if low_pass.time_constant <= 0:
        return np.ones(len(tau))
    m = np.round(tau / interval).astype(int)
    lasts = max(int(np.ceil(low_pass.lasts / interval)), 1)
    lags = np.arange(1, min(lasts, int(2 * m[-1])) + 1)
    r = low_pass.autocovariance(lags * interval)
    sums, moments = (np.concatenate([[0.0], np.cumsum(part)]) for part in (r, lags * r))

    def spread(count: np.ndarray) -> np.ndarray:
        within = np.minimum(count - 1, len(lags))
        return np.asarray(count * (1 + 2 * sums[within]) - 2 * moments[within])

    return np.asarray((4 * spread(m) - spread(2 * m)) / (2 * m * (1 + 2 * sums[-1])))


def _time_constants(curve: AllanCurve) -> np.ndarray:
    """Time constants of low passes to try [s]."""
    interval = float(curve.tau[0])
    longest = min(LONGEST_LOW_PASS_S, float(curve.tau[-1]) / 3)
    if len(curve.tau) < FEWEST_FOR_LOW_PASS or longest <= interval / 4:
        return np.zeros(0)
    count = max(round(LOW_PASSES_PER_DECADE * np.log10(4 * longest / interval)), 2)
    return np.geomspace(interval / 4, longest, count)


def _shared(curve: AllanCurve) -> float:
    """Averaging times share their data: the scatter of fits is that of three points in two
    decades.
    """
    tau = curve.tau
    if len(tau) < 2:
        return 1.0
    return float(max(len(tau) / max(1.5 * np.log10(tau[-1] / tau[0]), 1), 1))


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
