"""A hand-held stick: unknown world and mounting, a truth of 15 Hz with flipped signs and gaps, and
a clock of its own.
"""

import json
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, RotationSpline

from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.specs.protocol import Analysis, Estimation

RATE, TRUTH_RATE, SECONDS = 100.0, 15.0, 180.0
OFFSET_S, DRIFT_PPM = 0.050, 100.0


class FixedClock:
    """Always the same day."""

    def utc(self):
        return datetime(2026, 1, 1, tzinfo=UTC)

    def monotonic_ns(self):
        return 0

    def sleep(self, seconds):
        """Time does not pass."""


def motion(seed: int, axes: int) -> RotationSpline:
    """Smooth turns about `axes` axes of the body, with a rest at the start."""
    rng = np.random.default_rng(seed)
    time = np.arange(-2, SECONDS + 3, 1.0)
    angles = np.zeros((len(time), 3))
    for axis in range(axes):
        for frequency in rng.uniform(0.05, 0.25, 4):
            angles[:, axis] += rng.uniform(0.2, 0.5) * np.sin(
                2 * np.pi * (frequency * time + rng.random())
            )
    angles *= np.clip((time[:, None] - 6) / 4, 0, 1)
    return RotationSpline(time, Rotation.from_euler("XYZ", angles))


def stick(tmp_path, seed: int, axes: int = 3):
    """A session of the stick, with the mounting and the world that estimate is to find."""
    rng = np.random.default_rng(seed)
    body = motion(seed, axes)
    mounting = Rotation.random(rng=rng)  # body from sensor
    world = Rotation.from_rotvec([0, 0, rng.uniform(-3, 3)]) * Rotation.from_rotvec(
        0.2 * rng.standard_normal(3)
    )
    device = np.arange(int(RATE * SECONDS)) / RATE + OFFSET_S
    host = (device - OFFSET_S) / (1 + DRIFT_PPM * 1e-6)
    orientation = body(host)
    gravity_in_world = world.inv().apply([0.0, 0.0, 9.80665])  # the truth's world is not even level
    acc = (orientation * mounting).inv().apply(
        np.tile(gravity_in_world, (len(host), 1))
    ) + 0.02 * rng.standard_normal((len(host), 3))
    before = body(host - 1 / RATE)  # mean rate over the interval, in the axes at its end
    gyr = mounting.inv().apply(
        (before.inv() * orientation).as_rotvec() * RATE
    ) + 0.002 * rng.standard_normal((len(host), 3))
    stamp = np.round(1e9 * device).astype(np.int64)
    arrival = np.round(1e9 * (host + 0.004 + rng.exponential(0.003, len(host)))).astype(np.int64)
    samples = ImuSamples(
        stamp,
        np.maximum.accumulate(arrival),
        gyr,
        acc,
        None,
        None,
        np.arange(len(host)),
        np.zeros(len(host), bool),
    )
    seen = np.arange(0, SECONDS - 1, 1 / TRUTH_RATE)
    q = body(seen) * Rotation.from_rotvec(np.radians(0.05) * rng.standard_normal((len(seen), 3)))
    quaternions = q.as_quat(scalar_first=True) * rng.choice([-1, 1], (len(seen), 1))
    kept = rng.random(len(seen)) > 0.05
    kept[600:660] = False
    truth = Truth(np.round(1e9 * seen[kept]).astype(np.int64), quaternions[kept])
    analysis = Analysis(
        estimate=Estimation(filters=["vqf_6d"], align="motion", align_clock=True, calibrate="none")
    )
    recording = Recording(
        "stick", "a stick", {"imu": ImportedSensor([samples], RATE, "synthetic", truth)}, analysis
    )
    session = write_recording(
        recording, [tmp_path / "stick.csv"], "synthetic", tmp_path / f"stick_{seed}", FixedClock()
    )
    manifest = json.loads((session.path / "manifest.json").read_text())
    manifest["sensors"]["imu"]["rate_delay_s"] = 0.5 / RATE
    (session.path / "manifest.json").write_text(json.dumps(manifest))
    return type(session)(session.path), mounting


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_clock_world_and_mounting_are_found_together(tmp_path, seed):
    session, mounting = stick(tmp_path, seed)
    estimated = estimate(session)
    sensor = estimated.sensors["imu"]
    assert sensor.clock.offset_s * 1e3 == pytest.approx(1e3 * OFFSET_S, abs=2)
    assert sensor.clock.drift_ppm == pytest.approx(DRIFT_PPM, abs=20)
    fit = sensor.frames["vqf_6d"]
    assert fit.method == "motion"
    found = Rotation.from_rotvec(np.radians(fit.mounting_deg))
    assert np.degrees((found * mounting.inv()).magnitude()) < 0.3
    rows = evaluate(session, estimated).orientation
    assert rows[0].inclination_rmse_deg < 1.0  # the heading of a 6-axis filter drifts


def test_of_a_motion_about_one_axis_only_the_angle_about_it_is_held(tmp_path):
    session, _ = stick(tmp_path, 4, axes=1)
    estimated = estimate(session)
    sensor = estimated.sensors["imu"]
    assert sensor.frames["vqf_6d"].method == "motion"
    assert len(sensor.frames["vqf_6d"].undetermined) == 1
    evaluation = evaluate(session, estimated)
    assert evaluation.orientation[0].total_rmse_deg < 3.0
    warning = next(str(found) for found in sensor.findings if "one axis" in str(found))
    assert "add rotations" in warning
    assert any("one axis" in note for note in evaluation.notes)
