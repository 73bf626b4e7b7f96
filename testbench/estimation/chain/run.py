"""Run the chain filter over samples: forwards, backwards where a smoother is wanted, and find how lively the joints are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from testbench.estimation.chain.kernel import filter_chain
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import FilterSettings
from testbench.estimation.chain.start import start_state
from testbench.estimation.chain.state import state_indices

LIVELINESS = {"kinematic": (np.radians(10.0), np.radians(1e5)), "fourier": (np.radians(1e-4), np.radians(10.0))}
"""Between what values the liveliness is sought; units as of FilterSettings."""
SEARCH_TOLERANCE = 0.1
"""Of the decimal logarithm of the liveliness."""


@dataclass(frozen=True)
class ChainSamples:
    """Calibrated samples of the sensors on a chain, in order of time.

    Attributes:
        start: When the rest ends and the filter begins [s]. mean, counts: Mean readings at rest, shape (s, 6), and how many.
        time: Instants, shape (e,), not decreasing [s]. sensor: Which of the sensors, shape (e,). reading: Rate and force, shape
        (e, 6) [rad/s], [m/s^2]; NaN where only one of the triads was read at that instant.
    """

    start: float
    mean: np.ndarray
    counts: np.ndarray
    time: np.ndarray
    sensor: np.ndarray
    reading: np.ndarray

    def until(self, seconds: float) -> ChainSamples:
        """The first seconds."""
        end = int(np.searchsorted(self.time, self.start + seconds))
        return replace(self, time=self.time[:end], sensor=self.sensor[:end], reading=self.reading[:end])


@dataclass(frozen=True)
class ChainMotion:
    """What the filter says after each sample.

    Attributes:
        time: Shape (e,) [s]. mean, sd: Joint angles, rates and accelerations with standard uncertainties, shape (e, 3, m).
        nis: Normalised innovation squared, mean over the readings of a sample, shape (e,). likelihood: Its logarithm.
        state, covariance: Shapes (e, n) and (e, n, n); empty unless asked for. factors: Of the process noise before each.
    """

    time: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    nis: np.ndarray
    likelihood: float
    state: np.ndarray
    covariance: np.ndarray
    factors: np.ndarray


def run_filter(sensors: ChainSensors, settings: FilterSettings, samples: ChainSamples, keep: bool = False) -> ChainMotion:
    """Filter samples from the start state on.

    Args:
        keep: Whether to keep states and covariances.
    """
    x, P = start_state(sensors, settings, samples.mean, samples.counts)
    return continue_filter(sensors, settings, samples, x, P, samples.start, settings.levels(), keep)


def continue_filter(
    sensors: ChainSensors,
    settings: FilterSettings,
    samples: ChainSamples,
    x: np.ndarray,
    P: np.ndarray,
    start: float,
    levels: np.ndarray,
    keep: bool = False,
) -> ChainMotion:
    """Filter samples from a state on; x, P and levels are changed in place to those of the last sample."""
    m = len(sensors.joints)
    variance = np.array([noise.variance for noise in settings.noise])[samples.sensor]
    limits = sensors.limits if settings.limits else np.tile([-np.inf, np.inf], (m, 1))
    mean, sd, nis, likelihood, factors, states, covariances = filter_chain(
        x, P, settings.harmonics, state_indices(m, settings.harmonics), sensors.arrays, sensors.gravity, limits, start,
        samples.time, samples.sensor, samples.reading, variance, settings.jerk(m), settings.walk(m), levels, keep,
    )  # fmt: skip
    return ChainMotion(samples.time, mean, sd, nis, likelihood, states, covariances, factors)


def most_likely(sensors: ChainSensors, settings: FilterSettings, samples: ChainSamples) -> FilterSettings:
    """Settings with the liveliness that makes the innovations most likely (maximum likelihood of a state space model; Harvey,
    Forecasting, Structural Time Series Models and the Kalman Filter, 1989, sect. 3.4).

    The likelihood has one maximum wherever we looked; the search is bounded and scalar (Brent's).
    """
    low, high = np.log10(LIVELINESS["fourier" if settings.harmonics else "kinematic"])

    def cost(exponent: float) -> float:
        likelihood = run_filter(sensors, replace(settings, liveliness=10**exponent), samples).likelihood
        return -likelihood if np.isfinite(likelihood) else 1e300

    found = minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": SEARCH_TOLERANCE})
    return replace(settings, liveliness=float(10**found.x))
