"""Rows that are missing without stamps or a counter are seen by what the rest jumps."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.formats.lost_rows import LostRows
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import of_arrays, simulated


def _found(samples: ImuSamples, size: int = 10**9):
    watcher = LostRows()
    for begin in range(0, len(samples), size):
        for _ in watcher.watch([samples.rows(slice(begin, begin + size))]):
            pass
    return watcher.findings()


def _even(samples: ImuSamples, rate: float, without: slice = slice(0)) -> ImuSamples:
    """Samples whose times are made by their rows."""
    gyr, acc = (np.delete(own, without, axis=0) for own in (samples.gyr, samples.acc))
    return of_arrays(rate, gyr, acc)


SEEDS = range(24)


def test_clean_recordings_are_left_alone():
    for seed in SEEDS:
        known = simulated(seed)
        assert not _found(_even(known.samples, known.rate)), seed


@pytest.mark.parametrize("lost_s", [0.2, 1.0])
def test_rows_lost_in_motion_are_named_in_most_recordings(lost_s):
    named = 0
    for seed in SEEDS:
        known = simulated(seed)
        speed = np.linalg.norm(known.samples.gyr, axis=1)
        count = round(lost_s * known.rate)
        middle = slice(len(speed) // 5, -len(speed) // 5)
        at = len(speed) // 5 + int(np.argmax(speed[middle])) - count // 2
        spoilt = _even(known.samples, known.rate, slice(at, at + count))
        named += any(own.code == "time.rows_lost" for own in _found(spoilt))
    assert named > 0.7 * len(SEEDS)


def test_chunks_tell_the_same_and_stamps_with_holes_are_not_asked():
    known = simulated(5)
    at = int(np.argmax(np.linalg.norm(known.samples.gyr, axis=1)))
    count = round(0.5 * known.rate)
    spoilt = _even(known.samples, known.rate, slice(at, at + count))
    whole = _found(spoilt)
    assert whole
    for size in (50, 333):
        assert _found(spoilt, size) == whole
    stamped = np.delete(np.arange(len(known.samples)), slice(at, at + count)) / known.rate
    told = of_arrays(known.rate, spoilt.gyr, spoilt.acc, seconds=stamped)
    assert not _found(told)
