"""Integrators have the order they state, keep the length they state, and agree with oracles that
share no code with them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from testbench.exceptions import InputError, NotFoundError
from testbench.model.integrators import CG4_B, CG4_C, INTEGRATORS, get_integrator, steps_as_printed

DURATION = 4.0


def smooth_rate(t: np.ndarray) -> np.ndarray:
    """A rate about all axes, up to about 2 rad/s, whose direction changes all the time."""
    return np.stack(
        [1.2 * np.sin(1.3 * t) + 0.3, 0.9 * np.cos(2.1 * t), 0.7 * np.sin(0.8 * t + 1.0) - 0.4],
        axis=-1,
    )


@pytest.fixture(scope="module")
def reference() -> np.ndarray:
    """The rotation matrix after DURATION, by SciPy's DOP853 on the matrix equation dR/dt = R
    [w]x.
    """

    def derivative(t: float, flat: np.ndarray) -> np.ndarray:
        x, y, z = smooth_rate(np.array(t))
        return (flat.reshape(3, 3) @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])).ravel()

    solution = solve_ivp(
        derivative, (0, DURATION), np.eye(3).ravel(), method="DOP853", rtol=1e-13, atol=1e-14
    )
    return solution.y[:, -1].reshape(3, 3)


def error_rad(q: np.ndarray, reference: np.ndarray) -> float:
    return float(
        (
            Rotation.from_matrix(reference).inv() * Rotation.from_quat(q, scalar_first=True)
        ).magnitude()
    )


def exact_stages(integrator, n: int, step: float) -> np.ndarray:
    """The rates at the stages of n steps, shape (n, nodes, 3)."""
    at = step * np.arange(n)[:, None] + step * np.array(integrator.nodes)
    return smooth_rate(at.ravel()).reshape(n, len(integrator.nodes), 3)


def errors_at(
    name: str, counts: list[int], reference: np.ndarray, sampled: str | None
) -> np.ndarray:
    """Angle errors with rates that are exact at the stages, or taken from samples."""
    integrator, found = get_integrator(name), []
    for n in counts:
        step = DURATION / n
        if sampled is None:
            q = integrator.steps(exact_stages(integrator, n, step), step)
        else:
            q = integrator.integrate(smooth_rate(step * np.arange(n + 1)), step, stages=sampled)
        found.append(error_rad(q[-1], reference))
    return np.array(found)


def slopes(errors: np.ndarray) -> np.ndarray:
    return np.log2(errors[:-1] / errors[1:])


@pytest.mark.parametrize(
    ("name", "order", "counts"),
    [
        ("euler", 1, [800, 1600, 3200]),
        ("euler_raw", 1, [800, 1600, 3200]),
        ("trapezoid", 2, [200, 400, 800]),
        ("tustin", 2, [200, 400, 800]),
        ("rk4", 4, [40, 80, 160]),
        ("cg4", 4, [40, 80, 160]),
        ("midpoint", 2, [200, 400, 800]),
    ],
)
def test_the_error_falls_with_the_stated_order_when_the_rates_are_exact(
    name, order, counts, reference
):
    assert get_integrator(name).order == order
    assert slopes(errors_at(name, counts, reference, None)) == pytest.approx(order, abs=0.12)


@pytest.mark.parametrize("name", ["trapezoid", "tustin", "rk4", "cg4", "midpoint"])
def test_rates_that_are_interpolated_between_samples_hold_every_method_to_order_two(
    name, reference
):
    assert slopes(errors_at(name, [200, 400, 800], reference, "interpolated")) == pytest.approx(
        2, abs=0.05
    )


def test_a_measured_middle_gives_rk4_its_fourth_order_back(reference):
    assert slopes(errors_at("rk4", [80, 160, 320], reference, "measured")) == pytest.approx(
        4, abs=0.12
    )


@pytest.mark.parametrize("name", ["rk4", "cg4", "midpoint"])
def test_a_rate_held_constant_over_the_step_leaves_order_one(name, reference):
    assert slopes(errors_at(name, [400, 800, 1600], reference, "constant")) == pytest.approx(
        1, abs=0.1
    )


def test_at_twenty_milliseconds_the_methods_stand_apart_by_the_known_sizes(reference):
    exact = {name: np.degrees(errors_at(name, [200], reference, None)[0]) for name in INTEGRATORS}
    assert exact["cg4"] < 1e-6 and exact["rk4"] < 1e-5
    assert 1e-4 < exact["midpoint"] < 2e-2 and 1e-4 < exact["trapezoid"] < 2e-2
    assert exact["euler"] > 0.1
    interpolated = np.degrees(errors_at("cg4", [200], reference, "interpolated")[0])
    assert interpolated > 1000 * exact["cg4"]


def test_the_crouch_grossman_coefficients_meet_the_quadrature_conditions_of_order_four():
    b, c = np.array(CG4_B), np.array(CG4_C)
    for power in range(4):
        assert b @ c**power == pytest.approx(1 / (power + 1), abs=2e-15)


@pytest.mark.parametrize("name", ["cg4", "midpoint", "euler"])
def test_products_of_rotations_keep_unit_length_over_a_hundred_thousand_steps(name):
    t = 0.01 * np.arange(100_001)
    q = get_integrator(name).integrate(smooth_rate(t), 0.01)
    assert np.abs(np.linalg.norm(q, axis=1) - 1).max() < 1e-10


@given(rate=st.floats(0.1, 40.0), step=st.floats(1e-3, 0.05))
def test_the_length_grows_and_shrinks_by_the_stability_function_of_each_method(rate, step):
    """For a constant rate the eigenvalues of a step are R(+-i z), z = rate step / 2: an oracle on
    paper.
    """
    z = rate * step / 2
    expected = {"euler_raw": abs(1 + 1j * z), "trapezoid": abs(1 + 1j * z + (1j * z) ** 2 / 2)}
    expected["rk4"] = abs(sum((1j * z) ** k / f for k, f in enumerate((1, 1, 2, 6, 24))))
    for name, growth in expected.items():
        q = get_integrator(name).integrate(np.tile([0.6 * rate, 0.0, 0.8 * rate], (11, 1)), step)
        assert np.linalg.norm(q[-1]) == pytest.approx(growth**10, rel=1e-12)


def test_the_length_drifts_within_the_bounds_of_the_methods_at_twenty_milliseconds():
    rates = smooth_rate(0.02 * np.arange(201))
    drift = {
        n: abs(np.linalg.norm(get_integrator(n).integrate(rates, 0.02)[-1]) - 1)
        for n in ("euler_raw", "trapezoid", "rk4")
    }
    fastest = np.linalg.norm(rates, axis=1).max()
    z = fastest * 0.02 / 2
    assert (
        drift["rk4"] < 200 * z**6 / 144
        and drift["trapezoid"] < 200 * z**4 / 8 + 200 * (fastest * 0.02) ** 4
    )
    assert 1e-3 < drift["euler_raw"] < 200 * z**2 / 2


RATES = st.lists(st.tuples(*[st.floats(-60, 60)] * 3), min_size=2, max_size=12).map(np.array)


@given(rates=RATES, step=st.floats(1e-3, 0.05))
def test_tustin_solves_its_linear_equation(rates, step):
    """(I - h/4 W(w1)) q1 = (I + h/4 W(w0)) q0 with the matrix W of q (0, w), solved by NumPy."""

    def matrix(w):
        return np.array(
            [[0, *-w], [w[0], 0, w[2], -w[1]], [w[1], -w[2], 0, w[0]], [w[2], w[1], -w[0], 0]]
        )

    q = np.array([1.0, 0.0, 0.0, 0.0])
    expected = [q]
    for before, after in pairwise(rates):
        q = np.linalg.solve(
            np.eye(4) - step / 4 * matrix(after), (np.eye(4) + step / 4 * matrix(before)) @ q
        )
        expected.append(q)
    found = get_integrator("tustin").integrate(rates, step)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@given(rates=RATES, step=st.floats(1e-3, 0.05))
def test_tustin_keeps_the_length_times_its_law(rates, step):
    q = get_integrator("tustin").integrate(rates, step)
    kept = np.sum(q**2, axis=1) * (1 + np.sum((step * rates / 4) ** 2, axis=1))
    np.testing.assert_allclose(kept / kept[0], 1, atol=1e-12)


def test_from_rest_to_rest_tustin_ends_at_the_length_it_began_with_and_is_shorter_between():
    rates = np.zeros((201, 3))
    rates[1:-1] = smooth_rate(0.02 * np.arange(199))
    length = np.linalg.norm(get_integrator("tustin").integrate(rates, 0.02), axis=1)
    assert abs(length[-1] - 1) < 1e-12 and (length[1:-1] < 1).all()


@given(
    axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    rate=st.floats(-30, 30),
    step=st.floats(1e-4, 0.02),
)
def test_a_constant_rate_is_integrated_exactly_by_rotations(axis, rate, step):
    vector = rate * np.array(axis) / np.linalg.norm(axis)
    expected = Rotation.from_rotvec(vector * step * 20)
    for name in ("cg4", "midpoint"):
        q = get_integrator(name).integrate(np.tile(vector, (21, 1)), step)
        assert (expected.inv() * Rotation.from_quat(q[-1], scalar_first=True)).magnitude() < 1e-12


def test_rates_are_the_bodys_own_and_the_start_stands_on_the_left(reference):
    integrator = get_integrator("cg4")
    start = np.array([0.5, -0.5, 0.5, 0.5])
    stages = exact_stages(integrator, 200, 0.02)
    q = integrator.steps(stages, 0.02, start)
    expected = Rotation.from_quat(start, scalar_first=True).as_matrix() @ reference
    assert error_rad(q[-1], expected) < 1e-7
    assert np.array_equal(q[0], start)


def test_the_formula_as_printed_is_followed_to_the_letter():
    """q <- (q + h/2 (f(w0, q) + f(w1, q + h f(w0, q)))) / 2 with f = q w, written out here with
    SciPy's product.
    """
    h, rates = 0.02, smooth_rate(0.02 * np.arange(4))
    q = np.array([1.0, 0.0, 0.0, 0.0])

    def product(p, w):
        matrix = np.array(
            [[0, *-w], [w[0], 0, w[2], -w[1]], [w[1], -w[2], 0, w[0]], [w[2], w[1], -w[0], 0]]
        )
        return matrix @ p

    expected = [q]
    for w0, w1 in pairwise(rates):
        q = (q + h / 2 * (product(q, w0) + product(q + h * product(q, w0), w1))) / 2
        expected.append(q)
    trapezoid = get_integrator("trapezoid")
    stages, _ = trapezoid.stages_from_samples(rates)
    assert np.allclose(steps_as_printed(trapezoid, stages, h), expected, atol=1e-15)
    assert np.allclose(steps_as_printed(trapezoid, 0 * stages, h)[:, 0], [1, 0.5, 0.25, 0.125])


def test_what_does_not_fit_is_refused_with_what_does():
    rates = np.zeros((10, 3))
    with pytest.raises(NotFoundError, match="known: euler"):
        get_integrator("rk5")
    with pytest.raises(InputError, match="odd number of samples, not 10"):
        get_integrator("rk4").integrate(rates, 0.01, stages="measured")
    with pytest.raises(InputError, match="only its middle can be measured"):
        get_integrator("cg4").integrate(rates[:9], 0.01, stages="measured")
    with pytest.raises(InputError, match=r"shape \(n, 3, 3\)"):
        get_integrator("rk4").steps(np.zeros((4, 2, 3)), 0.01)
    with pytest.raises(InputError, match="two samples"):
        get_integrator("rk4").integrate(rates[:1], 0.01)
