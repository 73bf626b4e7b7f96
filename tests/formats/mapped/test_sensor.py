"""Units, axes and times of a sensor, and what its session keeps of the mapping."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems, InputError
from tests.formats.mapped.mappings import PLAIN, check

G = 9.80665


BODY = """\
  other:
    acc: {columns: [ax, ay, az], unit: m/s^2}
segments: {imu: upper_arm, other: {name: forearm, rotation_deg: {ZYX: [0, 90, 0]}}}
joints:
  elbow: {proximal: imu, distal: other, sequence: ZXZ}
exclude: [{from_s: 0.5, to_s: 1, reason: cable touched, sensors: [other]}]
"""


def test_full_scale_and_sampling_stand_in_the_manifest(plain, motion, load):
    text = PLAIN.replace("unit: m/s^2", "unit: m/s^2, full_scale: 16 g")
    text = (
        text.replace("unit: rad/s", "unit: rad/s, full_scale: 8.7") + "    sampling: integrated\n"
    )
    sensor = load(text, plain(motion(300))).manifest.sensors["imu"]
    assert sensor.full_scale is not None
    assert sensor.full_scale.acc_m_s2 == pytest.approx(16 * 9.80665)
    assert sensor.full_scale.gyr_rad_s == 8.7
    assert sensor.sampling == "integrated" and sensor.rate_delay_s == pytest.approx(0.005)


def test_segments_joints_and_excluded_intervals_are_kept(plain, motion, load):
    session = load(PLAIN + BODY, plain(motion(300)))
    body = session.analysis.body
    assert body is not None and body.segments["imu"].name == "upper_arm"
    assert body.segments["other"].rotation_deg == {"ZYX": [0, 90, 0]}
    assert body.joints["elbow"].distal == "other"
    assert session.analysis.estimate.exclude[0].reason == "cable touched"
    assert session.analysis.joints["elbow"] is body.joints["elbow"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{imu: upper_arm", "{hand: upper_arm", r":9:\d+: segments.hand: there is no sensor"),
        ("distal: other", "distal: hand", r":11:\d+: joints.elbow.distal: there is no sensor"),
        ("[other]}]", "[hand]}]", r":12:\d+: exclude\[0\].sensors: there is no sensor 'hand'"),
        ("to_s: 1", "to_s: 0.1", r":12:\d+: exclude\[0\]: from_s 0.5 is not before"),
        ("sequence: ZXZ", "sequence: ZZZ", r":11:\d+: joints.elbow.sequence: must be"),
        ("sequence: ZXZ", "order: ZXZ", r":11:\d+: .*unknown key 'order'"),
        ("unit: rad/s", "unit: rad/s, full_scale: 5 furlong", r":6:\d+: .*is no full scale"),
        ("unit: rad/s", "unit: rad/s, full_scale: 0", r":6:\d+: .*more than 0"),
        ("unit: rad/s", "unit: rad/s, file: 7", r":6:\d+: "),
        ("unit: rad/s", "unit: rad/s, optional: yes", r":6:\d+: .*must be true or false"),
        ("segments: {imu: upper_arm,", "segments: {imu: [1],", r":9:\d+: "),
    ],
)
def test_faults_of_further_keys_are_named_with_their_place(plain, motion, load, old, new, said):
    text = PLAIN + BODY
    assert old in text
    with pytest.raises(FileProblems, match="map.yaml" + said):
        load(text.replace(old, new, 1), plain(motion(300)))


@pytest.mark.parametrize("earth", ["ENU", "NED", "NWU"])
def test_the_earth_of_a_quaternion(plain, motion, load, xyz, earth):
    from testbench.model.earths import to_earth_frame

    m = motion(300)
    text = PLAIN + (f"    quaternion: {{columns: [qw, qx, qy, qz], order: wxyz, earth: {earth}}}\n")
    samples = load(text, plain(m, more=xyz("q{}", to_earth_frame(m.q, earth), "wxyz"))).imu("imu")
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-9


@pytest.mark.parametrize(
    ("acc", "acc_factor", "gyr", "gyr_factor"),
    [
        ("g", G, "deg/s", np.pi / 180),
        ("mg", G / 1000, "mdeg/s", np.pi / 180e3),
        ("m/s^2", 1.0, "rad/s", 1.0),
    ],
)
@pytest.mark.parametrize("stated", [True, False])
def test_units_stated_or_told_by_gravity_and_turns(
    plain, motion, load, acc, acc_factor, gyr, gyr_factor, stated
):
    m = motion(2400)
    text = PLAIN.replace("unit: m/s^2", f"unit: {acc}").replace("unit: rad/s", f"unit: {gyr}")
    if not stated:
        text = text.replace(f", unit: {acc}}}", "}").replace(f", unit: {gyr}}}", "}")
    check(load(text, plain(m, acc=acc_factor, gyr=gyr_factor, form="%.12g")).imu("imu"), m)


def test_a_unit_that_cannot_be_told_is_asked_for_by_its_key(plain, motion, load, tmp_path):
    m = motion(600)
    text = PLAIN.replace(", unit: m/s^2}", "}")
    with pytest.raises(
        InputError,
        match=r"\|acc\| at rest is 3.*the key sensors\.imu\.acc\.unit of the mapping, or --unit "
        r"acc=UNIT",
    ):
        load(text, plain(m, acc=9.80665 / 3))
    assert not (tmp_path / "session").exists()
    assert load(text, plain(m, acc=9.80665 / 3), units={"acc": "g"})


def test_counts_with_offset_and_scale_can_be_recovered(plain, motion, load):
    m = motion(600)
    counts = np.round(m.acc / G * 2048 + 32768)
    path = plain(m, more={"cx": counts[:, 0], "cy": counts[:, 1], "cz": counts[:, 2]}, form="%.12g")
    text = PLAIN.replace(
        "[ax, ay, az], unit: m/s^2", f"[cx, cy, cz], unit: g, offset: 32768, scale: {1 / 2048}"
    )
    session = load(text, path)
    kept = session.manifest.content["sensors"]["imu"]["raw_counts"]["acc"]
    np.testing.assert_array_equal(
        np.round(session.imu("imu").acc / G / kept["scale"] + kept["offset"]), counts
    )


def test_a_wrapping_clock_in_milliseconds(plain, motion, load):
    m = motion(600)
    ms = (65_000 + np.arange(600) * 10) % 65_536
    path = plain(m, more={"ms": ms})
    text = PLAIN.replace("{column: t, unit: s}", "{column: ms, unit: ms, wraps_bits: 16}")
    np.testing.assert_array_equal(np.diff(load(text, path).imu("imu").device_time_ns), 10_000_000)


def test_a_rate_in_place_of_times_and_a_counter_that_lost_some(plain, motion, load):
    m = motion(600)
    counter = np.arange(600) + 7 * (np.arange(600) > 250)
    text = PLAIN.replace("time: {column: t, unit: s}", "rate_hz: 100").replace(
        "  imu:\n", "  imu:\n    counter: n\n"
    )
    samples = load(text, plain(m, more={"n": counter})).imu("imu")
    assert (
        np.argmax(np.diff(samples.host_time_ns)) == 250
        and samples.host_time_ns[-1] == 6_060_000_000
    )


@pytest.mark.parametrize("axes", ["left_leg_frontal", "{x: -z, y: -y, z: -x}"])
def test_axes_turn_every_vector_and_the_orientation(plain, motion, load, axes, xyz):
    m = motion(600)
    text = PLAIN + f"    quaternion: {{columns: [qw, qx, qy, qz], order: wxyz}}\n    axes: {axes}\n"
    samples = load(text, plain(m, more=xyz("q{}", m.q, "wxyz"))).imu("imu")
    matrix = np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]])
    np.testing.assert_allclose(samples.acc, m.acc @ matrix.T, atol=1e-6)
    np.testing.assert_allclose(samples.gyr, m.gyr @ matrix.T, atol=1e-6)
    up = Rotation.from_quat(samples.device_q, scalar_first=True).apply(samples.acc)
    np.testing.assert_allclose(up, np.tile([0, 0, G], (600, 1)), atol=1e-5)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("direction", ["earth_from_sensor", "sensor_from_earth"])
def test_orders_and_directions_of_quaternions(plain, motion, load, xyz, order, direction):
    m = motion(600)
    q = m.q if direction == "earth_from_sensor" else m.q * [1, -1, -1, -1]
    names = [f"q{axis}" for axis in order]
    text = (
        PLAIN + f"    quaternion: {{columns: [{', '.join(names)}], order: {order}, direction: "
        f"{direction}}}\n"
    )
    samples = load(text, plain(m, more=xyz("q{}", q, "wxyz"))).imu("imu")
    np.testing.assert_allclose(samples.device_q, m.q, atol=1e-8)
