"""A chain of two sensors on a UR3e, and motions drawn from the filter's own models: what the
covariances must be right for.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from testbench.estimation.chain.run import ChainSamples
from testbench.estimation.chain.sensors import ChainSensors, chain_sensors
from testbench.estimation.chain.settings import FilterSettings, SensorNoise
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.robot import load_robot

INTERVAL = 0.01
NOISE = SensorNoise(np.radians(0.1), 0.03, np.radians(0.3), 0.05, 1e-5, 1e-4)
PLACES = {
    "forearm": ("forearm_link", Pose(np.eye(3), np.array([-0.10, 0.03, 0.05]))),
    "hand": ("wrist_3_link", Pose(np.eye(3), np.array([0.0, 0.02, 0.05]))),
}


@pytest.fixture(scope="session")
def kinematics() -> Kinematics:
    return Kinematics(load_robot("ur3e"))


@pytest.fixture(scope="session")
def sensors(kinematics: Kinematics) -> ChainSensors:
    return chain_sensors(kinematics, PLACES, None, kinematics.robot.home)


@pytest.fixture(scope="session")
def measure(sensors: ChainSensors) -> Callable[..., ChainSamples]:
    """Noisy samples of both sensors at times, from joint motions of shape (n, 3, m), with biases
    drawn and walking.
    """

    def make(
        motion: np.ndarray, rng: np.random.Generator, interval: float = INTERVAL, at_rest: int = 100
    ) -> ChainSamples:
        s = len(sensors.sensors)
        bias = np.sqrt(NOISE.bias_variance) * rng.normal(size=(s, 6))
        sd, walk = np.sqrt(NOISE.variance), np.sqrt(NOISE.walk * interval)
        zero = np.zeros(len(sensors.joints))
        rest = (
            sensors.readings(motion[0, 0], zero, zero)[0]
            + bias
            + sd / np.sqrt(at_rest) * rng.normal(size=(s, 6))
        )
        readings = []
        for q, v, a in motion[1:]:
            bias = bias + walk * rng.normal(size=(s, 6))
            readings.append(sensors.readings(q, v, a)[0] + bias + sd * rng.normal(size=(s, 6)))
        n = len(motion) - 1
        return ChainSamples(
            0.0,
            rest,
            np.full(s, at_rest),
            np.repeat(np.arange(1, n + 1) * interval, s),
            np.tile(np.arange(s), n),
            np.concatenate(readings),
        )

    return make


@pytest.fixture(scope="session")
def white_jerk(sensors: ChainSensors, kinematics: Kinematics) -> Callable[..., np.ndarray]:
    """A motion from rest whose jerk is white: q, v and a of every joint, shape (n + 1, 3, m)."""

    def make(n: int, density: float, start_sd: float, rng: np.random.Generator) -> np.ndarray:
        h, m = INTERVAL, len(sensors.joints)
        Q = np.array(
            [
                [h**5 / 20, h**4 / 8, h**3 / 6],
                [h**4 / 8, h**3 / 3, h**2 / 2],
                [h**3 / 6, h**2 / 2, h],
            ]
        )
        F, L = np.array([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]]), np.linalg.cholesky(Q)
        motion = np.zeros((n + 1, 3, m))
        motion[0, 0] = kinematics.robot.home + start_sd * rng.normal(size=m)
        for i in range(n):
            motion[i + 1] = F @ motion[i] + density * L @ rng.normal(size=(3, m))
        return motion

    return make


@pytest.fixture(scope="session")
def settings(kinematics: Kinematics) -> FilterSettings:
    """Of the kinematic state, for motions of `white_jerk` with a density of 300
    deg/s^3/sqrt(Hz).
    """
    return FilterSettings(
        0, [NOISE, NOISE], kinematics.robot.home, np.radians(2.0), np.radians(300.0), limits=False
    )
