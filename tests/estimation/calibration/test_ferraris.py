"""Ferraris: against the package imucal on its own recording, and against turns with known
errors.
"""

from __future__ import annotations

import json

import imucal
import numpy as np
import pandas as pd
import pytest

from testbench.estimation.calibration.ferraris import FerrarisTurn, ferraris, ferraris_gyroscope
from testbench.estimation.calibration.poses import StaticPoses, TrueVector, static_poses
from testbench.exceptions import InputError
from testbench.model.statistics.least_squares import PoorExcitation
from tests.estimation.calibration.simulated import GRAVITY, SIX, part, poses_of, rng

RATE_HZ, EARTH = 204.8, 9.81
FACES = ["x_p", "x_a", "y_p", "y_a", "z_p", "z_a"]


@pytest.mark.data
def test_agrees_with_imucal_on_its_example(data):
    table = pd.read_csv(data / "imucal" / "example_ferraris_session.csv").drop(columns="n_samples")
    sections = json.loads((data / "imucal" / "example_ferraris_session_list.json").read_text())
    regions = imucal.ferraris_regions_from_section_list(table, pd.DataFrame(sections).T)
    oracle = imucal.FerrarisCalibration(grav=EARTH).compute(
        regions, sampling_rate_hz=RATE_HZ, from_acc_unit="m/s^2", from_gyr_unit="deg/s"
    )
    acc, gyr = table.iloc[:, 3:].to_numpy(), np.radians(table.iloc[:, :3].to_numpy())
    times = np.arange(len(acc)) / RATE_HZ
    intervals = np.array([[sections[name]["start"], sections[name]["end"]] for name in FACES])
    poses = static_poses(acc, intervals, times=times, true=TrueVector(EARTH))
    ours = ferraris(poses)
    np.testing.assert_allclose(ours.bias, oracle.b_a, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.inv(ours.matrix), oracle.K_a @ oracle.R_a, rtol=1e-6)
    cuts = [
        slice(sections[f"{axis}_rot"]["start"], sections[f"{axis}_rot"]["end"]) for axis in "xyz"
    ]
    turns = [FerrarisTurn(gyr[cut], ours.apply(acc[cut]), 1 / RATE_HZ) for cut in cuts]
    rest = static_poses(gyr, intervals, times=times, true=TrueVector(EARTH), floor=0.0)
    gyroscope = ferraris_gyroscope(rest, poses, turns, np.radians(-360))
    np.testing.assert_allclose(np.degrees(gyroscope.bias), oracle.b_g, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(gyroscope.g_matrix), oracle.K_ga, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.inv(gyroscope.matrix), oracle.K_g @ oracle.R_g, rtol=1e-6)
    # and what both make of the whole recording
    theirs = oracle.calibrate_df(table, acc_unit="m/s^2", gyr_unit="deg/s")[list(table)].to_numpy()
    np.testing.assert_allclose(ours.apply(acc), theirs[:, 3:], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(
        np.degrees(gyroscope.apply(gyr, ours.apply(acc))), theirs[:, :3], rtol=1e-6, atol=1e-6
    )


def gyroscope_part() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    draw = rng(5)
    return (
        np.eye(3) + 0.01 * draw.standard_normal((3, 3)),
        0.02 * draw.standard_normal(3),
        2e-4 * draw.standard_normal((3, 3)),
    )


def session(
    noise: float = 0.0, angle_sd: float = 0.0, draw: np.random.Generator | None = None, n: int = 400
) -> tuple[StaticPoses, StaticPoses, list[FerrarisTurn]]:
    """Six rests and three full turns at a steady rate in 2 s; `noise` of a sample of the rate."""
    response, bias, g_matrix = gyroscope_part()
    draw = draw or rng(0)
    interval = 2.0 / n
    means = bias + SIX @ g_matrix.T + noise / np.sqrt(n) * draw.standard_normal((6, 3))
    rest = StaticPoses(means, np.full((6, 3), noise**2 / n + 1e-20), GRAVITY, count=np.full(6, n))
    turns = []
    for axis in range(3):
        rate = np.zeros((n, 3))
        rate[:, axis] = (2 * np.pi + angle_sd * draw.standard_normal()) / 2.0
        force = np.tile(SIX[2 * axis], (n, 1))
        turns.append(
            FerrarisTurn(
                rate @ response.T
                + bias
                + force @ g_matrix.T
                + noise * draw.standard_normal((n, 3)),
                force,
                interval,
            )
        )
    return rest, poses_of(SIX, np.eye(3), np.zeros(3)), turns


def truth() -> np.ndarray:
    response, bias, g_matrix = gyroscope_part()
    return np.concatenate([response.reshape(-1), bias, g_matrix.reshape(-1)])


def test_ideal_turns_give_the_exact_answer():
    rest, faces, turns = session()
    calibration = ferraris_gyroscope(rest, faces, turns, 2 * np.pi)
    np.testing.assert_allclose(calibration.fits[0].values, truth(), atol=1e-9)
    corrected = calibration.apply(turns[1].rate, turns[1].force)
    np.testing.assert_allclose(corrected, np.tile([0, np.pi, 0], (len(corrected), 1)), atol=1e-9)


def test_95_percent_intervals_of_the_gyroscope_hold_the_truth():
    draw, inside, angle_sd = rng(6), np.zeros(21), 2e-3
    for _ in range(1000):
        rest, faces, turns = session(2e-2, angle_sd, draw, 50)
        fit = ferraris_gyroscope(rest, faces, turns, 2 * np.pi, angle_sd).fits[0]
        inside += np.abs(fit.values - truth()) <= fit.half_width()
    assert ((inside >= 930) & (inside <= 970)).all(), inside


def test_repeated_faces_count_as_one_and_sharpen_it():
    response, bias = part()
    once, twice = (poses_of(np.tile(SIX, (k, 1)), response, bias) for k in (1, 2))
    np.testing.assert_allclose(ferraris(once).matrix, ferraris(twice).matrix, atol=1e-12)
    np.testing.assert_allclose(
        ferraris(once).fits[0].sd / np.sqrt(2), ferraris(twice).fits[0].sd, rtol=1e-9
    )


def test_what_is_missing_is_said():
    rest, faces, turns = session()
    with pytest.raises(InputError, match="three turns"):
        ferraris_gyroscope(rest, faces, turns[:2], 2 * np.pi)
    with pytest.raises(PoorExcitation, match="-z up"):
        ferraris_gyroscope(rest.subset(np.arange(5)), faces.subset(np.arange(5)), turns, 2 * np.pi)
