"""The measurement model: each error, put in alone, is seen alone and at its stated size."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.model import rotation
from testbench.model.imu import DeviceOrientationModel, TriadModel
from testbench.records.specs.sensor import (
    Accelerometer,
    DeviceOrientation,
    Gyroscope,
    Magnetometer,
    TriadParameters,
    load_preset,
)

G = 9.80665
RATE = 100.0
PARTS = 400
"""Parts off the production line, enough to see a standard deviation within 10 % (3 sigma of
1/sqrt(2 * 3 * 400)).
"""


def accelerometer(**errors: object) -> TriadParameters:
    return Accelerometer.model_validate({"range_g": 16.0} | errors).triad()


def gyroscope(**errors: object) -> TriadParameters:
    return Gyroscope.model_validate({"range_deg_s": 2000.0} | errors).triad()


def measure(
    triad: TriadParameters, x: np.ndarray, seed: int = 0, force: np.ndarray | None = None
) -> np.ndarray:
    return TriadModel(triad, RATE, seed, "sensor", "triad").measure(np.atleast_2d(x), force)[0]


def some_motion(n: int = 50) -> np.ndarray:
    return np.random.default_rng(1).normal(0, 3, (n, 3))


def test_a_sensor_without_errors_reports_what_happens():
    x = some_motion()
    np.testing.assert_array_equal(measure(accelerometer(), x), x)


def test_a_turn_on_bias_is_added_to_every_sample_and_differs_between_parts_as_stated():
    triad = accelerometer(bias_sd_mg=10.0)
    x = some_motion()
    bias = measure(triad, x, seed=3) - x
    assert np.ptp(bias, axis=0).max() < 1e-14
    assert np.unique(bias[0]).size == 3
    parts = np.array([measure(triad, np.zeros(3), seed)[0] for seed in range(PARTS)])
    assert parts.std() == pytest.approx(0.010 * G, rel=0.1)
    assert abs(parts.mean()) < 4 * 0.010 * G / np.sqrt(parts.size)


def test_sensors_of_one_part_have_its_errors_and_a_noise_of_their_own():
    """A name in place of the first label: one device at two rates."""
    sheet = load_preset("matrix").gyroscope.triad()
    slow, fast = (
        TriadModel(sheet, rate, 3, name, "gyroscope", drawn_as="device")
        for name, rate in (("slow", 25.0), ("fast", 200.0))
    )
    alone = TriadModel(sheet, 25.0, 3, "slow", "gyroscope")
    for key in ("matrix", "bias", "g_matrix", "drift"):
        np.testing.assert_array_equal(getattr(slow.errors, key), getattr(fast.errors, key))
    assert not np.array_equal(slow.errors.bias, alone.errors.bias)
    still = np.zeros((50, 3))
    assert not np.array_equal(slow.measure(still)[0], fast.measure(still)[0])


def test_a_scale_error_grows_with_the_signal_and_stays_on_its_axis():
    triad = accelerometer(scale_sd_percent=2.0)
    one, two = measure(triad, np.diag([1.0, 1.0, 1.0])), measure(triad, np.diag([2.0, 2.0, 2.0]))
    np.testing.assert_allclose(two, 2 * one, rtol=1e-14)
    assert np.count_nonzero(one - np.diag(np.diag(one))) == 0
    parts = np.array([np.diag(measure(triad, np.eye(3), seed)) - 1 for seed in range(PARTS)])
    assert parts.std() == pytest.approx(0.02, rel=0.1)


def test_a_cross_axis_error_shows_an_axis_what_the_others_feel_and_leaves_its_own_scale_alone():
    triad = accelerometer(cross_axis_sd_percent=1.0)
    response = measure(triad, np.eye(3))
    np.testing.assert_array_equal(np.diag(response), 1.0)
    others = np.array(
        [measure(triad, np.eye(3), seed)[~np.eye(3, dtype=bool)] for seed in range(PARTS)]
    )
    assert others.std() == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("rate", [60.0, 100.0, 1000.0])
def test_white_noise_has_the_density_times_the_root_of_half_the_rate(rate):
    triad = accelerometer(noise_density_ug_sqrthz=[100.0, 200.0, 0.0])
    noise, _ = TriadModel(triad, rate, 5, "sensor").measure(np.zeros((40_000, 3)))
    expected = np.array([100e-6, 200e-6, 0.0]) * G * np.sqrt(rate / 2)
    np.testing.assert_allclose(noise.std(axis=0), expected, rtol=0.015)
    neighbours = np.mean(noise[1:, 0] * noise[:-1, 0]) / noise[:, 0].var()
    assert abs(neighbours) < 0.02  # white
    assert abs(np.corrcoef(noise[:, 0], noise[:, 1])[0, 1]) < 0.02


def test_quantisation_reports_whole_counts_within_half_a_count():
    triad = accelerometer(counts_per_g=2048.0)
    x = some_motion(500)
    found = measure(triad, x)
    counts = found / (G / 2048)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert np.abs(found - x).max() <= G / 2048 / 2 * (1 + 1e-9)
    assert np.abs(found - x).max() > 0.9 * G / 2048 / 2


def test_beyond_full_scale_the_reading_stays_there_and_the_sample_is_marked():
    x = np.radians([[1999.0, 0, 0], [2001, 0, 0], [0, -2500, 0], [0, 0, 1]])
    readings, saturated = TriadModel(gyroscope(), RATE, 0, "sensor").measure(x)
    np.testing.assert_array_equal(saturated, [False, True, True, False])
    np.testing.assert_allclose(
        np.degrees(readings), [[1999, 0, 0], [2000, 0, 0], [0, -2000, 0], [0, 0, 1]], rtol=1e-12
    )


def test_saturation_is_judged_after_the_errors():
    triad = gyroscope(bias_sd_deg_s=50.0)
    bias = measure(triad, np.zeros(3))[0]
    axis = int(np.argmax(np.abs(bias)))
    x = np.zeros((1, 3))
    x[0, axis] = np.sign(bias[axis]) * (np.radians(2000) - np.abs(bias[axis]) / 2)
    _, saturated = TriadModel(triad, RATE, 0, "sensor", "triad").measure(x)
    assert saturated.all()


@pytest.mark.parametrize("bandwidth", [2.0, 5.0, 10.0])
def test_the_bandwidth_lets_a_sine_of_its_frequency_through_at_minus_three_decibels(bandwidth):
    rate, n = 1000.0, 20_000
    t = np.arange(n) / rate
    for frequency, gain in (
        (bandwidth, 1 / np.sqrt(2)),
        (bandwidth / 10, 1 / np.sqrt(1.01)),
        (10 * bandwidth, 1 / np.sqrt(101)),
    ):
        x = np.sin(2 * np.pi * frequency * t)[:, None] * np.ones(3)
        y, _ = TriadModel(gyroscope(bandwidth_hz=bandwidth), rate, 0, "sensor").measure(x)
        settled = slice(n // 2, None)
        assert np.sqrt(2) * y[settled].std() == pytest.approx(gain, rel=0.05)


def test_a_low_pass_starts_at_rest_in_what_it_first_feels():
    y = measure(accelerometer(bandwidth_hz=5.0), np.full((20, 3), 9.81))
    np.testing.assert_allclose(y, 9.81, rtol=1e-14)


def test_the_nonlinearity_is_cubic_odd_and_reaches_its_size_at_full_scale():
    triad = accelerometer(nonlinearity_percent_fs=0.5)
    full = 16 * G
    levels = np.array([0.999, 0.5, -0.5])[:, None] * full * np.ones(3)
    error = (
        measure(accelerometer(nonlinearity_percent_fs=0.5, range_g=16.0), levels / 1.01)
        - levels / 1.01
    )
    expected = 0.005 * full * (levels / 1.01 / full) ** 3
    np.testing.assert_allclose(error, expected, rtol=1e-9)
    assert triad.nonlinearity == 0.005


def test_g_sensitivity_shows_a_gyroscope_the_specific_force():
    triad = gyroscope(g_sensitivity_sd_deg_s_g=0.1)
    still = np.zeros((3, 3))
    response = measure(triad, still, force=G * np.eye(3))
    np.testing.assert_array_equal(measure(triad, still, force=np.zeros((3, 3))), 0.0)
    np.testing.assert_allclose(
        measure(triad, still, force=2 * G * np.eye(3)), 2 * response, rtol=1e-12
    )
    parts = np.array([measure(triad, still, seed, G * np.eye(3)) for seed in range(PARTS)])
    assert np.degrees(parts.std()) == pytest.approx(0.1, rel=0.06)


def test_the_in_run_bias_wanders_with_the_stated_spread():
    triad = gyroscope(in_run_bias_deg_h=3600.0, bias_time_constant_s=1.0)
    wander = measure(triad, np.zeros((60_000, 3)))
    assert np.degrees(wander.std()) == pytest.approx(1.0, rel=0.1)


def test_a_random_walk_of_the_bias_grows_with_the_root_of_time():
    triad = gyroscope(bias_random_walk_deg_h_sqrts=3600.0)
    ends = np.array([measure(triad, np.zeros((900, 3)), seed)[[99, 899]] for seed in range(300)])
    np.testing.assert_allclose(np.degrees(ends.std(axis=(0, 2))), [1.0, 3.0], rtol=0.08)


def test_a_magnetometer_has_its_own_words_for_the_same_errors():
    triad = Magnetometer.model_validate(
        {"range_uT": 800.0, "hard_iron_sd_uT": 2.0, "resolution_uT": 0.025}
    ).triad()
    assert (triad.unit, triad.bias_sd, triad.resolution) == ("uT", 2.0, 0.025)


ALL = {
    "counts_per_deg_s": 16.4,
    "noise_density_deg_s_sqrthz": [0.01, 0.01, 0.02],
    "bias_sd_deg_s": 0.5,
    "in_run_bias_deg_h": 100.0,
    "bias_random_walk_deg_h_sqrts": 50.0,
    "scale_sd_percent": 1.0,
    "cross_axis_sd_percent": 1.0,
    "nonlinearity_percent_fs": 0.1,
    "g_sensitivity_sd_deg_s_g": 0.1,
    "bandwidth_hz": 20.0,
}


@pytest.mark.parametrize("cuts", [[1], [499], [1, 2, 3], [100, 100, 250], list(range(1, 500))])
def test_a_stream_read_in_pieces_is_the_stream_read_at_once_to_the_bit(cuts):
    x, force = some_motion(500), some_motion(500)[::-1]

    def model() -> TriadModel:
        return TriadModel(gyroscope(**ALL), RATE, 7, "sensor", "gyroscope")

    whole, marks = model().measure(x, force)
    in_pieces = model()
    pieces = [
        in_pieces.measure(a, b)
        for a, b in zip(np.split(x, cuts), np.split(force, cuts), strict=True)
    ]
    assert np.concatenate([piece[0] for piece in pieces]).tobytes() == whole.tobytes()
    np.testing.assert_array_equal(np.concatenate([piece[1] for piece in pieces]), marks)


def test_the_device_orientation_read_in_pieces_is_the_one_read_at_once_to_the_bit():
    parameters = DeviceOrientation(
        inclination_sd_deg=1.0, heading_sd_deg=2.0, noise_sd_deg=0.1, time_constant_s=5.0
    )
    q = rotation.from_rotation_vector(some_motion(300))

    def model() -> DeviceOrientationModel:
        return DeviceOrientationModel(parameters, RATE, 7, "sensor")

    in_pieces = model()
    pieces = [in_pieces.measure(part) for part in np.split(q, [1, 50, 50, 299])]
    assert np.concatenate(pieces).tobytes() == model().measure(q).tobytes()


def test_the_device_orientation_errs_about_the_vertical_and_against_it_as_stated():
    parameters = DeviceOrientation(
        heading_unknown=False,
        inclination_sd_deg=0.5,
        heading_sd_deg=2.0,
        time_constant_s=0.5,
        noise_sd_deg=0.0,
    )
    true = rotation.from_rotation_vector(np.tile([0.3, -1.0, 0.7], (60_000, 1)))
    measured = DeviceOrientationModel(parameters, RATE, 2, "sensor").measure(true)
    error = rotation.multiply(measured, rotation.conjugate(true))
    assert np.degrees(rotation.heading_angle(error).std()) == pytest.approx(2.0, rel=0.08)
    # two horizontal axes, each with its own error
    assert np.degrees(np.sqrt(np.mean(rotation.inclination_angle(error) ** 2))) == pytest.approx(
        0.5 * np.sqrt(2), rel=0.08
    )


def test_the_earth_of_the_device_has_a_new_heading_at_each_power_up_and_none_where_it_is_known():
    headings = np.array(
        [
            DeviceOrientationModel(DeviceOrientation(), RATE, seed, "a").heading
            for seed in range(200)
        ]
    )
    assert np.unique(headings).size == 200
    assert (
        headings.min() < -2.8 and headings.max() > 2.8 and abs(np.mean(np.exp(1j * headings))) < 0.2
    )  # all round
    assert DeviceOrientationModel(DeviceOrientation(), RATE, 0, "b").heading != headings[0]
    assert (
        DeviceOrientationModel(DeviceOrientation(heading_unknown=False), RATE, 0, "a").heading
        == 0.0
    )


def test_a_device_without_errors_reports_the_truth_in_an_earth_turned_about_the_vertical():
    model = DeviceOrientationModel(DeviceOrientation(), RATE, 4, "sensor")
    true = rotation.from_rotation_vector(some_motion(20))
    error = rotation.multiply(model.measure(true), rotation.conjugate(true))
    np.testing.assert_allclose(rotation.inclination_angle(error), 0, atol=1e-12)
    np.testing.assert_allclose(
        rotation.wrap(rotation.heading_angle(error) - model.heading), 0, atol=1e-12
    )
