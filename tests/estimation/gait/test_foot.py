"""A sensor on a foot that walks as told: strides, events, path, and what is said of all of them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from testbench.estimation.gait import strapdown, strapdown_errors
from testbench.estimation.gait.foot import FootWalk, walk_on_foot
from testbench.estimation.gait.readings import Readings
from testbench.estimation.gait.strides import UNKNOWN_WAY, foot_strides
from tests.estimation.gait.walker import (
    Walked,
    Walker,
    loop,
    readings,
    straight,
    varied,
    walked,
    with_errors,
)


@cache
def reckoned(kind: str, seed: int = 0) -> tuple[Walked, Readings, FootWalk]:
    walkers: dict[str, Walker] = {
        "straight": straight(),
        "loop": loop(),
        "slow rate": loop(rate=100.0),
        "stairs": straight(8, 0.6, rises=np.full(8, 0.17)),
        "no rest": straight(rests=(0.2, 0.2)),
    }
    true = walked(walkers.get(kind) or varied(seed))
    own = readings(true, *with_errors(true, seed))
    found = walk_on_foot(own)
    assert found is not None
    return true, own, found


KINDS = ["straight", "loop", "slow rate", "stairs", "no rest"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_stride_is_found_once_with_its_length(kind) -> None:
    true, own, found = reckoned(kind)
    strides = foot_strides(own, found)
    assert len(strides) == len(true.lengths)
    np.testing.assert_allclose([s.length_m for s in strides], true.lengths, atol=0.006)


@pytest.mark.parametrize("kind", KINDS)
def test_contacts_are_found_when_they_happen(kind) -> None:
    true, own, found = reckoned(kind)
    strides = foot_strides(own, found)
    np.testing.assert_allclose([s.ic_s for s in strides], true.initial, atol=0.005)
    np.testing.assert_allclose([s.tc_s for s in strides], true.terminal, atol=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_strides_of_all_lengths_speeds_and_turns_are_found(seed) -> None:
    true, own, found = reckoned("varied", seed)
    strides = foot_strides(own, found)
    assert len(strides) == len(true.lengths)
    lengths, sd = np.array([[s.length_m, s.length_sd_m] for s in strides]).T
    np.testing.assert_allclose(lengths, true.lengths, atol=0.01)
    assert np.mean(np.abs(lengths - true.lengths) < 1.96 * sd) > 0.9
    np.testing.assert_allclose([s.ic_s for s in strides], true.initial, atol=0.01)


def test_a_loop_closes_and_its_turns_add_up() -> None:
    _, own, found = reckoned("loop")
    place = found.track.position
    assert np.linalg.norm(place[found.last - found.first] - place[0]) < 0.05
    assert sum(s.turn_deg for s in foot_strides(own, found)) == pytest.approx(360, abs=1)


def test_level_floors_are_told_from_stairs() -> None:
    assert reckoned("straight")[2].level and reckoned("loop")[2].level
    _, own, found = reckoned("stairs")
    assert not found.level
    np.testing.assert_allclose([s.rise_m for s in foot_strides(own, found)], 0.17, atol=0.005)


def test_a_floor_that_is_said_to_be_level_is_level() -> None:
    _, own, _ = reckoned("stairs")
    found = walk_on_foot(own, level=True)
    assert found is not None and found.level
    assert abs(found.track.position[-1, 2]) < 0.3


def test_a_foot_that_fidgets_has_not_walked() -> None:
    true, own, _ = reckoned("straight")
    still = slice(0, 500)
    gyr, acc = own.uniform.gyr[still].copy(), own.uniform.acc[still].copy()
    gyr[200:260, 1] += 2.0 * np.sin(np.linspace(0, 4 * np.pi, 60))
    found = walk_on_foot(readings(Walked(true.time[still], *[np.zeros(0)] * 6), gyr, acc))
    assert found is not None and not found.moves


def test_chunks_of_any_size_give_the_same_way(monkeypatch) -> None:
    _, own, found = reckoned("loop")
    monkeypatch.setattr(strapdown, "CHUNK", 700)
    again = walk_on_foot(own)
    assert again is not None
    np.testing.assert_allclose(again.track.position, found.track.position, atol=1e-9)
    np.testing.assert_allclose(
        again.track.stride_covariance, found.track.stride_covariance, atol=1e-12
    )


def test_a_stride_over_a_hole_is_in_no_mean() -> None:
    true, own, found = reckoned("straight")
    own = readings(true, own.uniform.gyr, own.uniform.acc.copy())
    third = found.moves[2]
    own.acc[third.leaves + 20 : third.leaves + 60] = np.nan
    again = walk_on_foot(own)
    assert again is not None
    strides = foot_strides(own, again)
    assert [s.left_out for s in strides].count(UNKNOWN_WAY) == 1
    assert all(s.counted for s in strides[3:-1])


def test_the_transition_is_the_derivative_of_the_strapdown_equations() -> None:
    rng = np.random.default_rng(0)
    before, row = np.zeros((2, strapdown.COLUMNS))
    before[0:6], row[0:6] = rng.standard_normal((2, 6)) + [0, 0, 0, 0, 0, 9.8]
    row[6] = 0.01
    state = np.zeros(strapdown.NOMINAL)
    state[6:10] = [0.5, 0.5, -0.5, 0.5]
    state[3:6] = 1.0

    def after(error: np.ndarray) -> np.ndarray:
        own = state.copy()
        strapdown._corrected(own, error)
        cov, turn = np.zeros((strapdown.STATES,) * 2), np.empty((3, 6))
        strapdown._predicted(row, before, own, cov, turn)
        return own

    size, base = 1e-5, after(np.zeros(strapdown.STATES))
    derivative = np.eye(strapdown.STATES)
    for i in range(15):
        error = np.zeros(strapdown.STATES)
        error[i] = size
        change = (after(error) - base) / size
        w, x, y, z = base[6:10]
        left = np.array([[-x, w, -z, y], [-y, z, w, -x], [-z, -y, x, w]])
        turned = 2 * left @ change[6:10]
        derivative[:15, i] = np.concatenate([change[0:6], turned, change[10:16]])
    cov, turn = np.eye(strapdown.STATES), np.empty((3, 6))
    strapdown._predicted(row, before, state.copy(), np.zeros_like(cov), turn)
    strapdown_errors.carry_covariance(cov, turn, row[6])
    # the product of errors over one step is of the second order in it
    np.testing.assert_allclose(cov, derivative @ derivative.T, atol=2e-3)
