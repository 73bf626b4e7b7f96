"""Quality gates: each injected fault is flagged where it is, and nothing else."""

import numpy as np
import pytest

from testbench.consistency.doubtful import Belief, Gates
from testbench.consistency.traits import Traits
from testbench.estimation.signals.quality import Inspection
from testbench.estimation.signals.timing import audit_timing
from testbench.model.truth import without_jumps
from testbench.records.session.samples import ImuSamples, Truth
from tests.estimation.assessed import assess

N, RATE = 2000, 100.0


def recording(seed=0, noise=0.01):
    """A sensor at rest with a little noise."""
    rng = np.random.default_rng(seed)
    time = (np.arange(N) * 1e9 / RATE).astype(np.int64)
    acc = np.array([0.0, 0.0, 9.80665]) + noise * rng.standard_normal((N, 3))
    mag = np.array([20.0, 0.0, 40.0]) + noise * rng.standard_normal((N, 3))
    q = np.tile([1.0, 0.0, 0.0, 0.0], (N, 1))
    gyr = noise * rng.standard_normal((N, 3))
    return ImuSamples(time, time, gyr, acc, mag, q, np.arange(N), np.zeros(N, dtype=bool))


def gates(samples):
    return assess(samples, np.ones(len(samples), dtype=bool))[0]


def test_a_sound_recording_passes_every_gate():
    quality = gates(recording())
    assert not quality.flagged.any()
    assert quality.findings == []


@pytest.mark.parametrize(
    ("reason", "spoil"),
    [
        ("saturated", lambda s: s.saturated.__setitem__(slice(50, 60), True)),
        ("not finite", lambda s: s.acc.__setitem__((slice(50, 60), 1), np.nan)),
        (
            "stuck",
            lambda s: [column.__setitem__(slice(49, 60), column[49]) for column in (s.gyr, s.acc)],
        ),
        (
            "quaternion not of unit length",
            lambda s: s.device_q.__setitem__((slice(50, 60), 0), 0.9),
        ),
    ],
)
def test_a_fault_is_flagged_where_it_is(reason, spoil):
    samples = recording()
    spoil(samples)
    quality = gates(samples)
    assert np.flatnonzero(quality.flags[reason]).tolist() == list(range(50, 60))
    assert quality.numbers[reason] == 10
    assert quality.flagged.sum() == 10


def test_a_model_without_noise_is_not_called_stuck_for_being_at_rest_and_a_sensor_is():
    still = recording(noise=0.0)
    model, _ = assess(still, np.ones(N, dtype=bool), Belief(has_noise=False))
    assert not model.flagged.any()
    assert gates(still).numbers["stuck"] == N


def test_a_model_without_noise_may_rest_in_a_recording_that_moves_for_the_most_part():
    samples = recording()
    for column in (samples.gyr, samples.acc):
        column[:800] = column[0]
    at_rest = np.arange(N) < 800
    assert assess(samples, at_rest)[0].numbers["stuck"] == 799
    assert not assess(samples, at_rest, Belief(has_noise=False))[0].flagged.any()


def test_the_second_after_a_long_gap_is_flagged():
    samples = recording()
    keep = np.r_[0:500, 550:N]
    cut = ImuSamples(
        *[None if column is None else column[keep] for column in vars(samples).values()]
    )
    flagged = np.flatnonzero(gates(cut).flags["after a gap"])
    assert flagged[0] == 500
    assert len(flagged) == 101


def test_after_a_gap_of_seconds_filters_begin_anew_with_the_first_sample():
    samples = recording()
    cut = samples.rows(np.r_[0:500, 700:1200, 1290:N])
    gates = Gates(Traits().add(cut), Belief())
    for chunks in ([slice(0, None)], [slice(0, 300), slice(300, 500), slice(500, None)]):
        inspection = Inspection(gates)
        after = [
            inspection.flags(cut.rows(own), gates.doubt(cut.rows(own)), slice(None))["after a gap"]
            for own in chunks
        ]
        flagged = np.flatnonzero(np.concatenate(after)).tolist()
        assert flagged == [*range(500, 601), *range(1000, 1101)]
        assert inspection.lost == [(499, 500)]  # 0.9 s are bridged


def test_a_column_the_file_lacks_is_no_fault():
    samples = recording()
    samples.gyr[:] = np.nan
    assert not gates(samples).flagged.any()


def test_a_wrong_norm_at_rest_and_a_disturbed_field_are_remarked_on():
    samples = recording()
    samples.acc[:] *= 1.08
    samples.mag[:400] *= 1.5
    remarks = list(map(str, gates(samples).findings))
    assert any("1.080 g" in remark for remark in remarks)
    assert any("magnetic field" in remark for remark in remarks)


def test_a_jump_of_the_truth_is_blanked_and_counted_and_a_sign_flip_is_not():
    q = np.tile([1.0, 0.0, 0.0, 0.0], (100, 1))
    q[30:] *= -1
    q[60] = [0.0, 1.0, 0.0, 0.0]
    truth, count = without_jumps(
        Truth((np.arange(100) * 1e7).astype(np.int64), q), fastest=lambda: 1.0
    )
    assert count == 3
    assert np.flatnonzero(np.isnan(truth.q_world_from_sensor[:, 0])).tolist() == [59, 60, 61]


def test_the_audit_counts_gaps_lost_packets_repeated_and_backward_stamps():
    samples = recording()
    time = samples.device_time_ns.copy()
    time[700] = time[699]
    time[900] = time[898]
    counter = samples.counter.copy()
    keep = np.r_[0:500, 505:N]
    audit = audit_timing(
        ImuSamples(
            time[keep],
            time[keep],
            samples.gyr[keep],
            samples.acc[keep],
            None,
            None,
            counter[keep],
            samples.saturated[keep],
        ),
        RATE,
    )
    assert audit.lost_packets == 5
    assert audit.longest_gap_ms == pytest.approx(60.0)
    assert (audit.repeated_stamps, audit.backward_stamps) == (1, 1)
    assert audit.sampling_rate_hz == pytest.approx(100.0, rel=1e-2)
    assert audit.lost_percent == pytest.approx(100 * 5 / N)


@pytest.mark.parametrize("lag", [0, 3, -4])
def test_an_accelerometer_that_lags_the_gyroscope_is_found_out(lag):
    time = np.arange(6000) / RATE
    angle = np.sin(2 * np.pi * 0.7 * time) + 0.5 * np.sin(2 * np.pi * 0.31 * time)
    rate = np.gradient(angle, time)
    gyr = np.column_stack([rate, 0 * rate, 0 * rate])
    acc = 9.80665 * np.column_stack([0 * angle, np.sin(angle), np.cos(angle)])
    stamp = (time * 1e9).astype(np.int64)
    late = ImuSamples(
        stamp,
        stamp,
        gyr,
        np.roll(acc, lag, axis=0),
        None,
        None,
        np.arange(6000),
        np.zeros(6000, dtype=bool),
    )
    assert audit_timing(late, RATE).acc_after_gyr_ms == pytest.approx(10 * lag, abs=1.0)


def test_the_uncertainty_of_that_lag_is_as_large_as_its_errors():
    errors = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        time = np.arange(3000) / RATE
        phases = rng.uniform(0, 2 * np.pi, 4)
        waves = zip((0.31, 0.7, 1.1, 1.9), phases, strict=True)
        angle = sum(0.3 * np.sin(2 * np.pi * f * time + phase) for f, phase in waves)
        rate = np.gradient(angle, time)
        gyr = np.column_stack([rate, 0 * rate, 0 * rate]) + rng.normal(0, 0.02, (3000, 3))
        acc = 9.80665 * np.column_stack([0 * angle, np.sin(angle), np.cos(angle)])
        acc += rng.normal(0, 0.1, acc.shape)
        stamp = (time * 1e9).astype(np.int64)
        clean = np.zeros(3000, dtype=bool)
        samples = ImuSamples(stamp, stamp, gyr, acc, None, None, np.arange(3000), clean)
        found = audit_timing(samples, RATE)
        errors.append(found.acc_after_gyr_ms / found.acc_after_gyr_sd_ms)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 2.0
