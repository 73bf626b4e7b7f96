"""Triads at the end of their range are not calibrated; others, however coarse, are."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.consistency.doubtful import SATURATED, Doubts
from testbench.estimation.calibration.clipping import (
    clipped_in_motion,
    clipped_triads,
    plateaus,
)
from testbench.estimation.calibration.pile_up import cut_off_at
from testbench.estimation.calibration.session_calibration import calibrate, missed_gravity
from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.records.results.calibration import TriadCalibration
from testbench.records.session.samples import ImuSamples

RATE = 50.0
REST_S, TURN_S = 2.0, 1.5
TURNS = 20


@pytest.fixture(scope="module")
def turned() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, rates and forces of a sensor that is turned by quarters and more between rests."""
    rng = np.random.default_rng(5)
    rests, turns = round(REST_S * RATE), round(TURN_S * RATE)
    profile = 1 - np.cos(2 * np.pi * (np.arange(turns) + 0.5) / turns)
    axes = np.vstack([np.eye(3)[i % 3] + 0.2 * rng.standard_normal(3) for i in range(TURNS)])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    parts = [np.zeros((rests, 3))]
    for i, axis in enumerate(axes):
        angle = np.radians(rng.uniform(70, 130)) * (-1 if i % 4 > 1 else 1)
        parts += [profile[:, None] * axis * angle / TURN_S, np.zeros((rests, 3))]
    rate = np.vstack(parts)
    steps = Rotation.from_rotvec(rate / RATE)
    attitude = Rotation.identity()
    up = np.empty_like(rate)
    for i, step in enumerate(steps):
        up[i] = attitude.inv().apply([0, 0, 9.81])
        attitude = attitude * step
    gyr = rate + np.array([0.01, -0.02, 0.015]) + 0.002 * rng.standard_normal(rate.shape)
    return np.arange(len(rate)) / RATE, gyr, up + 0.005 * rng.standard_normal(up.shape)


def sampled(t, gyr, acc, mag=None) -> ImuSamples:
    time = np.round(t * 1e9).astype(np.int64)
    count = np.arange(len(t))
    return ImuSamples(time, time, gyr, acc, mag, None, count, np.zeros(len(t), dtype=bool))


def still(t: np.ndarray) -> np.ndarray:
    """Where the sensor of `turned` rests, shape (n,), bool."""
    return (t % (REST_S + TURN_S)) < REST_S


@pytest.mark.parametrize("limit_deg_s", [40.0, 60.0, 110.0])
@pytest.mark.parametrize("digits", [3, 6])
def test_a_gyroscope_that_is_cut_off_in_its_turns_is_told(turned, limit_deg_s, digits):
    t, gyr, acc = turned
    limit = np.radians(limit_deg_s)
    assert np.abs(gyr).max() > limit
    samples = sampled(t, np.clip(gyr, -limit, limit).round(digits), acc)
    (told,) = clipped_triads(samples, Doubts.none(len(t)), still(t)).values()
    found = float(re.match(r"the gyroscope is clipped \(x at ([\d.]+) deg/s", told.sentence)[1])
    assert found == pytest.approx(limit_deg_s, abs=np.degrees(10.0**-digits))


def test_an_accelerometer_is_looked_at_in_its_rests_alone(turned):
    t, gyr, acc = turned
    jolted, cut = acc.copy(), acc.copy()
    moving = np.flatnonzero(~still(t))
    jolted[moving[5:15], 0] = jolted[moving[80:95], 0] = 19.6
    assert not clipped_triads(sampled(t, gyr, jolted), Doubts.none(len(t)), still(t))
    cut[:, 0] = np.minimum(cut[:, 0], 7.0)
    (told,) = clipped_triads(sampled(t, gyr, cut), Doubts.none(len(t)), still(t)).values()
    assert told.sentence.startswith("the accelerometer is clipped (x at 7 m/s^2)")


def test_one_axis_that_is_cut_off_to_one_side_is_named(turned):
    _, gyr, _ = turned
    cut = gyr.copy()
    cut[:, 1] = np.minimum(cut[:, 1], 0.8)
    assert plateaus(cut, "gyr") == [("y", 0.8)]


@pytest.mark.parametrize("step", [1e-9, 1e-3, 0.0175, 0.1])
def test_coarse_readings_that_are_not_cut_off_are_none(turned, step):
    """Down to one count of 1 deg/s, and of 5 deg/s."""
    t, gyr, acc = turned
    assert not clipped_triads(
        sampled(t, np.round(gyr / step) * step, np.round(acc / step) * step),
        Doubts.none(len(t)),
        still(t),
    )


def test_a_turn_table_at_one_rate_and_a_field_that_repeats_are_not_cut_off(turned):
    t, _, acc = turned
    rng = np.random.default_rng(6)
    level = np.where((np.arange(len(t)) // 200) % 3 == 1, 0.524, 0.0)
    steady = np.column_stack([level, -level, 0 * t]) + 0.0006 * rng.standard_normal((len(t), 3))
    field = np.repeat(40 * acc[::10] / 9.81, 10, axis=0)[: len(t)]
    assert not clipped_triads(
        sampled(t, steady.round(3), acc, field.round(1)), Doubts.none(len(t)), still(t)
    )


def test_readings_that_the_sensor_marks_are_enough(turned):
    t, gyr, acc = turned
    doubts = Doubts.none(len(t))
    doubts.add(SATURATED, np.array([100, 101]), "gyr")
    assert not clipped_triads(sampled(t, gyr, acc), doubts, still(t))
    doubts.add(SATURATED, np.array([300]), "gyr")
    said = clipped_triads(sampled(t, gyr, acc), doubts, still(t))["gyr"].sentence
    assert "3 readings at full scale" in said


def test_turns_that_miss_gravity_are_remarked():
    found = TriadCalibration("gravity_turns")
    good, bad = (
        replace(found, validation={"gravity_direction_median_deg": value}) for value in (4.9, 13.36)
    )
    assert not missed_gravity(good, refused=False)
    (said,) = missed_gravity(bad, refused=False)
    assert "median of 13.4 deg" in said.sentence and "not for use" in said.sentence
    (said,) = missed_gravity(bad, refused=True)
    assert "not calibrated" in said.sentence and "--method gravity_turns" in said.remedy


@pytest.mark.parametrize("limit", [np.inf, 1.0])
def test_a_session_of_it_is_not_calibrated(turned, tmp_path, clock, limit):
    t, gyr, acc = turned
    columns = np.column_stack([t, acc, np.clip(gyr, -limit, limit)])
    titles = "t,ax,ay,az,gx,gy,gz"
    np.savetxt(tmp_path / "imu.csv", columns, "%.4f", ",", header=titles, comments="")
    (tmp_path / "map.yaml").write_text(
        "description: turns\ntime: {column: t, unit: s}\nsensors:\n  imu:\n    acc: {columns: "
        "[ax, ay, az], unit: m/s^2}\n    gyr: {columns: [gx, gy, gz], unit: rad/s}\n"
    )
    options = Options(str(tmp_path / "map.yaml"), units={"gyr": "rad/s"})
    file, out = tmp_path / "imu.csv", tmp_path / "session"
    session = import_recording("generic", [file], out, clock, options)
    methods = ["norm_only", "gravity_turns"]
    if limit < np.inf:
        with pytest.raises(InputError, match="the gyroscope is clipped"):
            calibrate(session, "imu", methods)
        others = calibrate(session, "imu")
        assert list(others.calibration.triads) == ["accelerometer"]
        said = [own for own in others.calibration.findings if own.code == "calibration.clipped"]
        assert [own.values["triad"] for own in said] == ["gyroscope"]
    else:
        found = calibrate(session, "imu", methods).calibration.triads["gyroscope"]
        np.testing.assert_allclose(np.diag(found.matrix), 1.0, atol=0.01)


def bells(count: float, limit: float = np.inf, noise: float = 1.0) -> list[np.ndarray]:
    """Ten rests of 200 readings in counts, the highest about 50, cut off at a limit."""
    rng = np.random.default_rng(8)
    means = np.linspace(-40.0, 50.3, 10)
    readings = means[:, None] + noise * rng.standard_normal((10, 200))
    return list(np.minimum(np.round(readings / count) * count, limit))


@pytest.mark.parametrize("count", [1e-3, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("sigmas", [-8.0, -1.0, 0.5, 1.0])
def test_the_noise_of_a_rest_shows_where_it_is_cut_off(count, sigmas):
    limit = round((50.3 + sigmas) / count) * count
    assert cut_off_at(bells(count, limit)) == pytest.approx(limit)


@pytest.mark.parametrize("count", [1e-6, 0.1, 0.5, 1.0, 3.0, 10.0])
def test_the_noise_of_a_rest_that_is_not_cut_off_is_whole(count):
    for noise in (1.0, 0.3):
        assert cut_off_at(bells(count, noise=noise)) is None


def test_a_motion_that_is_cut_off_on_the_way_is_named_and_no_reason_to_refuse(turned):
    t, gyr, acc = turned
    moving = ~still(t)
    largest = float(acc[~moving].max())
    jolted = acc.copy()
    jolted[moving] *= 1.0 + 0.4 * np.sin(20 * t[moving])[:, None] ** 2
    samples = sampled(t, gyr, jolted.round(4))
    assert not clipped_in_motion(samples, still(t))
    cut = sampled(t, gyr, np.minimum(jolted, largest + 0.5).round(4))
    (told,) = clipped_in_motion(cut, still(t))
    assert told.code == "calibration.clipped_moving" and told.values["triad"] == "accelerometer"
    assert not clipped_triads(cut, Doubts.none(len(t)), still(t))
