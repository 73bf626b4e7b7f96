"""Noise at rest, in data-sheet units."""

import numpy as np
import pytest

from testbench.evaluation.noise import LongRest, longest_rest, noise_of, norm_error_percent
from testbench.frames import STANDARD_GRAVITY
from testbench.model.imu import TriadModel
from testbench.records.session.samples import ImuSamples
from testbench.records.specs.sensor import load_preset

RATE = 60.0


def at_rest(seconds=120.0, seed=0):
    """What the Xsens DOT preset reads at rest with z up."""
    n = int(seconds * RATE)
    preset = load_preset("xsens_dot")
    time = (np.arange(n) * 1e9 / RATE).astype(np.int64)
    up = np.tile([0.0, 0.0, STANDARD_GRAVITY], (n, 1))
    acc, _ = TriadModel(preset.accelerometer.triad(), RATE, seed, "acc").measure(up)
    gyr, _ = TriadModel(preset.gyroscope.triad(), RATE, seed, "gyr").measure(np.zeros((n, 3)))
    return ImuSamples(time, time, gyr, acc, None, None, np.arange(n), np.zeros(n, dtype=bool))


def rest_of(samples):
    columns = samples.to_columns()
    return LongRest(len(samples), (len(samples) - 1) / RATE, columns, columns.__getitem__)


def test_the_data_sheet_that_was_simulated_is_measured_again():
    samples = at_rest()
    rows = {(row.quantity, row.axis): row for row in noise_of("dot", rest_of(samples)).rows}
    for axis, density in (("x", 120.0), ("y", 120.0), ("z", 200.0)):
        row = rows["acc", axis]
        assert row.noise_density_unit == "ug/sqrt(Hz)"
        assert row.noise_density == pytest.approx(
            density, abs=4 * row.noise_density_sd + 0.03 * density
        )
    gyr = rows["gyr", "x"]
    # 16.4 counts per deg/s round to 0.061 deg/s, whose own noise adds to the 0.007 deg/s/sqrt(Hz)
    # of the sheet
    quantised = np.hypot(0.007, (1 / 16.4) / np.sqrt(12) / np.sqrt(RATE / 2))
    assert gyr.noise_density == pytest.approx(quantised, rel=0.1)
    assert gyr.random_walk == pytest.approx(gyr.noise_density / np.sqrt(2) * 60, rel=1e-9)


def test_the_mean_norm_is_compared_with_gravity():
    samples = at_rest()
    scaled = ImuSamples(*{**vars(samples), "acc": samples.acc * 0.98}.values())
    plain = norm_error_percent(rest_of(samples))
    assert norm_error_percent(rest_of(scaled)) == pytest.approx(
        0.98 * (100 + plain) - 100, abs=1e-9
    )


def test_the_longest_rest_ends_at_motion_and_at_gaps():
    time = (np.arange(3000) * 1e9 / RATE).astype(np.int64)
    still = np.ones(3000, bool)
    still[1000] = False
    assert longest_rest(time, still) == slice(1001, 3000)
    time[2000:] += 500_000_000
    assert longest_rest(time, still) == slice(0, 1000)


@pytest.mark.parametrize("rate", [1.0, 5.0, 9.0, 50.0])
def test_a_rest_is_found_at_any_rate_and_ends_at_a_gap(rate):
    time = (np.arange(600) * 1e9 / rate).astype(np.int64)
    still = np.ones(600, bool)
    assert longest_rest(time, still) == slice(0, 600)
    time[580:] += round(max(3e9 / rate, 2e8))
    assert longest_rest(time, still) == slice(0, 580)


def test_a_short_rest_gives_no_row():
    time = at_rest(seconds=5.0).device_time_ns
    assert longest_rest(time, np.ones(len(time), bool)) is None
    assert noise_of("dot", None).rows == [] and norm_error_percent(None) is None


def test_a_quantity_that_is_unknown_somewhere_or_never_changes_gives_no_row():
    samples = at_rest()
    samples.gyr[100, 1] = np.nan
    samples.acc[:] = [0.0, 0.0, STANDARD_GRAVITY]
    assert {row.quantity for row in noise_of("dot", rest_of(samples)).rows} == {
        "acc"
    }  # its axes differ
    samples.acc[:] = 1.0
    assert noise_of("dot", rest_of(samples)).rows == []
