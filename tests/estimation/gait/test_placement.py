"""Where a sensor sits is found by its name or its motion, and not guessed."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.gait.foot import walk_on_foot
from testbench.estimation.gait.placement import place_by_motion, place_by_name, side_by_name
from testbench.model import rotation
from tests.estimation.gait.walker import Walked, readings, straight, varied, walked, with_errors


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_a_foot_is_known_by_its_motion(seed) -> None:
    true = walked(straight() if seed is None else varied(seed))
    own = readings(true, *with_errors(true))
    assert place_by_motion(own, walk_on_foot(own)) == "foot"


def limb(swing_deg: float, turning_deg_s: float, shaken: float, stance: float = 0.0):
    """A limb that swings to and fro about its y axis; in its stance it turns slowly and evenly."""
    t = np.arange(0, 20, 0.01)
    phase = t % 1.1 / 1.1
    share = max(stance, 0.5)
    back = 0.5 + 0.5 * np.cos(np.pi * np.clip((phase - share) / (1 - share), 0, 1))
    slow = phase / share if stance else 0.5 - 0.5 * np.cos(np.pi * np.clip(phase / share, 0, 1))
    pitch = np.radians(swing_deg) * np.where(phase < share, slow, back)
    rate = np.gradient(pitch, t)
    moving = (t > 3) & (t < 17)
    angle = np.cumsum(np.where(moving, rate, 0)) * 0.01
    gyr = np.zeros((len(t), 3))
    gyr[:, 1] = np.where(moving, rate, 0)
    gyr[:, 2] = np.where(moving, np.radians(turning_deg_s) * np.sin(2 * np.pi * t / 1.1), 0)
    q = rotation.from_euler("ZYX", np.column_stack([0 * t, angle, 0 * t]))
    up = rotation.rotate(rotation.conjugate(q), np.tile([0, 0, 9.81], (len(t), 1)))
    step = np.where(moving, shaken * np.sin(2 * np.pi * t / 0.55), 0)
    noise = np.random.default_rng(0).standard_normal((2, len(t), 3))
    acc = up + 0.01 * noise[0] + np.outer(step, [0.3, 0, 1])
    return readings(Walked(t, *[np.zeros(0)] * 6), gyr + 0.001 * noise[1], acc)


def test_shank_thigh_and_wrist_are_not_told_apart() -> None:
    for swing, stance in ((60.0, 0.6), (40.0, 0.5), (50.0, 0.0)):
        own = limb(swing, 10.0, 3.0, stance)
        assert place_by_motion(own, walk_on_foot(own)) is None


def test_a_chest_is_known_by_slow_turns_and_shaking_steps() -> None:
    own = limb(4.0, 25.0, 2.5)
    assert place_by_motion(own, walk_on_foot(own)) == "chest"


def test_a_sensor_at_rest_says_nothing_of_its_place() -> None:
    own = limb(0.0, 0.0, 0.0)
    assert place_by_motion(own, walk_on_foot(own)) is None


@pytest.mark.parametrize(
    ("name", "place", "side"),
    [
        ("left_foot", "foot", "left"),
        ("RFoot", "foot", "right"),
        ("tibia_l", "shank", "left"),
        ("wrist", "wrist", ""),
        ("Sternum", "chest", ""),
        ("short_walk", None, ""),
        ("LTibia", "shank", "left"),
        ("right", None, "right"),
        ("Pelvis", None, ""),
    ],
)
def test_names_say_where_a_sensor_sits(name, place, side) -> None:
    assert place_by_name(name) == place
    assert side_by_name(name) == side
