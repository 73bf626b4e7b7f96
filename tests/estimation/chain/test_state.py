import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.stats import truncnorm

from testbench.estimation.chain.effect import no_effect
from testbench.estimation.chain.kernel import hold, truncated
from testbench.estimation.chain.state import (
    Process,
    confinement,
    drive,
    joint_motion,
    motion_size,
    propagate,
    state_indices,
    transition,
)

FREE = np.zeros((3, 2))
CONFINED = np.array([[0.4, 6.0], [0.0, 0.0], [-1.0, 1.5]])


def held_by(limits: np.ndarray) -> Process:
    """A kinematic process of joints with limits, shape (m, 2) [rad], and without noise."""
    m = len(limits)
    none = np.zeros(3 * m)
    return Process(0, state_indices(m, 0), limits, np.zeros((m, 2)), np.zeros(m), none, none)


@pytest.mark.parametrize(
    ("harmonics", "confined"), [(0, FREE), (0, CONFINED), (1, FREE), (4, FREE)]
)
def test_the_transition_has_the_derivative_it_says_and_moves_the_covariance_by_it(
    harmonics, confined
):
    rng = np.random.default_rng(harmonics)
    m = 3
    n = motion_size(m, harmonics) + 5
    x, dt = rng.normal(size=n), 0.013
    x[motion_size(m, harmonics) - 1] = 5.0
    moved = x.copy()
    F = transition(moved, m, harmonics, confined, dt)
    for i in range(n):
        high, low = x.copy(), x.copy()
        high[i] += 1e-6
        low[i] -= 1e-6
        transition(high, m, harmonics, confined, dt), transition(low, m, harmonics, confined, dt)
        np.testing.assert_allclose(F[:, i], (high - low) / 2e-6, atol=1e-8)
    root = rng.normal(size=(n, n))
    P, y = root @ root.T, x.copy()
    expected = F @ P @ F.T
    propagate(y, P, m, harmonics, confined, dt)
    np.testing.assert_allclose(P, expected, atol=1e-12 * np.abs(P).max())
    np.testing.assert_allclose(y, moved, atol=1e-14)


def test_the_series_is_a_fourier_series_whose_rate_and_acceleration_are_its_derivatives():
    """Against the series of the source, a_k cos + b_k sin at the base frequency, written out."""
    rng = np.random.default_rng(5)
    m, n, omega, dt = 2, 4, 4.0, 0.01
    a0, a, b = rng.normal(size=m), rng.normal(size=(n, m)), rng.normal(size=(n, m))
    x = np.concatenate([a0, *[row for k in range(n) for row in (a[k], b[k])], [omega]])
    indices = state_indices(m, n)
    motion, slopes = np.empty((3, m)), np.empty((3, m, 2 * n + 2))
    for i in range(50):
        t, k = i * dt, np.arange(1, n + 1)[:, None]
        cos, sin = np.cos(k * omega * t), np.sin(k * omega * t)
        expected = [
            a0 + np.sum(a * cos + b * sin, axis=0),
            np.sum(k * omega * (b * cos - a * sin), axis=0),
            np.sum(-((k * omega) ** 2) * (a * cos + b * sin), axis=0),
        ]
        joint_motion(x, indices, n, motion, slopes)
        np.testing.assert_allclose(motion, expected, atol=1e-9)
        transition(x, m, n, FREE, dt)


def test_the_slopes_of_the_joints_are_those_of_finite_differences():
    rng = np.random.default_rng(6)
    m, n = 2, 3
    x = rng.normal(size=motion_size(m, n))
    indices = state_indices(m, n)
    motion, slopes, spare = (
        np.empty((3, m)),
        np.empty((3, m, 2 * n + 2)),
        np.empty((3, m, 2 * n + 2)),
    )
    joint_motion(x, indices, n, motion, slopes)
    for j in range(m):
        for t, index in enumerate(indices[j]):
            sides = []
            for sign in (1, -1):
                y = x.copy()
                y[index] += sign * 1e-6
                joint_motion(y, indices, n, motion, spare)
                sides.append(motion[:, j].copy())
            np.testing.assert_allclose(slopes[:, j, t], (sides[0] - sides[1]) / 2e-6, atol=1e-7)


@pytest.mark.parametrize(
    ("confined", "long", "rtol"), [(FREE[:2], 0.3, 1e-13), (CONFINED[:2], 0.03, 1e-3)]
)
def test_two_short_steps_of_white_jerk_are_one_long_one(confined, long, rtol):
    m, x = 2, np.zeros(6)
    jerk, walk = np.array([2.0, 3.0]), np.zeros(6)
    once, twice = np.zeros((6, 6)), np.zeros((6, 6))
    drive(once, m, 0, jerk, confined, walk, long)
    for dt in (long / 3, 2 * long / 3):
        propagate(x, twice, m, 0, confined, dt)
        drive(twice, m, 0, jerk, confined, walk, dt)
    np.testing.assert_allclose(twice, once, rtol=rtol, atol=1e-18)


def test_a_confined_joint_follows_its_differential_equation():
    """Against the exponential of the equation's matrix, and Van Loan's of its noise."""
    (middle, rate), dt, density = CONFINED[0], 0.02, 3.0
    A = np.array([[0, 1, 0], [0, 0, 1], [-(rate**3), -3 * rate**2, -3 * rate]])
    x = np.array([0.9, -2.0, 30.0])
    expected = expm(A * dt) @ (x - [middle, 0, 0]) + [middle, 0, 0]
    transition(x, 1, 0, CONFINED[:1], dt)
    np.testing.assert_allclose(x, expected, rtol=1e-12)
    L = np.diag([0, 0, density])
    both = expm(np.block([[-A, L], [np.zeros((3, 3)), A.T]]) * dt)
    Q = np.zeros((3, 3))
    drive(Q, 1, 0, np.array([density]), CONFINED[:1], np.zeros(3), dt)
    np.testing.assert_allclose(Q, both[3:, 3:].T @ both[:3, 3:], rtol=1e-4)


def test_of_a_joint_that_nothing_tells_of_its_range_is_all_that_is_known_for_ever():
    limits, jerk = np.array([[-0.2, 0.4], [-np.inf, np.inf]]), np.array([900.0, 900.0])
    confined = confinement(limits, jerk)
    assert confined[0, 0] == pytest.approx(0.1)
    assert confined[1].tolist() == [0, 0]
    x, P = np.array([0.4, 0.0, 1.0, 0.0, 0.0, 0.0]), np.diag([1e-4, 0.0, 1e-2, 0.0, 1e-2, 0.0])
    for _ in range(1000):
        propagate(x, P, 2, 0, confined, 0.01)
        drive(P, 2, 0, jerk, confined, np.zeros(6), 0.01)
    assert x[0] == pytest.approx(0.1, abs=1e-6)
    assert np.sqrt(P[0, 0]) == pytest.approx(0.6 / np.sqrt(12), rel=1e-3)
    assert np.sqrt(P[1, 1]) > 100  # and of one without limits nothing


@given(
    mean=st.floats(-4, 4), sd=st.floats(0.1, 3), low=st.floats(-1.5, -0.1), high=st.floats(0.1, 1.5)
)
def test_a_cut_normal_density_has_the_moments_that_scipy_says(mean, sd, low, high):
    a, b = (low - mean) / sd, (high - mean) / sd
    if a > 6 or b < -6:
        return
    shift, variance = truncated(mean, sd, low, high)
    assert shift == pytest.approx(truncnorm.mean(a, b, mean, sd), abs=1e-6)
    assert variance == pytest.approx(truncnorm.var(a, b, mean, sd), abs=1e-6)


@pytest.mark.parametrize("mean", [-20.0, 20.0])
def test_far_beyond_a_limit_what_is_left_lies_at_the_limit(mean):
    shift, variance = truncated(mean, 1.0, -1.0, 1.0)
    assert shift == pytest.approx(truncnorm.mean(-1 - mean, 1 - mean, mean, 1.0), abs=1e-3)
    assert variance == pytest.approx(truncnorm.var(-1 - mean, 1 - mean, mean, 1.0), rel=0.02)


def test_a_joint_beyond_its_limit_is_brought_back_and_takes_along_what_goes_with_it():
    m = 1
    P = np.array([[0.04, 0.03, 0.0], [0.03, 0.09, 0.0], [0.0, 0.0, 1.0]])
    motion, slopes, h = np.empty((3, m)), np.empty((3, m, 3)), np.empty(3)
    limits = np.array([[-1.0, 1.0]])
    x, inside = np.array([1.2, 0.5, 0.3]), np.array([0.9, 0.5, 0.3])
    before = P.copy()
    hold(inside, P, no_effect(3, 1, (1, 1)), held_by(limits), motion, slopes, h)
    np.testing.assert_array_equal(P, before)  # within its limits nothing is done
    hold(x, P, no_effect(3, 1, (1, 1)), held_by(limits), motion, slopes, h)
    expected = truncnorm.mean(-11, -1, 1.2, 0.2)
    assert x[0] == pytest.approx(expected, abs=1e-6) and x[0] < 1.0
    assert x[1] == pytest.approx(0.5 + 0.03 / 0.04 * (expected - 1.2), abs=1e-6)
    assert x[2] == 0.3
    np.testing.assert_array_equal(
        P, before
    )  # put in with every sample it would make the filter sure of the limit


def test_a_joint_that_nothing_is_known_of_is_known_by_its_limits():
    m = 1
    x, P = np.array([0.4, 0.0, 0.0]), np.diag([9.0, 1.0, 1.0])
    P[0, 1] = P[1, 0] = 1.5
    motion, slopes, h = np.empty((3, m)), np.empty((3, m, 3)), np.empty(3)
    hold(x, P, no_effect(3, 1, (1, 1)), held_by(np.array([[-1.0, 1.0]])), motion, slopes, h)
    assert x[0] == pytest.approx(truncnorm.mean(-1.4 / 3, 0.2, 0.4, 3.0), abs=1e-6)
    assert P[0, 0] == pytest.approx(truncnorm.var(-1.4 / 3, 0.2, 0.4, 3.0), abs=1e-6)
    assert (np.linalg.eigvalsh(P) > 0).all()
