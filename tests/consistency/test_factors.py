"""A gyroscope that is wrong by a large factor: it is named as it is, and what it may mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.consistency.factors import names_of_factor
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import GRAVITY, check_samples, of_arrays, simulated

RATE = 100.0


@pytest.fixture(scope="module")
def turned() -> ImuSamples:
    """Turns by 95 deg in 2 s about eight axes, with rests of 2 s between them."""
    rng = np.random.default_rng(1)
    part = np.linspace(0, 1, round(2 * RATE))
    angle = np.radians(95) * (part - np.sin(2 * np.pi * part) / (2 * np.pi))
    pose, rates, forces = Rotation.from_euler("xyz", [10, 5, 30], degrees=True), [], []
    for axis in rng.normal(0, 1, (8, 3)):
        axis = axis / np.linalg.norm(axis)
        turn = pose * Rotation.from_rotvec(np.outer(np.append(np.zeros(200), angle), axis))
        forces.append(turn.inv().apply([0, 0, GRAVITY]))
        rates.append(np.outer(np.gradient(np.append(np.zeros(200), angle), 1 / RATE), axis))
        pose = turn[-1]
    gyr, acc = np.vstack(rates), np.vstack(forces)
    noise = rng.normal(0, 1, (2, *acc.shape))
    return of_arrays(RATE, gyr + 0.004 + 0.002 * noise[0], acc + 0.02 * noise[1])


# 16.4 and 20 times as far is about one, or whole, turns more in each turn by 95 deg
@pytest.mark.parametrize(
    ("times", "says"),
    [
        (8.0, ["8 times too large"]),
        (12.0, ["no unit or range"]),
        (16.4, ["16 times too large", "counts of 16.4"]),
        (20.0, ["no unit or range"]),
        (1 / 8, ["8 times too small"]),
    ],
)
def test_a_large_factor_is_told_as_it_is(turned: ImuSamples, times: float, says: list[str]):
    found = check_samples([replace(turned, gyr=turned.gyr * times)])
    told = [one for one in found if one.code != "consistency.unchecked"]
    assert [one.code for one in told] == ["consistency.gyr_factor"]
    assert told[0].values["factor"] == pytest.approx(1 / times, rel=0.03)
    assert all(text in str(told[0]) for text in says)
    assert "rate" not in told[0].remedy and "time" not in told[0].remedy


def test_a_factor_has_no_name_but_those_that_fit():
    assert names_of_factor(1 / 12) == []
    assert names_of_factor(0.0153) == ["counts of 65.5 to a deg/s taken for deg/s"]
    assert names_of_factor(1.02 / 57.3)[0] == "deg/s taken for rad/s"


@pytest.mark.parametrize("seed", [2, 8])
def test_a_lever_blurs_no_factor_that_is_one_of_time(seed: int):
    right = simulated(seed).samples
    counts = replace(
        right,
        device_time_ns=right.device_time_ns // 10,
        host_time_ns=right.host_time_ns // 10,
    )
    told = [one for one in check_samples([counts]) if one.code != "consistency.unchecked"]
    assert [one.code for one in told] == ["consistency.gyr_or_time_unit"]
    assert told[0].values["factor"] == 10
