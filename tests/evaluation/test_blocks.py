"""Block lengths, confidence intervals and standard errors of series with memory."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from testbench.model.statistics.blocks import (
    LONGEST_SERIES,
    block_length,
    intervals,
    mean_and_error,
    resampled_sums,
    sample_series,
    step_series,
)


def autoregressive(n: int, memory: float, rng: np.random.Generator) -> np.ndarray:
    """A stationary AR(1) process of unit innovation."""
    noise = rng.standard_normal(n + 200)
    return lfilter([1.0], [1.0, -memory], noise)[200:]


@pytest.mark.parametrize("memory", [0.3, 0.6, 0.8])
def test_the_block_length_of_an_autoregressive_process_is_that_of_theory(memory):
    # G = sum |k| R(k) and g = sum R(k) in closed form; Patton, Politis & White 2009, eqs 3 to 5.
    n, variance = 4000, 1 / (1 - memory**2)
    slope, level = 2 * variance * memory / (1 - memory) ** 2, variance * (1 + memory) / (1 - memory)
    wanted = (2 * slope**2 / (4 / 3 * level**2)) ** (1 / 3) * n ** (1 / 3)
    rng = np.random.default_rng(1)
    found = np.median([block_length(autoregressive(n, memory, rng)) for _ in range(40)])
    assert found == pytest.approx(wanted, rel=0.2)


def test_a_series_without_memory_needs_no_blocks():
    rng = np.random.default_rng(2)
    assert np.median([block_length(rng.standard_normal(300)) for _ in range(50)]) <= 2
    assert block_length(np.full(100, 3.7)) == 1
    assert block_length(np.arange(5.0)) == 1


def test_a_block_never_exceeds_a_third_of_the_series():
    drift = np.linspace(0, 1, 90)
    assert 15 < block_length(drift) <= 30


@given(st.integers(1, 30), st.integers(1, 30), st.integers(0, 1000))
def test_resampled_sums_are_those_of_the_rows_that_were_drawn(n, length, seed):
    rng = np.random.default_rng(seed)
    length = min(length, n)
    columns = rng.normal(size=(n, 2))
    starts = rng.integers(0, n, (7, -(-n // length)))
    rows = ((starts[:, :, None] + np.arange(length)) % n).reshape(7, -1)[
        :, :n
    ]  # the circle, and the last block cut
    np.testing.assert_allclose(
        resampled_sums(columns, starts, length), columns[rows].sum(axis=1), atol=1e-12
    )


def test_intervals_cover_the_mean_of_a_series_with_memory_where_naive_ones_do_not():
    rng = np.random.default_rng(3)
    inside = naive = 0
    runs = 200
    for _ in range(runs):
        errors = 0.5 + autoregressive(400, 0.8, rng)
        found = intervals(sample_series(errors), rng)
        inside += found.mean[0] <= 0.5 <= found.mean[1]
        naive += abs(errors.mean() - 0.5) < 1.96 * errors.std() / np.sqrt(len(errors))
    assert 0.86 * runs < inside < 0.99 * runs
    assert naive < 0.6 * runs


def test_intervals_of_few_independent_poses_are_as_wide_as_students():
    rng = np.random.default_rng(4)
    inside = 0
    for _ in range(400):
        errors = rng.normal(1.0, 0.3, 7)
        found = intervals(
            step_series(errors, [np.array([i]) for i in range(7)], moving=False, equally=True), rng
        )
        inside += found.mean[0] <= 1.0 <= found.mean[1]
    assert 0.90 < inside / 400 < 0.98


def test_the_same_seed_gives_the_same_interval():
    series = sample_series(np.random.default_rng(5).standard_normal(500))
    assert intervals(series, np.random.default_rng(0)) == intervals(
        series, np.random.default_rng(0)
    )


def test_an_error_of_constant_size_has_intervals_of_no_width():
    signs = np.where(np.arange(100) % 2, 1.0, -1.0)
    found = intervals(sample_series(3.0 * signs), np.random.default_rng(0))
    assert found.absolute == pytest.approx([3, 3])
    assert found.rms == pytest.approx([3, 3])
    assert found.mean[0] <= 0 <= found.mean[1]


def test_the_standard_error_is_that_of_theory():
    n, memory = 2000, 0.7
    rng = np.random.default_rng(6)
    stated = [mean_and_error(autoregressive(n, memory, rng), np.ones(n))[1] for _ in range(60)]
    assert np.median(stated) == pytest.approx(1 / (1 - memory) / np.sqrt(n), rel=0.15)


def test_steps_count_alike_or_by_their_samples():
    errors = np.array([1.0, 1.0, 1.0, -4.0, 2.0, 2.0])
    steps = [np.arange(3), np.array([3]), np.array([4]), np.array([5])]
    alike = step_series(errors, steps, moving=False, equally=True)
    assert alike.mean.sum() / alike.weight.sum() == pytest.approx((1 - 4 + 2 + 2) / 4)
    by_samples = step_series(errors, steps, moving=False, equally=False)
    assert by_samples.mean.sum() / by_samples.weight.sum() == pytest.approx(errors.mean())
    assert by_samples.square.sum() / by_samples.weight.sum() == pytest.approx(np.mean(errors**2))


def test_few_poses_say_nothing_of_others_and_a_sweep_is_cut_into_runs_of_time():
    errors = np.random.default_rng(7).standard_normal(6000)
    poses = [np.arange(0, 100), np.arange(200, 300)]
    assert step_series(errors, poses, moving=False, equally=True) is None
    series = step_series(errors, [np.arange(6000)], moving=True, equally=True)
    assert len(series) == LONGEST_SERIES
    assert series.mean.sum() / series.weight.sum() == pytest.approx(errors.mean(), abs=0.002)
