"""Clock alignment: an offset and a drift that were put in are found again, and the stated
uncertainty is honest.
"""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.signals.time_alignment import fit_clock
from testbench.records.results.estimate import ClockFit
from testbench.records.session.samples import ImuSamples, Truth

SECONDS = 60


def smooth_rate(t: np.ndarray) -> np.ndarray:
    """A motion with pauses: bursts of turning about changing axes, shape (n, 3) [rad/s]."""
    burst = np.clip(np.sin(2 * np.pi * t / 4.1), 0, None) ** 3
    return burst[:, None] * np.column_stack([np.cos(t / 3), np.sin(t / 5), 0.5 * np.cos(t / 7)])


def recording(
    offset_s: float = 0.0,
    drift_ppm: float = 0.0,
    noise: float = 1e-4,
    seed: int = 0,
    latency_s: float = 0.01,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    gain: float = 1.0,
    turn: np.ndarray | None = None,
) -> tuple[ImuSamples, Truth]:
    rng = np.random.default_rng(seed)
    t = np.arange(0, SECONDS, 0.008)
    truth = Truth((t * 1e9).astype(np.int64), np.tile([1.0, 0, 0, 0], (len(t), 1)), smooth_rate(t))
    host = np.arange(0.0123, SECONDS, 1 / 60)
    gyr = (
        gain * smooth_rate(host) @ (np.eye(3) if turn is None else turn)
        + bias
        + noise * rng.standard_normal((len(host), 3))
    )
    device = host * (1 + 1e-6 * drift_ppm) + offset_s
    arrival = host + latency_s + 0.004 * rng.exponential(size=len(host))
    zero = np.zeros((len(host), 3))
    return ImuSamples(
        np.round(device * 1e9).astype(np.int64),
        np.round(np.maximum.accumulate(arrival) * 1e9).astype(np.int64),
        gyr,
        zero,
        None,
        None,
        np.arange(len(host)),
        np.zeros(len(host), dtype=bool),
    ), truth


@pytest.mark.parametrize("offset_s", [0.0, 0.05, -1.7, 3600.0])
@pytest.mark.parametrize("drift_ppm", [0.0, 100.0, -300.0])
def test_offset_and_drift_are_recovered(offset_s, drift_ppm):
    fit = fit_clock(*recording(offset_s, drift_ppm))
    assert fit.method == "angular_rate"
    assert fit.offset_s == pytest.approx(offset_s, abs=2e-4)
    assert fit.drift_ppm == pytest.approx(drift_ppm, abs=5)


def test_a_late_arrival_an_arbitrary_mounting_a_bias_and_a_gain_do_not_shift_the_clock():
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    fit = fit_clock(
        *recording(0.05, 100.0, latency_s=0.2, bias=(0.003, -0.002, 0.001), gain=1.01, turn=turn)
    )
    assert fit.offset_s == pytest.approx(0.05, abs=5e-4)
    assert fit.drift_ppm == pytest.approx(100, abs=10)


def test_the_fit_brings_device_times_back_to_the_host():
    samples, truth = recording(0.05, 100.0)
    host = (np.arange(len(samples)) / 60 + 0.0123) * 1e9
    np.testing.assert_allclose(
        fit_clock(samples, truth).to_host(samples.device_time_ns), host, atol=5e5
    )


def test_the_stated_uncertainty_covers_the_error_and_is_not_boastfully_wide():
    scores, widths = [], []
    for seed in range(40):
        fit = fit_clock(*recording(0.05, 100.0, noise=0.01, seed=seed))
        scores.append(
            [(fit.offset_s - 0.05) / fit.offset_sd_s, (fit.drift_ppm - 100) / fit.drift_sd_ppm]
        )
        widths.append(fit.offset_sd_s)
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    assert (spread > 0.5).all() and (spread < 2.0).all()
    assert max(widths) < 2e-3


def test_more_noise_means_more_uncertainty_and_a_larger_residual():
    quiet, loud = (fit_clock(*recording(noise=noise)) for noise in (1e-3, 1e-2))
    assert loud.offset_sd_s > 3 * quiet.offset_sd_s
    # the noise of one axis while moving; at rest that of the length of three
    assert 0.9 < loud.residual_deg_s / np.degrees(1e-2) < np.sqrt(3)
    assert loud.angle_error_deg > 0


def test_a_sensor_that_never_moves_falls_back_on_the_arrival_times_and_is_late_by_the_latency():
    samples, truth = recording(0.05, 0.0)
    still = Truth(truth.host_time_ns, truth.q_world_from_sensor, np.zeros_like(truth.rate))
    fit = fit_clock(samples, still)
    assert fit.method == "arrival"
    assert fit.offset_s == pytest.approx(0.05 - 0.01, abs=2e-3)
    assert fit_clock(samples, None).method == "arrival"


def test_the_arrival_times_alone_see_a_drift():
    fit = fit_clock(recording(0.05, 400.0)[0], None)
    assert fit.drift_ppm == pytest.approx(400, abs=40)


def test_no_fit_leaves_times_as_they_are():
    times = np.array([0, 17, 5_000_000_000])
    np.testing.assert_array_equal(ClockFit().to_host(times), times)
