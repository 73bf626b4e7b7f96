"""Moving means and Savitzky-Golay filters against SciPy, ends and all."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import savgol_filter

from testbench.model.windows import moving_mean, savitzky_golay


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7, 50, 333])
@pytest.mark.parametrize("n", [1, 2, 5, 30, 400])
def test_a_moving_mean_is_that_of_scipy_however_wide_the_window(n: int, size: int) -> None:
    signal = np.random.default_rng(n).normal(size=(n, 3))
    for ends, mode in (("mirrored", "reflect"), ("held", "nearest")):
        expected = uniform_filter1d(signal, size, axis=0, mode=mode)
        np.testing.assert_allclose(moving_mean(signal, size, ends), expected, atol=1e-14)
        np.testing.assert_allclose(
            moving_mean(signal[:, 0], size, ends), expected[:, 0], atol=1e-14
        )


@pytest.mark.parametrize("size", [3, 4, 51])
def test_a_window_whose_mean_is_nil_holds_no_mark(size: int) -> None:
    marked = np.random.default_rng(1).random(2000) < 0.02
    free = maximum_filter1d(marked.astype(np.int8), size) == 0
    np.testing.assert_array_equal(moving_mean(marked, size) == 0, free)


def test_the_mean_of_no_samples_is_none() -> None:
    assert moving_mean(np.zeros((0, 3)), 5).shape == (0, 3)


@pytest.mark.parametrize("interval", [0.002, 0.008, 1.0])
@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize(("n", "window"), [(5, 5), (7, 5), (30, 13), (500, 51)])
def test_a_savitzky_golay_filter_is_that_of_scipy(
    n: int, window: int, derivative: int, interval: float
) -> None:
    signal = np.random.default_rng(n).normal(size=(n, 6))
    expected = savgol_filter(signal, window, 3, deriv=derivative, delta=interval, axis=0)
    found = savitzky_golay(signal, window, 3, derivative, interval)
    np.testing.assert_allclose(found, expected, atol=1e-12 / interval**derivative)


def test_a_cubic_keeps_its_value_and_slope_up_to_the_ends() -> None:
    time = np.arange(40) * 0.01
    cubic = np.column_stack([1 + time - 3 * time**2 + 2 * time**3])
    slope = np.column_stack([1 - 6 * time + 6 * time**2])
    np.testing.assert_allclose(savitzky_golay(cubic, 9, 3), cubic, atol=1e-12)
    np.testing.assert_allclose(savitzky_golay(cubic, 9, 3, 1, 0.01), slope, atol=1e-10)
