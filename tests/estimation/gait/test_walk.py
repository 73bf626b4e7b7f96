"""From orientations to a path: straight on, round a corner, and by the published parameters."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.gait import PUBLISHED, PedestrianParameters, walk
from testbench.model import rotation
from testbench.records.specs.published import load_published_tables

PARAMETERS = PUBLISHED["universal"]


def swinging(
    cycles: int,
    turn_deg=0.0,
    turn_after: int | None = None,
    amplitude_deg=20.0,
    frequency=1.0,
    rate=100.0,
):
    """Rest, cycles with a turn of the heading between two of them, rest: times [ns],
    q_world_from_level.
    """
    t = np.arange(-2.0, cycles / frequency + 2.0, 1 / rate)
    during = (t >= 0) & (t < cycles / frequency)
    pitch = np.where(during, np.radians(amplitude_deg) * np.sin(2 * np.pi * frequency * t), 0.0)
    yaw = np.radians(turn_deg) * (t * frequency >= (cycles if turn_after is None else turn_after))
    angles = np.column_stack([yaw, pitch, np.zeros(len(t))])
    return np.round((t - t[0]) * 1e9).astype(np.int64), rotation.from_euler("ZYX", angles)


def test_a_straight_walk_is_as_long_as_its_cycles():
    found = walk(*swinging(12), PARAMETERS)
    length = 0.0294 * 40 + 0.232
    assert len(found.cycles) == 12
    assert found.distance == pytest.approx(12 * length, rel=1e-3)
    np.testing.assert_allclose(found.end, [12 * length, 0], rtol=1e-3, atol=1e-9)
    assert found.positions.shape == (13, 2)


@pytest.mark.parametrize("turn", [90.0, -90.0, 180.0, 200.0])
def test_a_corner_turns_the_path(turn):
    found = walk(*swinging(10, turn, 4), PARAMETERS)
    length = found.distance / 10
    expected = length * (
        4 * np.array([1, 0]) + 6 * np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))])
    )
    np.testing.assert_allclose(found.end, expected, atol=0.02)


def test_the_initial_heading_turns_all_of_it():
    one, other = walk(*swinging(5), PARAMETERS), walk(*swinging(5), PARAMETERS, heading=np.pi / 2)
    np.testing.assert_allclose(other.end, [-one.end[1], one.end[0]], atol=1e-9)


def test_a_heading_beyond_half_a_turn_does_not_jump():
    time, q = swinging(20)
    spin = rotation.from_heading(np.linspace(0, 4 * np.pi, len(q)))
    headings = walk(time, rotation.multiply(spin, q), PARAMETERS).headings
    assert (np.diff(headings) > 0).all() and np.ptp(headings) > 3 * np.pi


def test_without_cycles_there_is_no_way():
    time, q = swinging(0)
    found = walk(time, q, PARAMETERS)
    assert found.distance == 0
    np.testing.assert_array_equal(found.end, [0, 0])


def test_the_published_parameters_are_those_of_table_11():
    rows = load_published_tables("reference_4").tables["11"].rows
    assert {row.label for row in rows} == set(PUBLISHED) - {"universal"}
    for row in rows:
        own = PUBLISHED[row.label]
        assert [own.amplitude_deg, own.false_zero_deg, own.intercept_m] == row.values


def test_the_published_parameters_make_sense_as_a_line_and_none_as_a_product():
    cycle = 151.72 / 109  # m, of the run they were tuned on
    for name, own in PUBLISHED.items():
        if name == "universal":
            continue
        swing_deg = (
            cycle - own.intercept_m
        ) / own.slope_m_deg  # that makes the run as long as it was
        assert own.length(swing_deg) == pytest.approx(cycle)
        assert 5 < swing_deg < 50  # what limbs and chest do in walking
    chest = PUBLISHED["ngimu_chest"]
    product = PedestrianParameters(intercept_m=chest.intercept_m, form="product")
    assert product.length(10) < 0.4  # m a cycle; nobody walks 109 of them to 151 m
