"""Truth and gyroscope that part slowly are told, with when and how far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.parting import find_parting
from testbench.records.session.samples import Truth
from tests.estimation.test_access import samples_of
from tests.estimation.test_truth_faults import ramped


@pytest.fixture(scope="module")
def motion():
    """Samples and the truth of them; gyroscope and body are not aligned, and its scale is off."""
    samples, truth = samples_of()
    crooked = np.array([[1.02, 0.01, 0.0], [0.0, 0.98, 0.01], [0.01, 0.0, 1.01]])
    mounted = Rotation.from_euler("XYZ", [20, -70, 110], degrees=True).as_matrix() @ crooked
    bias = np.radians([0.5, -1.0, 0.3])
    return replace(samples, gyr=samples.gyr @ mounted.T + bias), truth


def _found(samples, truth: Truth):
    half = int(np.median(np.diff(samples.device_time_ns))) // 2
    return find_parting(samples, samples.device_time_ns - half, truth)


def test_nothing_is_told_where_both_turn_alike(motion):
    assert _found(*motion) is None


@pytest.mark.parametrize(
    ("begin", "seconds", "degrees"),
    [(61.3, 0.5, 7), (40.2, 1, -20), (92.9, 5, 20), (121.7, 20, 20), (61.3, 40, 20)],
)
def test_a_truth_that_drifts_is_told(motion, begin, seconds, degrees):
    samples, truth = motion
    found = _found(samples, ramped(truth, begin, seconds, degrees))
    assert found is not None
    # a slow drift over a fifth of the recording is in part taken for a bias
    near = 1.5 if seconds <= 20 else 4.0
    assert np.degrees(found.angle) == pytest.approx(abs(degrees), abs=near)
    assert found.begin_ns * 1e-9 == pytest.approx(begin, abs=near)
    assert found.end_ns * 1e-9 == pytest.approx(begin + seconds, abs=near)


def test_a_gap_is_no_parting(motion):
    samples, truth = motion
    lost = np.abs(samples.device_time_ns * 1e-9 - 90) < 4
    gyr = np.where(lost[:, None], np.nan, samples.gyr)
    assert _found(replace(samples, gyr=gyr), truth) is None


def test_fast_turns_about_changing_axes_are_followed():
    """700 deg/s at its most: means of rates no longer add up to the turn."""
    t = np.arange(0, 60, 0.005)
    angles = np.column_stack([np.cumsum(np.sin(0.7 * t)), 90 * np.sin(9 * t), 80 * np.sin(11 * t)])
    q = Rotation.from_euler("ZYX", angles, degrees=True)
    samples, _ = samples_of()
    gyr = (q[:-1].inv() * q[1:]).as_rotvec() / 0.005
    stamps = np.round(t[1:] * 1e9).astype(np.int64)
    own = replace(
        samples,
        device_time_ns=stamps,
        host_time_ns=stamps,
        gyr=gyr,
        acc=np.zeros_like(gyr),
        counter=np.arange(len(stamps)),
        **{
            name: None
            for name in ("mag", "device_q", "temperature", "status")
            if hasattr(samples, name)
        },
    )
    truth = Truth(np.round(t * 1e9).astype(np.int64), q.as_quat(scalar_first=True))
    assert np.degrees(np.linalg.norm(gyr, axis=1).max()) > 700
    assert _found(own, truth) is None
    found = _found(own, ramped(truth, 30, 4, 40))
    assert found is not None
    assert np.degrees(found.angle) == pytest.approx(40, abs=8)
