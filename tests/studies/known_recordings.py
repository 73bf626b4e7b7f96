"""Recordings whose truth is known exactly: sensors that turn as a formula says, with noise that is
stated.
"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Analysis, Estimation

RATE = 100.0
GRAVITY = 9.81
FIELD = np.array([0.0, 20.0, -40.0])


class FixedClock:
    def utc(self) -> datetime:
        return datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)

    def monotonic_ns(self) -> int:
        return 0

    def sleep(self, seconds: float) -> None: ...


def tumbling(n: int) -> Rotation:
    """Orientations at n + 1 instants: slow turns about all axes that never repeat."""
    t = np.arange(n + 1) / RATE
    angles = [0.9 * np.sin(0.7 * t), 0.6 * np.sin(1.1 * t + 0.4), 1.3 * np.sin(0.5 * t + 1.0)]
    return Rotation.from_euler("ZYX", np.column_stack(angles))


def write_known(
    out: Path,
    seed: int,
    seconds: float = 60.0,
    gyr_sd: float = 0.02,
    acc_sd: float = 0.3,
    mag_sd: float = 0.5,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    device_turn_deg: float = 0.0,
) -> Session:
    """A session, aligned by nobody: the earth of the sensor is the world.

    Args:
        gyr_sd: White noise of each sample [rad/s, m/s^2, uT].
        acc_sd: White noise of each sample [rad/s, m/s^2, uT].
        mag_sd: White noise of each sample [rad/s, m/s^2, uT].
        bias: Of the gyroscope [rad/s].
        device_turn_deg: The device's own orientation is the true one, turned by so much about the
            world's x.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE)
    steps = tumbling(n)
    now = steps[1:]
    rate = (steps[:-1].inv() * now).as_rotvec() * RATE
    gyr = rate + np.array(bias) + gyr_sd * rng.standard_normal((n, 3))
    acc = now.inv().apply([0, 0, GRAVITY]) + acc_sd * rng.standard_normal((n, 3))
    mag = now.inv().apply(FIELD) + mag_sd * rng.standard_normal((n, 3))
    turned = Rotation.from_euler("x", device_turn_deg, degrees=True) * now
    time = np.round(np.arange(n) * 1e9 / RATE).astype(np.int64)
    samples = ImuSamples(
        time,
        time,
        gyr,
        acc,
        mag,
        turned.as_quat(scalar_first=True),
        np.arange(n),
        np.zeros(n, dtype=bool),
    )
    truth = Truth(time, now.as_quat(scalar_first=True), rate)
    analysis = Analysis(
        estimate=Estimation(
            filters=["madgwick_marg", "vqf_9d"], align="none", align_clock=False, calibrate="none"
        )
    )
    recording = Recording(
        out.name, "known", {"imu": ImportedSensor([samples], RATE, "made up", truth)}, analysis
    )
    return write_recording(recording, [out], "made", out, FixedClock())
