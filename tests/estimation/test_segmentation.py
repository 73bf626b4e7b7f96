"""When a sensor is at rest, by its own gyroscope, against the times at which the arm was."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.signals.segmentation import detect_static, detect_static_by_force

INTERVAL = 1 / 60


def moves(noise: float, bias: float = 0.0, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A gyroscope over ten moves of 1 s with rests of 2 s between, and which samples rest."""
    t = np.arange(0, 30, INTERVAL)
    phase = t % 3
    moving = phase >= 2
    rate = np.where(moving, np.sin(np.pi * (phase - 2)) ** 2, 0.0)
    gyr = np.column_stack([rate, -0.5 * rate, 0 * rate]) + bias
    return gyr + noise * np.random.default_rng(seed).standard_normal(gyr.shape), ~moving


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize("bias", [0.0, 0.02, -0.2])
def test_rests_are_found_whole_but_for_their_borders_and_no_motion_is_let_in(noise, bias):
    gyr, resting = moves(noise, bias)
    static = detect_static(gyr, INTERVAL)
    speed = np.abs(gyr - bias).max(axis=1)
    assert not static[speed > 0.1].any()
    assert (static & ~resting).sum() < 0.02 * resting.sum()
    assert static[resting].mean() > 0.75


def test_a_sensor_that_only_rests_is_static_throughout():
    gyr = 1e-3 * np.random.default_rng(0).standard_normal((600, 3)) + 0.01
    assert detect_static(gyr, INTERVAL).mean() > 0.99


@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_a_handful_of_samples_is_no_error(count):
    assert detect_static(np.zeros((count, 3)), INTERVAL).shape == (count,)


def test_a_recording_is_static_within_the_dwells_of_its_steps_and_nowhere_else(quick):
    estimated = quick.estimate.sensors["forearm"]
    time, static = estimated.host_time_ns, estimated.static
    allowed = np.zeros(len(time), dtype=bool)
    for step in quick.session.steps:
        truth = quick.session.truth("forearm")
        dwell = (time > step.settled_ns) & (time < step.end_ns)
        allowed |= dwell
        well_inside = (time > step.settled_ns + 350_000_000) & (time < step.end_ns - 220_000_000)
        if step.kind == "move" and well_inside.any():
            assert static[well_inside].mean() > 0.95, step.name
    still = np.linalg.norm(truth.rate, axis=1) < np.radians(
        2.0
    )  # moves of the other joint leave this sensor nearly at rest
    allowed |= np.interp(time, truth.host_time_ns, still) > 0.5
    assert (static & ~allowed).sum() == 0


def test_a_straight_line_over_a_gap_does_not_set_the_measure_of_rest():
    rng = np.random.default_rng(2)
    gyr = 0.01 * rng.standard_normal((6000, 3))
    gyr[2000:3000] += np.linspace(0.5, 1.0, 1000)[
        :, None
    ]  # turns, then packets are lost until it turns on
    gyr[3000:4500] = np.linspace(1.0, 0.5, 1500)[:, None]
    real = np.r_[0:3000, 4500:6000]
    static = detect_static(gyr, 0.01, real)
    assert static[100:1900].all() and static[4600:5900].all()
    assert not static[2050:2950].any()


def leaning(noise: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """An accelerometer that leans by 20 deg and back in 2 s, with rests of 4 s between."""
    t = np.arange(0, 60, INTERVAL)
    phase = t % 6
    moving = phase >= 4
    lean = np.where(moving, np.radians(20) * np.sin(np.pi * (phase - 4) / 2) ** 2, 0.0)
    acc = 9.80665 * np.column_stack([np.sin(lean), 0 * lean, np.cos(lean)])
    return acc + noise * np.random.default_rng(seed).standard_normal(acc.shape), ~moving


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.03])
def test_an_accelerometer_alone_shows_rests_and_no_motion_is_let_in(noise):
    acc, resting = leaning(noise)
    static = detect_static_by_force(acc, INTERVAL)
    assert not static[~resting].any()
    assert static[resting].mean() > 0.45  # a second of each border is not let in


def test_an_accelerometer_that_never_rests_has_no_rest():
    t = np.arange(0, 60, INTERVAL)
    shaken = np.column_stack([3 * np.sin(7 * t), 2 * np.cos(5 * t), 9.8 + np.sin(11 * t)])
    assert not detect_static_by_force(shaken, INTERVAL).any()
    assert not detect_static_by_force(np.full((300, 3), np.nan), INTERVAL).any()
