"""Time alignment: a sensor's clock against the host's, from the magnitude of the angular rate.

The magnitude does not depend on any frame, so it needs neither heading nor mounting, and
orientations give it whatever their signs. A coarse offset comes from cross-correlation, near the
arrival times where both were recorded by one host, else over every overlap of the two records; then
offset and drift (with the gyroscope's gain) from least squares by Gauss-Newton, to a fraction of a
sample; a truth of low rate is met by averaging the sensor over the same interval.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.signals.clock_certainty import by_clusters, of_a_noisy_truth
from testbench.estimation.signals.common_motion import (
    DECISIVE,
    CommonMotion,
    Shift,
    find_common_motion,
    worse_by,
)
from testbench.estimation.signals.rates import RateMagnitude, sensor_rate, truth_rate
from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import gradient, median_interval
from testbench.model.windows import moving_mean
from testbench.records.results.estimate import ClockFit
from testbench.records.session.samples import ImuSamples, Truth

GRID_S = 0.01
SEARCH_S = 3.0
"""The coarse search looks this far on either side of what the arrival times say."""
LEAST_RATE = np.radians(2.0)
"""A record whose fastest motion stays below this says nothing of time [rad/s]."""
ITERATIONS = 60
SLOPE_OVER_S = 0.2
"""The slope of the truth's rate is that of its mean over so long [s]: of orientations with noise
the rates are mostly noise, and their slope would pull the fit and promise too much.
"""
SPANS_S = (0.1, 0.2, 0.4)
"""Rates of orientations are compared as means over one of these, too [s]."""
LEAST_SPANS = 20.0
"""The truth must last for so many of them [1]."""
SHORTER = 0.7
"""What is left of a step where the last one led away [1]."""
MOST_POINTS = 400_000
"""More rates than this are thinned out: hours of them say no more of two numbers."""
TWIN_RATES = 3.0
"""A truth that turns this many times faster than the sensor ever does has jumped there [1]."""
LEAST_EXPLAINED = 0.36
"""Part of the variance of the sensor's rates that a fit must explain where nothing else ties the
clocks together: a correlation of 0.6 [1].
"""
OWN_ERRORS = 1e-3
"""Part of the variance of the rates that errors of the sensor take at any shift: two fits that part
by less explain alike [1].
"""
CLEARLY_MORE = 1.3
"""And a shift is only ruled out if it leaves so many times as much: noise of a truth makes its
small rates too large, which is no noise of the fit and favours shifts of a decaying motion [1].
"""
MOST_OF_RIVALS = 10_000
"""Rates by which rival shifts are held against one another."""
MOST_NAMED = 4
"""Rival shifts that are named."""
SAME_S = 0.05
"""Fits that end so near to one another are one [s]."""
UNIT_FACTORS = (1e-3, 1e3, 1e-6, 1e6, 1e-9)
"""By which times are wrong that were read in another unit than theirs [1]."""
RATE_FACTORS = (1 / 2, 2.0, 5 / 6, 6 / 5, 4 / 5, 5 / 4, 2 / 3, 3 / 2, 1 / 4, 4.0)
"""By which times are wrong that were made of frames at another rate than the cameras ran at: those
of 24, 25, 30, 50, 60, 100, 120, 200, 240 Hz are in these proportions [1].
"""
LIKE_ONE_MOTION = 0.9
"""Rates correlate by as much where a factor is named: of several that are tried one may fit by
chance [1].
"""
FURTHEST_SPAN = 20.0
"""Records whose spans differ by a greater factor may be in different units [1]."""
PART_ERROR_S = 50e-6
"""What the part's own cross-axis and g-sensitivity errors may do to the offset in every move alike
[s]; from simulation.
"""
MOST_DRIFT = 0.01
"""No clock drifts by more: the fit has lost its way [1]."""


def fit_clock(
    samples: ImuSamples,
    truth: Truth | None,
    rate_delay: float = 0.0,
    common_host: bool = True,
    near: bool = False,
) -> ClockFit:
    """Fit the sensor's clock to the host's.

    Args:
        samples: Of the sensor.
        truth: Its rates or orientations; None or motionless leaves only the arrival times.
        rate_delay: How much older than its time stamp an angular rate is [s]: half an interval for
            a sensor that integrates on board.
        common_host: Whether one host saw the samples and the truth arrive; else each may have begun
            at any time, and every overlap is looked at.
        near: Whether the truth's times are known well enough to choose between shifts that fit
            alike.

    Returns:
        The fit; its method is "angular_rate", or "arrival" where nothing can be fitted, with the
        reason: then it is late by the unknown latency, or without a common host unknown.
    """
    arrival = _fit_arrival(samples)
    if truth is None or len(samples) < 10:
        return arrival
    true, measured = truth_rate(truth), sensor_rate(samples)
    if len(true.time) < 10 or len(measured.time) < 10:
        return replace(arrival, refused="unknown")
    true = _without_jumps(true, measured)
    if len(true.time) < 10 or (common_host and true.rate.max() < LEAST_RATE):
        return replace(arrival, refused="still")
    # the rate between two orientations is not late
    delay = rate_delay if measured.width == 0 else 0.0
    # A device's clock may count from anywhere; about its own beginning offset and drift are far
    # from singular.
    zero = float(measured.time[0]) - float(true.time[0])
    measured = replace(measured, time=measured.time - zero - delay)
    if not common_host:
        return fit_anywhere(measured, true, arrival, zero, near)
    measured = _averaged(measured, true.width).thinned(MOST_POINTS)
    drift = 1e-6 * arrival.drift_ppm
    offset = arrival.offset_s - zero
    lag = _coarse_lag((measured.time - offset) / (1 + drift), measured.rate, true)
    fit = _refine(measured, true, offset + lag, drift)
    return (
        replace(arrival, refused="no common motion")
        if fit is None
        else replace(fit, offset_s=fit.offset_s + zero)
    )


def fit_anywhere(
    measured: RateMagnitude, true: RateMagnitude, arrival: ClockFit, zero: float, near: bool
) -> ClockFit:
    """The fit where nothing is known of when each record began; see `fit_clock`.

    Args:
        measured: By the sensor.
        true: On the host's clock.
        arrival: What the times say as they were read.
        zero: Taken off the sensor's times [s].
        near: As for `fit_clock`.
    """
    factor = _unit_factor(measured, true)
    if factor is not None:
        return replace(arrival, refused="unit", unit_factor=factor)
    if min(measured.rate.max(), true.rate.max()) < LEAST_RATE:
        return replace(arrival, refused="still")
    measured = _averaged(measured, true.width)
    found = find_common_motion(measured, true)
    stated = arrival.offset_s - zero
    if not found.shifts:
        factor = _rate_factor(measured, true)
        if factor is not None:
            return replace(arrival, refused="unit", unit_factor=factor)
        return replace(arrival, refused="no common motion", correlation=found.correlation)
    fits = _fitting_alike(measured, true, found)
    if not fits:
        return replace(arrival, refused="no common motion", correlation=found.correlation)
    # Shifts are named as what is to be added to the truth's times as they were read.
    begin = float(measured.time[0])
    shifts = [begin - (begin - fit.offset_s) / (1 + 1e-6 * fit.drift_ppm) - stated for fit in fits]
    chosen = 0
    if len(shifts) > 1:
        chosen = int(np.argmin(np.abs(shifts)))
        others = np.delete(shifts, chosen)
        if not near or abs(shifts[chosen]) > np.abs(others - shifts[chosen]).min() / 4:
            named = sorted(shifts, key=abs)[:MOST_NAMED]
            return replace(
                arrival, refused="periodic", candidates_s=named, correlation=found.correlation
            )
    fit = fits[chosen]
    return replace(fit, offset_s=fit.offset_s + zero, shift_s=shifts[chosen])


def _fitting_alike(
    measured: RateMagnitude, true: RateMagnitude, found: CommonMotion
) -> list[ClockFit]:
    """Fits at those shifts of which none explains the rates clearly better, the best first.

    Args:
        measured: By the sensor.
        true: On the host's clock.
        found: Shifts that may fit.
    """
    begin = float(measured.time[0])
    thinned = measured.thinned(MOST_POINTS if len(found.shifts) == 1 else MOST_OF_RIVALS)

    def refined(shift: Shift) -> ClockFit | None:
        offset = begin - (begin - shift.lag_s) * (1 + shift.drift)
        return _refine(thinned, true, offset, shift.drift)

    fits = [fit for fit in map(refined, found.shifts) if fit is not None]
    fits = [fit for fit in fits if (fit.correlation or 0.0) ** 2 >= LEAST_EXPLAINED]
    fits.sort(key=lambda fit: -(fit.correlation or 0.0))
    left = np.array([1 - (fit.correlation or 0.0) ** 2 + OWN_ERRORS for fit in fits])
    alike: list[ClockFit] = []
    for fit, unexplained in zip(fits, left, strict=True):
        worse = worse_by(unexplained, float(left[0]), np.asarray(found.independent))
        more = (unexplained - OWN_ERRORS) / max(float(left[0]) - OWN_ERRORS, 1e-9)
        apart = [abs(fit.offset_s - own.offset_s) > SAME_S for own in alike]
        if (worse < DECISIVE or more < CLEARLY_MORE) and all(apart):
            alike.append(fit)
    if len(alike) == 1 and len(thinned.time) < len(measured.time):
        only = alike[0]
        whole = measured.thinned(MOST_POINTS)
        fit_of_all = _refine(whole, true, only.offset_s, 1e-6 * only.drift_ppm)
        return [only if fit_of_all is None else fit_of_all]
    return alike


def _without_jumps(true: RateMagnitude, measured: RateMagnitude) -> RateMagnitude:
    """Without rates that the sensor never comes near: a reference that took one body for another
    jumps.
    """
    fastest = float(np.quantile(measured.rate, 0.999))
    kept = true.rate <= max(TWIN_RATES * fastest, np.radians(30.0))
    if kept.all() or kept.mean() < 0.9:  # a sensor in another unit, or one that hardly turns
        return true
    return replace(true, time=true.time[kept], rate=true.rate[kept])


def _unit_factor(measured: RateMagnitude, true: RateMagnitude) -> float | None:
    """What the truth's times must be multiplied by to fit, if another unit makes them fit."""
    spans = [float(record.time[-1] - record.time[0]) for record in (measured, true)]
    if 1 / FURTHEST_SPAN < spans[0] / spans[1] < FURTHEST_SPAN:
        return None
    for factor in UNIT_FACTORS:
        can_be = 1 / FURTHEST_SPAN < spans[0] / (spans[1] * factor) < FURTHEST_SPAN
        if can_be and _by_factor(measured, true, factor).shifts:
            return factor
    return None


def _rate_factor(measured: RateMagnitude, true: RateMagnitude) -> float | None:
    """What the truth's times must be multiplied by to fit, if another frame rate makes them fit."""
    found = {factor: _by_factor(measured, true, factor) for factor in RATE_FACTORS}
    fitting = {
        factor: own.correlation
        for factor, own in found.items()
        if own.shifts and own.correlation > LIKE_ONE_MOTION
    }
    return max(fitting, key=fitting.__getitem__, default=None)


def _by_factor(measured: RateMagnitude, true: RateMagnitude, factor: float) -> CommonMotion:
    """The motion in common if the truth's times are multiplied by a factor."""
    scaled = RateMagnitude(
        true.time * factor, true.rate / factor, true.width * factor, true.gap * factor
    )
    return find_common_motion(_averaged(measured, scaled.width), scaled)


def _fit_arrival(samples: ImuSamples) -> ClockFit:
    """From the least delayed arrivals, one in each of up to 50 windows."""
    host, device = samples.host_time_ns / NANOSECONDS, samples.device_time_ns / NANOSECONDS
    if len(host) < 2:
        return ClockFit(offset_s=float(device[0] - host[0]) if len(host) else 0.0, method="arrival")
    ahead = device - host
    picks = [
        window[np.argmax(ahead[window])]
        for window in np.array_split(np.arange(len(host)), min(50, len(host) // 2 + 1))
    ]
    enough = len(picks) > 5 and host[-1] - host[0] > 10
    drift, offset = (
        np.polyfit(host[picks], ahead[picks], 1) if enough else (0.0, float(ahead[picks].max()))
    )
    return ClockFit(offset_s=float(offset), drift_ppm=float(drift * 1e6), method="arrival")


def _averaged(measured: RateMagnitude, width: float) -> RateMagnitude:
    """The sensor's rate as a truth sees it that is a mean over `width` [s]."""
    interval = median_interval(measured.time)
    count = round(width / interval)
    rate = moving_mean(measured.rate, count) if count > 1 else measured.rate
    # the centre of an even window lies half a sample before the sample it is assigned to
    shift = interval / 2 if count > 1 and count % 2 == 0 else 0.0
    return RateMagnitude(measured.time - shift, rate, max(width, measured.width), measured.gap)


def _coarse_lag(time: np.ndarray, rate: np.ndarray, true: RateMagnitude) -> float:
    """Seconds that the sensor's time, brought to the host, still lies ahead of the truth."""
    start, end = max(time[0], true.time[0]) - SEARCH_S, min(time[-1], true.time[-1]) + SEARCH_S
    grid = np.arange(start, end, GRID_S)
    a = np.interp(grid, time, rate, left=0, right=0)
    b = np.where(true.known_at(grid), np.interp(grid, true.time, true.rate, left=0, right=0), 0.0)
    size = 1 << (2 * len(grid)).bit_length()  # so long that neither end meets the other
    spectrum = np.fft.rfft(a - a.mean(), size) * np.conj(np.fft.rfft(b - b.mean(), size))
    correlation = np.fft.irfft(spectrum, size)
    longest = min(int(SEARCH_S / GRID_S), len(grid) - 1)
    lags = np.arange(-longest, longest + 1)
    return float(lags[np.argmax(correlation[lags])] * GRID_S)


def _refine(
    measured: RateMagnitude, true: RateMagnitude, offset: float, drift: float
) -> ClockFit | None:
    """The fit by rates as they are, or by means over the span that makes the times surest.

    Rates of orientations hold their noise, the more the shorter the time between them. Means of
    both over longer spans hold less of it, and less of a fast motion. A truth that gives rates is
    taken as it is.
    """
    fastest = float(true.rate.max())
    best = as_it_is = _fitted(measured, true, offset, drift, fastest)
    if best is None or true.width == 0:
        return best
    for span in SPANS_S:
        if span > (true.time[-1] - true.time[0]) / LEAST_SPANS:
            break
        offset, drift = best.offset_s, 1e-6 * best.drift_ppm
        fit = _fitted(measured.smoothed(span), true.smoothed(span), offset, drift, fastest)
        if fit is None or not fit.angle_error_deg < best.angle_error_deg:
            break
        best = fit
    assert as_it_is is not None
    return replace(best, residual_deg_s=as_it_is.residual_deg_s)


# One piece: what is fitted, and how sure that is, share residuals and derivatives.
def _fitted(
    measured: RateMagnitude, true: RateMagnitude, offset: float, drift: float, fastest: float
) -> ClockFit | None:
    """Gauss-Newton on offset, drift and gain.

    Minimises the sum of (rate(t) - gain * truth((t - offset) / (1 + drift)))^2. None where the two
    records drift apart, so that nothing can be compared.
    """
    slope = _smooth_slope(true)
    middle = float(measured.time.mean())
    gain = _first_gain(measured, true, offset, drift)
    residual, jacobian, inside = np.zeros(1), np.eye(3), np.zeros(1, dtype=bool)
    expected = np.zeros(1)
    left, length = np.inf, 1.0
    for _ in range(ITERATIONS):
        host = (measured.time - offset) / (1 + drift)
        inside = true.known_at(host)
        if inside.sum() < 10:
            return None
        expected = np.interp(host[inside], true.time, true.rate)
        by_time = gain * np.interp(host[inside], true.time, slope) / (1 + drift)
        # About the middle of the recording, offset and drift are nearly uncorrelated.
        centred = (measured.time[inside] - middle) / (1 + drift)
        jacobian = np.column_stack([by_time, by_time * centred, -expected])
        residual = measured.rate[inside] - gain * expected
        squares = float(residual @ residual) / len(residual)
        if squares > 1.01 * left:  # faster than the smoothed slope can follow
            if true.width == 0:
                slope = gradient(true.rate, true.time)
            else:  # of orientations that slope is mostly noise, and pulls the fit
                length *= SHORTER
        left = min(left, squares)
        step = length * np.linalg.lstsq(jacobian, -residual, rcond=None)[0]
        drift += step[1]
        offset += step[0] - step[1] * (middle - offset) / (1 + drift)
        gain += step[2]
        if abs(step[0]) < 1e-9 and abs(step[1]) < 1e-12:
            break
    if abs(drift) > MOST_DRIFT:
        return None
    variance = float(residual @ residual) / max(len(residual) - 3, 1)
    rates, time = measured.rate[inside], measured.time[inside]
    if true.width == 0:
        candidates = [variance * np.linalg.pinv(jacobian.T @ jacobian)]
        candidates += by_clusters(jacobian, residual, time)
    else:
        candidates = [of_a_noisy_truth(jacobian, residual, time, expected)]

    def sd(direction: list[float], floor: float = 0.0) -> float:
        """The largest of all, and never less than the floor."""
        weights = np.array(direction)
        return float(
            np.sqrt(max(weights @ covariance @ weights for covariance in candidates) + floor**2)
        )

    return ClockFit(
        offset_s=float(offset),
        drift_ppm=float(drift * 1e6),
        offset_sd_s=sd([1.0, -(middle - offset) / (1 + drift), 0.0], PART_ERROR_S),
        drift_sd_ppm=sd([0.0, 1.0, 0.0]) * 1e6,
        residual_deg_s=float(np.degrees(np.sqrt(variance))),
        angle_error_deg=float(np.degrees(fastest)) * sd([1.0, 0.0, 0.0], PART_ERROR_S),
        method="angular_rate",
        correlation=float(np.sqrt(max(1 - variance / max(float(np.var(rates)), 1e-30), 0.0))),
    )


def _smooth_slope(true: RateMagnitude) -> np.ndarray:
    """How fast the truth's rate changes, shape (n,) [rad/s^2]."""
    usual = median_interval(true.time) if len(true.time) > 1 else SLOPE_OVER_S
    half = max(round(SLOPE_OVER_S / 2 / max(usual, 1e-6)) // 2 * 2 + 1, 1)
    # a mean of means: a triangle, which has no sidelobes that let noise through
    smooth = moving_mean(moving_mean(true.rate, half, "held"), half, "held")
    return gradient(smooth, true.time)


def _first_gain(measured: RateMagnitude, true: RateMagnitude, offset: float, drift: float) -> float:
    """By what the truth's rates fit the sensor's at a first guess of the times: a truth in another
    unit of angle is aligned all the same.
    """
    host = (measured.time - offset) / (1 + drift)
    inside = true.known_at(host)
    expected = np.interp(host[inside], true.time, true.rate)
    gain = float(expected @ measured.rate[inside]) / max(float(expected @ expected), 1e-30)
    return gain if gain > 0 else 1.0
