"""Steps of a truth of a few degrees are told from what the gyroscope does wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.parted_truth import cut_at, told_of
from testbench.estimation.alignment.parting import Parting, find_partings
from testbench.records.session.samples import Truth
from tests.estimation.test_access import samples_of


@pytest.fixture(scope="module")
def motion():
    """Samples and the truth of them, with noise; gyroscope and body are not aligned."""
    samples, truth = samples_of()
    mounted = Rotation.from_euler("XYZ", [20, -70, 110], degrees=True).as_matrix()
    noise = np.random.default_rng(6).normal(0, np.radians(0.2), (len(truth.host_time_ns), 3))
    q = Rotation.from_quat(truth.q_world_from_sensor, scalar_first=True)
    q = (q * Rotation.from_rotvec(noise)).as_quat(scalar_first=True)
    gyr = samples.gyr @ (mounted @ np.diag([1.02, 0.98, 1.01])).T + np.radians([0.5, -1.0, 0.3])
    return replace(samples, gyr=gyr), replace(truth, q_world_from_sensor=q)


def relabelled(truth: Truth, at: float, degrees: float, of_body: bool) -> Truth:
    """From a time on of another body, or in another world."""
    by = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, -0.64, 0.48]))
    q = Rotation.from_quat(truth.q_world_from_sensor, scalar_first=True)
    other = (q * by if of_body else by * q).as_quat(scalar_first=True)
    late = truth.host_time_ns * 1e-9 >= at
    return replace(
        truth, q_world_from_sensor=np.where(late[:, None], other, q.as_quat(scalar_first=True))
    )


def _partings(samples, truth: Truth) -> list[Parting]:
    half = int(np.median(np.diff(samples.device_time_ns))) // 2
    return find_partings(samples, samples.device_time_ns - half, truth)


@pytest.mark.parametrize("of_body", [True, False])
@pytest.mark.parametrize("at", [40.2, 61.3, 92.9, 121.7])
@pytest.mark.parametrize("degrees", [4.5, 6.0])
def test_a_small_step_is_found_where_it_is(motion, at, degrees, of_body):
    samples, truth = motion
    (found,) = _partings(samples, relabelled(truth, at, degrees, of_body))
    assert found.sharp
    assert np.degrees(found.angle) == pytest.approx(degrees, abs=1.5)
    assert found.begin_ns * 1e-9 == pytest.approx(at, abs=0.3)
    assert found.end_ns * 1e-9 == pytest.approx(at, abs=0.3)


def test_none_is_found_where_both_turn_alike(motion):
    assert _partings(*motion) == []


def test_the_truth_is_cut_at_every_step_and_told_as_one_that_steps(motion):
    samples, truth = motion
    for at in (40.2, 92.9, 150.0):
        truth = relabelled(truth, at, 5.0, of_body=True)
    found = _partings(samples, truth)
    assert len(found) == 3 and all(own.sharp for own in found)
    time = samples.device_time_ns
    cut = cut_at(found, truth, time)
    assert cut is not None
    told = told_of(found, time, time, cut[1])
    assert (told.code, told.values["steps"]) == ("truth.stepped", 3)
    assert {own.reason for own in cut[2]} == {"the truth has stepped"}
    assert "steps 3 times by up to" in told.sentence and "first at 40." in told.sentence
