import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.vector_mounting import mounting_from_vectors


def angle_deg(q, expected):
    return np.degrees((Rotation.from_quat(q, scalar_first=True) * expected.inv()).magnitude())


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_rates_alone_give_the_mounting(seed):
    rng = np.random.default_rng(seed)
    X = Rotation.random(rng=rng)
    rate = rng.standard_normal((500, 3))
    found = mounting_from_vectors([(X.apply(rate), rate, 500)])
    assert angle_deg(found.q_body_from_sensor, X) < 1e-6
    assert found.observability > 0.5
    assert found.warning() is None


def test_one_axis_of_turning_is_refused_and_gravity_helps():
    rng = np.random.default_rng(5)
    X = Rotation.random(rng=rng)
    rate = rng.standard_normal((500, 1)) * [1.0, 0, 0]
    alone = mounting_from_vectors([(X.apply(rate), rate, 500)])
    assert not alone.trusted
    assert "cannot be solved" in alone.warning()
    assert "(1.00, 0.00, 0.00) in the sensor (it reaches 0.000 beside it" in alone.warning()
    force = np.tile([0, 9.8, 1.0], (50, 1))
    both = mounting_from_vectors([(X.apply(rate), rate, 500), (X.apply(force), force, 50)])
    assert both.trusted
    assert angle_deg(both.q_body_from_sensor, X) < 1e-6


def test_the_stated_uncertainty_is_that_of_repeats():
    rng = np.random.default_rng(6)
    X = Rotation.random(rng=rng)
    rate, force = (
        rng.standard_normal((200, 3)) * [1, 0.4, 0.1],
        Rotation.random(20, rng=rng).apply([0, 0, 9.8]),
    )
    errors, stated = [], []
    for _ in range(300):
        noisy = [
            (X.apply(v), v + size * rng.standard_normal(v.shape), len(v))
            for v, size in ((rate, 0.05), (force, 0.02))
        ]
        found = mounting_from_vectors(noisy)
        errors.append(
            (X.inv() * Rotation.from_quat(found.q_body_from_sensor, scalar_first=True)).as_rotvec()
        )
        stated.append(found.sd)
    np.testing.assert_allclose(np.std(errors, axis=0), np.mean(stated, axis=0), rtol=0.15)


def test_no_pair_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        mounting_from_vectors([(np.zeros((0, 3)), np.zeros((0, 3)), 0)])
