"""The filter of Quijano & Valencia as its text prints it: derivatives, and motions."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.chain.placement import Constants
from testbench.estimation.chain.run import ChainSamples
from testbench.estimation.chain.sensors import chain_sensors
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.robot import load_robot
from testbench.studies.chain.as_printed import (
    HARMONICS,
    _by_states,
    _model_lengths,
    _predicted,
    run_as_printed,
)

ROBOT = Kinematics(load_robot("squat_2dof"))
SENSORS = chain_sensors(
    ROBOT,
    {name: (name, Pose(np.eye(3), np.array([0.04, 0.0, 0.25]))) for name in ("shank", "thigh")},
    None,
    np.zeros(2),
)


@pytest.mark.parametrize("frequency", [None, 0.5])
def test_the_slopes_are_those_of_the_readings(frequency):
    """By the states, the lengths among them, against central differences."""
    lengths = Constants.of(SENSORS, 0.0, 0.0, 1.0)
    assert len(lengths.names) == 1  # the shank's, between both joints
    m = len(SENSORS.joints)
    motion = m * (2 * HARMONICS + 1) if frequency else 3 * m
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.normal(0, 0.3, motion), 1.1 * _model_lengths(SENSORS, lengths)])
    D = _by_states(m, len(x), 0.7, frequency)
    _, H = _predicted(SENSORS, lengths, x, D)
    numeric = np.empty_like(H)
    for i in range(len(x)):
        step = np.zeros(len(x))
        step[i] = 1e-6
        above, below = (_predicted(SENSORS, lengths, x + s * step, D)[0] for s in (1, -1))
        numeric[:, i] = (above - below) / 2e-6
    np.testing.assert_allclose(H, numeric, atol=1e-6)


def swinging(seconds: float = 30.0):
    """What two perfect sensors read of joints that swing at 0.5 Hz, and the angles."""
    t = np.arange(round(100 * seconds)) / 100
    w = 2 * np.pi * 0.5
    waves = [(0.3, 0.2, 0.4), (0.8, 0.7, 1.1)]  # mean, amplitude, phase
    q, v, a = (
        np.column_stack(columns)
        for columns in zip(
            *[
                (
                    mean + size * np.sin(w * t + phase),
                    w * size * np.cos(w * t + phase),
                    -w * w * size * np.sin(w * t + phase),
                )
                for mean, size, phase in waves
            ],
            strict=True,
        )
    )
    readings = np.array([SENSORS.readings(*row)[0] for row in zip(q, v, a, strict=True)])
    samples = ChainSamples(
        0.0,
        readings[0],
        np.array([10, 10]),
        np.repeat(t, 2),
        np.tile([0, 1], len(t)),
        readings.reshape(-1, 6),
    )
    return samples, q


@pytest.mark.parametrize(("frequency", "most_deg"), [(None, 10.0), (0.5, 5.0)])
def test_it_follows_joints_that_swing(frequency, most_deg):
    samples, q = swinging()
    found = run_as_printed(SENSORS, samples, frequency)
    late = slice(-1000, None)
    error = np.degrees(found.mean[late, 0] - q[late])
    assert np.sqrt(np.mean(error**2)) < most_deg
    assert (found.sd > 0).all()
