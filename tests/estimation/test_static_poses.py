"""Calibration from static poses: errors that were put in are found, and few poses do no harm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.static_poses import fit_static_poses
from testbench.model import rotation

GRAVITY = np.array([0.0, 0.0, -9.80665])
SIX = rotation.from_matrix(
    Rotation.from_euler(
        "XYZ",
        [[0, 0, 0], [180, 0, 0], [90, 0, 0], [-90, 0, 0], [0, 90, 0], [0, -90, 0]],
        degrees=True,
    ).as_matrix()
)


def force(q_world_from_sensor: np.ndarray) -> np.ndarray:
    """Specific force at rest in each pose, by SciPy."""
    return Rotation.from_quat(q_world_from_sensor, scalar_first=True).inv().apply(-GRAVITY)


class Part:
    """A sensor with known errors, at rest."""

    def __init__(
        self, seed: int, bias_sd: float = 0.1, scale_sd: float = 0.005, g_sd: float = 1.8e-4
    ):
        rng = np.random.default_rng(seed)
        self.rng = rng
        self.matrix = np.eye(3) + scale_sd * rng.standard_normal((3, 3))
        self.bias = bias_sd * rng.standard_normal(3)
        self.gyr_bias = np.radians(0.2) * rng.standard_normal(3)
        self.g_matrix = g_sd * rng.standard_normal((3, 3))

    def rest(self, q: np.ndarray, samples: int = 200) -> tuple[list[np.ndarray], list[np.ndarray]]:
        acc, gyr = [], []
        for f in force(q):
            acc.append(self.matrix @ f + self.bias + 0.01 * self.rng.standard_normal((samples, 3)))
            gyr.append(
                self.gyr_bias + self.g_matrix @ f + 7e-4 * self.rng.standard_normal((samples, 3))
            )
        return acc, gyr


def test_six_poses_give_bias_scale_and_cross_axis_back():
    for seed in range(10):
        part = Part(seed)
        fit = fit_static_poses(*part.rest(SIX), list(SIX), GRAVITY)
        assert fit.poses == 6 and fit.method == "static_poses"
        np.testing.assert_allclose(fit.acc_bias, part.bias, atol=0.01)
        np.testing.assert_allclose(fit.acc_matrix @ part.matrix, np.eye(3), atol=1.5e-3)
        np.testing.assert_allclose(fit.gyr_bias, part.gyr_bias, atol=3e-4)


def test_the_correction_undoes_the_errors_in_poses_it_has_not_seen():
    part = Part(3)
    acc, gyr = part.rest(SIX)
    fit = fit_static_poses(acc, gyr, list(SIX), GRAVITY)
    new = rotation.normalise(np.random.default_rng(1).normal(size=(20, 4)))
    acc, gyr = part.rest(new)
    rates, forces, _ = fit.apply(
        np.array([g.mean(axis=0) for g in gyr]), np.array([a.mean(axis=0) for a in acc]), None
    )
    assert np.abs(forces - force(new)).max() < 0.02
    assert np.degrees(np.abs(rates).max()) < 0.03


def test_the_stated_uncertainty_of_the_bias_is_that_of_repeated_calibrations():
    errors, stated = [], []
    for seed in range(200):
        part = Part(seed)
        part.bias = part.bias * 4  # as wide as the prior
        fit = fit_static_poses(*part.rest(SIX, 20), list(SIX), GRAVITY)
        errors.append(fit.acc_bias - part.bias)
        stated.append(fit.acc_bias_sd)
    # the poses' own error, which is not simulated here, is part of what is stated
    assert np.std(errors) < 1.3 * np.mean(stated)
    assert np.mean(stated) < 0.01


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_few_poses_do_not_make_other_poses_worse(count):
    before, after, rate_before, rate_after = [], [], [], []
    new = rotation.normalise(np.random.default_rng(1).normal(size=(20, 4)))
    for seed in range(60):
        part = Part(seed)
        fit = fit_static_poses(*part.rest(SIX[:count]), list(SIX[:count]), GRAVITY)
        acc, gyr = (np.array([x.mean(axis=0) for x in kind]) for kind in part.rest(new, 20))
        rates, forces, _ = fit.apply(gyr, acc, None)
        before.append(acc - force(new))
        after.append(forces - force(new))
        rate_before.append(gyr)
        rate_after.append(rates)
    assert np.sqrt(np.mean(np.square(after))) < np.sqrt(np.mean(np.square(before)))
    assert np.sqrt(np.mean(np.square(rate_after))) < np.sqrt(np.mean(np.square(rate_before)))


def test_no_pose_means_no_correction():
    fit = fit_static_poses([], [], [], GRAVITY)
    given = np.ones((4, 3)), 2 * np.ones((4, 3)), 3 * np.ones((4, 3))
    assert fit.method == "none" and fit.poses == 0
    for found, before in zip(fit.apply(*given), given, strict=True):
        np.testing.assert_allclose(found, before, rtol=1e-14)


PLANAR = [
    rotation.from_euler("XYZ", np.radians(angles))
    for angles in ((0.0, 0, 0), (0.0, 90, 0), (0.0, -90, 0))
]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("poses", [SIX, PLANAR], ids=["six", "planar"])
def test_a_crooked_mounting_is_found_even_from_poses_in_one_plane(axis, poses):
    turned = rotation.from_rotation_vector(
        np.radians(5.0) * np.eye(3)[axis]
    )  # q_believed_from_sensor
    felt = rotation.rotate(rotation.conjugate(turned), force(np.array(poses)))
    fit = fit_static_poses(
        [np.tile(f, (50, 1)) for f in felt], [np.zeros((50, 3))] * len(poses), list(poses), GRAVITY
    )
    error = rotation.multiply(
        rotation.from_matrix(fit.R_believed_from_sensor), rotation.conjugate(turned)
    )
    assert np.degrees(rotation.angle(error)) < 0.25
