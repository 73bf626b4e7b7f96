from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.axes import AS_DOCUMENTED, STRAIGHT, findings_on, identify_axes
from testbench.estimation.signals.recording import STANDARD_DOWN
from testbench.formats.axes import find_axes
from testbench.model import rotation
from testbench.records.session.samples import ImuSamples, Truth
from tests.told import told

RIGHT_HANDED = [
    Rotation.from_matrix(m).as_matrix().round().astype(int)
    for m in Rotation.create_group("O").as_matrix()
]


@cache
def moving(
    seed: int = 0, n: int = 4000, axes: tuple[int, ...] = (0, 1, 2)
) -> tuple[ImuSamples, Truth, np.ndarray]:
    """A sensor that stops often and turns about some axes between, by SciPy alone."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) / 100
    rate = np.zeros((n, 3))
    for axis in axes:
        rate[:, axis] = 2.0 * np.sin(2 * np.pi * (0.11 + 0.07 * axis) * time + rng.uniform(0, 6))
    rate[(np.arange(n) // 200) % 2 == 0] = 0.0
    orientation = [Rotation.from_rotvec(rng.uniform(-1, 1, 3))]
    for w in rate[:-1]:
        orientation.append(orientation[-1] * Rotation.from_rotvec(w / 100))
    R = np.array([o.as_matrix() for o in orientation])
    q = np.array([o.as_quat()[[3, 0, 1, 2]] for o in orientation])
    ns = (time * 1e9).astype(np.int64)
    acc = np.einsum("nij,i->nj", R, [0, 0, 9.80665])
    mag = np.einsum("nij,i->nj", R, [0, 24.0, -39.0])

    def noise(size: float) -> np.ndarray:
        return size * rng.standard_normal((n, 3))

    samples = ImuSamples(
        ns,
        ns,
        rate + noise(0.01) + 0.02,
        acc + noise(0.05),
        mag + noise(0.3),
        q.copy(),
        np.arange(n),
        np.zeros(n, bool),
    )
    return samples, Truth(ns, q, rate, None), np.linalg.norm(rate, axis=1) == 0


def identify(samples, truth, static):
    return identify_axes(samples, samples.device_time_ns, static, truth, STANDARD_DOWN)


def test_a_sound_sensor_needs_no_remark():
    found = identify(*moving())
    assert [found[t].axes for t in ("gyr", "acc", "mag", "device_q")] == [STRAIGHT] * 3 + [
        AS_DOCUMENTED
    ]
    assert told(findings_on(found)) == []
    assert found["gyr"].gain == pytest.approx(1, abs=0.01)


@settings(max_examples=24)
@given(st.sampled_from(range(24)), st.integers(0, 3))
def test_every_axis_map_is_found_and_undone_by_the_importers_map(k, seed):
    samples, truth, static = moving(seed)
    swapped = RIGHT_HANDED[k]
    turned = replace(
        samples,
        gyr=samples.gyr @ swapped.T,
        acc=samples.acc @ swapped.T,
        mag=samples.mag @ swapped.T,
    )
    found = identify(turned, truth, static)
    for triad in ("gyr", "acc", "mag"):
        undone = find_axes(found[triad].axes).vectors(getattr(turned, triad))
        np.testing.assert_allclose(undone, getattr(samples, triad), atol=1e-12)


def test_a_mirrored_triad_and_wrong_units_are_named():
    samples, truth, static = moving()
    found = identify(replace(samples, gyr=samples.gyr * [1, 1, -1]), truth, static)
    assert (found["gyr"].axes, found["gyr"].right_handed) == ("x: +x, y: +y, z: -z", False)
    assert "mirrors the sensor" in told(findings_on(found))[0]
    found = identify(
        replace(samples, gyr=np.degrees(samples.gyr), acc=samples.acc / 9.80665), truth, static
    )
    assert "deg/s were taken for rad/s" in told(findings_on(found))[0]
    assert "g were taken for m/s^2" in told(findings_on(found))[1]


@pytest.mark.parametrize(
    ("signs", "northern", "southern"),
    [
        ([-1, 1, 1], "x: -x, y: +y, z: +z", "x: +x, y: -y, z: -z"),
        ([1, 1, -1], "x: +x, y: +y, z: -z", "x: -x, y: -y, z: +z"),
        ([-1, -1, 1], "x: -x, y: -y, z: +z", "x: +x, y: +y, z: -z"),
    ],
)
def test_a_magnetometer_with_a_wrong_sign_is_named_in_both_its_readings(signs, northern, southern):
    samples, truth, static = moving()
    found = identify(replace(samples, mag=samples.mag * signs), truth, static)
    (remark,) = told(findings_on(found))
    (other,) = {northern, southern} - {found["mag"].axes}
    assert f"it fits '{found['mag'].axes}' or that with all signs reversed, '{other}'" in remark
    assert (
        f"'{northern}' if the field points down" in remark
        and f"'{southern}' if it points up" in remark
    )


@pytest.mark.parametrize("sign", [1, -1])
def test_a_magnetometer_with_all_signs_reversed_differs_by_the_dip_alone(sign):
    samples, truth, static = moving()
    found = identify(replace(samples, mag=sign * samples.mag), truth, static)
    assert found["mag"].axes == STRAIGHT and not told(findings_on(found))
    assert found["mag"].field_dip_deg == pytest.approx(
        sign * np.degrees(np.arctan2(39, 24)), abs=0.5
    )


def test_a_level_field_does_not_tell_the_two_readings_apart():
    samples, truth, static = moving()
    level = (
        Rotation.from_quat(truth.q_world_from_sensor, scalar_first=True).inv().apply([0, 45.0, 0.5])
    )
    (remark,) = told(findings_on(identify(replace(samples, mag=level * [1, -1, 1]), truth, static)))
    assert "all signs reversed" in remark and "points" not in remark


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        (lambda q: rotation.conjugate(q), "w x y z, sensor from earth, z up"),
        (lambda q: q[:, [1, 2, 3, 0]], "x y z w, earth from sensor, z up"),
        (
            lambda q: rotation.multiply(np.array([0.0, 2**-0.5, 2**-0.5, 0.0]), q),
            "w x y z, earth from sensor, z down",
        ),
    ],
)
def test_a_quaternion_of_another_convention_is_named(changed, named):
    samples, truth, static = moving()
    found = identify(replace(samples, device_q=changed(samples.device_q)), truth, static)
    assert found["device_q"].axes == named
    assert named in told(findings_on(found))[0]


def test_truth_of_orientations_only_and_of_two_axes_will_do():
    samples, truth, static = moving(axes=(0, 1))
    found = identify(samples, replace(truth, rate=None), static)
    assert found["gyr"].axes == STRAIGHT
    assert found["gyr"].right_handed is None
    assert found["gyr"].unseen == ["z"]


def test_a_single_axis_tells_nothing():
    samples, truth, static = moving(axes=(1,))
    found = identify(samples, truth, static)
    assert found["gyr"].axes is None
    assert found["gyr"].unseen == ["x", "z"]


def test_a_crooked_mounting_is_measured():
    samples, truth, static = moving()
    R = Rotation.from_rotvec([0.1, -0.15, 0.05]).as_matrix()
    found = identify(replace(samples, gyr=samples.gyr @ R.T, acc=samples.acc @ R.T), truth, static)
    expected = np.degrees(np.linalg.norm([0.1, -0.15, 0.05]))
    assert found["gyr"].crooked_deg == pytest.approx(expected, abs=0.2)
    assert found["acc"].crooked_deg == pytest.approx(expected, abs=0.2)


def mounted(seed: int, mounting: Rotation) -> tuple[ImuSamples, Truth, np.ndarray]:
    """The same recording with the truth of a body that the sensor sits on."""
    samples, truth, static = moving(seed)
    q = Rotation.from_quat(truth.q_world_from_sensor, scalar_first=True) * mounting.inv()
    return samples, Truth(truth.host_time_ns, q.as_quat(scalar_first=True)), static


def told_of_a_mounting(samples: ImuSamples, truth: Truth, static: np.ndarray) -> list[str]:
    """Codes of what is found where the mounting is not known."""
    time = samples.device_time_ns
    found = identify_axes(samples, time, static, truth, STANDARD_DOWN, mounting_known=False)
    return [own.code for own in findings_on(found, mounting_known=False)]


def test_a_sensor_in_any_mounting_has_no_wrong_axes():
    """Of mountings drawn at random, 0.65 % lie within 10 deg of an exchange of axes."""
    rng = np.random.default_rng(3)
    mountings = Rotation.random(40, rng=rng)
    near = [
        np.degrees(min((own * map_.inv()).magnitude() for map_ in Rotation.create_group("O")))
        for own in mountings
    ]
    told_at = [told_of_a_mounting(*mounted(k % 4, own)) for k, own in enumerate(mountings)]
    assert [own for own, angle in zip(told_at, near, strict=True) if own and angle > 11] == []
    assert sum(bool(own) for own in told_at) <= 1


def test_exchanged_axes_are_named_on_a_sensor_that_sits_straight():
    rng = np.random.default_rng(4)
    for k, exchanged in enumerate(RIGHT_HANDED):
        samples, truth, static = mounted(k % 4, Rotation.from_rotvec(rng.normal(0, 0.04, 3)))
        gyr = samples.gyr @ exchanged.T
        codes = told_of_a_mounting(replace(samples, gyr=gyr), truth, static)
        assert codes == ([] if np.allclose(exchanged, np.eye(3)) else ["axes.other"])


def test_a_mirror_is_no_mounting():
    samples, truth, static = mounted(1, Rotation.from_euler("ZYX", [40, 33, -70], degrees=True))
    mirrored = replace(samples, gyr=samples.gyr * [1, 1, -1])
    assert told_of_a_mounting(mirrored, truth, static) == ["axes.mirrored"]


def test_noise_of_the_truth_is_no_gain():
    samples, truth, static = moving(2)
    rng = np.random.default_rng(5)
    shaken = Rotation.from_rotvec(np.radians(3.0) * rng.standard_normal((len(samples), 3)))
    q = (Rotation.from_quat(truth.q_world_from_sensor, scalar_first=True) * shaken).as_quat(
        scalar_first=True
    )
    found = identify(samples, Truth(truth.host_time_ns, q), static)
    assert found["gyr"].gain < 0.75 and told(findings_on({"gyr": found["gyr"]})) == []
    half = identify(replace(samples, gyr=0.3 * samples.gyr), Truth(truth.host_time_ns, q), static)
    assert "0." in told(findings_on({"gyr": half["gyr"]}))[0]
