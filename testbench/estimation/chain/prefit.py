"""Where the sensors really sit, by the innovations of the chain filter (maximum a posteriori).

The filter runs with the placement as it is believed and says what every innovation would owe to an
error of it (`effect.PlacementEffect`). The regression of the innovations on that, with the prior,
is a step of Gauss and Newton; the next run starts from there.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from testbench.estimation.chain.blur import blurred
from testbench.estimation.chain.effect import PlacementEffect
from testbench.estimation.chain.placement import Constants, moved
from testbench.estimation.chain.run import ChainSamples, run_filter
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import FilterSettings

STEPS, SETTLED = 15, 0.3
"""Runs at most; and a step below this part of what remains uncertain is the last [1]."""
TUNED = 3
"""In so many runs, the first ones, the process noise is sought."""
HELD = 0.5
"""A constant of which more than this part of its prior standard deviation is left is held by the
prior: the motion hardly tells it [1].
"""


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

    @property
    def sd(self) -> np.ndarray:
        """Standard deviations that are left, shape (p,)."""
        return np.sqrt(np.diag(self.constants.covariance))

    @property
    def held(self) -> list[str]:
        """What the prior holds, in words, sensor by sensor."""
        free = self.sd > HELD * self.constants.sd
        own = free[: 6 * len(self.sensors.sensors)].reshape(-1, 2, 3)
        named = [
            f"{what} of {name} along {' and '.join(itertools.compress('xyz', axes))}"
            for name, pair in zip(self.sensors.sensors, own, strict=True)
            for what, axes in zip(("turn", "place"), pair, strict=True)
            if axes.any()
        ]
        lengths = free[6 * len(self.sensors.sensors) :]
        return named + [
            f"length before {joint}"
            for joint, on in zip(self.constants.names, lengths, strict=True)
            if on
        ]

    def facts(self) -> dict[str, Any]:
        """As they stand in estimate.json: by sensor and, of lengths, by the joint at the end."""
        names = self.sensors.sensors
        values, sds = (x[: 6 * len(names)].reshape(-1, 2, 3) for x in (self.values, self.sd))
        lengths = zip(
            self.constants.names,
            100 * self.values[6 * len(names) :],
            100 * self.sd[6 * len(names) :],
            strict=True,
        )
        return {
            "settled": self.settled,
            "sensors": {
                name: {
                    "rotation_vector_deg": np.degrees(value[0]).tolist(),
                    "rotation_sd_deg": np.degrees(sd[0]).tolist(),
                    "position_mm": (1000 * value[1]).tolist(),
                    "position_sd_mm": (1000 * sd[1]).tolist(),
                }
                for name, value, sd in zip(names, values, sds, strict=True)
            },
            "lengths": {
                joint: {"percent": float(value), "sd_percent": float(sd)}
                for joint, value, sd in lengths
            },
            "held": self.held,
        }


def most_probable(
    effect: PlacementEffect, constants: Constants, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The constants by the innovations of one run, and their covariance.

    Args:
        effect: Of the constants on the run.
        constants: With their prior about zero.
        values: Those that the run was made with, shape (p,).

    Returns:
        Step from the values, shape (p,), and covariance, shape (p, p).
    """
    prior = np.diag(constants.sd**-2.0)
    covariance = np.linalg.inv(effect.information + prior)
    return covariance @ (effect.score - prior @ values), covariance


def fit_placement(
    sensors: ChainSensors,
    settings: FilterSettings,
    samples: ChainSamples,
    constants: Constants,
    tune: Callable[[ChainSensors, FilterSettings], FilterSettings],
) -> PlacementFit:
    """Fit the placement to samples.

    Each run takes its readings for as noisy as the last step, of which the next error is a part,
    would make them (`blur.blurred`): at first that is the prior. So the filter follows the motion
    though its sensors sit elsewhere, which a step of Gauss and Newton needs, and the last runs are
    those of the noise alone.

    Args:
        sensors: As stated.
        settings: Of the filter, which must hold for any motion (`harmonics` 0).
        samples: From a rest on.
        constants: Which to fit, with their prior.
        tune: Gives settings their process noise, with sensors where they are.
    """
    values, placed = np.zeros(len(constants.sd)), sensors
    step, settled = constants.sd, False
    for number in range(STEPS):
        noise = blurred(settings.noise, samples, *_off(sensors, constants, step))
        own = replace(settings, noise=noise)
        if number < TUNED:
            own = tune(placed, own)
            settings = replace(settings, process_noise=own.process_noise)
        motion = run_filter(placed, own, samples, constants)
        step, covariance = most_probable(motion.effect, constants, values)
        values = values + step
        placed = moved(sensors, constants, values)
        settled = number > 0 and bool((np.abs(step) < SETTLED * np.sqrt(np.diag(covariance))).all())
        if settled:
            break
    return PlacementFit(replace(constants, covariance=covariance), values, placed, settled)


def _off(
    sensors: ChainSensors, constants: Constants, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Turn [rad] and shift [m] of each sensor along each axis, RMS, by constants that are off by
    a step; shape (s,) each.
    """
    s = len(sensors.sensors)
    turns, shifts = np.sqrt(np.mean(step[: 6 * s].reshape(s, 2, 3) ** 2, axis=2)).T
    stretched = np.where(constants.lengths >= 0, step[constants.lengths], 0.0)
    longer = stretched * np.linalg.norm(sensors.offsets, axis=2)
    return turns, np.sqrt(shifts**2 + np.sum(longer**2, axis=1) / 3)
