"""Accelerations of a swinging body feign a gain of the gyroscope that is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from testbench.consistency.excerpt import thin
from testbench.consistency.fits import Pair
from testbench.consistency.swings import is_explained
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import GRAVITY, check_samples, of_arrays, simulated

RATE = 100.0


def pendulum(length: float, lever: float, seed: int = 33) -> ImuSamples:
    """A free point pendulum after a rest, let go at 50 deg: a sensor at a distance from its pivot.

    The forces are those of mechanics in polar coordinates: no formula is shared with the checks.
    """
    time = np.arange(0, 60, 1 / RATE)
    pull = GRAVITY / length
    state = [np.radians(50), 0.0]
    solved = solve_ivp(
        lambda t, y: [y[1], -pull * np.sin(y[0]) - 0.02 * y[1]],
        (0, 60),
        state,
        t_eval=time,
        rtol=1e-8,
    )
    angle, rate = solved.y
    faster = -pull * np.sin(angle) - 0.02 * rate
    along = GRAVITY * np.sin(angle) + lever * faster
    inward = GRAVITY * np.cos(angle) + lever * rate**2
    nothing = np.zeros(len(time))
    rest = round(4 * RATE)
    mount = Rotation.random(random_state=seed)
    # x forward, z up along the rod, the turn about -y
    acc = mount.apply(np.column_stack([along, nothing, inward]))
    gyr = mount.apply(np.column_stack([nothing, -rate, nothing]))
    held = mount.apply([GRAVITY * np.sin(angle[0]), 0.0, GRAVITY * np.cos(angle[0])])
    acc = np.vstack([np.tile(held, (rest, 1)), acc])
    gyr = np.vstack([np.zeros((rest, 3)), gyr])
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, 1, (2, *acc.shape))
    return of_arrays(RATE, gyr + 0.002 + 0.0015 * noise[0], acc + 0.025 * noise[1])


@pytest.mark.parametrize("lever", [0.35, 0.4, 0.5])
def test_a_pendulum_is_not_taken_for_a_wrong_scale(lever: float):
    found = check_samples([pendulum(0.8, lever)])
    assert [one.code for one in found] == ["consistency.unchecked"]
    assert "gyroscope against accelerometer: scale" in found[0].values["what"]


def test_a_lever_explains_a_pendulum_but_no_wrong_scale_of_what_a_hand_turns():
    swinging, held = thin([pendulum(0.8, 0.4)]), thin([simulated(4).samples])
    assert swinging is not None and held is not None
    pair = Pair.of(swinging, swinging.acc, 0.01)
    assert pair is not None and is_explained(pair, 0.5, np.zeros(3))
    seconds = held.interval_ns * held.samples / 1e9
    other = Pair.of(replace(held, gyr=2 * held.gyr), held.acc, seconds)
    assert other is not None and not is_explained(other, 0.5, np.zeros(3))
