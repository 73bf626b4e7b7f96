import numpy as np
import pytest

from testbench.model.statistics.least_squares import FitParameter, PoorExcitation, solve

LINE = [FitParameter("slope", "1/s", 0.0, 10.0), FitParameter("offset", "1", 0.0, 10.0)]


def test_equals_linear_regression():
    rng = np.random.default_rng(1)
    x = np.linspace(0, 5, 40)
    y = 2.0 * x - 1.0 + 0.1 * rng.standard_normal(40)
    fit = solve(lambda theta: theta[0] * x + theta[1] - y, LINE)
    values, covariance = np.polyfit(x, y, 1, cov=True)
    np.testing.assert_allclose(fit.values, values, atol=1e-10)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-6)
    assert fit["slope"] == fit.values[0]
    np.testing.assert_allclose(np.diag(fit.correlation), 1.0)


def test_stated_intervals_cover():
    rng = np.random.default_rng(2)
    x = np.linspace(0, 1, 6)
    inside = np.zeros(2)
    for _ in range(1000):
        y = 3.0 * x + 0.5 + 0.2 * rng.standard_normal(6)
        fit = solve(lambda theta, y=y: theta[0] * x + theta[1] - y, LINE)
        inside += np.abs(fit.values - [3.0, 0.5]) <= fit.half_width(0.95)
    assert (inside >= 930).all()
    assert (inside <= 970).all()


def test_names_what_is_not_determined():
    three = [*LINE, FitParameter("curvature", "1/s^2", 0.0, 10.0)]
    x = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
    with pytest.raises(PoorExcitation, match="slope, curvature") as caught:
        solve(lambda theta: theta[0] * x + theta[1] + theta[2] * x**2 - x, three)
    assert caught.value.parameters == ("slope", "curvature")
    with pytest.raises(PoorExcitation, match="1 observations are fewer"):
        solve(lambda theta: theta[:1], LINE)


def test_names_what_stays_vaguer_than_its_data_sheet():
    x = np.array([0.0, 1e-3] * 5)
    with pytest.raises(PoorExcitation, match="slope"):
        solve(lambda theta: theta[0] * x + theta[1], LINE, known_scatter=True)
