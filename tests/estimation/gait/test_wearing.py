"""How a sensor is worn: its readings are turned into the level frame before any filter."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.filters import choose_filters
from testbench.estimation.filters.base import UniformSamples
from testbench.estimation.gait import PUBLISHED, walk
from testbench.estimation.gait.parameters import MOUNTINGS
from testbench.estimation.gait.wearing import FOUND, levelled, mounting_matrix
from testbench.exceptions import InputError
from testbench.model import rotation
from tests.estimation.gait.walker import SWING_HZ, swinging


@pytest.mark.parametrize("filter_name", ["euler_ekf", "euler_ekf_listing", "vqf_6d"])
@pytest.mark.parametrize("mounting", [*MOUNTINGS, FOUND, "z down"])
def test_worn_in_any_way_an_euler_filter_gives_the_same_walk(mounting, filter_name) -> None:
    pitch, level = swinging()
    axes = np.array(MOUNTINGS.get(mounting, MOUNTINGS["frontal"]), dtype=float)
    if mounting == "z down":  # as an import with an axis map of the source leaves it
        axes, mounting = np.diag([1.0, -1.0, -1.0]), FOUND
    worn = UniformSamples(level.interval, level.gyr @ axes, level.acc @ axes)
    R, _ = mounting_matrix(mounting, worn.gyr, worn.acc)
    q = choose_filters([filter_name])[0].run(levelled(worn, R))
    time = np.round(np.arange(len(q)) / SWING_HZ * 1e9).astype(np.int64)
    found = walk(time, q, PUBLISHED["universal"])
    assert len(found.cycles) == 12
    assert found.distance == pytest.approx(12 * (0.0294 * 40 + 0.232), rel=0.02)
    assert np.degrees(found.headings[-1] - found.headings[0]) == pytest.approx(90, abs=5)
    step = rotation.to_euler("ZYX", q)[:, 1]
    assert np.degrees(np.sqrt(np.mean((np.abs(step) - np.abs(pitch)) ** 2))) < 2


@pytest.mark.parametrize("mounting", list(MOUNTINGS))
def test_a_mounting_is_found_and_called_by_its_name(mounting) -> None:
    _, level = swinging()
    axes = np.array(MOUNTINGS[mounting], dtype=float)
    R, name = mounting_matrix(FOUND, level.gyr @ axes, level.acc @ axes)
    assert name == mounting
    np.testing.assert_allclose(np.abs(R), np.abs(axes), atol=0.1)
    assert np.linalg.det(R) == pytest.approx(1)


def test_a_mounting_that_gravity_denies_is_refused_with_the_one_that_fits() -> None:
    _, level = swinging()
    with pytest.raises(InputError, match=r"worn 'frontal' it would lean by 9.* looks like 'level'"):
        mounting_matrix("frontal", level.gyr, level.acc, "shin")
