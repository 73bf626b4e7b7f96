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
from testbench.estimation.chain.settings import FilterSettings, SensorNoise

STEPS, SETTLED = 15, 0.3
"""Runs at most; and a step below this part of what remains uncertain is the last [1]."""
NEAR = 1.0
"""The same of a step after which the process noise may be the most likely one [1]."""
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
    looser: float = 1.0,
    rigid: bool = True,
) -> PlacementFit:
    """Fit the placement to samples.

    Each run takes its readings for as noisy as the last step, of which the next error is a part,
    would make them (`blur.blurred`): at first that is the prior. So the filter follows the motion
    though its sensors sit elsewhere, which a step of Gauss and Newton needs, and the last runs are
    those of the noise alone.

    A regression on what the filter predicts is biased where innovations are not white: with too
    much process noise the filter runs after its readings, with too little it lags, and what an
    error of placement would do goes with either. So the last runs of a rigid chain, once it is
    near, are by the most likely process noise, at which innovations are whitest. That takes every
    innovation for news, which those of limbs are not; what is left uncertain is that of the looser
    filter before. What a body's readings owe to skin and to axes that are not the model's is no
    process noise, and the most likely one is no whiter there: persons are fitted by the looser one.

    Args:
        sensors: As stated.
        settings: Of the filter, which must hold for any motion (`harmonics` 0).
        samples: From a rest on.
        constants: Which to fit, with their prior.
        tune: Gives settings their most likely process noise, with sensors where they are.
        looser: Process noise of the first runs, and of the covariance, over the most likely one
            [1].
        rigid: Whether the sensors are on rigid links, and not on a body.
    """
    fit = _Fit(sensors, settings, samples, constants)
    step, near = constants.sd, SETTLED if not rigid or looser == 1.0 else NEAR
    for number in range(STEPS):
        noise = blurred(settings.noise, samples, *_off(sensors, constants, step))
        own = replace(fit.settings, noise=noise)
        if number < TUNED:
            fit.settings = looser_than(tune(fit.placed, own), looser)
        step, loose = fit.run(noise)
        if number > 0 and _small(step, loose, near):
            break
    settled = _small(step, loose, near)
    if near > SETTLED:
        fit.settings = tune(fit.placed, replace(fit.settings, noise=settings.noise))
        for _ in range(STEPS):
            step, _ = fit.run(settings.noise)
            settled = _small(step, loose, SETTLED)
            if settled:
                break
    return PlacementFit(replace(constants, covariance=loose), fit.values, fit.placed, settled)


class _Fit:
    """A placement on its way to the most probable one.

    Args:
        sensors: As stated.
        settings: Of the filter.
        samples: From a rest on.
        constants: Which are fitted.

    Attributes:
        settings: Of the filter, with the process noise of the next run.
        values: Of the constants so far, shape (p,).
        placed: The sensors by them.
    """

    def __init__(
        self,
        sensors: ChainSensors,
        settings: FilterSettings,
        samples: ChainSamples,
        constants: Constants,
    ):
        self.settings, self.placed, self.values = settings, sensors, np.zeros(len(constants.sd))
        self._sensors, self._samples, self._constants = sensors, samples, constants

    def run(self, noise: list[SensorNoise]) -> tuple[np.ndarray, np.ndarray]:
        """Take a step of Gauss and Newton, and give it, shape (p,), with the covariance.

        Args:
            noise: That the readings are taken to have.
        """
        settings = replace(self.settings, noise=noise)
        motion = run_filter(self.placed, settings, self._samples, self._constants)
        step, covariance = most_probable(motion.effect, self._constants, self.values)
        self.values = self.values + step
        self.placed = moved(self._sensors, self._constants, self.values)
        return step, covariance


def _small(step: np.ndarray, covariance: np.ndarray, part: float) -> bool:
    """Whether a step, shape (p,), is below a part of what remains uncertain."""
    return bool((np.abs(step) < part * np.sqrt(np.diag(covariance))).all())


def looser_than(settings: FilterSettings, times: float) -> FilterSettings:
    """With so many times the process noise.

    Args:
        settings: Of the filter.
        times: By how much [1].
    """
    return replace(settings, process_noise=times * settings.process_noise)


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
