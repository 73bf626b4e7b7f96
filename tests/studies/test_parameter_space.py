"""Walking through parameters: the least cost that was planted is found, however the parameters are
scaled.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.estimation.filters.base import Parameter, switch
from testbench.exceptions import InputError, NotFoundError
from testbench.pipeline.parameter_space import FAILED, Axis, Effort, Space, find_optimum

GAIN = Parameter("gain", 0.1, "1", "", "", 0.001, 10.0)
TAU = Parameter("tau", 3.0, "s", "", "", 1.0, 9.0, "linear")
GATE = Parameter("gate", 0.0, "1", "", "", 0.05, 5.0)
FAST = switch("fast", False, "", "")


@given(st.sampled_from([GAIN, TAU, GATE]), st.floats(0, 1))
def test_a_part_of_a_range_is_a_value_and_back(parameter, part):
    axis = Axis(parameter)
    value = axis.value(part)
    assert parameter.low <= value <= parameter.high
    assert axis.part(value) == pytest.approx(part, abs=1e-9)


def test_grids_follow_the_scale_and_keep_what_is_off_by_default():
    np.testing.assert_allclose(Axis(GAIN).grid(5), [1e-3, 1e-2, 0.1, 1, 10])
    np.testing.assert_allclose(Axis(TAU).grid(5), [1, 3, 5, 7, 9])
    assert Axis(GATE).grid(3) == pytest.approx([0, 0.05, 0.5, 5])
    assert Axis(FAST).grid(7) == [0, 1]


@given(st.floats(-2.8, 0.8), st.floats(1.2, 8.8))
def test_the_planted_optimum_of_two_parameters_is_found(log_gain, tau):
    space = Space.of([GAIN, TAU, GATE], ["gain", "tau"])

    def cost(point):
        return float(np.hypot(3 * (np.log10(point[0]) - log_gain), point[1] - tau) ** 2 + 1.5)

    found = find_optimum(space, (0.1, 3.0), cost, Effort())
    assert found.converged
    assert found.value == pytest.approx(1.5, abs=2e-3)
    assert np.log10(found.point[0]) == pytest.approx(log_gain, abs=0.03)
    assert found.point[1] == pytest.approx(tau, abs=0.06)
    assert space.at_edge(found.point) == []


def test_switches_and_what_is_off_are_found_on_the_grid_and_stay_as_they_are():
    space = Space.of([GAIN, GATE, FAST], None)

    def cost(point):
        gain, gate, fast = point
        return (np.log10(gain) + 1.3) ** 2 + (0 if gate == 0 else 1) + (0 if fast else 2)

    found = find_optimum(space, (0.1, 0.5, 0.0), cost, Effort())
    assert found.point[1:] == (0.0, 1.0)
    assert np.log10(found.point[0]) == pytest.approx(-1.3, abs=0.02)


def test_many_parameters_are_walked_through_one_after_the_other():
    parameters = [Parameter(f"p{i}", 1.0, "1", "", "", 0.01, 100.0) for i in range(6)]
    space, effort = Space.of(parameters, None), Effort(values=9, points=300)
    planted = np.array([-1.5, -1, -0.5, 0.5, 1, 1.5])
    assert effort.grid(space)[0] is False
    found = find_optimum(
        space, (1.0,) * 6, lambda p: float(np.sum((np.log10(p) - planted) ** 2)), effort
    )
    np.testing.assert_allclose(np.log10(found.point), planted, atol=0.05)
    assert len(found.tried) < 6 * 9 * 2


@given(st.integers(0, 10_000))
def test_a_search_never_ends_worse_than_it_began(seed):
    space = Space.of([GAIN, TAU], None)

    def cost(point):  # rough and without any shape
        return float(
            np.random.default_rng(
                [seed, *np.frombuffer(np.array(point).tobytes(), np.uint32)]
            ).uniform(0, 5)
        )

    found = find_optimum(space, (0.1, 3.0), cost, Effort(values=3))
    assert found.value <= cost((0.1, 3.0))
    assert found.value == cost(found.point)
    assert found.value <= min(cost(point) for point in found.tried)


def test_an_optimum_at_the_end_of_a_range_is_said_to_be_there():
    space = Space.of([GAIN], None)
    found = find_optimum(space, (0.1,), lambda point: -np.log(point[0]), Effort())
    assert found.point == (10.0,)
    assert space.at_edge(found.point) == ["gain"]


def test_where_a_filter_fails_is_never_the_optimum():
    space = Space.of([GAIN], None)
    found = find_optimum(
        space,
        (0.1,),
        lambda p: np.inf if p[0] > 0.02 else 1 + np.log10(p[0] / 0.005) ** 2,
        Effort(),
    )
    assert found.point[0] == pytest.approx(0.005, rel=0.05)
    assert find_optimum(space, (0.1,), lambda p: np.nan, Effort(values=3)).value == FAILED


def test_parameters_that_cannot_be_tuned_are_refused():
    with pytest.raises(NotFoundError, match="'zeta'; known: gain, tau"):
        Space.of([GAIN, TAU], ["zeta"])
    with pytest.raises(InputError, match="twice"):
        Space.of([GAIN, TAU], ["tau", "tau"])
    with pytest.raises(InputError, match="no parameter"):
        Space.of([], None)
    with pytest.raises(InputError, match="cannot be walked through"):
        Space.of([Parameter("gain", 1.0, "1", "", "", 0.0, 1.0)], None)
