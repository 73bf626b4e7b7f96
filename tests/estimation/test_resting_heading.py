"""A heading that turns while its sensor rests is measured and named."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.alignment.resting_heading import drift_finding, resting_drift
from testbench.estimation.filters import get_filter
from testbench.model import rotation

TIME_NS = (np.arange(6000) * 1e7).astype(np.int64)
RESTING = (np.arange(6000) // 1000) % 2 == 0  # ten seconds of rest, ten of motion


def turning(resting_deg_s: float, moving_deg_s: float) -> np.ndarray:
    """About the vertical, tilted by 30 deg, shape (n, 4)."""
    rate = np.where(RESTING, resting_deg_s, moving_deg_s)
    heading = rotation.from_heading(np.radians(np.cumsum(rate) * 0.01))
    return rotation.multiply(heading, rotation.from_rotation_vector(np.radians([30.0, 0.0, 0.0])))


@pytest.mark.parametrize("drift", [0.0, 0.02, 0.7, -20.0])
def test_the_drift_at_rest_is_found_whatever_happens_in_motion(drift):
    assert np.degrees(resting_drift(turning(drift, 35.0), TIME_NS, RESTING)) == pytest.approx(
        abs(drift), abs=1e-9
    )


def test_without_a_rest_there_is_none():
    assert resting_drift(turning(0.7, 0.7), TIME_NS, np.arange(6000) % 50 == 0) is None


def test_a_drift_is_named_for_filters_that_have_no_magnetometer():
    imufilter, marg = get_filter("imufilter"), get_filter("madgwick_marg")
    assert (
        "imufilter: its heading turns by 0.7 deg/s while the sensor rests (median over 30 s of "
        "rest)" in str(drift_finding(imufilter, turning(0.7, 0.0), TIME_NS, RESTING))
    )
    assert drift_finding(imufilter, turning(0.02, 50.0), TIME_NS, RESTING) is None
    assert drift_finding(marg, turning(0.7, 0.0), TIME_NS, RESTING) is None


def test_a_few_seconds_of_rest_are_not_enough_to_blame_a_filter():
    """A filter settles in its first seconds; five of them say nothing of a minute."""
    imufilter = get_filter("imufilter")
    short = RESTING & (TIME_NS < 5e9)
    assert drift_finding(imufilter, turning(19.0, 0.0), TIME_NS, short) is None
    assert drift_finding(imufilter, turning(19.0, 0.0), TIME_NS, RESTING) is not None
