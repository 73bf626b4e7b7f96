"""A truth that was lost is found in a recording of any length, by how the sensor turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation import estimate
from testbench.estimation.signals import access
from testbench.estimation.signals.mean_turning import MeanTurning
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


def test_mean_rates_are_those_of_all_samples_however_they_come():
    rates = np.random.default_rng(1).standard_normal((1_003, 3))
    turning = MeanTurning(EVERY)
    for begin, end in ((0, 3), (3, 400), (400, 400), (400, 1_003)):
        turning.add(rates[begin:end])
    expected = rates[:1_001].reshape(-1, EVERY, 3).mean(axis=1)
    np.testing.assert_allclose(turning.rates(), expected, rtol=1e-12)
