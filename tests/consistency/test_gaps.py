"""Rows that a logger lost now and then do not switch off the checks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.consistency.excerpt import LONGEST_BRIDGE, thin
from testbench.consistency.still_intervals import find_rests
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import Known, check_samples, of_arrays, simulated


@pytest.fixture(scope="module")
def known() -> Known:
    return simulated(4)


def without(samples: ImuSamples, every: int, rows: int) -> ImuSamples:
    """The samples with so many lost of every so many."""
    lost = np.arange(len(samples)) % every >= every - rows
    gone = np.where(lost[:, None], np.nan, 1.0)
    return replace(samples, gyr=samples.gyr * gone, acc=samples.acc * gone)


def test_a_wrong_unit_is_told_in_spite_of_a_lost_row_in_fifty(known: Known):
    wrong = replace(known.samples, gyr=np.degrees(known.samples.gyr))
    codes = [one.code for one in check_samples([without(wrong, 50, 1)])]
    assert "consistency.gyr_unit" in codes


def test_rests_are_found_in_spite_of_gaps(known: Known):
    excerpt = thin([without(known.samples, 40, 10)])
    assert excerpt is not None
    found = find_rests(excerpt, excerpt.interval_ns * excerpt.samples / NANOSECONDS)
    assert found.norm == pytest.approx(9.81, rel=0.1)
    assert found.bias is not None


def test_a_bridge_is_a_straight_line_and_longer_gaps_stay():
    count = 40
    ramp = np.linspace(0, 1, count)[:, None] * np.array([1.0, 2, 3])
    acc, gyr = ramp + 9, ramp.copy()
    acc[10 : 10 + LONGEST_BRIDGE] = gyr[20 : 21 + LONGEST_BRIDGE] = np.nan
    acc[0] = np.nan
    excerpt = thin([of_arrays(100.0, gyr, acc)])
    assert excerpt is not None
    np.testing.assert_allclose(excerpt.acc[1:], (ramp + 9)[1:])
    assert np.isnan(excerpt.acc[0]).all()
    lost = np.flatnonzero(np.isnan(excerpt.gyr).any(axis=1))
    assert list(lost) == list(range(20, 21 + LONGEST_BRIDGE))
