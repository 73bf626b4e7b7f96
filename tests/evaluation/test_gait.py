"""A walk against what somebody counted, measured or walked along."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.evaluation.gait import WalkTruth, distances_from, judge_walk
from testbench.exceptions import InputError
from testbench.records.results.gait import Gait, SensorGait, Stride


def walk_along(places: list[tuple[float, float]], method: str = "strapdown") -> Gait:
    """A walk whose strides end at these places."""
    at = np.array([(0.0, 0.0), *places])
    lengths = np.linalg.norm(np.diff(at, axis=0), axis=1)
    strides = [
        Stride(begin_s=i, end_s=i + 1, length_m=float(lengths[i]), x_m=x, y_m=y)
        for i, (x, y) in enumerate(places)
    ]
    distance = float(lengths.sum())
    own = SensorGait(sensor="f", on="foot", method=method, strides=strides, distance_m=distance)
    return Gait(session="s", fingerprint="", sensors={"f": own})


def checks(found: Gait) -> dict[str, float]:
    return {row.quantity: row.error for row in found.checks}


def test_cycles_and_distance_are_held_against_what_was_typed() -> None:
    found = judge_walk(walk_along([(1, 0), (2, 0), (3, 0)]), WalkTruth(4, 2.5))
    assert checks(found) == {"cycles": -1, "distance_m": pytest.approx(0.5)}
    assert [row.error_percent for row in found.checks] == [-25, pytest.approx(20)]


def test_a_path_that_is_only_turned_lies_on_the_corners() -> None:
    turned = [(0.0, 1.0), (0.0, 2.0), (-1.0, 2.0)]
    found = judge_walk(walk_along(turned), WalkTruth(corners_m=[(5, 5), (7, 5), (7, 6)]))
    errors = checks(found)
    assert errors["path_length_m"] == pytest.approx(0)
    assert errors["end_off_m"] < 0.02 and errors["path_off_m"] < 0.02


def test_a_mirrored_path_does_not_lie_on_the_corners() -> None:
    found = judge_walk(
        walk_along([(1, 0), (2, 0), (2, -2)]), WalkTruth(corners_m=[(0, 0), (2, 0), (2, 2)])
    )
    assert checks(found)["end_off_m"] + checks(found)["path_off_m"] > 1


def test_distances_are_to_the_nearest_side() -> None:
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    places = np.array([[1.0, 0.5], [3.0, 1.0], [-1.0, 0.0], [3.0, 3.0]])
    np.testing.assert_allclose(distances_from(places, corners), [0.5, 1, 1, np.sqrt(2)])


def test_a_regression_is_told_which_intercept_fits() -> None:
    found = judge_walk(walk_along([(1, 0), (2, 0)], "regression"), WalkTruth(distance_m=2.5))
    (said,) = found.sensors["f"].findings
    assert said.values["more_m"] == pytest.approx(0.25)


@pytest.mark.parametrize(
    "truth",
    [WalkTruth(cycles=0), WalkTruth(distance_m=-1), WalkTruth(corners_m=[(0, 0)])],
)
def test_a_truth_that_no_walk_can_have_is_refused(truth) -> None:
    with pytest.raises(InputError, match=r"--(cycles|distance|corners)"):
        judge_walk(walk_along([(1, 0)]), truth)
