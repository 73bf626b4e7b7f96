"""A recording gone through in pieces gives what the whole gives, at the samples that are kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.estimation import estimate
from testbench.estimation.signals import access
from testbench.evaluation import evaluate
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.frames import NANOSECONDS
from testbench.records.results.estimate import Estimate
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.specs.protocol import Analysis, Estimation
from tests.benchmarks.long_recordings import orientation

RATE, SECONDS, EVERY, PIECE = 100.0, 200.0, 7, 1_500
FILTERS = ["device", "vqf_6d", "vqf_9d", "fusion", "madgwick_imu", "vqf_offline"]


def samples_of(spoil=None) -> tuple[ImuSamples, Truth]:
    """A motion with rests, 10 ms late and 50 ppm fast, with magnetometer and a device's
    orientation.
    """
    rng = np.random.default_rng(5)
    index = np.arange(int(RATE * SECONDS))
    host = index / RATE / (1 + 50e-6)
    turned = orientation(host, 3)
    gyr = (
        orientation(host - 1 / RATE, 3).inv() * turned
    ).as_rotvec() * RATE + 0.002 * rng.standard_normal((len(index), 3))
    acc = turned.inv().apply([0, 0, 9.80665]) + 0.02 * rng.standard_normal((len(index), 3))
    mag = turned.inv().apply([0, 20.0, -40.0]) + 0.1 * rng.standard_normal((len(index), 3))
    device = np.round((index / RATE + 0.01) * NANOSECONDS).astype(np.int64)
    arrival = np.maximum.accumulate(
        np.round((host + rng.exponential(0.002, len(host))) * NANOSECONDS).astype(np.int64)
    )
    q = turned.as_quat(scalar_first=True)
    columns = [device, arrival, gyr, acc, mag, q, index, np.zeros(len(index), dtype=bool)]
    if spoil is not None:
        columns = spoil(columns)
    seen = np.arange(0, SECONDS, 0.02)
    truth = Truth(
        np.round(seen * NANOSECONDS).astype(np.int64),
        orientation(seen, 3).as_quat(scalar_first=True),
    )
    return ImuSamples(*columns), truth


def lost(columns):
    """Packets lost all over, also at the seams of the pieces, and a stretch of 40 s."""
    keep = np.random.default_rng(1).random(len(columns[0])) > 0.02
    keep[[PIECE, PIECE - 1, 3 * PIECE, 3 * PIECE + 1]] = False
    keep[9_000:13_000] = False
    return [column[keep] for column in columns]


def damaged(columns):
    """Stuck, saturated and missing readings, over the seams of the pieces; a bad quaternion."""
    gyr, acc, q, saturated = columns[2], columns[3], columns[5], columns[7]
    for array in (gyr, acc):
        array[2 * PIECE - 2 : 2 * PIECE + 4] = array[2 * PIECE - 3]
        array[300:320] = array[299]
    gyr[5 * PIECE - 3 : 5 * PIECE + 2, 0] = np.nan
    saturated[4 * PIECE : 4 * PIECE + 3] = True
    q[700] *= 1.2
    return columns


def dark(columns):
    """Half a minute without an accelerometer, more than a whole piece."""
    columns[3][14_990:18_020] = np.nan
    return columns


def untrusted(columns):
    """A counter that starts again now and then."""
    columns[6] = columns[6] % 256
    return columns


CASES = {"plain": None, "lost": lost, "damaged": damaged, "dark": dark, "untrusted": untrusted}


@pytest.fixture(scope="module", params=CASES)
def case(request, tmp_path_factory):
    samples, truth = samples_of(CASES[request.param])
    settings = Estimation(filters=FILTERS, align="motion", align_clock=True, calibrate="none")
    sensor = ImportedSensor([samples], RATE, "synthetic", truth, {"sampling": "instantaneous"})
    folder = tmp_path_factory.mktemp("long")

    class Clock:
        def utc(self):
            from datetime import UTC, datetime

            return datetime(2026, 1, 1, tzinfo=UTC)

    session = write_recording(
        Recording("long", "long", {"imu": sensor}, Analysis(estimate=settings)),
        [folder / "a.csv"],
        "made up",
        folder / "s",
        Clock(),
    )
    whole = estimate(session)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(access, "MOST_KEPT", len(samples) // EVERY + 1)
        patch.setattr(access, "MOST_AT_ONCE", len(samples) - 1)
        patch.setattr(access, "PIECE", PIECE)
        patch.setattr(access, "STRETCH", 15_000)
        pieces = estimate(session)
    return request.param, session, whole, pieces


def test_every_filter_that_can_go_on_gives_the_same_orientation(case):
    name, _, whole, pieces = case
    whole, pieces = whole.sensors["imu"], pieces.sensors["imu"]
    assert (whole.every, pieces.every) == (1, EVERY)
    assert list(pieces.orientation) == FILTERS[:-1] and list(whole.orientation) == FILTERS
    assert "all" in pieces.skipped["vqf_offline"]
    assert any("one of 7 samples" in found.sentence for found in pieces.findings)
    for key, q in pieces.orientation.items() if name != "dark" else ():
        # the clock and the mounting are fitted to fewer samples; what a filter does between is the
        # same
        turned = np.abs(np.sum(q * whole.orientation[key][EVERY - 1 :: EVERY][: len(q)], axis=1))
        expected = 0.2 if name in {"damaged", "lost"} else 0.05
        assert np.degrees(2 * np.arccos(np.minimum(np.quantile(turned, 0.02), 1))) < expected, key


def test_a_filter_that_needs_the_whole_recording_gets_it_while_it_is_not_too_long(case):
    _, session, whole, pieces = case
    clock, kinds = whole.sensors["imu"].clock, {"vqf_offline": access_filter("vqf_offline")}
    every = pieces.sensors["imu"].every
    (_, expected), *_ = access.WholeRecording(session.sensor("imu")).orientations(
        kinds, clock, lambda samples: samples
    )
    (_, found), *_ = access.PiecewiseRecording(session.sensor("imu"), every).orientations(
        kinds, clock, lambda samples: samples
    )
    np.testing.assert_array_equal(found, expected[every - 1 :: every])


def test_the_filters_see_the_same_samples_bit_for_bit_when_the_clock_is_given(case):
    name, session, whole, _ = case
    clock = whole.sensors["imu"].clock
    plain = access.WholeRecording(session.sensor("imu"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(access, "PIECE", PIECE)
        cut = access.PiecewiseRecording(session.sensor("imu"), EVERY)
        kinds = {key: access_filter(key) for key in FILTERS[:-1]}
        ours = dict(cut.orientations(kinds, clock, lambda uniform: uniform))
    for key, expected in plain.orientations(kinds, clock, lambda uniform: uniform):
        rows = slice(EVERY - 1, None, EVERY)
        before = slice(
            0, 14_000 // EVERY if name == "dark" else None
        )  # then nobody knows, and guesses differ
        assert np.isfinite(ours[key]).all()
        np.testing.assert_allclose(
            ours[key][before], expected[rows][: len(ours[key])][before], atol=1e-9, err_msg=key
        )


def access_filter(key):
    from testbench.estimation.filters import get_filter

    return get_filter(key)


def test_the_gates_refuse_the_same_samples(case):
    _, session, whole, pieces = case
    whole, pieces = whole.sensors["imu"], pieces.sensors["imu"]
    assert pieces.quality == pytest.approx(whole.quality)
    kept = len(pieces.flagged)
    blocks = whole.flagged[: kept * EVERY].reshape(kept, EVERY).any(axis=1)
    np.testing.assert_array_equal(pieces.flagged, blocks)
    assert session.sample_count("imu") // EVERY == kept


def test_timing_and_clock_are_the_same(case):
    name, _, whole, pieces = case
    whole, pieces = whole.sensors["imu"], pieces.sensors["imu"]
    for key, value in vars(whole.timing).items():
        if key not in {"arrival_jitter_ms", "acc_after_gyr_ms", "acc_after_gyr_sd_ms"}:
            assert getattr(pieces.timing, key) == pytest.approx(value, rel=1e-6, abs=1e-6), key
    assert pieces.timing.arrival_jitter_ms == pytest.approx(whole.timing.arrival_jitter_ms, rel=0.1)
    if name != "lost":
        assert pieces.clock.offset_s == pytest.approx(whole.clock.offset_s, abs=1e-3)
    assert np.mean(pieces.static == whole.static[EVERY - 1 :: EVERY][: len(pieces.static)]) > 0.97


def test_errors_and_noise_are_the_same(case, tmp_path):
    name, session, whole, pieces = case
    pieces.save(tmp_path)
    again = Estimate.load(tmp_path)
    assert again.sensors["imu"].every == EVERY
    one, other = (
        evaluate(session, whole),
        evaluate(session, replace(again, fingerprint=whole.fingerprint)),
    )
    mine = {row.filter: row for row in other.orientation}
    for row in one.orientation:
        if row.filter in mine and name != "dark":
            assert mine[row.filter].inclination_rmse_deg == pytest.approx(
                row.inclination_rmse_deg, rel=0.1, abs=0.05
            ), row.filter
    sd = {(row.quantity, row.axis): row.sd for row in other.noise}
    for row in one.noise:
        assert sd[row.quantity, row.axis] == pytest.approx(
            row.sd, rel=0.1
        )  # of raw samples, not of every seventh
