"""Two orientations of one sensor: what lies between them, and that it is called no error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.evaluation.differences import difference_tables, pairs
from testbench.model import rotation
from testbench.records.results.estimate import SensorEstimate


def sensor(**orientation: np.ndarray) -> SensorEstimate:
    count = len(next(iter(orientation.values())))
    time = np.arange(count, dtype=np.int64) * 10_000_000
    flat = np.zeros(count, dtype=bool)
    return SensorEstimate(host_time_ns=time, static=flat, flagged=flat, orientation=orientation)


@pytest.fixture(scope="module")
def q() -> np.ndarray:
    drawn = np.random.default_rng(2).normal(size=(400, 4))
    return rotation.normalise(drawn)


def turned(q: np.ndarray, heading_deg: float, sensor_deg: float = 0.0) -> np.ndarray:
    """In a world turned about the vertical, and of a sensor turned about its own x axis."""
    own = rotation.from_rotation_vector(np.tile([np.radians(sensor_deg), 0, 0], (len(q), 1)))
    world = rotation.from_heading(np.full(len(q), np.radians(heading_deg)))
    return rotation.multiply(rotation.multiply(world, q), own)


def test_the_heading_between_two_worlds_is_taken_off_and_stated(q):
    (row,) = difference_tables("imu", sensor(device=q, vqf_6d=turned(q, 70.0)), None).comparison
    assert (row.first, row.second) == ("vqf_6d", "device")
    assert row.heading_offset_deg == pytest.approx(70.0)
    assert row.max_deg == pytest.approx(0, abs=1e-6)
    assert row.mean_quaternion_length == pytest.approx(0, abs=1e-8)


def test_a_constant_angle_comes_out_in_every_number(q):
    tables = difference_tables("imu", sensor(device=q, vqf_6d=turned(q, 0.0, 8.0)), "device")
    (row,) = tables.comparison
    off = abs(row.heading_offset_deg)  # of a finite set of random axes
    assert row.mean_deg == pytest.approx(8.0, abs=off + 1e-9)
    assert row.rms_deg == pytest.approx(8.0, abs=off + 1e-9)
    assert row.mean_quaternion_length == pytest.approx(
        2 * np.sin(np.radians(row.mean_deg) / 4), rel=1e-3
    )
    series = tables.series["difference_imu"]["vqf_6d_device_total_rad"]
    assert np.degrees(series).mean() == pytest.approx(row.mean_deg, rel=1e-5)


def test_a_sign_of_a_quaternion_is_no_difference(q):
    (row,) = difference_tables("imu", sensor(device=q, vqf_6d=-q), "device").comparison
    assert row.max_deg == pytest.approx(0, abs=1e-6)
    assert row.mean_quaternion_length == pytest.approx(0, abs=1e-8)


def test_samples_that_were_left_out_do_not_count(q):
    other = q.copy()
    other[:50] = turned(q[:50], 0.0, 90.0)
    other[50:60] = np.nan
    bad = np.arange(len(q)) < 50
    (row,) = difference_tables(
        "imu", replace(sensor(device=q, vqf_6d=other), flagged=bad), "device"
    ).comparison
    assert row.n == len(q) - 60
    assert row.max_deg == pytest.approx(0, abs=1e-6)


def test_every_pair_of_few_is_compared_and_of_many_each_with_the_devices(q):
    few = sensor(vqf_6d=q, device=q, fusion=q)
    assert pairs(few, None) == [("vqf_6d", "device"), ("fusion", "device"), ("fusion", "vqf_6d")]
    assert pairs(few, "fusion") == [("vqf_6d", "fusion"), ("device", "fusion")]
    many = sensor(**dict.fromkeys(["a", "b", "c", "d", "device"], q))
    assert pairs(many, None) == [(key, "device") for key in "abcd"]


def test_what_cannot_be_compared_with_is_said(q):
    one = replace(sensor(vqf_6d=q), skipped={"device": "the sensor gives no device_q"})
    tables = difference_tables("imu", one, "device")
    assert not tables.comparison and not tables.series
    (found,) = tables.findings
    assert str(found) == "imu: not compared with device: the sensor gives no device_q"
