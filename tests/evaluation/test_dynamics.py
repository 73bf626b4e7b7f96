"""Delays, settling times and what a sweep was: known ones are found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from testbench.evaluation.dynamics import (
    CONVERGENCE_BAND,
    TrueTurning,
    amplitude_and_frequency,
    angle_delay,
    convergence_times,
    orientation_delay,
    rate_in_world,
)
from testbench.model import rotation
from testbench.records.session.plan import PlannedStep

RATE = 100.0
N = 2000
TIME_NS = np.round(np.arange(N) / RATE * 1e9).astype(np.int64)
T = TIME_NS / 1e9


def angle(t: np.ndarray) -> np.ndarray:
    return np.radians(30 + 20 * np.sin(2 * np.pi * 0.5 * t) + 5 * np.sin(2 * np.pi * 0.9 * t + 1))


def orientation(t: np.ndarray) -> np.ndarray:
    return rotation.multiply(
        rotation.from_heading(0.5 * np.sin(2 * t)),
        rotation.from_rotation_vector(
            np.column_stack([0.4 * np.sin(3 * t), 0.3 * np.cos(2.2 * t), 0 * t])
        ),
    )


@pytest.mark.parametrize("delay", [0.0, 0.0034, 0.03, 0.12, -0.02])
def test_a_delay_of_an_angle_is_found_to_a_fraction_of_a_sample(delay):
    rows = np.arange(100, 1900)
    found, sd = angle_delay(TIME_NS, angle(T - delay), angle(T), [rows])
    assert found == pytest.approx(delay, abs=2e-5)
    assert sd < 1e-4


def test_an_offset_and_a_gain_are_no_delay():
    found, _ = angle_delay(
        TIME_NS, 1.05 * angle(T) + 0.02, angle(T), [np.arange(100, 900), np.arange(1000, 1900)]
    )
    assert found == pytest.approx(0, abs=1e-5)


def test_the_stated_uncertainty_of_a_delay_is_its_scatter():
    rng = np.random.default_rng(0)
    results = []
    for _ in range(60):
        noisy = angle(T - 0.02) + np.radians(0.5) * rng.standard_normal(N)
        results.append(angle_delay(TIME_NS, noisy, angle(T), [np.arange(100, 1900)]))
    delays, stated = np.array(results).T
    assert delays.mean() == pytest.approx(0.02, abs=3e-4)
    assert np.median(stated) == pytest.approx(delays.std(), rel=0.4)


def there_and_back(t: np.ndarray) -> np.ndarray:
    """One trapezoid of 45 deg at 60 deg/s, from 3 s on [rad]."""
    return np.radians(45 * (np.clip((t - 3) / 0.75, 0, 1) - np.clip((t - 3.95) / 0.75, 0, 1)))


SHORT = np.arange(298, 472)


def test_a_drift_through_a_sweep_there_and_back_is_no_delay():
    drifting = there_and_back(T - 0.01) + np.radians(0.5) * T
    found, sd = angle_delay(TIME_NS, drifting, there_and_back(T), [SHORT])
    assert found == pytest.approx(0.01, abs=2e-5)
    assert sd < 2e-3


@pytest.mark.parametrize("tau_s", [0.05, 0.3, 1.0, 20.0])
def test_the_delay_of_one_short_sweep_is_as_sure_as_is_stated_though_errors_last(tau_s):
    rng = np.random.default_rng(5)
    kept = np.exp(-1 / RATE / tau_s)
    found = []
    for _ in range(100):
        noise = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(2 * N))[N:]
        estimated = there_and_back(T - 0.01) + np.radians(0.3) * noise
        found.append(angle_delay(TIME_NS, estimated, there_and_back(T), [SHORT]))
    delays, stated = np.array(found).T
    z = (delays - 0.01) / stated
    assert np.mean(np.abs(z) < 2) >= 0.88  # 95 % less three standard deviations of a count
    assert 0.55 < np.sqrt(np.mean(z**2)) < 1.3


@pytest.mark.parametrize("tau_s", [0.05, 1.0])
def test_the_delay_of_an_orientation_in_a_short_motion_is_as_sure_as_is_stated(tau_s):
    rng = np.random.default_rng(6)
    kept = np.exp(-1 / RATE / tau_s)
    true = TrueTurning.of(TIME_NS, orientation(T))
    moving = np.zeros(N, bool)
    moving[500:800] = True
    found = []
    for _ in range(60):
        noise = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal((3, 2 * N)))[:, N:]
        turned = rotation.from_rotation_vector(np.radians(0.3) * noise.T)
        found.append(
            orientation_delay(rotation.multiply(turned, orientation(T - 0.01)), true, moving)
        )
    delays, stated = np.array(found).T
    z = (delays - delays.mean()) / stated
    assert np.mean(np.abs(z) < 2) >= 0.85
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.35


def test_an_angle_that_rests_or_is_not_followed_has_no_delay():
    rows = np.arange(100, 1900)
    still = np.full(N, 0.3)
    assert angle_delay(TIME_NS, still, still, [rows]) is None
    assert angle_delay(TIME_NS, still, angle(T), [rows]) is None
    assert angle_delay(TIME_NS, still, angle(T), []) is None


def test_the_rate_in_the_world_is_that_of_the_rotation():
    q = rotation.from_rotation_vector(np.column_stack([0.7 * T, 0 * T, 0 * T]))
    rate = rate_in_world(TIME_NS, q)
    np.testing.assert_allclose(rate[1:-1], np.tile([0.7, 0, 0], (N - 2, 1)), atol=1e-9)
    q[500] = np.nan
    rate = rate_in_world(TIME_NS, q)
    assert np.isnan(rate[[0, 499, 501, -1]]).all() and np.isfinite(rate[502]).all()


@pytest.mark.parametrize("delay", [0.004, 0.02, -0.01])
@pytest.mark.parametrize("drift", [0.0, 0.02])
def test_a_delay_of_an_orientation_is_found_beside_a_drift_of_heading(delay, drift):
    true = orientation(T)
    estimated = rotation.multiply(rotation.from_heading(drift * T), orientation(T - delay))
    moving = (T > 1) & (T < 19)
    found, _ = orientation_delay(estimated, TrueTurning.of(TIME_NS, true), moving)
    assert found == pytest.approx(delay, rel=0.03, abs=2e-4)


def test_an_orientation_that_rests_or_is_unknown_has_no_delay():
    still = np.tile([1.0, 0, 0, 0], (N, 1))
    everywhere = np.ones(N, bool)
    assert orientation_delay(still, TrueTurning.of(TIME_NS, still), everywhere) is None
    lost = np.full((N, 4), np.nan)
    assert orientation_delay(still, TrueTurning.of(TIME_NS, lost), everywhere) is None


def dwell(begin_s: float, end_s: float) -> PlannedStep:
    times = (round((begin_s - 1) * 1e9), round(begin_s * 1e9), round(end_s * 1e9))
    return PlannedStep(0, "s", "evaluation", "n", "move", {}, *times)


def test_the_settling_time_is_when_a_decaying_error_enters_the_band():
    begin, tau, size = 2.0, 0.3, np.radians(4.0)
    error = np.radians(0.7) + size * np.exp(-np.maximum(T - begin, 0) / tau)
    (found,) = convergence_times(TIME_NS, error, [dwell(begin, 12.0)])
    assert found == pytest.approx(tau * np.log(size / CONVERGENCE_BAND), abs=2 / RATE)


def test_an_error_settled_from_the_start_takes_no_time_and_one_that_never_is_takes_for_ever():
    steps = [dwell(2.0, 6.0), dwell(8.0, 12.0), dwell(30.0, 31.0)]
    error = np.where(T < 7, 0.01, np.radians(2) * np.maximum(T - 7, 0))  # a drift that does not end
    found = convergence_times(TIME_NS, error, steps)
    assert found[0] == 0.0 and np.isinf(found[1]) and np.isnan(found[2])


def test_noise_widens_the_band_in_which_an_error_counts_as_settled():
    noise = np.radians(0.5) * np.random.default_rng(1).standard_normal(N)
    error = noise + np.radians(20.0) * np.exp(-np.maximum(T - 2, 0) / 0.2)
    (found,) = convergence_times(TIME_NS, error, [dwell(2.0, 4.0)])
    assert 0.3 < found < 1.5


def test_amplitude_and_frequency_of_a_sine_are_its_own():
    amplitude, frequency = amplitude_and_frequency(TIME_NS, 0.2 * np.sin(2 * np.pi * 0.75 * T) + 1)
    assert amplitude == pytest.approx(0.2, rel=1e-3)
    assert frequency == pytest.approx(0.75, rel=0.01)
    assert amplitude_and_frequency(TIME_NS, np.full(N, 0.4)) is None
