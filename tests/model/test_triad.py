"""TRIAD against rotations that are known, and TRIAD-to-TRIAD against the difference of two
orientations.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.triad import rotation_between_triads, triad

UP, NORTH = np.array([0.0, 0.0, 9.8]), np.array([0.0, 24.0, -39.0])


def random(n: int, seed: int) -> Rotation:
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=(n, 4)))


def test_the_joint_rotation_of_two_sensors_is_found_wherever_they_point():
    proximal, distal = random(100, 1), random(100, 2)  # world from sensor
    found = rotation_between_triads(
        proximal.inv().apply(UP),
        proximal.inv().apply(NORTH),
        distal.inv().apply(UP),
        distal.inv().apply(NORTH),
    )
    error = proximal.inv() * distal * Rotation.from_quat(found, scalar_first=True).inv()
    assert error.magnitude().max() < 1e-12


def test_it_is_the_difference_of_the_two_orientations_even_where_the_field_is_disturbed():
    generator = np.random.default_rng(3)
    proximal, distal = random(50, 4).inv(), random(50, 5).inv()
    seen = [
        turn.apply(v) + generator.normal(scale=0.5, size=(50, 3))
        for turn in (proximal, distal)
        for v in (UP, NORTH)
    ]
    world = triad(UP, NORTH)
    orientations = [
        rotation.from_matrix(world @ np.swapaxes(triad(*pair), 1, 2))
        for pair in (seen[:2], seen[2:])
    ]
    difference = rotation.multiply(rotation.conjugate(orientations[0]), orientations[1])
    direct = rotation_between_triads(*seen)
    assert rotation.angle(rotation.multiply(difference, rotation.conjugate(direct))).max() < 1e-9


def test_the_first_vector_is_met_exactly_and_the_second_only_in_its_plane():
    w = triad(np.array([0.0, 0, 2.0]), np.array([1.0, 0, 5.0]))
    np.testing.assert_allclose(w, np.column_stack([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]), atol=1e-12)
    assert np.linalg.det(w) == pytest.approx(1)


@pytest.mark.parametrize("second", [[0, 0, -3.0], [0, 0, 0.0]])
def test_two_vectors_in_one_line_are_refused(second):
    with pytest.raises(InputError, match="do not lie in one line"):
        triad(np.array([0.0, 0, 1]), np.array(second))
