"""Vectors seen from where a window began, against SciPy's rotations step by step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.consistency.angular_rate import Windows, sums


@pytest.mark.parametrize("step", [1e-12, 1e-4, 0.05, 0.3999, 0.4001, 1.0, 3.0])
def test_means_are_those_of_small_rotations_one_after_the_other(step):
    """At every angle of a step [rad], on both sides of where its series ends."""
    rng = np.random.default_rng(5)
    bias, seconds = np.array([0.3, -0.2, 0.1]), 0.01
    rates, vectors = rng.standard_normal((2, 41, 3))
    middle = (rates[1:] + rates[:-1]) / 2 - bias
    rates = rates - bias
    rates *= step / seconds / np.linalg.norm(middle, axis=1).max()
    rates += bias
    windows = Windows(
        np.array([[0, 20]]), np.array([[20, 40]]), np.array([[[0.5, 0.5]]]), seconds, 1.0
    )
    turned, expected = Rotation.identity(), np.zeros((3, 3, 3))
    for row in range(40):
        expected += np.einsum("ij,k->ijk", turned.as_matrix(), vectors[row]) / 40
        rate = (rates[row] + rates[row + 1]) / 2 - bias
        turned = turned * Rotation.from_rotvec(rate * seconds)
    found = sums(rates, vectors, windows, bias=bias)[0, 0]
    np.testing.assert_allclose(found, expected, atol=1e-13)
