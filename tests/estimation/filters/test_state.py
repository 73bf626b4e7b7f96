"""Filters can be stopped and resumed, fed sample by sample, and fed at irregular intervals."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.estimation.filters import FILTERS, UniformSamples, get_filter
from testbench.estimation.filters.base import RecursiveFilter
from testbench.exceptions import InputError
from testbench.model import rotation
from tests.estimation.filters.motions import heading_deg, inclination_deg, wander

RECURSIVE = [name for name, kind in FILTERS.items() if issubclass(kind, RecursiveFilter)]
SAMPLES, TRUE = wander(6)
SAMPLES = replace(SAMPLES, device_q=TRUE)


def test_only_the_offline_filter_needs_the_whole_recording():
    assert [name for name, kind in FILTERS.items() if not kind.causal] == ["vqf_offline"]
    assert set(FILTERS) - set(RECURSIVE) == {"vqf_offline"}
    with pytest.raises(InputError, match="needs the whole recording at once"):
        get_filter("vqf_offline").advance(SAMPLES)


@pytest.mark.parametrize("name", RECURSIVE)
@settings(max_examples=5)
@given(cut=st.integers(1, len(SAMPLES) - 1))
def test_two_pieces_give_what_the_whole_gives_bit_for_bit(name, cut):
    kind = get_filter(name)
    whole = kind.run(SAMPLES)
    first, state = kind.advance(SAMPLES.piece(slice(0, cut)))
    second, _ = kind.advance(SAMPLES.piece(slice(cut, None)), state)
    np.testing.assert_array_equal(np.vstack([first, second]), whole)


@pytest.mark.parametrize("name", RECURSIVE)
def test_sample_by_sample_gives_what_the_whole_gives(name):
    kind, state, rows = get_filter(name), None, []
    for i in range(200):
        q, state = kind.advance(SAMPLES.piece(slice(i, i + 1)), state)
        rows.append(q[0])
    np.testing.assert_array_equal(np.array(rows), kind.run(SAMPLES)[:200])


@pytest.mark.parametrize("name", RECURSIVE)
def test_the_state_survives_being_written_as_json(name):
    kind = get_filter(name)
    _, state = kind.advance(SAMPLES.piece(slice(0, 300)))
    read = json.loads(json.dumps(state))
    rest = SAMPLES.piece(slice(300, None))
    np.testing.assert_array_equal(kind.advance(rest, read)[0], kind.advance(rest, state)[0])


def test_what_is_not_the_filters_own_state_is_refused():
    _, state = get_filter("mahony_imu").advance(SAMPLES)
    with pytest.raises(InputError, match="mahony_marg cannot resume the state of mahony_imu"):
        get_filter("mahony_marg").advance(SAMPLES, state)
    with pytest.raises(InputError, match="is not whole"):
        get_filter("mahony_imu").advance(SAMPLES, {"filter": "mahony_imu", "started": [1.0]})
    _, state = get_filter("vqf_6d").advance(SAMPLES)
    with pytest.raises(InputError, match=r"was run every 0\.01 s"):
        get_filter("vqf_6d").advance(replace(SAMPLES, interval=0.02), state)


IRREGULAR = [
    name
    for name, kind in FILTERS.items()
    if kind.sampling != "memoryless" and not kind.known_faults
]


@pytest.mark.parametrize("name", IRREGULAR)
def test_irregular_samples_are_followed_as_well_as_regular_ones(name):
    """Intervals that differ by up to 60 %: an interval taken for the mean one would be degrees off
    within a second.
    """
    samples, true = wander(40, noise=0.1, jitter=0.6)
    assert samples.intervals is not None and samples.intervals.std() > 0.3 * samples.interval
    q = get_filter(name).run(samples)
    settled = slice(1500, None)
    assert inclination_deg(q, true)[settled].max() < 1.5
    heading = heading_deg(q, true)[settled]
    # the thesis's gain of 0.35 lets more of the noise through
    assert np.ptp(heading) < (2.5 if name.startswith("madgwick_zeta") else 2.0)
    if "mag" in FILTERS[name].needs:
        assert np.abs(heading).max() < 2.0


def test_pieces_of_irregular_samples_go_to_filters_that_take_them_only():
    samples, _ = wander(3, jitter=0.5)
    for name in ("mekf", "gyro", "fusion"):
        kind = get_filter(name)
        first, state = kind.advance(samples.piece(slice(0, 111)))
        second, _ = kind.advance(samples.piece(slice(111, None)), state)
        np.testing.assert_array_equal(np.vstack([first, second]), kind.run(samples))
    with pytest.raises(InputError, match="chunks of regular samples only"):
        get_filter("vqf_6d").advance(samples)


@pytest.mark.parametrize(
    "name", [name for name, kind in FILTERS.items() if kind.sampling == "native"]
)
def test_samples_before_the_first_usable_one_give_the_identity_and_then_it_starts(name):
    acc, mag = SAMPLES.acc.copy(), np.array(SAMPLES.mag)
    acc[:5] = np.nan
    mag[:7] = 0.0
    q = get_filter(name).run(UniformSamples(0.01, SAMPLES.gyr, acc, mag))
    if name.startswith(("gyro", "euler_ekf_as", "euler_ekf_listing", "euler_ekf_simple_as")):
        return  # these start at once, from nothing
    first = 7 if "mag" in FILTERS[name].needs else 5
    assert np.isfinite(q).all()
    up = rotation.rotate(q[first], acc[first])
    assert np.degrees(np.arccos(up[2] / np.linalg.norm(up))) < 0.01
    if not name.startswith("euler"):
        np.testing.assert_array_equal(q[:first], np.tile([1.0, 0, 0, 0], (first, 1)))


@pytest.mark.parametrize(
    "name", [name for name in RECURSIVE if FILTERS[name].sampling == "native" and name != "gyro"]
)
def test_a_hole_in_accelerometer_and_magnetometer_is_bridged_by_the_gyroscope(name):
    acc, mag = SAMPLES.acc.copy(), np.array(SAMPLES.mag)
    acc[300:340], mag[300:340] = np.nan, np.nan
    q = get_filter(name).run(UniformSamples(0.01, SAMPLES.gyr, acc, mag))
    assert np.isfinite(q).all()
    turned = rotation.multiply(rotation.conjugate(q[299]), q[339])
    true = rotation.multiply(rotation.conjugate(TRUE[299]), TRUE[339])
    limit = 30 if "simple" in name or "printed" in name else 1.0
    assert np.degrees(rotation.angle(rotation.multiply(turned, rotation.conjugate(true)))) < limit
