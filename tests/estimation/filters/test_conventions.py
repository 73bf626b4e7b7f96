"""Orientation filters: the convention each must keep, and the packages they must agree with."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from vqf import VQF, offlineVQF

from testbench.estimation.filters import FILTERS, UniformSamples, get_filter
from testbench.estimation.filters.maths import tilt
from testbench.exceptions import NotFoundError
from testbench.model import rotation

RATE = 100.0
UP = np.array([0.0, 0.0, 9.80665])
FIELD = np.array([0.0, 24.0, -39.0])  # magnetic north along y: east, north, up
COMPUTED = [name for name, kind in FILTERS.items() if name != "device" and not kind.known_faults]
LEVEL = [name for name in COMPUTED if "acc" in FILTERS[name].needs]
TURNING = [name for name in COMPUTED if name != "tilt"]
WITH_NORTH = ["vqf_offline", *(name for name in COMPUTED if "mag" in FILTERS[name].needs)]

# The 24 ways to lay three right-handed axes along those of the world.
AXIS_ALIGNED = [
    np.array(
        [
            [sign if axis == column else 0.0 for column in range(3)]
            for axis, sign in zip(order, signs, strict=True)
        ]
    )
    for order in itertools.permutations(range(3))
    for signs in itertools.product([1.0, -1.0], repeat=3)
]
AXIS_ALIGNED = [matrix for matrix in AXIS_ALIGNED if np.linalg.det(matrix) > 0]


def moving(R_world_from_sensor: Rotation, rate: np.ndarray) -> UniformSamples:
    """What an ideal sensor reports that turns without being accelerated."""
    return UniformSamples(
        1 / RATE, rate, R_world_from_sensor.inv().apply(UP), R_world_from_sensor.inv().apply(FIELD)
    )


def at_rest(R_world_from_sensor: Rotation, seconds: float) -> UniformSamples:
    n = round(seconds * RATE)
    return moving(
        Rotation.from_quat(np.tile(R_world_from_sensor.as_quat(), (n, 1))), np.zeros((n, 3))
    )


def turning(
    start: Rotation, axis: np.ndarray, rate: float, rest_s: float, turn_s: float
) -> tuple[UniformSamples, Rotation]:
    """Rest, a turn about an axis of the sensor, rest; each reading is the mean rate since the one
    before.
    """
    t = np.arange(round((2 * rest_s + turn_s) * RATE)) / RATE
    angle = rate * np.clip(t - rest_s, 0, turn_s)
    rates = np.diff(angle, prepend=0.0)[:, None] * RATE * axis
    true = start * Rotation.from_rotvec(angle[:, None] * axis)
    return moving(true, rates), true


def quaternion(turn: Rotation) -> np.ndarray:
    return turn.as_quat(scalar_first=True)


def error(q: np.ndarray, true: np.ndarray) -> np.ndarray:
    return rotation.multiply(q, rotation.conjugate(true))


def tremor_deg(name: str) -> float:
    """What a filter of fixed step size trembles by at rest: twice its step, in degrees."""
    return np.degrees(2.5 * get_filter(name).parameters.get("beta", 0.0) / RATE)


def test_there_are_24_axis_aligned_poses():
    assert len(AXIS_ALIGNED) == 24


@pytest.mark.parametrize("name", LEVEL)
def test_at_rest_in_every_axis_aligned_pose_the_inclination_is_right(name):
    for matrix in AXIS_ALIGNED:
        pose = Rotation.from_matrix(matrix)
        q = get_filter(name).run(at_rest(pose, 12))[-1]
        assert np.linalg.norm(q) == pytest.approx(1, abs=1e-6)
        up = rotation.rotate(
            q, pose.inv().apply([0.0, 0.0, 1.0])
        )  # what the filter says of the direction of the force
        assert np.degrees(np.arccos(np.clip(up[2], -1, 1))) < max(0.1, tremor_deg(name)), matrix


@pytest.mark.parametrize("name", TURNING)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_slow_turn_about_each_axis_of_the_sensor_is_followed_in_its_direction(
    name, axis, direction
):
    for start in (Rotation.identity(), Rotation.from_euler("XYZ", [25, -35, 60], degrees=True)):
        samples, true = turning(
            start, np.eye(3)[axis], direction * np.radians(20), rest_s=10, turn_s=3
        )
        q = get_filter(name).run(samples)
        before, after = round(9.5 * RATE), -1
        turned = rotation.multiply(rotation.conjugate(q[before]), q[after])
        expected = quaternion(true[before].inv() * true[after])
        assert np.degrees(rotation.angle(expected)) == pytest.approx(60, abs=1e-6)
        assert np.degrees(rotation.angle(error(turned, expected))) < 1.0


@pytest.mark.parametrize("name", WITH_NORTH)
def test_with_a_magnetometer_the_earth_is_east_north_up(name):
    for angles in ([0, 0, 0], [0, 0, 90], [30, -50, 200], [180, 10, 45]):
        true = Rotation.from_euler("ZYX", angles, degrees=True)
        q = get_filter(name).run(at_rest(true, 30))[-1]
        assert np.degrees(rotation.angle(error(q, quaternion(true)))) < max(
            0.2, tremor_deg(name)
        ), angles


def test_without_a_magnetometer_the_offline_filter_still_runs():
    samples = at_rest(Rotation.from_euler("x", 30, degrees=True), 5)
    without = UniformSamples(samples.interval, samples.gyr, samples.acc)
    q = get_filter("vqf_offline").run(without)[-1]
    assert rotation.rotate(q, samples.acc[-1]) == pytest.approx(UP, abs=1e-3)


@cache
def walk(seconds: float = 20, seed: int = 4) -> tuple[UniformSamples, Rotation]:
    """A wandering motion with noise."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE)
    t = np.arange(n) / RATE
    rates = np.column_stack(
        [0.8 * np.sin(0.9 * t), 0.6 * np.cos(0.7 * t), 0.5 * np.sin(1.3 * t + 1)]
    )
    steps = Rotation.from_rotvec(rates / RATE)
    true = [Rotation.from_euler("XYZ", [0.2, -0.3, 0.5])]
    for step in steps[1:]:
        true.append(true[-1] * step)
    ideal = moving(Rotation.concatenate(true), rates)
    assert ideal.mag is not None
    return UniformSamples(
        ideal.interval,
        rates + 0.002 * rng.standard_normal((n, 3)),
        ideal.acc + 0.05 * rng.standard_normal((n, 3)),
        ideal.mag + 0.3 * rng.standard_normal((n, 3)),
    ), Rotation.concatenate(true)


@pytest.mark.parametrize("name", COMPUTED)
def test_a_wandering_motion_is_followed_to_a_degree_in_inclination(name):
    samples, true = walk(60)
    settled = slice(round(20 * RATE), None)
    inclination = rotation.inclination_angle(
        error(get_filter(name).run(samples), quaternion(true))
    )[settled]
    assert np.degrees(np.sqrt(np.mean(inclination**2))) < 1.0


def test_madgwicks_filter_starts_level_with_the_first_reading():
    samples = at_rest(Rotation.from_euler("XYZ", [150, -40, 70], degrees=True), 0.1)
    q = get_filter("madgwick_imu").run(samples)
    np.testing.assert_allclose(rotation.rotate(q[0], samples.acc[0]), UP, atol=1e-9)


@pytest.mark.parametrize(
    "direction", [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -3, 0], [0.1, 0.2, -0.97]]
)
def test_the_tilt_turns_a_force_upwards_by_the_smallest_rotation(direction):
    force = np.array(direction, dtype=float)
    q = tilt(force)
    np.testing.assert_allclose(rotation.rotate(q, force), [0, 0, np.linalg.norm(force)], atol=1e-12)
    assert rotation.angle(q) == pytest.approx(np.arccos(force[2] / np.linalg.norm(force)), abs=1e-7)


def test_no_force_gives_no_tilt_and_no_division_by_zero():
    np.testing.assert_array_equal(tilt(np.zeros(3)), [1, 0, 0, 0])


def test_vqf_is_the_package_called_directly():
    samples, _ = walk()
    gyr, acc, mag = (np.ascontiguousarray(x) for x in (samples.gyr, samples.acc, samples.mag))
    batch = VQF(1 / RATE).updateBatch(gyr, acc, mag)
    np.testing.assert_array_equal(get_filter("vqf_9d").run(samples), batch["quat9D"])
    np.testing.assert_allclose(get_filter("vqf_6d").run(samples), batch["quat6D"], atol=1e-12)
    np.testing.assert_array_equal(
        get_filter("vqf_offline").run(samples), offlineVQF(gyr, acc, mag, 1 / RATE)["quat9D"]
    )


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_does_not_write_into_its_samples_and_gives_the_same_twice(name):
    samples, true = walk(3)
    samples = UniformSamples(
        samples.interval, samples.gyr, samples.acc, samples.mag, quaternion(true)
    )
    before = [array.copy() for array in (samples.gyr, samples.acc, samples.mag, samples.device_q)]
    first = get_filter(name).run(samples).copy()
    np.testing.assert_array_equal(get_filter(name).run(samples), first)
    for array, copy in zip(
        (samples.gyr, samples.acc, samples.mag, samples.device_q), before, strict=True
    ):
        np.testing.assert_array_equal(array, copy)
    assert first.shape == (len(samples.gyr), 4)


def test_a_filter_says_what_the_samples_lack():
    bare = UniformSamples(0.01, np.zeros((5, 3)), np.zeros((5, 3)))
    assert get_filter("vqf_9d").missing(bare) == ["mag"]
    assert get_filter("device").missing(bare) == ["device_q"]
    assert get_filter("vqf_6d").missing(bare) == []


def test_an_unknown_filter_is_refused_with_those_that_exist():
    with pytest.raises(NotFoundError, match="unknown filter 'kalman'; known: device, gyro"):
        get_filter("kalman")


@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_is_listed_under_its_own_name_with_its_source(name):
    assert FILTERS[name].name == name
    assert FILTERS[name].source


@pytest.mark.parametrize("name", ["mekf", "ekf"])
@pytest.mark.parametrize("pose", [[0, 0, 0], [0, 0, 90], [0, 89, 0], [40, -30, 130]])
def test_a_kalman_filter_forgets_a_wrong_first_heading_alike_in_every_pose(name, pose):
    """The first sample's field is 20 deg off: that is doubt about the vertical, whichever axis of
    the sensor lies along it.
    """
    settings = (
        {"acc_sd_m_s2": 0.1} if name == "mekf" else {}
    )  # the force is then believed far more than the field

    def errors(angles: list[float]) -> np.ndarray:
        true = Rotation.from_euler("ZYX", angles, degrees=True)
        samples = at_rest(true, 2.0)
        off = true.inv().apply(Rotation.from_euler("z", 20, degrees=True).apply(FIELD))
        q = get_filter(name, settings).run(replace(samples, mag=np.vstack([off, samples.mag[1:]])))
        return np.degrees((Rotation.from_quat(q, scalar_first=True) * true.inv()).magnitude())

    expected = errors([0, 0, 0])
    assert expected[0] == pytest.approx(20, abs=1e-6)
    np.testing.assert_allclose(errors(pose), expected, atol=0.01)
