"""A sensor made of its noise at rest: from made-up readings whose noise is known, none of it
counted twice.
"""

from __future__ import annotations

import numpy as np
import pytest

from testbench.evaluation.noise import LongRest, noise_of
from testbench.pipeline.noise_preset import measured_sensor
from testbench.records.session.samples import GYR
from testbench.records.specs.sensor import load_preset

BASE = load_preset("xsens_dot")
RATE, SECONDS = 60.0, 3600
COUNT_DEG_S = 1 / BASE.gyroscope.counts_per_deg_s


def rest(sd_counts: float, walk_deg_h_sqrts: float = 0.0) -> LongRest:
    """Normal noise and a random walk, rounded to whole counts."""
    rng = np.random.default_rng(2)
    n = int(RATE * SECONDS)
    columns = {}
    for offset, key in zip((0.1, 0.35, 0.8), GYR, strict=True):
        walk = walk_deg_h_sqrts / 3600 / np.sqrt(RATE) * np.cumsum(rng.standard_normal(n))
        reading = COUNT_DEG_S * (offset + sd_counts * rng.standard_normal(n)) + walk
        columns[key] = np.radians(np.round(reading / COUNT_DEG_S) * COUNT_DEG_S)
    return LongRest(n, (n - 1) / RATE, list(columns), columns.__getitem__)


@pytest.mark.parametrize("sd_counts", [0.5, 0.6, 2.0])
def test_the_noise_of_rounding_is_not_written_into_the_white_noise(sd_counts):
    sensor, _ = measured_sensor(noise_of("s", rest(sd_counts)).rows, BASE, "a test")
    true = sd_counts * COUNT_DEG_S / np.sqrt(RATE / 2)
    assert sensor.gyroscope.noise_density_deg_s_sqrthz == pytest.approx([true] * 3, rel=0.03)


def test_noise_below_the_counts_is_kept_from_the_data_sheet_and_said():
    sensor, kept = measured_sensor(noise_of("s", rest(0.2)).rows, BASE, "a test")
    assert sensor.gyroscope.noise_density_deg_s_sqrthz == BASE.gyroscope.noise_density_deg_s_sqrthz
    assert sum("hidden by the counts" in sentence for sentence in kept) == 3


def test_a_random_walk_that_was_found_leaves_no_other_slow_noise_of_the_data_sheet():
    rows = noise_of("s", rest(0.6, walk_deg_h_sqrts=2.0)).rows
    assert all(row.rate_random_walk is not None and row.bias_instability is None for row in rows)
    sensor, kept = measured_sensor(rows, BASE, "a test")
    assert BASE.gyroscope.in_run_bias_deg_h > 0
    assert sensor.gyroscope.in_run_bias_deg_h == 0
    assert sensor.gyroscope.bias_random_walk_deg_h_sqrts == pytest.approx(2.0, rel=0.25)
    assert any("holds the slow noise" in sentence for sentence in kept)
    assert sensor.accelerometer == BASE.accelerometer  # of which nothing was measured


def test_a_rest_that_shows_no_slow_noise_leaves_that_of_the_data_sheet():
    sensor, kept = measured_sensor(noise_of("s", rest(2.0)).rows, BASE, "a test")
    assert sensor.gyroscope.in_run_bias_deg_h == BASE.gyroscope.in_run_bias_deg_h
    assert any(
        "bias instability not shown" in sentence and "10 kept" in sentence for sentence in kept
    )
