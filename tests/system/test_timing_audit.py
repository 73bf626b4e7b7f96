import numpy as np
import pytest

from testbench.pipeline.run import run
from tests.asking import run_of


@pytest.fixture(scope="module")
def result(altered_protocol, tmp_path_factory):
    def set_clocks(protocol):
        clock = {
            "offset_ms": 40,
            "offset_sd_ms": 0,
            "drift_ppm": 60,
            "drift_sd_ppm": 0,
            "latency_ms": 5,
            "latency_jitter_ms": 3,
        }
        for sensor in protocol["sensors"].values():
            sensor["parameters"] = {"clock": dict(clock), "lost_packets_percent": 0.5}

    return run(
        run_of(altered_protocol("timing_audit", set_clocks), logs=tmp_path_factory.mktemp("logs"))
    )


@pytest.mark.parametrize("name", ["dot", "matrix"])
def test_recovers_the_clock_and_the_losses_it_was_given(result, name):
    sensor = result.estimate.sensors[name]
    assert sensor.clock.offset_s == pytest.approx(0.040, abs=0.0005)
    assert sensor.clock.drift_ppm == pytest.approx(60, abs=1.0)
    timing = sensor.timing
    samples = result.session.imu(name)
    assert timing.lost_packets == int(np.sum(np.diff(samples.counter) - 1))
    assert timing.lost_percent == pytest.approx(0.5, abs=0.2)
    assert timing.arrival_jitter_ms == pytest.approx(3, rel=0.15)
    assert timing.gaps > 10
    assert abs(timing.acc_after_gyr_ms) < 1.5


def test_a_late_accelerometer_is_found_with_an_uncertainty(result):
    """5 ms, and what the low passes of both triads delay them by."""
    timing = result.estimate.sensors["late"].timing
    expected = 5 + 1e3 / (2 * np.pi) * (1 / 62.5 - 1 / 32)
    assert timing.acc_after_gyr_ms == pytest.approx(
        expected, abs=2 * timing.acc_after_gyr_sd_ms + 0.5
    )
    assert 0 < timing.acc_after_gyr_sd_ms < 1.5
