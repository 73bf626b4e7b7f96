"""Axis maps: signed permutations, presets, and what they do to vectors and orientations alike."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.exceptions import InputError, NotFoundError
from testbench.formats.axes import AxisMap, AxisNames, axis_presets, find_axes
from testbench.model import rotation

SIGNED = [
    AxisNames(x=signs[0] + p[0], y=signs[1] + p[1], z=signs[2] + p[2])
    for p in itertools.permutations("xyz")
    for signs in itertools.product(["", "-"], repeat=3)
]
PROPER = [names for names in SIGNED if AxisMap.from_names(names).is_rotation]
numbers = st.floats(-100, 100)
vectors = st.tuples(numbers, numbers, numbers)


def test_half_of_all_signed_permutations_are_rotations() -> None:
    assert len(SIGNED) == 48 and len(PROPER) == 24


@given(st.sampled_from(SIGNED), vectors)
def test_a_map_is_its_matrix(names: AxisNames, vector: tuple[float, float, float]) -> None:
    axes = AxisMap.from_names(names)
    np.testing.assert_array_equal(axes.vectors(np.array([vector]))[0], axes.matrix @ vector)
    np.testing.assert_array_equal(axes.matrix @ axes.matrix.T, np.eye(3))


@given(st.sampled_from(PROPER), vectors, st.tuples(numbers, numbers, numbers, numbers))
def test_vectors_and_orientations_turn_together(
    names: AxisNames, vector: tuple[float, ...], q: tuple[float, ...]
) -> None:
    q_earth_from_file = rotation.normalise(np.array([q]) + [[1e-3, 0, 0, 0]])
    axes = AxisMap.from_names(names)
    before = rotation.rotate(q_earth_from_file, np.array([vector]))
    after = rotation.rotate(axes.orientations(q_earth_from_file), axes.vectors(np.array([vector])))
    np.testing.assert_allclose(after, before, atol=1e-9)


def test_the_presets_are_those_of_the_thesis_and_rotations() -> None:
    presets = axis_presets()
    assert {name: (p.x, p.y, p.z) for name, p in presets.items()} == {
        "left_leg_enu": ("x", "-y", "-z"),
        "left_leg_frontal": ("-z", "-y", "-x"),
        "left_leg_side": ("y", "-z", "-x"),
    }
    for name in presets:
        assert find_axes(name).is_rotation


def test_a_map_can_be_written_out() -> None:
    expected = find_axes("left_leg_frontal").matrix
    for text in ("x: -z, y: -y, z: -x", "x=-z,y=-y,z=-x", "{z: -x, x: -z, y: -y}"):
        np.testing.assert_array_equal(find_axes(text).matrix, expected)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x: -x, y: y, z: z", "left-handed"),
        ("x: y, y: x, z: z", "left-handed"),
        ("x: x, y: x, z: z", "exactly once"),
        ("x: x, y: y", "is not an axis map"),
        ("x: u, y: v, z: w", "is not an axis map"),
    ],
)
def test_a_map_that_is_none_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        find_axes(text)


def test_an_unknown_preset_is_refused_with_those_that_exist() -> None:
    with pytest.raises(NotFoundError, match="left_leg_side"):
        find_axes("right_arm")
