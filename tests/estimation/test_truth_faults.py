"""A truth that was lost is found in a recording of any length, by how the sensor turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation import estimate
from testbench.estimation.signals import access
from testbench.estimation.signals.mean_turning import MeanTurning
from testbench.estimation.signals.truth_faults import find_faults
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.records.session.samples import Truth
from testbench.records.specs.protocol import Analysis, Estimation
from tests.estimation.test_access import RATE, samples_of

EVERY = 7


def spoilt(truth: Truth) -> Truth:
    """Of another body for the last 50 s, and still for 6 s while the sensor turns."""
    time, q = truth.host_time_ns * 1e-9, truth.q_world_from_sensor.copy()
    late = time > 150
    by = Rotation.from_euler("X", 50, degrees=True)
    q[late] = (Rotation.from_quat(q[late], scalar_first=True) * by).as_quat(scalar_first=True)
    held = (time > 80) & (time < 86)
    q[held] = q[held][0]
    return replace(truth, q_world_from_sensor=q)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The sensor's estimate, all at once and in pieces."""
    samples, truth = samples_of()
    settings = Estimation(filters=["madgwick_imu"], align="motion", calibrate="none")
    folder = tmp_path_factory.mktemp("faults")
    sensor = ImportedSensor([samples], RATE, "synthetic", spoilt(truth))
    recording = Recording("faults", "faults", {"imu": sensor}, Analysis(estimate=settings))
    from datetime import UTC, datetime

    class Clock:
        def utc(self):
            return datetime(2026, 1, 1, tzinfo=UTC)

    session = write_recording(recording, [folder / "a.csv"], "made up", folder / "s", Clock())
    whole = estimate(session).sensors["imu"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(access, "MOST_KEPT", len(samples) // EVERY + 1)
        patch.setattr(access, "PIECE", 1_500)
        return whole, estimate(session).sensors["imu"]


def test_a_long_recording_loses_what_a_short_one_loses(found):
    whole, pieces = found
    assert (whole.every, pieces.every) == (1, EVERY)
    codes = [{own.code for own in sensor.findings} for sensor in found]
    assert {"truth.stepped", "truth.frozen", "truth.aligned_apart"} <= codes[0] & codes[1]
    same = whole.flagged[EVERY - 1 :: EVERY] == pieces.flagged
    assert same.mean() > 0.995
    assert pieces.quality["the truth stands still"] == pytest.approx(6 * RATE / EVERY, abs=3)
    apart = [sensor.is_apart.mean() for sensor in found]
    assert apart[1] == pytest.approx(apart[0], abs=2e-3) and apart[0] > 0.24


@pytest.fixture(scope="module")
def motion():
    """Samples and the truth of them."""
    return samples_of()


def ramped(truth: Truth, begin: float, seconds: float, degrees: float) -> Truth:
    """A truth that is turned in its world by and by."""
    part = np.clip((truth.host_time_ns * 1e-9 - begin) / seconds, 0, 1)
    by = Rotation.from_rotvec(np.radians(degrees) * part[:, None] * [0, 0, 1])
    q = by * Rotation.from_quat(truth.q_world_from_sensor, scalar_first=True)
    return replace(truth, q_world_from_sensor=q.as_quat(scalar_first=True))


@pytest.mark.parametrize(
    ("begin", "seconds", "degrees"),
    [(61.3, 0.05, 50), (121.7, 0.05, -50), (121.7, 0.2, 50), (61.3, 0.2, -50), (92.9, 0.5, 50)],
)
def test_a_step_is_found_however_it_was_smoothed_and_whichever_way(motion, begin, seconds, degrees):
    samples, truth = motion
    faults = find_faults(samples, samples.device_time_ns, ramped(truth, begin, seconds, degrees))
    (found,) = faults.findings
    assert (found.code, found.values["steps"]) == ("truth.stepped", 1)
    inner = slice(10, -10)
    apart = np.any([own.rows for own in faults.apart], axis=0)[inner]
    rest = ~faults.stepped[inner]
    time = samples.device_time_ns[inner] * 1e-9
    before = time < begin
    for piece, other in ((apart, rest), (rest, apart)):
        if piece[before].mean() > 0.5:
            assert not piece[time > begin + seconds].any()
            assert other[time > begin + seconds + 1.5].all() and piece[time < begin - 1.5].all()


def test_a_truth_that_is_late_does_not_step(motion):
    samples, truth = motion
    for late_s in (-0.25, 0.03, 0.1):
        late = samples.device_time_ns + round(1e9 * late_s)
        assert not find_faults(samples, late, truth).findings


def test_a_gyroscope_with_a_wrong_sign_is_not_taken_for_a_truth_that_steps(motion):
    samples, truth = motion
    mirrored = replace(samples, gyr=samples.gyr * [1, 1, -1])
    assert not find_faults(mirrored, samples.device_time_ns, truth).findings


def test_mean_rates_are_those_of_all_samples_however_they_come():
    rates = np.random.default_rng(1).standard_normal((1_003, 3))
    turning = MeanTurning(EVERY)
    for begin, end in ((0, 3), (3, 400), (400, 400), (400, 1_003)):
        turning.add(rates[begin:end])
    expected = rates[:1_001].reshape(-1, EVERY, 3).mean(axis=1)
    np.testing.assert_allclose(turning.rates(), expected, rtol=1e-12)
