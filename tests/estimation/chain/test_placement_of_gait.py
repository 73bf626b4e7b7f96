"""A placement in gait, whose jerk is not white: what the accelerations alone tell of it."""

from __future__ import annotations

import numpy as np
import yaml

from testbench.estimation.chain.placement import Constants, moved
from testbench.estimation.chain.prefit import fit_placement
from testbench.estimation.chain.run import ChainSamples, most_likely
from testbench.estimation.chain.sensors import ChainSensors, chain_sensors
from testbench.estimation.chain.settings import FilterSettings, SensorNoise
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.robot import load_robot
from testbench.records.specs.shipped import shipped_folder

NOISE = SensorNoise(np.radians(0.3), 0.015, np.radians(0.1), 0.005, 1e-6, 1e-6)
PLACES = {
    "pelvis": ("pelvis", Pose(np.eye(3), np.array([-0.09, 0.0, 0.05]))),
    "thigh_r": ("thigh_r", Pose(np.eye(3), np.array([0.0, -0.07, -0.2]))),
}
SECONDS, INTERVAL = 20.0, 0.01
PELVIS_TURN = 2
"""Place, among the constants, of the turn of the pelvis's sensor about the vertical."""


def gait(joints: list[str]) -> np.ndarray:
    """Angles, rates and accelerations of the shipped gait, shape (n + 1, 3, m); two seconds to
    begin.
    """
    path = shipped_folder("protocols") / "gait.yaml"
    sections = yaml.safe_load(path.read_text("utf-8"))["sections"]
    centre = sections[1]["steps"][0]["move_to_deg"]
    sweep = sections[-1]["steps"][0]["sweep"]
    time = np.arange(round(SECONDS / INTERVAL) + 1) * INTERVAL
    ramp = np.clip(time / 2.0, 0, 1)
    ramp = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    angles = np.tile(np.radians([centre.get(name, 0.0) for name in joints]), (len(time), 1))
    for i, wave in enumerate(sweep[name]["fourier"] for name in joints):
        for k, (size, phase) in enumerate(
            zip(wave["amplitudes_deg"], wave["phases_deg"], strict=True), 1
        ):
            turn = np.sin(2 * np.pi * k * 0.875 * time + np.radians(phase))
            angles[:, i] += ramp * np.radians(size) * turn
    rates = np.gradient(angles, INTERVAL, axis=0)
    motion = np.stack([angles, rates, np.gradient(rates, INTERVAL, axis=0)], axis=1)
    motion[0, 1:] = 0.0
    return motion


def recorded(sensors: ChainSensors, motion: np.ndarray, seed: int) -> ChainSamples:
    """What noisy sensors read."""
    rng, zero = np.random.default_rng(seed), np.zeros(motion.shape[2])
    sd, shape = np.sqrt(NOISE.variance), (2, 6)
    bias = np.sqrt(NOISE.bias_variance) * rng.normal(size=shape)
    rest = sensors.readings(motion[0, 0], zero, zero)[0] + bias + sd / 10 * rng.normal(size=shape)
    rows = [sensors.readings(*at)[0] + bias + sd * rng.normal(size=shape) for at in motion[1:]]
    time = np.arange(1, len(motion)) * INTERVAL
    return ChainSamples(
        0.0,
        rest,
        np.full(2, 100),
        np.repeat(time, 2),
        np.tile([0, 1], len(time)),
        np.concatenate(rows),
    )


def test_a_turn_that_accelerations_alone_tell_is_found_within_what_is_stated():
    seed = 1
    robot = load_robot("lower_limb")
    sensors = chain_sensors(Kinematics(robot), PLACES, None, robot.home)
    motion = gait(sensors.joints)
    constants = Constants.of(sensors, np.radians(3.0), 0.01)
    values = constants.sd * np.random.default_rng(seed).normal(size=len(constants.sd))
    values[PELVIS_TURN] = np.radians(-5.0)
    samples = recorded(moved(sensors, constants, values), motion, seed)
    settings = FilterSettings(
        0, [NOISE, NOISE], motion[0, 0], np.radians(0.05), np.radians(4000.0), limits=True
    )
    fit = fit_placement(
        sensors,
        settings,
        samples,
        constants,
        lambda at, own: most_likely(at, own, samples, 5.0),
        2.0,
    )
    assert fit.settled
    error = fit.values - values
    # by twice the most likely process noise alone it is 5 deg, and said to be known to 0.5
    assert abs(np.degrees(error[PELVIS_TURN])) < 1.2
    assert np.sqrt(np.mean((error / fit.sd) ** 2)) < 1.6
