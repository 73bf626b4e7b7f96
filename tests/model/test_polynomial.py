"""Polynomial fits against numpy, and their intervals against what they promise."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.exceptions import InputError
from testbench.model.statistics.polynomial import fit_quadratic, fit_surface

X = np.linspace(-3, 5, 30)


def test_a_quadratic_is_that_of_numpy_with_its_covariance():
    y = 0.4 * X**2 - X + 2 + np.random.default_rng(1).normal(scale=0.3, size=30)
    fit = fit_quadratic(X, y)
    values, covariance = np.polyfit(X, y, 2, cov=True)
    np.testing.assert_allclose(fit.fit.values, values, rtol=1e-10)
    np.testing.assert_allclose(fit.fit.covariance, covariance, rtol=1e-8)
    residuals = y - np.polyval(values, X)
    assert fit.rmse == pytest.approx(np.sqrt(residuals @ residuals / 27))
    assert fit.r_squared == pytest.approx(1 - residuals.var() / y.var())
    np.testing.assert_allclose(fit.at(X), np.polyval(values, X), atol=1e-12)


def test_the_interval_holds_the_truth_nineteen_times_in_twenty():
    generator, held = np.random.default_rng(2), 0
    for _ in range(600):
        low, high = fit_quadratic(X, 0.4 * X**2 + generator.normal(size=30)).interval("a")
        held += low < 0.4 < high
    assert 0.92 < held / 600 < 0.98


def test_a_surface_finds_the_polynomial_it_was_made_of():
    x, y = (part.ravel() for part in np.meshgrid(np.arange(6.0), np.arange(-4.0, 5), indexing="ij"))
    z = 1 + 2 * x + x * y**2 - 0.5 * x**2
    fit = fit_surface(x, y, z, (2, 2))  # x y^2 has a degree too many
    assert fit.fit.names == ("p00", "p01", "p02", "p10", "p11", "p20")
    assert fit.r_squared < 1
    better = fit_surface(x, y, z, (3, 2))
    assert better.r_squared == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(better.at(x, y), z, atol=1e-9)
    assert better.scale[0] == pytest.approx(np.std(x, ddof=1))


@pytest.mark.parametrize("x", [[1.0, 2, 3], [1.0, 1, 2, 2, 1]])
def test_points_that_say_too_little_are_refused(x):
    with pytest.raises(InputError, match="do not determine the 3 coefficients a, b, c"):
        fit_quadratic(np.array(x), np.ones(len(x)))
