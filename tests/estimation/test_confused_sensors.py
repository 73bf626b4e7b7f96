"""Two bodies of one walk whose truths were exchanged are named, and those that were not are not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.confused_sensors import name_confused
from testbench.estimation.alignment.true_motion import true_motion
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.samples import ImuSamples, Truth

RATE, SECONDS = 100, 50.0
IMPORTED = SensorRecord(driver="imported")


def legs(seed: int) -> dict[str, tuple[ImuSamples, Truth]]:
    """Both thighs of a person who walks and turns round: alike, half a stride apart."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, SECONDS, 1 / RATE)
    uneven = gaussian_filter1d(rng.standard_normal(len(t)), RATE)
    stride = 2 * np.pi * np.cumsum(0.95 * (1 + 0.03 * uneven / uneven.std())) / RATE
    walks = np.interp(t, [0, 3, 5, SECONDS - 5, SECONDS - 3], [0, 0, 1, 1, 0])
    heading = np.cumsum(np.where(np.sin(0.35 * t) > 0.9, 40, 0)) / RATE
    found = {}
    for name, phase in (("left", 0.0), ("right", np.pi)):
        own = stride + phase
        swing = 25 * np.sin(own) + 6 * np.sin(2 * own + 0.5)
        across = 3 * np.sin(own + 1) + 2 * np.sin(2 * own)
        angles = np.column_stack([heading, swing * walks, across * walks])
        body = Rotation.from_euler("ZYX", angles, degrees=True)
        sensor = body * Rotation.random(rng=rng)
        gyr = (sensor[:-1].inv() * sensor[1:]).as_rotvec() * RATE
        gyr += 0.01 * rng.standard_normal(3) + 0.005 * rng.standard_normal(gyr.shape)
        stamps = np.round(1e9 * t[1:]).astype(np.int64)
        none = np.zeros(len(stamps), dtype=bool)
        samples = ImuSamples(
            stamps,
            stamps - stamps[0],
            gyr,
            np.zeros_like(gyr),
            None,
            None,
            np.arange(len(stamps)),
            none,
        )
        seen = slice(3 * RATE, None, 2)
        noise = Rotation.from_rotvec(0.002 * rng.standard_normal((len(t[seen]), 3)))
        q = (body[seen] * noise).as_quat(scalar_first=True)
        found[name] = samples, Truth(np.round(1e9 * (t[seen] - 3.0)).astype(np.int64), q)
    return found


@pytest.mark.parametrize("exchanged", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_exchanged_legs_of_a_walk_are_named(seed, exchanged):
    walk = legs(seed)
    other = {"left": "right", "right": "left"}
    access: dict[str, Any] = {
        name: SimpleNamespace(
            samples=own, turned=own, measured=np.ones(len(own), dtype=bool), every=1
        )
        for name, (own, _) in walk.items()
    }
    found = {}
    for name in walk:
        truth = walk[other[name] if exchanged else name][1]
        file: Any = SimpleNamespace(thinned=lambda own=truth: own, is_long=False)
        found[name] = true_motion(access[name], file, IMPORTED, True)
    described = dict.fromkeys(walk, IMPORTED)
    named = name_confused(found, access, described, True)
    expected = {name: other[name] for name in walk} if exchanged else {}
    assert {name: own.values["other"] for name, own in named.items()} == expected
    assert {own.code for own in named.values()} <= {"truth.of_another"}
    if not exchanged:
        assert all(not own.unaligned for own in found.values())
