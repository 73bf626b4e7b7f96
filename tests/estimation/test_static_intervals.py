"""Rests by four witnesses, against the times at which the sensor rested."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.static_intervals import (
    between_peaks,
    by_events,
    by_gyroscope,
    by_variance,
    compare,
)
from testbench.estimation.signals.segmentation import intervals_of

INTERVAL, GRAVITY = 0.01, 9.80665
REST, MOVE = 300, 150
"""Samples."""


def session(
    moves: int, noise: float = 0.01, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gyroscope, accelerometer and the true rests of a sensor that is turned from pose to pose
    about a new axis each time.
    """
    draw = np.random.default_rng(seed)
    q, rates, forces, rests = Rotation.identity(), [], [], []
    profile = np.sin(np.pi * (np.arange(MOVE) + 0.5) / MOVE) ** 2
    count = 0
    for k in range(moves + 1):
        rests.append([count, count + REST])
        rates.append(np.zeros((REST, 3)))
        forces.append(np.tile(q.inv().apply([0, 0, GRAVITY]), (REST, 1)))
        count += REST
        if k == moves:
            break
        turn = draw.standard_normal(3)
        turn *= draw.uniform(0.6, 2.5) / np.linalg.norm(turn)
        rate = turn * profile[:, None] / profile.sum() / INTERVAL
        path = q * Rotation.from_rotvec(turn * np.cumsum(profile)[:, None] / profile.sum())
        rates.append(rate)
        forces.append(path.inv().apply([0, 0, GRAVITY]))
        q = path[-1]
        count += MOVE
    gyr, acc = (np.vstack(parts) for parts in (rates, forces))
    bias = np.array([0.01, -0.02, 0.005])
    return (
        gyr + bias + 2e-3 * draw.standard_normal(gyr.shape),
        acc + noise * draw.standard_normal(acc.shape),
        np.array(rests),
    )


def test_runs_are_counted_as_a_person_would():
    np.testing.assert_array_equal(
        intervals_of(np.array([1, 1, 0, 1, 0, 0, 1, 1, 1], bool)), [[0, 2], [3, 4], [6, 9]]
    )
    np.testing.assert_array_equal(
        intervals_of(np.array([1, 1, 0, 1, 0, 0, 1, 1, 1], bool), 2), [[0, 2], [6, 9]]
    )
    assert intervals_of(np.zeros(0, bool)).shape == (0, 2)


@given(st.lists(st.booleans(), max_size=60))
def test_runs_give_the_mask_back(values):
    mask = np.zeros(len(values), bool)
    for begin, end in intervals_of(np.array(values, bool)):
        assert not mask[begin:end].any()
        mask[begin:end] = True
    assert mask.tolist() == values


@pytest.mark.parametrize("seed", range(5))
def test_every_way_finds_the_rests_and_lets_no_motion_in(seed):
    gyr, acc, rests = session(16, seed=seed)
    moving = np.ones(len(gyr), bool)
    for begin, end in rests:
        moving[begin:end] = False
    fast = moving & (np.linalg.norm(gyr, axis=1) > 0.2)
    ways = {
        "gyroscope": by_gyroscope(gyr, INTERVAL),
        "peaks": between_peaks(gyr, INTERVAL),
        "variance": by_variance(acc, INTERVAL, window_s=0.5).intervals,
        "start": by_variance(acc, INTERVAL, initial_s=2.5, window_s=0.5).intervals,
    }
    for name, found in ways.items():
        assert len(found) == 17, name
        for begin, end in found:
            if name in ("gyroscope", "peaks"):
                assert not fast[begin:end].any(), name
            else:  # a turn about the vertical is not felt
                assert acc[begin:end].std(axis=0).max() < 0.02, name
    truth = compare({"truth": rests, **ways}, len(gyr), INTERVAL)[:4]
    for agreement in truth:
        assert agreement.matched == 17
        assert agreement.iou > 0.75, agreement
        assert agreement.border_abs_s < 0.5, agreement


def test_the_threshold_is_that_of_the_best_calibration_and_not_of_a_few_bits():
    _, acc, _ = session(16)
    acc = acc * [1.02, 0.99, 1.01] + [0.1, -0.05, 0.02]
    found = by_variance(acc, INTERVAL, window_s=0.5)
    assert found.calibrated
    chosen = found.residuals[found.multiple - 1]
    assert chosen < 3e-3
    assert found.residuals.shape == (10,)
    assert found.threshold > 0
    few = by_variance(acc[: 4 * (REST + MOVE)], INTERVAL, window_s=0.5)
    assert not few.calibrated
    assert np.isnan(few.residuals).all()
    assert len(few.intervals) == 4


def test_the_arms_events_become_intervals_of_samples():
    times = 100 + np.arange(1000) * INTERVAL
    found = by_events(np.array([101.0, 105.0, 120.0]), np.array([103.0, 106.0, 121.0]), times)
    np.testing.assert_allclose(times[found[:, 0]], [101.3, 105.3], atol=INTERVAL)
    np.testing.assert_allclose(times[found[:, 1] - 1], [103.0, 106.0], atol=INTERVAL)


def test_agreement_against_arithmetic():
    a, b = np.array([[0, 100], [200, 300]]), np.array([[10, 100], [190, 290], [400, 500]])
    (agreement,) = compare({"a": a, "b": b}, 600, INTERVAL)
    assert agreement.counts == (2, 3)
    assert agreement.matched == 2
    assert agreement.iou == pytest.approx((90 + 90) / (100 + 110 + 100))
    assert agreement.start_later_s == pytest.approx(0.0)
    assert agreement.end_later_s == pytest.approx(-0.05)
    assert agreement.border_abs_s == pytest.approx(0.075)
    (none,) = compare({"a": np.zeros((0, 2), int), "b": np.zeros((0, 2), int)}, 600, INTERVAL)
    assert none.matched == 0
    assert np.isnan(none.iou)
    assert np.isnan(none.border_abs_s)


@pytest.mark.parametrize("count", [0, 1, 5, 30])
def test_a_handful_of_samples_is_no_error(count):
    still = np.zeros((count, 3))
    assert between_peaks(still, INTERVAL).shape == (0, 2)
    assert by_variance(still, INTERVAL).intervals.shape == (0, 2)
