"""Whether a truth is that of the sensor, as it was read: angular rates of both, in any frames.

A quaternion read with its scalar at the wrong end, or the wrong way round, still turns as fast as
the right one: both mistakes are its conjugate between two fixed rotations. What changes is about
which axis it turns. So the gyroscope's rates are turned onto the truth's by the best rotation
(Kabsch 1976), for each reading, and for the truths of other sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.alignment.axes import true_rates
from testbench.estimation.signals.rates import rest_reading
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.windows import moving_mean
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples, Truth

MOST_SAMPLES = 20_000
OVER_S = 0.1
"""Rates are compared as means over so long [s]."""
LEAST_RATE = np.radians(5.0)
"""RMS rate of a motion that tells readings apart [rad/s]."""
LEAST_ACROSS = 0.02
"""Part of the variance of the rates that must lie across their main axis: about one axis every
reading fits [1].
"""
BELONGS, FITS = 0.95, 0.9
"""Part of the variance that a truth of the sensor explains at least, and one that is named in its
place [1].
"""
BETTER = 4.0
"""What is named must leave so many times less unexplained [1]."""
NEAR = np.radians(30.0)
"""A mounting that turns by less is the one that is believed [rad]."""


@dataclass(frozen=True)
class RateFit:
    """How well a gyroscope's rates fit those of a truth.

    Attributes:
        explained: Part of the variance, the rates turned by the best rotation [1].
        mounting: Angle of that rotation [rad].
        magnitudes: Correlation of the magnitudes, which no axis or reading changes [1].
    """

    explained: float
    mounting: float
    magnitudes: float


def fit_rates(
    samples: ImuSamples, time_ns: np.ndarray, truth: Truth, least_across: float = LEAST_ACROSS
) -> RateFit | None:
    """Turn a sensor's rates onto those of a truth.

    Args:
        samples: Of the sensor.
        time_ns: Instants that the rates are of, increasing, shape (n,) [ns].
        truth: Whose rates they may be.
        least_across: Part of the variance that must lie across the main axis [1].

    Returns:
        The fit; None where the motion tells nothing: too slow, or about one axis.
    """
    spaced = truth.host_time_ns[1:] - truth.host_time_ns[:-1]
    if len(spaced) < 10 or len(time_ns) < 20:
        return None
    step = median_interval(time_ns) / NANOSECONDS
    over = max(OVER_S, float(np.median(spaced)) / NANOSECONDS)
    count = max(round(over / max(step, 1e-6)) // 2 * 2 + 1, 1)
    known = np.isfinite(samples.gyr).all(axis=1)
    if known.sum() < 20:
        return None
    without_bias = samples.gyr - rest_reading(samples.gyr[known])
    gyr = moving_mean(np.where(known[:, None], without_bias, 0.0), count)
    gyr[moving_mean(known, count) < 0.999] = np.nan
    pick = np.unique(np.linspace(0, len(gyr) - 1, min(len(gyr), MOST_SAMPLES)).round().astype(int))
    rate, sound = true_rates(replace(truth, rate=None), time_ns[pick], count * step)
    sound &= np.isfinite(gyr[pick]).all(axis=1)
    if sound.sum() < 20:
        return None
    read, true = gyr[pick][sound], rate[sound]
    spread = np.sort(np.linalg.eigvalsh(true.T @ true / len(true)))
    if spread.sum() < LEAST_RATE**2 or spread[1] < least_across * spread.sum():
        return None
    profile = true.T @ read
    R = rotation.nearest_rotation(profile)
    gain = float(np.sum(R * profile) / max(float(np.sum(read**2)), 1e-30))
    left = float(np.sum((true - gain * read @ R.T) ** 2) / np.sum(true**2))
    lengths = rotation.lengths(true), rotation.lengths(read)
    alike = float(np.corrcoef(*lengths)[0, 1]) if all(np.ptp(own) > 0 for own in lengths) else 0.0
    return RateFit(1 - left, float(rotation.angle(rotation.from_matrix(R))), alike)


def misread(samples: ImuSamples, time_ns: np.ndarray, truth: Truth, fit: RateFit) -> Finding | None:
    """The order or direction that a truth should have been read in; None where neither helps.

    Args:
        samples: Of the sensor.
        time_ns: Instants that its rates are of, increasing, shape (n,) [ns].
        truth: As read.
        fit: Of the truth as read.
    """
    if fit.explained >= BELONGS:
        return None
    q = truth.q_world_from_sensor
    readings = {
        "xyzw": np.roll(q, 1, axis=1),  # what was read as w x y z is x y z w
        "wxyz": np.roll(q, -1, axis=1),
        "direction": rotation.conjugate(q),
    }
    fits = {
        name: found
        for name, reread in readings.items()
        # walking turns about little more than one axis once it is read right
        if (found := fit_rates(samples, time_ns, replace(truth, q_world_from_sensor=reread), 0.0))
        and _better(found, fit)
    }
    if not fits:
        return None
    nearest = min(fits, key=lambda name: fits[name].mounting)
    code = "truth.direction" if nearest == "direction" else "truth.order"
    if fits[nearest].mounting > NEAR:
        code = "truth.order_or_direction"
    return finding(
        code,
        remedy=nearest,
        as_read_percent=100 * max(fit.explained, 0.0),
        percent=100 * fits[nearest].explained,
    )


def confused(
    samples: ImuSamples,
    time_ns: np.ndarray,
    own: RateFit | None,
    others: Mapping[str, tuple[Truth, np.ndarray | None]],
    least_across: float = LEAST_ACROSS,
) -> Finding | None:
    """Which other sensor's truth is that of a sensor; None where none is.

    Args:
        samples: Of the sensor.
        time_ns: Instants that its rates are of, increasing, shape (n,) [ns].
        own: How well its own truth fits.
        others: Truths of other sensors, by name, each with the instants by a clock that was fitted
            to it, shape (n,) [ns], or None to take those above.
        least_across: Part of the variance that must lie across the main axis [1].
    """
    explained = own.explained if own is not None else 0.0
    found: dict[str, RateFit] = {}
    for name, (truth, instants) in others.items():
        fit = fit_rates(samples, time_ns if instants is None else instants, truth, least_across)
        if fit is not None and _better(fit, RateFit(explained, 0.0, 0.0)):
            found[name] = fit
    if not found:
        return None
    other = max(found, key=lambda name: found[name].explained)
    return finding(
        "truth.of_another",
        other=other,
        percent=100 * found[other].explained,
        own_percent=100 * max(explained, 0.0),
    )


def _better(fit: RateFit, than: RateFit) -> bool:
    return fit.explained > FITS and BETTER * (1 - fit.explained) < 1 - than.explained
