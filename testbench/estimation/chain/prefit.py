"""Where the sensors really sit, by the innovations of the chain filter (maximum a posteriori).

The filter runs with the placement as it is believed and says what every innovation would owe to an
error of it (`kernel.PlacementEffect`). The regression of the innovations on that, with the prior,
is a step of Gauss and Newton; the next run starts from there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.chain.placement import Constants, moved
from testbench.estimation.chain.run import ChainMotion, ChainSamples, run_filter
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import FilterSettings

STEPS, SETTLED = 6, 0.1
"""Runs at most; and a step below this part of what remains uncertain is the last [1]."""


@dataclass(frozen=True)
class PlacementFit:
    """What innovations say of the placement.

    Attributes:
        constants: With the covariance that is left.
        values: Most probable ones, shape (p,) [rad], [m], [1].
        sensors: Placed by them.
        settled: Whether the last step was small.
    """

    constants: Constants
    values: np.ndarray
    sensors: ChainSensors
    settled: bool


def most_probable(
    motion: ChainMotion, constants: Constants, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The constants by the innovations of one run, and their covariance.

    Args:
        motion: With the effect of the constants.
        constants: With their prior about zero.
        values: Those that the run was made with, shape (p,).

    Returns:
        Step from the values, shape (p,), and covariance, shape (p, p).
    """
    assert motion.effect is not None
    prior = np.diag(constants.sd**-2.0)
    covariance = np.linalg.inv(motion.effect.information + prior)
    return covariance @ (motion.effect.score - prior @ values), covariance


def fit_placement(
    sensors: ChainSensors, settings: FilterSettings, samples: ChainSamples, constants: Constants
) -> PlacementFit:
    """Fit the placement to samples.

    Args:
        sensors: As stated.
        settings: Of the filter, which should hold for any motion (`harmonics` 0).
        samples: From a rest on.
        constants: Which to fit, with their prior.
    """
    values = np.zeros(len(constants.sd))
    settled = False
    for _ in range(STEPS):
        motion = run_filter(moved(sensors, constants, values), settings, samples, constants)
        step, covariance = most_probable(motion, constants, values)
        values = values + step
        settled = bool((np.abs(step) < SETTLED * np.sqrt(np.diag(covariance))).all())
        if settled:
            break
    fitted = replace(constants, covariance=covariance)
    return PlacementFit(fitted, values, moved(sensors, constants, values), settled)
