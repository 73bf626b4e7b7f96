"""What is learned of readings chunk by chunk, against plain loops over all of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from testbench.consistency.traits import MOST, QuantityTraits, longest_of


def readings(seed: int) -> np.ndarray:
    """Coarse readings with runs, zeros, missing and impossible ones, shape (3000, 3)."""
    rng = np.random.default_rng(seed)
    x = np.round(rng.normal(0, 0.4, (3000, 3)), 1)
    for begin in rng.integers(0, 2900, 12):
        x[begin : begin + rng.integers(2, 40)] = x[begin]
        x[begin : begin + 9, rng.integers(3)] = 4.0
    x[rng.integers(0, 3000, 8)] = 0.0
    x[rng.integers(0, 3000, 8), rng.integers(3)] = np.nan
    x[rng.integers(0, 3000, 4)] = np.inf
    x[rng.integers(0, 3000, 4), 1] = -2 * MOST["acc"]
    return x


def longest(flags) -> int:
    best = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        best = max(best, run)
    return best


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("seed", range(2))
def test_counts_and_ends_are_those_of_plain_loops_in_either_layout(seed, order):
    x = readings(seed)
    known = [row for row in x.tolist() if all(abs(v) < 1e300 for v in row)]
    sound = [row for row in known if all(abs(v) <= MOST["acc"] for v in row)]
    own = QuantityTraits("acc")
    own.add(np.asarray(x, order=order))
    assert own.count == len(known) < len(x)
    assert own.zero == sum(row == [0, 0, 0] for row in known) > 0
    assert own.beyond == len(known) - len(sound) > 0
    for axis in range(3):
        column = [row[axis] for row in sound]
        assert own.low[axis] == min(column) and own.high[axis] == max(column)
        assert own.high_run[axis] == longest(v == max(column) for v in column)
        assert own.low_run[axis] == longest(v == min(column) for v in column)
        assert own.axis_run[axis] == longest(a == b for a, b in pairwise(column))
    assert own.repeated.old == sum(a == b for a, b in pairwise(x.tolist()))


@pytest.mark.parametrize("size", [64, 777, 5000])
def test_chunks_in_either_layout_tell_the_same_noise(size):
    rng = np.random.default_rng(1)
    x = np.round(rng.normal(0, 0.02, (60_000, 3)), 4)
    found = []
    for order in "CF":
        own = QuantityTraits("acc")
        for begin in range(0, len(x), size):
            own.add(np.asarray(x[begin : begin + size], order=order))
        found.append(own.axis_repeats)
        np.testing.assert_allclose(own.quantum, 1e-4, rtol=1e-9)
    np.testing.assert_array_equal(found[0], found[1])
    # q / (2 s sqrt(pi)): what readings of this noise repeat
    repeated = np.mean(x[1:] == x[:-1], axis=0)
    np.testing.assert_allclose(found[0], repeated, rtol=0.5)


@pytest.mark.parametrize(
    ("rows", "runs"), [([], 0), ([5], 1), ([1, 3, 9], 1), ([1, 2, 4, 5, 6, 9], 3), ([0, 1], 2)]
)
def test_the_longest_run_of_consecutive_numbers(rows, runs):
    assert longest_of(np.array(rows, dtype=int)) == runs
