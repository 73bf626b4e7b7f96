"""Heading over time: yaw against SciPy, and drifts that are put in and come out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.heading import heading_drift, heading_error, yaw

TIME = np.arange(1000, dtype=np.int64) * 10_000_000
SWING = Rotation.from_euler(
    "YX", np.column_stack([0.5 * np.sin(TIME / 1e9 * 5), 0.1 * np.cos(TIME / 1e9 * 5)])
)


def quaternion(turn: Rotation) -> np.ndarray:
    return turn.as_quat(scalar_first=True)


def drifting(total: float) -> np.ndarray:
    ramp = np.clip((TIME / 1e9 - 1) / 8, 0, 1)
    return quaternion(Rotation.from_euler("Z", (total * ramp)[:, None]) * SWING)


def test_yaw_is_the_first_angle_of_zyx():
    turns = Rotation.from_euler("ZYX", np.random.default_rng(1).uniform(-1.2, 1.2, size=(50, 3)))
    each = np.array([yaw(quaternion(turn)[None])[0] for turn in turns])
    np.testing.assert_allclose(each, turns.as_euler("ZYX")[:, 0], atol=1e-12)


@pytest.mark.parametrize("total", [0.3, -2.0, 9.0])
def test_a_drift_that_is_put_in_comes_out_with_its_turns(total):
    found = heading_drift(TIME, drifting(total), quaternion(SWING))
    assert found.drift == pytest.approx(total, abs=1e-9)
    assert found.largest == pytest.approx(abs(total), abs=1e-9)
    assert found.span_s == pytest.approx(9.5)


def test_an_earth_of_another_heading_is_no_drift():
    turned = rotation.multiply(rotation.from_heading(2.5), drifting(0.0))
    assert heading_drift(TIME, turned, quaternion(SWING)).drift == pytest.approx(0, abs=1e-12)


def test_without_a_truth_the_yaw_itself_is_the_drift():
    assert heading_drift(TIME, drifting(1.5)).drift == pytest.approx(1.5, abs=1e-2)


def test_samples_without_truth_are_left_out():
    q_true = quaternion(SWING)
    q_true[:200] = np.nan
    assert heading_drift(TIME, drifting(4.0), q_true).drift < 4.0
    assert np.isnan(heading_error(drifting(4.0), q_true)[:200]).all()
    with pytest.raises(InputError, match="at least ten samples"):
        heading_drift(TIME[:200], drifting(1.0)[:200], q_true[:200])
