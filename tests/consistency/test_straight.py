"""Samples that were filled in along straight lines are told by the noise that they lack, and a
recording that was interpolated as a whole is told as that.

Lines are drawn by numpy and scipy over recordings by the data sheets of parts, as a logger or an
exporter would.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
from scipy.interpolate import interp1d

from testbench.consistency.doubtful import STRAIGHT, STUCK, Belief, Gates, doubts_on
from testbench.consistency.straight import chance_of, straight_rows, tolerance_of
from testbench.consistency.traits import Traits
from testbench.records.session.samples import ImuSamples
from tests.estimation.test_doubtful import NOISY, recorded

KEYS = ("gyr", "acc", "mag")
RESOLVED = ["mpu6050", "xsens_dot", "xsens_mti"]
"""Parts of which every gap is found to the row. Of others the noise of a triad is about a count: a
gap of five rows may look stuck or sound, and ten sound rows once looked filled in.
"""


def columns_of(samples: ImuSamples, keys=KEYS) -> dict[str, np.ndarray]:
    return {key: getattr(samples, key).copy() for key in keys if getattr(samples, key) is not None}


def filled(samples: ImuSamples, gaps: list[tuple[int, int]], keys=KEYS, decimals=None):
    """The samples with gaps (first row, rows) filled along lines, and where these are."""
    columns, where = columns_of(samples, keys), np.zeros(len(samples), dtype=bool)
    for first, count in gaps:
        where[first : first + count] = True
    kept = np.flatnonzero(~where)
    for key, column in columns.items():
        line = interp1d(kept, column[kept], axis=0)(np.arange(len(samples)))
        if decimals is not None:
            line = np.round(line, decimals)
        columns[key] = line
    return replace(samples, **columns), where


@pytest.mark.parametrize("preset", RESOLVED)
@pytest.mark.parametrize("rate", [50.0, 400.0])
@pytest.mark.parametrize("decimals", [None, 5])
def test_gaps_of_5_ms_to_5_s_are_found_to_the_row(preset, rate, decimals):
    samples = recorded(preset, 1, rate)
    rows = [max(round(rate * s), 5) for s in (0.005, 0.03, 0.5, 5.0)]
    gaps = [(round(rate * at), count) for at, count in zip((9, 14, 20, 40), rows, strict=True)]
    spoilt, where = filled(samples, gaps, decimals=decimals)
    doubts = doubts_on(spoilt, Belief())
    np.testing.assert_array_equal(doubts.flags[STRAIGHT], where)
    assert set(doubts.quantities[STRAIGHT]) == set(columns_of(samples))
    assert not doubts_on(spoilt, Belief(keep=frozenset({STRAIGHT, STUCK}))).flags
    assert set(doubts.flags) == {STRAIGHT}
    gates = Gates(Traits().add(spoilt), Belief())
    assert gates.suspects and not gates.resampled()


def test_a_coarse_triad_is_found_where_another_one_is():
    samples = recorded("mpu6050_100hz", 1)
    spoilt, where = filled(samples, [(900, 300)])
    doubts = doubts_on(spoilt, Belief())
    np.testing.assert_array_equal(doubts.flags[STRAIGHT], where)
    assert "gyr" in doubts.quantities[STRAIGHT]


def test_one_triad_alone_is_found_and_the_others_stay():
    samples = recorded("xsens_dot", 2)
    spoilt, where = filled(samples, [(1500, 40)], keys=("acc",))
    doubts = doubts_on(spoilt, Belief())
    np.testing.assert_array_equal(doubts.flags[STRAIGHT], where)
    assert doubts.quantities[STRAIGHT] == {"acc"}


@pytest.mark.parametrize("preset", RESOLVED)
@pytest.mark.parametrize("times", [2, 2.5, 4])
def test_a_recording_of_a_lower_rate_is_told_as_that(preset, times):
    samples = recorded(preset, 3)
    at = np.arange(0, len(samples), times)
    columns = {
        key: interp1d(at, column[np.floor(at).astype(int)], axis=0, bounds_error=False)(
            np.arange(len(samples))
        )
        for key, column in columns_of(samples).items()
    }
    spoilt = replace(samples, **columns)
    gates = Gates(Traits().add(spoilt), Belief())
    on_lines = {2: 2.0, 2.5: 5 / 3, 4: 4.0}[times]
    assert gates.resampled()  # of those whose noise still shows
    for rows in gates.resampled().values():
        assert rows == pytest.approx(on_lines, rel=0.05)
    assert STRAIGHT not in gates.doubt(spoilt).flags


@pytest.mark.parametrize("preset", NOISY)
@pytest.mark.parametrize("rate", [25.0, 100.0, 800.0])
def test_a_sound_recording_has_no_lines(preset, rate):
    for seed in range(2):
        samples = recorded(preset, seed, rate)
        gates = Gates(Traits().add(samples), Belief())
        assert not gates.resampled()
        assert STRAIGHT not in gates.doubt(samples).flags


def test_smooth_noise_is_no_line():
    """Readings behind a low pass at a hundredth of their rate: slow, and far from white."""
    samples = recorded("xsens_dot", 4, 400.0)
    b, a = scipy.signal.butter(2, 0.02)
    columns = {k: scipy.signal.lfilter(b, a, c, axis=0) for k, c in columns_of(samples).items()}
    for decimals in (2, 4, 9):
        smooth = replace(samples, **{k: np.round(c, decimals) for k, c in columns.items()})
        gates = Gates(Traits().add(smooth), Belief())
        assert not gates.resampled() and STRAIGHT not in gates.doubt(smooth).flags


def test_chunks_find_what_the_whole_does():
    samples = recorded("xsens_dot", 5)
    spoilt, where = filled(samples, [(995, 12), (3000, 500)])
    traits = Traits()
    for begin in range(0, len(spoilt), 1000):
        traits.add(spoilt.rows(slice(begin, begin + 1000)))
    gates = Gates(traits, Belief())
    assert gates.suspects
    found, margin = [], gates.margin
    for begin in range(0, len(spoilt), 1000):
        low, high = max(begin - margin, 0), begin + 1000 + margin
        flags = gates.doubt(spoilt.rows(slice(low, high))).flags
        own = flags.get(STRAIGHT, np.zeros(min(high, len(spoilt)) - low, dtype=bool))
        found.append(own[begin - low : begin - low + 1000])
    np.testing.assert_array_equal(np.concatenate(found), where)


@pytest.mark.parametrize("count", [1.0, 0.3, 0.01])
def test_the_chance_of_lines_by_noise_is_an_upper_bound(count):
    """Of white noise of deviation 1 in multiples of `count`, in three axes."""
    noise = np.round(np.random.default_rng(0).standard_normal((400_000, 3)) / count) * count
    deviation, quantum = np.ones(3), np.full(3, count)
    rows = straight_rows(noise, tolerance_of(deviation, quantum))
    assert len(rows) / len(noise) <= chance_of(deviation, quantum)
    twice = np.sum(np.diff(rows) == 1)
    assert twice / len(noise) <= chance_of(deviation, quantum) ** 2 + 1e-5
