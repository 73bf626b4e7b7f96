"""An import says how many gaps there are between its samples, and how long they last."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from testbench.formats.holes import Holes
from testbench.records.session.samples import ImuSamples


def samples_at(time: np.ndarray) -> ImuSamples:
    stamps, nothing = np.round(1e9 * time).astype(np.int64), np.zeros((len(time), 3))
    flags = np.zeros(len(time), dtype=bool)
    return ImuSamples(stamps, stamps, nothing, nothing, None, None, np.arange(len(time)), flags)


def found(time: np.ndarray, cuts: list[int]) -> list:
    holes, bounds = Holes(), [0, *cuts, len(time)]
    chunks = [samples_at(time[a:b]) for a, b in pairwise(bounds)]
    assert sum(len(chunk) for chunk in holes.watch(chunks)) == len(time)
    return holes.findings()


@pytest.mark.parametrize("cuts", [[], [500], [1, 499, 500, 501]])
def test_gaps_are_counted_with_their_length_wherever_chunks_end(cuts):
    time = np.arange(2000) / 100.0
    kept = np.r_[0:500, 800:1000, 1010:1500, 1502:2000]
    (told,) = found(time[kept], cuts)
    assert told.code == "time.gaps"
    assert told.values["count"] == 2  # two lost samples are no gap
    assert told.values["total_s"] == pytest.approx(3.01 + 0.11)
    assert told.values["longest_s"] == pytest.approx(3.01)
    assert told.values["at_s"] == pytest.approx(4.99)


@pytest.mark.parametrize("rate", [5.0, 100.0, 1000.0])
def test_jitter_is_no_gap(rate):
    rng = np.random.default_rng(0)
    steps = (1 + 0.4 * rng.uniform(-1, 1, 3000)) / rate
    assert found(np.cumsum(steps), [1000, 2000]) == []
