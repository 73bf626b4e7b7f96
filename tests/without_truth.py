"""Sessions that nobody knows the truth of, made of motions that the tests know."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from testbench.model import rotation
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_writer import SessionWriter
from testbench.records.specs.protocol import Analysis, Estimation, JointDefinition, Segment, Sensor

GRAVITY = np.array([0.0, 0.0, 9.80665])
RATE = 60.0
REST_S, SWING_S, FLEXION_DEG = 3.0, 9.0, 50.0
"""A rest, nine swings of a second each, and a rest."""


def swing_deg(seconds: np.ndarray) -> np.ndarray:
    """Flexion of a joint that swings once a second between two rests."""
    inside = np.clip(seconds - REST_S, 0.0, SWING_S)
    return FLEXION_DEG / 2 * (1 - np.cos(2 * np.pi * inside))


def times(length_s: float = 2 * REST_S + SWING_S, rate: float = RATE) -> np.ndarray:
    """Sampling instants [s]."""
    return np.arange(round(length_s * rate)) / rate


def samples_of(
    seconds: np.ndarray,
    q: np.ndarray,
    own: np.ndarray | None = None,
    gyr: bool = True,
    mag: bool = False,
) -> ImuSamples:
    """What a sensor reads that goes through orientations, noise of a good one added.

    Args:
        seconds: Sampling instants, shape (n,).
        q: True q_world_from_sensor, shape (n, 4).
        own: The device's q_earth_from_sensor, or None.
        gyr: Whether it has a gyroscope.
        mag: Whether it has a magnetometer.
    """
    noise = np.random.default_rng(5)
    count, inverse = len(seconds), rotation.conjugate(q)
    turns = rotation.to_rotation_vector(rotation.multiply(inverse[:-1], q[1:]))
    rate = np.vstack([np.zeros(3), turns / np.diff(seconds)[:, None]])
    rate += noise.normal(0, 1e-3, rate.shape)
    acc = rotation.rotate(inverse, np.tile(GRAVITY, (count, 1)))
    field = rotation.rotate(inverse, np.tile([0.0, 20.0, -40.0], (count, 1)))
    stamps = np.round(1e9 * seconds).astype(np.int64)
    return ImuSamples(
        stamps,
        stamps,
        rate if gyr else np.full((count, 3), np.nan),
        acc + noise.normal(0, 0.01, acc.shape),
        field + noise.normal(0, 0.1, field.shape) if mag else None,
        own,
        np.arange(count),
        np.zeros(count, dtype=bool),
    )


def written(
    path: Path,
    sensors: dict[str, ImuSamples],
    filters: list[str],
    joints: dict[str, JointDefinition] | None = None,
    **settings: object,
) -> Session:
    """A session of sensors without a truth, as an import makes it.

    Args:
        path: Its folder, to be made.
        sensors: Samples by name.
        filters: To run.
        joints: Of its sensors, whose axes are those of their segments.
        settings: Further ones of the estimate.
    """
    described = {
        name: Sensor(preset="xsens_dot", link=name, segment=Segment(name=name))
        for name in (sensors if joints else ())
    }
    estimate = Estimation(
        filters=filters, align="none", align_clock=False, calibrate="none", **settings
    )
    records = {name: {"driver": "import", "rate_hz": RATE} for name in sensors}
    writer = SessionWriter(
        path,
        Analysis(sensors=described, joints=joints or {}, estimate=estimate),
        records,
        datetime(2026, 1, 2, tzinfo=UTC),
        {"kind": "import", "source": ["walk.csv"]},
    )
    for name, samples in sensors.items():
        writer.add_table(f"imu_{name}", samples.to_columns())
    writer.close(RunStatus.COMPLETED, duration_s=2 * REST_S + SWING_S)
    return Session(writer.path)


def two_dots(folder: Path) -> Session:
    """A knee that swings, by two sensors with a quaternion and no gyroscope."""
    seconds = times()
    thigh = np.tile([1.0, 0.0, 0.0, 0.0], (len(seconds), 1))
    shank = rotation.from_euler("ZXY", _about_first(-np.radians(swing_deg(seconds))))
    return written(
        folder / "two_dots",
        {
            "thigh": samples_of(seconds, thigh, thigh, gyr=False),
            "shank": samples_of(seconds, shank, shank, gyr=False),
        },
        ["device"],
        {"knee": JointDefinition(proximal="thigh", distal="shank", definition="knee")},
    )


def one_imu(folder: Path, **settings: object) -> Session:
    """A sensor with nine axes and an orientation of its own, whose heading is 40 deg off."""
    seconds = times()
    q = rotation.from_euler("ZYX", _about_second(np.radians(swing_deg(seconds))))
    own = rotation.multiply(rotation.from_heading(np.full(len(seconds), np.radians(40.0))), q)
    samples = samples_of(seconds, q, own, mag=True)
    filters = ["device", "vqf_6d", "vqf_9d", "madgwick_imu"]
    return written(folder / "one_imu", {"wrist": samples}, filters, **settings)


def accelerometer_alone(folder: Path) -> Session:
    """A sensor that leans forth and back, without a gyroscope and without an orientation."""
    seconds = times()
    q = rotation.from_euler("ZYX", _about_second(np.radians(swing_deg(seconds))))
    return written(folder / "acc_alone", {"chest": samples_of(seconds, q, gyr=False)}, ["vqf_6d"])


def _about_first(angle: np.ndarray) -> np.ndarray:
    return np.column_stack([angle, np.zeros_like(angle), np.zeros_like(angle)])


def _about_second(angle: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros_like(angle), angle, np.zeros_like(angle)])
