"""Run the chain filter over samples, and find the process noise that makes them most likely."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from testbench.estimation.chain.effect import PlacementEffect, no_effect
from testbench.estimation.chain.kernel import ChainReadings, FilterPoint, filter_chain
from testbench.estimation.chain.placement import Constants, no_constants
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import FilterSettings
from testbench.estimation.chain.start import start_state
from testbench.estimation.chain.state import Process, confinement, state_indices
from testbench.model.statistics.intervals import gradient

PROCESS_NOISE = {
    "kinematic": (np.radians(10.0), np.radians(1e5)),
    "fourier": (np.radians(1e-4), np.radians(10.0)),
}
"""Between what values the process noise is sought; units as of FilterSettings."""
GRID, REFINEMENTS, SEARCH_TOLERANCE = 6, 4, 0.1
"""Values tried at first and then at most; the tolerance is of the decimal logarithm."""


@dataclass(frozen=True)
class ChainSamples:
    """Calibrated samples of the sensors on a chain, in order of time.

    Attributes:
        start: When the rest ends and the filter begins [s].
        mean: Mean readings at rest, shape (s, 6) [rad/s], [m/s^2].
        counts: Number of readings behind each mean, shape (s,).
        time: Instants, shape (e,), not decreasing [s].
        sensor: Which of the sensors, shape (e,).
        reading: Rate and force, shape (e, 6) [rad/s], [m/s^2].
        known_change: The changes of a part of a recording, shape (e, 6); see `change`.
    """

    start: float
    mean: np.ndarray
    counts: np.ndarray
    time: np.ndarray
    sensor: np.ndarray
    reading: np.ndarray
    known_change: np.ndarray | None = None

    @property
    def change(self) -> np.ndarray:
        """How fast the readings change, shape (e, 6), which is what a late clock adds.

        By central differences of each sensor's own.
        """
        if self.known_change is not None:
            return self.known_change
        change = np.zeros_like(self.reading)
        for i in range(len(self.counts)):
            own = np.flatnonzero(self.sensor == i)
            if len(own) > 1:
                change[own] = gradient(self.reading[own], self.time[own])
        return change

    def rows(self, begin: int, end: int | None) -> ChainSamples:
        """Some of them, with the changes that they have among all."""
        part = slice(begin, end)
        return replace(
            self,
            time=self.time[part],
            sensor=self.sensor[part],
            reading=self.reading[part],
            known_change=self.change[part],
        )

    def until(self, seconds: float) -> ChainSamples:
        """The first seconds."""
        end = int(np.searchsorted(self.time, self.start + seconds))
        return self.rows(0, end)


class Kept(NamedTuple):
    """States after each of e samples.

    Attributes:
        state: Shape (e, n).
        covariance: Shape (e, n, n).
        sensitivity: To constants of the placement, shape (e, n, p).
    """

    state: np.ndarray
    covariance: np.ndarray
    sensitivity: np.ndarray


@dataclass(frozen=True)
class ChainMotion:
    """What the filter says after each sample.

    Attributes:
        time: Shape (e,) [s].
        mean: Joint angles [rad], rates [rad/s] and accelerations [rad/s^2], shape (e, 3, m).
        sd: Their standard uncertainties, shape (e, 3, m).
        nis: Normalised innovation squared, mean over the readings of a sample, shape (e,).
        likelihood: Logarithm of that of each sample, shape (e,).
        kept: States after each sample; empty unless asked for.
        high: Part of the raised level of process noise that held before each sample, shape (e,).
        last: State and covariance of the filter after the last sample.
        effect: Of constants of the placement, after the last sample.
    """

    time: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    nis: np.ndarray
    likelihood: np.ndarray
    kept: Kept
    high: np.ndarray
    last: tuple[np.ndarray, np.ndarray]
    effect: PlacementEffect


def run_filter(
    sensors: ChainSensors,
    settings: FilterSettings,
    samples: ChainSamples,
    constants: Constants | None = None,
    keep: bool = False,
) -> ChainMotion:
    """Filter samples from the start state on.

    Args:
        sensors: The chain and what sits on it.
        settings: State, noise and start of the filter.
        samples: What the sensors read.
        constants: Of the placement, whose effect is wanted.
        keep: Whether to keep states and covariances.
    """
    point, effect = begin(sensors, settings, samples, constants)
    return continue_filter(sensors, settings, samples, point, effect, keep)


def begin(
    sensors: ChainSensors,
    settings: FilterSettings,
    samples: ChainSamples,
    constants: Constants | None,
) -> tuple[FilterPoint, PlacementEffect]:
    """The filter at rest, and the effect of constants on it; arguments as for `run_filter`."""
    constants = constants or no_constants(sensors)
    start = start_state(sensors, settings, samples.mean, samples.counts, len(constants.sd))
    point = FilterPoint(start.x, start.P, settings.levels(), samples.start)
    return point, constants.at(start, len(sensors.joints))


def continue_filter(
    sensors: ChainSensors,
    settings: FilterSettings,
    samples: ChainSamples,
    point: FilterPoint,
    effect: PlacementEffect | None = None,
    keep: bool = False,
) -> ChainMotion:
    """Filter samples from a state on.

    Args:
        sensors: The chain and what sits on it.
        settings: State and noise of the filter.
        samples: What the sensors read.
        point: Where the filter stands; its arrays end as those after the last sample.
        effect: Of constants of the placement, likewise; or None.
        keep: Whether to keep states and covariances.
    """
    variance = np.array([noise.variance for noise in settings.noise])[samples.sensor]
    readings = ChainReadings(
        samples.time, samples.sensor, samples.reading, samples.change, variance
    )
    effect = effect or no_effect(len(point.x), len(sensors.joints), sensors.columns.shape)
    mean, sd, nis, likelihood, high, *kept = filter_chain(
        point, process_of(sensors, settings), sensors.arrays, readings, effect, keep
    )
    last = point.x, point.P
    return ChainMotion(samples.time, mean, sd, nis, likelihood, Kept(*kept), high, last, effect)


def process_of(sensors: ChainSensors, settings: FilterSettings) -> Process:
    """How the joints of a chain move by the settings; limits are infinite where none shall hold."""
    m = len(sensors.joints)
    limits = sensors.limits if settings.limits else np.tile([-np.inf, np.inf], (m, 1))
    jerk = settings.jerk(m)
    return Process(
        settings.harmonics,
        state_indices(m, settings.harmonics),
        limits,
        confinement(limits, jerk),
        jerk,
        settings.walk(m),
        settings.raised(m),
    )


def most_likely(
    sensors: ChainSensors, settings: FilterSettings, samples: ChainSamples, since: float
) -> FilterSettings:
    """Settings with the process noise that makes the innovations most likely.

    Maximum likelihood of a state space model (Harvey, Forecasting, Structural Time Series Models
    and the Kalman Filter, 1989, sect. 3.4). A coarse grid finds the highest maximum, a bounded
    search (Brent) between its neighbours refines it.

    Args:
        sensors: The chain and what sits on it.
        settings: All others.
        samples: What the sensors read.
        since: Innovations from here on count [s].
    """
    low, high = np.log10(PROCESS_NOISE["fourier" if settings.harmonics else "kinematic"])
    grid = np.linspace(low, high, GRID)

    def likelihood(exponent: float) -> float:
        motion = run_filter(sensors, replace(settings, process_noise=10**exponent), samples)
        value = motion.likelihood[motion.time >= since].sum()
        return value if np.isfinite(value) else -np.inf

    values = np.array([likelihood(exponent) for exponent in grid])
    best = int(np.argmax(values))
    found = grid[best]
    if 0 < best < GRID - 1:
        from scipy.optimize import minimize_scalar  # a quarter of a second to load

        found = minimize_scalar(
            lambda exponent: -likelihood(exponent),
            bounds=(grid[best - 1], grid[best + 1]),
            method="bounded",
            options={"xatol": SEARCH_TOLERANCE, "maxiter": REFINEMENTS},
        ).x
    return replace(settings, process_noise=float(10**found))
