"""Random processes: their statistics, and that each purpose has numbers of its own."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.model.noise import GaussMarkov, RandomWalk, random_stream


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_a_gauss_markov_process_has_its_spread_from_the_first_value_on():
    firsts = np.array([GaussMarkov(2.0, 50.0, 0.1, 3, rng(seed)).draw(2) for seed in range(1000)])
    np.testing.assert_allclose(firsts.std(axis=(0, 2)), 2.0, rtol=0.06)


@pytest.mark.parametrize("time_constant", [0.5, 2.0])
def test_a_gauss_markov_process_forgets_with_its_time_constant(time_constant):
    interval = 0.02
    x = GaussMarkov(1.0, time_constant, interval, 8, rng()).draw(100_000)
    assert x.std() == pytest.approx(1.0, rel=0.05)
    for lag_s in (0.5 * time_constant, time_constant, 2 * time_constant):
        lag = round(lag_s / interval)
        assert np.mean(x[lag:] * x[:-lag]) == pytest.approx(
            np.exp(-lag_s / time_constant), abs=0.04
        )


def test_a_random_walk_has_its_density_after_one_second_and_steps_that_do_not_hang_together():
    walks = np.array([RandomWalk(0.3, 0.01, 1, rng(seed)).draw(400)[:, 0] for seed in range(1500)])
    np.testing.assert_allclose(walks[:, [99, 399]].std(axis=0), [0.3, 0.6], rtol=0.06)
    steps = np.diff(walks, axis=1)
    assert abs(np.mean(steps[:, 1:] * steps[:, :-1])) < 0.01 * steps.var()


@pytest.mark.parametrize(
    "process",
    [lambda: GaussMarkov(1.0, 3.0, 0.1, 2, rng()), lambda: RandomWalk(1.0, 0.1, 2, rng())],
    ids=["bias", "walk"],
)
def test_a_process_drawn_in_pieces_is_the_one_drawn_at_once_to_the_bit(process):
    whole, pieces = process().draw(100), process()
    assert np.concatenate([pieces.draw(n) for n in (1, 0, 49, 50)]).tobytes() == whole.tobytes()


def test_processes_of_no_size_are_silent():
    assert not GaussMarkov(0.0, 3.0, 0.1, 2, rng()).draw(10).any()
    assert not RandomWalk(0.0, 0.1, 2, rng()).draw(10).any()


def test_streams_of_different_purpose_or_seed_do_not_hang_together():
    names = [
        (0, "arm", "noise"),
        (0, "forearm", "noise"),
        (0, "arm", "bias"),
        (1, "arm", "noise"),
        (0, "armnoise"),
    ]
    draws = np.array(
        [random_stream(seed, *labels).standard_normal(20_000) for seed, *labels in names]
    )
    off_diagonal = np.corrcoef(draws) - np.eye(len(names))
    assert np.abs(off_diagonal).max() < 0.03


def test_labels_are_told_apart_by_their_borders():
    assert random_stream(0, "ab", "c").random() != random_stream(0, "a", "bc").random()


def test_the_same_seed_and_purpose_give_the_same_numbers():
    assert (
        random_stream(3, "arm", "noise").random(5).tobytes()
        == random_stream(3, "arm", "noise").random(5).tobytes()
    )
