"""Allan deviation: the known slopes, the known coefficients, and figures of another program."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from testbench.model.allan import allan_deviation, fit_noise

RATE = 100.0
GOLDEN = Path(__file__).parents[1] / "golden"


def white(density: float, n: int, seed: int) -> np.ndarray:
    """White noise whose Allan deviation is density / sqrt(tau)."""
    return density * np.sqrt(RATE) * np.random.default_rng(seed).standard_normal(n)


def test_the_nist_test_suite_of_ten_points_gives_the_published_deviation():
    # NIST SP 1065, section 12.4: nine frequency values, overlapping Allan deviation at 1 and 2
    # intervals
    data = np.array([892.0, 809, 823, 798, 671, 644, 883, 903, 677])
    curve = allan_deviation(data, 1.0, np.array([1, 2]))
    assert curve.deviation == pytest.approx([91.22945, 85.95287], abs=1e-5)


def test_white_noise_falls_with_the_root_of_the_averaging_time():
    curve = allan_deviation(white(0.01, 200_000, 0), RATE)
    slope = np.polyfit(np.log(curve.tau[:25]), np.log(curve.deviation[:25]), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.02)
    assert np.interp(1.0, curve.tau, curve.deviation) == pytest.approx(0.01, rel=0.02)


def test_a_ramp_of_slope_r_has_the_deviation_r_tau_over_root_two():
    ramp = 0.3 * np.arange(5000) / RATE
    curve = allan_deviation(ramp, RATE, np.array([10, 100]))
    assert curve.deviation == pytest.approx(0.3 * curve.tau / np.sqrt(2), rel=1e-9)


def test_the_confidence_bounds_hold_the_true_white_noise_two_times_in_three():
    inside = 0
    for seed in range(60):
        curve = allan_deviation(white(1.0, 5000, seed), RATE, np.array([100]))
        inside += curve.lower[0] <= 1.0 <= curve.upper[0]
    assert 0.5 < inside / 60 < 0.85


def test_injected_white_noise_is_recovered_within_its_uncertainty():
    z = []
    for seed in range(20):
        fit = fit_noise(allan_deviation(white(0.01, 60_000, seed), RATE)).white
        z.append((fit.value - 0.01) / fit.sd)
    assert np.sqrt(np.mean(np.square(z))) < 1.6


def test_injected_random_walk_is_recovered():
    rng = np.random.default_rng(3)
    walk = np.cumsum(0.002 / np.sqrt(RATE) * rng.standard_normal(400_000))
    fit = fit_noise(allan_deviation(walk + white(0.002, 400_000, 4), RATE))
    assert fit.rate_random_walk.value == pytest.approx(0.002, rel=0.25)
    assert fit.white.value == pytest.approx(0.002, rel=0.05)


def test_what_is_not_there_is_not_found():
    assert not fit_noise(allan_deviation(white(0.01, 60_000, 1), RATE)).rate_random_walk.found


def low_passed(cut_off: float, n: int, seed: int) -> np.ndarray:
    """White noise of density 1 a root of a hertz (one-sided) behind a low pass, drawn ten times as
    densely and then sampled.
    """
    dense, before = 10, 3000
    fine = np.sqrt(dense * RATE / 2) * np.random.default_rng(seed).standard_normal(
        n * dense + before
    )
    f = np.exp(-2 * np.pi * cut_off / (dense * RATE))
    return lfilter([1 - f], [1, -f], fine)[before::dense]


@pytest.mark.parametrize("cut_off", [4.0, 10.0, 20.0])
@pytest.mark.parametrize("seconds", [30, 200])
def test_noise_behind_a_low_pass_has_its_density_and_no_bias_instability(cut_off, seconds):
    density, bandwidth = [], []
    x = np.pi * cut_off / RATE
    folded = np.sqrt(x / np.tanh(x))  # the density at 0 Hz, with all that sampling folds onto it
    for seed in range(4):
        signal = low_passed(cut_off, round(seconds * RATE), seed)
        found = fit_noise(allan_deviation(signal, RATE))
        assert not found.bias_instability.found
        density.append((found.white.value - folded / np.sqrt(2)) / found.white.sd)
        bandwidth.append(found.bandwidth_hz)
    assert np.sqrt(np.mean(np.square(density))) < 1.8
    assert np.median(bandwidth) == pytest.approx(cut_off, rel=0.12)


@pytest.mark.parametrize("filtered", ["second order", "fourth order", "mean"])
@pytest.mark.parametrize("cut_off", [2.0, 10.0])
def test_noise_behind_any_usual_low_pass_has_its_density(filtered, cut_off):
    """Of sharp filters one of first order makes densities that are 1.3 to 2.4 times too large."""
    dense, count, found = 10, 6000, []
    for seed in range(4):
        fine = np.random.default_rng(seed).standard_normal(count * dense + 3000)
        fine *= np.sqrt(dense * RATE / 2)
        if filtered == "mean":  # sinc(0.443)^2 is a half
            width = round(0.443 * dense * RATE / cut_off)
            passed = lfilter(np.ones(width) / width, [1], fine)
        else:
            order = 2 if filtered == "second order" else 4
            passed = lfilter(*butter(order, 2 * cut_off / (dense * RATE)), fine)
        found.append(fit_noise(allan_deviation(passed[3000::dense], RATE)))
    assert np.mean([fit.white.value for fit in found]) == pytest.approx(1 / np.sqrt(2), rel=0.08)
    assert np.median([fit.bandwidth_hz for fit in found]) == pytest.approx(cut_off, rel=0.12)
    assert not any(fit.bias_instability.found for fit in found)


def test_white_noise_shows_no_low_pass():
    assert all(
        fit_noise(allan_deviation(white(1.0, n, seed), RATE)).bandwidth_hz is None
        for seed, n in enumerate([1500, 3000, 10_000, 40_000] * 5)
    )


def test_flicker_and_a_wandering_bias_are_no_low_pass():
    walk = np.cumsum(0.02 * np.random.default_rng(2).standard_normal(60_000))
    found = fit_noise(allan_deviation(walk + white(0.1, 60_000, 3), RATE))
    assert found.bandwidth_hz is None and found.rate_random_walk.found


def test_two_samples_are_refused():
    with pytest.raises(ValueError, match="at least 3"):
        allan_deviation(np.zeros(2), RATE)


def test_the_curve_is_that_of_allantools():
    """The golden file says which version computed it, and with which call."""
    factor, tau, deviation, differences = np.loadtxt(
        GOLDEN / "allan_oadev.csv", delimiter=",", unpack=True
    )
    signal = np.loadtxt(GOLDEN / "allan_signal.csv")
    curve = allan_deviation(signal, RATE, factor.astype(int))
    np.testing.assert_allclose(curve.tau, tau, rtol=1e-15)
    np.testing.assert_allclose(curve.deviation, deviation, rtol=1e-12)
    np.testing.assert_array_equal(len(signal) + 1 - 2 * factor, differences)
