"""What a triad with stated errors reads, worked out element by element; and what a curve without
scatter says of its noise.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from testbench.model.allan import AllanCurve, allan_deviation, fit_noise
from testbench.model.imu import SHEET_TEMPERATURE, TriadErrors, TriadModel, low_pass_coefficients
from testbench.records.specs.sensor import Accelerometer, Gyroscope

RATE = 100.0


def triad(parameters, errors: TriadErrors | None = None) -> TriadModel:
    model = TriadModel(parameters, RATE, 0, "sensor", "triad")
    model.errors = errors or TriadErrors(np.eye(3), *[np.zeros(3)] * 2, np.zeros(3))
    return model


def test_a_cross_axis_error_is_of_the_axis_that_reads_and_a_bias_is_not_scaled():
    matrix = np.eye(3)
    matrix[0, 1], matrix[2, 2] = 0.05, 1.1  # x reads 5 % of y; z reads 10 % too much
    errors = TriadErrors(matrix, np.array([0.0, 0.0, 0.5]), np.zeros((3, 3)), np.zeros(3))
    model = triad(Accelerometer.model_validate({"range_g": 16.0}).triad(), errors)
    read, _ = model.measure(np.array([[0.0, 2.0, 0.0], [2.0, 0.0, 3.0]]))
    np.testing.assert_allclose(read, [[0.1, 2.0, 0.5], [2.0, 0.0, 3.8]], atol=1e-12)


def test_gravity_shows_in_the_axis_of_the_gyroscope_that_is_sensitive_to_it():
    g_matrix = np.zeros((3, 3))
    g_matrix[1, 2] = 1e-3  # y reads a thousandth of the force along z
    errors = TriadErrors(np.eye(3), np.zeros(3), g_matrix, np.zeros(3))
    model = triad(Gyroscope.model_validate({"range_deg_s": 2000.0}).triad(), errors)
    read, _ = model.measure(np.zeros((1, 3)), np.array([[5.0, 6.0, 9.8]]))
    np.testing.assert_allclose(read, [[0, 9.8e-3, 0]], atol=1e-12)


def test_a_bias_drifts_from_that_of_the_data_sheets_temperature():
    sheet = {"range_g": 16.0, "bias_drift_sd_mg_k": 1.0}
    errors = TriadErrors(np.eye(3), np.zeros(3), np.zeros((3, 3)), np.array([0.01, 0.0, -0.02]))
    model = triad(Accelerometer.model_validate(sheet).triad(), errors)
    read, _ = model.measure(np.zeros((2, 3)), temperature=SHEET_TEMPERATURE + np.array([0.0, 10.0]))
    np.testing.assert_allclose(read, [[0, 0, 0], [0.1, 0, -0.2]], atol=1e-12)


@pytest.mark.parametrize("bandwidth", [3.0, 20.0, 90.0])
def test_a_low_pass_is_late_by_exactly_its_time_constant(bandwidth):
    (b0, b1), (_, a1) = low_pass_coefficients(bandwidth, RATE)
    ramp = np.arange(2000) / RATE
    read = np.zeros(2000)
    for i in range(1, 2000):
        read[i] = b0 * ramp[i] + b1 * ramp[i - 1] - a1 * read[i - 1]
    late = ramp[-1] - read[-1]
    assert late == pytest.approx(1 / (2 * np.pi * bandwidth), rel=1e-9)
    assert (b0 + b1) / (1 + a1) == pytest.approx(1)


def exact(white: float, flicker: float, walk: float) -> AllanCurve:
    """The curve that noise of these coefficients has on average (IEEE Std 952-1997, annex C)."""
    tau = np.geomspace(0.01, 300, 45)
    variance = white**2 / tau + 2 * np.log(2) / np.pi * flicker**2 + walk**2 * tau / 3
    deviation, edf = np.sqrt(variance), np.maximum(3e4 * 0.01 / tau * 2, 5)
    return AllanCurve(tau, deviation, deviation, deviation, edf)


@pytest.mark.parametrize(
    ("white", "flicker", "walk"), [(0.01, 0, 0.002), (0.01, 0.004, 0), (0.02, 0.003, 0.001)]
)
def test_a_curve_without_scatter_gives_its_coefficients_back(white, flicker, walk):
    found = fit_noise(exact(white, flicker, walk))
    assert found.white.value == pytest.approx(white, rel=0.01)
    if flicker:
        assert found.bias_instability.value == pytest.approx(flicker, rel=0.03)
    if walk:
        assert found.rate_random_walk.value == pytest.approx(walk, rel=0.03)


def test_the_ends_of_a_curves_interval_leave_a_sixth_out_on_either_side():
    signal = np.random.default_rng(1).standard_normal(5000)
    curve = allan_deviation(signal, RATE)
    np.testing.assert_allclose(
        curve.lower, curve.deviation * np.sqrt(curve.edf / chi2.ppf(0.8415, curve.edf)), rtol=1e-6
    )
    np.testing.assert_allclose(
        curve.upper, curve.deviation * np.sqrt(curve.edf / chi2.ppf(0.1585, curve.edf)), rtol=1e-6
    )


def test_the_degrees_of_freedom_are_those_that_the_estimates_scatter_by():
    # the variance of a chi-squared of so many degrees over its mean squared is 2 / edf
    factors = np.array([1, 10, 100])
    rng = np.random.default_rng(2)
    curves = [allan_deviation(rng.standard_normal(4000), RATE, factors) for _ in range(300)]
    squares = np.array([curve.deviation**2 for curve in curves])
    scatter = 2 * squares.mean(axis=0) ** 2 / squares.var(axis=0)
    stated = np.mean([curve.edf for curve in curves], axis=0)
    np.testing.assert_allclose(stated[1:], scatter[1:], rtol=0.25)


def test_the_uncertainty_of_a_coefficient_is_the_scatter_of_coefficients():
    white, walk = [], []
    rng = np.random.default_rng(3)
    for _ in range(40):
        wandering = np.cumsum(0.02 / np.sqrt(RATE) * rng.standard_normal(8000))
        signal = wandering + 0.01 * np.sqrt(RATE) * rng.standard_normal(8000)
        found = fit_noise(allan_deviation(signal, RATE))
        white.append((found.white.value, found.white.sd))
        walk.append((found.rate_random_walk.value, found.rate_random_walk.sd))
    value, sd = np.array(walk).T
    assert 0.65 < np.std(value) / np.median(sd) < 1.4
    value, sd = np.array(white).T  # of the one that is known best it says too much
    assert 0.35 < np.std(value) / np.median(sd) < 1.2
    assert np.mean(value) == pytest.approx(0.01, rel=0.02)
