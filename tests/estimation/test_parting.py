"""Truth and gyroscope that part slowly are told, with when and how far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.ambiguous_truth import find_ambiguous
from testbench.estimation.alignment.parted_truth import cut_at
from testbench.estimation.alignment.parting import Parting, find_partings
from testbench.estimation.signals.truth_faults import find_faults
from testbench.records.session.samples import Truth
from tests.benchmarks.recordings import of_arrays
from tests.estimation.test_access import samples_of
from tests.estimation.test_truth_faults import ramped


@pytest.fixture(scope="module")
def motion():
    """Samples and the truth of them; gyroscope and body are not aligned, and its scale is off."""
    samples, truth = samples_of()
    crooked = np.array([[1.02, 0.01, 0.0], [0.0, 0.98, 0.01], [0.01, 0.0, 1.01]])
    mounted = Rotation.from_euler("XYZ", [20, -70, 110], degrees=True).as_matrix() @ crooked
    bias = np.radians([0.5, -1.0, 0.3])
    return replace(samples, gyr=samples.gyr @ mounted.T + bias), truth


def _all(samples, truth: Truth) -> list[Parting]:
    half = int(np.median(np.diff(samples.device_time_ns))) // 2
    return find_partings(samples, samples.device_time_ns - half, truth)


def _found(samples, truth: Truth) -> Parting | None:
    return max(_all(samples, truth), key=lambda own: own.angle, default=None)


def test_nothing_is_told_where_both_turn_alike(motion):
    assert _found(*motion) is None


@pytest.mark.parametrize(
    ("begin", "seconds", "degrees"),
    [(61.3, 0.5, 7), (40.2, 1, -20), (92.9, 5, 20), (121.7, 20, 20), (61.3, 40, 20)],
)
def test_a_truth_that_drifts_is_told(motion, begin, seconds, degrees):
    samples, truth = motion
    found = _found(samples, ramped(truth, begin, seconds, degrees))
    assert found is not None
    # a slow drift over a fifth of the recording is in part taken for a bias
    near = 1.5 if seconds <= 20 else 4.0
    assert np.degrees(found.angle) == pytest.approx(abs(degrees), abs=near)
    assert found.begin_ns * 1e-9 == pytest.approx(begin, abs=near)
    assert found.end_ns * 1e-9 == pytest.approx(begin + seconds, abs=near)


def test_a_gap_is_no_parting(motion):
    samples, truth = motion
    lost = np.abs(samples.device_time_ns * 1e-9 - 90) < 4
    gyr = np.where(lost[:, None], np.nan, samples.gyr)
    assert _found(replace(samples, gyr=gyr), truth) is None


def test_fast_turns_about_changing_axes_are_followed():
    """700 deg/s at its most: means of rates no longer add up to the turn."""
    t = np.arange(0, 60, 0.005)
    angles = np.column_stack([np.cumsum(np.sin(0.7 * t)), 90 * np.sin(9 * t), 80 * np.sin(11 * t)])
    q = Rotation.from_euler("ZYX", angles, degrees=True)
    samples, _ = samples_of()
    gyr = (q[:-1].inv() * q[1:]).as_rotvec() / 0.005
    stamps = np.round(t[1:] * 1e9).astype(np.int64)
    own = replace(
        samples,
        device_time_ns=stamps,
        host_time_ns=stamps,
        gyr=gyr,
        acc=np.zeros_like(gyr),
        counter=np.arange(len(stamps)),
        **{
            name: None
            for name in ("mag", "device_q", "temperature", "status")
            if hasattr(samples, name)
        },
    )
    truth = Truth(np.round(t * 1e9).astype(np.int64), q.as_quat(scalar_first=True))
    assert np.degrees(np.linalg.norm(gyr, axis=1).max()) > 700
    assert _found(own, truth) is None
    found = _found(own, ramped(truth, 30, 4, 40))
    assert found is not None
    assert np.degrees(found.angle) == pytest.approx(40, abs=8)


def slipped(truth: Truth, begin: float, seconds: float, degrees: float) -> Truth:
    """A truth whose body slips under its markers by and by."""
    part = np.clip((truth.host_time_ns * 1e-9 - begin) / seconds, 0, 1)
    axis = np.array([0.6, -0.64, 0.48])
    by = Rotation.from_rotvec(np.radians(degrees) * part[:, None] * axis)
    q = Rotation.from_quat(truth.q_world_from_sensor, scalar_first=True) * by
    return replace(truth, q_world_from_sensor=q.as_quat(scalar_first=True))


@pytest.mark.parametrize(
    ("begin", "seconds", "degrees"), [(61.3, 0.5, 10), (40.2, 2, 30), (92.9, 5, -20), (80, 20, 25)]
)
def test_a_body_that_slips_under_its_markers_is_told_with_when(motion, begin, seconds, degrees):
    """From there on both turn about other axes: in the world they part for ever on."""
    samples, truth = motion
    found = _found(samples, slipped(truth, begin, seconds, degrees))
    assert found is not None
    assert np.degrees(found.angle) == pytest.approx(abs(degrees), abs=2)
    assert found.begin_ns * 1e-9 == pytest.approx(begin, abs=2.5)
    assert found.end_ns * 1e-9 == pytest.approx(begin + seconds, abs=2.5)


def test_a_truth_that_drifts_for_half_a_recording_is_told(motion):
    samples, truth = motion
    half = float(truth.host_time_ns[-1]) * 0.5e-9
    found = _all(samples, ramped(truth, half, half, 1.5 * half))
    parted = sum(own.end_ns - own.begin_ns for own in found) * 1e-9
    assert parted == pytest.approx(half, abs=0.3 * half)


@pytest.mark.parametrize("drift", [0.0, 1.0])
def test_a_truth_that_drifts_from_beginning_to_end_is_told_of_a_body_that_turns_far(drift):
    """Against a bias the drift turns with the body: here by half a turn either way."""
    t = np.arange(0, 100, 0.01)
    angles = np.array([170, 60, 100]) * np.sin(t[:, None] * [0.5, 0.9, 0.7])
    q = Rotation.from_euler("ZYX", angles, degrees=True)
    gyr = (q[:-1].inv() * q[1:]).as_rotvec() * 100 + np.radians([0.4, -0.3, 0.2])
    samples = of_arrays(100.0, gyr, np.zeros_like(gyr), seconds=t[1:])
    noise = 0.002 * np.random.default_rng(2).standard_normal((len(t), 3))
    truth = Truth(
        np.round(1e9 * t).astype(np.int64),
        (q * Rotation.from_rotvec(noise)).as_quat(scalar_first=True),
    )
    found = _all(samples, ramped(truth, 0.0, 100.0, 100 * drift))
    parted = sum(own.end_ns - own.begin_ns for own in found) * 1e-9
    assert parted == pytest.approx(100 * (drift > 0), abs=10)


def test_a_truth_is_cut_where_both_part():
    """What lies beside a parting is two pieces, the longer of which is kept."""
    seconds = np.arange(0, 100, 0.1)
    time = np.round(1e9 * seconds).astype(np.int64)
    truth = Truth(time, np.tile([1.0, 0, 0, 0], (len(time), 1)))
    cut = cut_at([Parting(0.3, 30_000_000_000, 40_000_000_000)], truth, time)
    assert cut is not None
    kept, lost, (other,) = cut
    known = np.isfinite(kept.q_world_from_sensor[:, 0])
    assert seconds[known].min() == pytest.approx(40) and known.sum() == 600
    np.testing.assert_array_equal(lost, ~known)
    assert seconds[other.rows].max() == pytest.approx(30) and len(other.truth.host_time_ns) == 301
    assert cut_at([Parting(0.3, 5_000_000_000, 95_000_000_000)], truth, time) is None


@pytest.mark.parametrize(("truth_rate", "told"), [(100, False), (8, True)])
def test_a_body_that_spins_at_1900_deg_s_has_no_steps_and_no_partings(truth_rate, told):
    """At 8 Hz it turns by more than half a turn between two orientations of its truth."""
    rng = np.random.default_rng(1)
    t = np.arange(0, 60, 0.01)
    angles = np.array([60, 40, 50]) * np.sin(t[:, None] * [0.9, 0.7, 1.1])
    pace = np.clip(np.sin(0.4 * t), 0, None)
    spin = Rotation.from_rotvec(np.radians(1900) * np.cumsum(pace)[:, None] * 0.01 * [0.6, 0, 0.8])
    q = Rotation.from_euler("ZYX", angles, degrees=True) * spin
    samples = of_arrays(
        100.0, (q[:-1].inv() * q[1:]).as_rotvec() * 100, np.zeros((len(t) - 1, 3)), seconds=t[1:]
    )
    noise = Rotation.from_rotvec(0.002 * rng.standard_normal((len(t), 3)))
    every = round(100 / truth_rate)
    stamps = np.round(1e9 * t).astype(np.int64)
    truth = Truth(stamps[::every], (q * noise).as_quat(scalar_first=True)[::every])
    assert np.degrees(np.linalg.norm(samples.gyr, axis=1).max()) > 1850
    faults = find_faults(samples, samples.device_time_ns, truth)
    assert not faults.findings or told
    if not told:
        assert _all(samples, truth) == []
    found = find_ambiguous(samples, samples.device_time_ns, truth)
    assert (found is not None) == told
    if found is not None:
        lost, finding = found
        assert finding.values["turn_deg"] == pytest.approx(1900 / truth_rate, rel=0.15)
        speed = np.degrees(np.linalg.norm(samples.gyr, axis=1))
        assert speed[lost].min() > 1000 and lost[speed > 1500].mean() > 0.95


@pytest.mark.parametrize("of_the_truth", [True, False])
def test_gaps_of_three_seconds_are_no_faults(motion, of_the_truth):
    samples, truth = motion
    clock = truth.host_time_ns if of_the_truth else samples.device_time_ns
    lost = (clock * 1e-9 % 40 > 20) & (clock * 1e-9 % 40 < 23)
    if of_the_truth:
        q = np.where(lost[:, None], np.nan, truth.q_world_from_sensor)
        truth = replace(truth, q_world_from_sensor=q)
    else:
        samples = replace(samples, gyr=np.where(lost[:, None], np.nan, samples.gyr))
    assert find_faults(samples, samples.device_time_ns, truth).findings == []
    assert _all(samples, truth) == []


@pytest.mark.parametrize("delay", [0.0, 0.025])
@pytest.mark.parametrize("seed", range(4))
def test_fast_turns_sampled_at_20_hz_are_no_parting(seed, delay):
    """Instants of a rate, as many boards sample it; whoever does not say so is taken to average."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 90, 0.0025)
    pace = 2 * np.pi * rng.uniform(0.3, 0.9, 3)
    angles = np.array([90, 60, 80]) * np.sin(t[:, None] * pace + rng.uniform(0, 6, 3))
    q = Rotation.from_euler("ZYX", angles, degrees=True)
    gyr = (q[:-1].inv() * q[1:]).as_rotvec() / 0.0025
    gyr = gyr[::20] + rng.normal(0, 0.005, (len(gyr[::20]), 3))
    samples = of_arrays(20.0, gyr, np.zeros_like(gyr), seconds=t[:-1:20] + 0.00125 + delay)
    noise = Rotation.from_rotvec(0.003 * rng.standard_normal((len(t), 3)))
    stamps = np.round(1e9 * t).astype(np.int64)
    truth = Truth(stamps[::4], (q * noise).as_quat(scalar_first=True)[::4])
    assert np.degrees(np.linalg.norm(gyr, axis=1).max()) > 300
    read = samples.device_time_ns - round(1e9 * delay)
    assert find_partings(samples, read, truth) == []
    found = find_partings(samples, read, ramped(truth, 40, 4, 50))
    assert found and max(np.degrees(own.angle) for own in found) == pytest.approx(50, abs=12)
